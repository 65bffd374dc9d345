"""A browser as the server sees it: a websocket client that speaks viser's protocol and remembers what it is sent."""

import re
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import msgspec.msgpack
import numpy as np
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

PROTOCOL = f"viser-v{viser.__version__}"
PREFIX = "viser-user:"  # of the keys that the server may read from the page's local storage
STORE = re.compile(r"localStorage\.setItem\(\"" + PREFIX + r"([^\"]+)\", (.*)\)$", re.DOTALL)
CAMERA = {"SetCameraPositionMessage": "position", "SetCameraLookAtMessage": "look_at",
          "SetCameraUpDirectionMessage": "up_direction", "SetCameraFovMessage": "fov"}

Message = dict[str, Any]


def decode(frame: bytes) -> list[Message]:
    """The messages of one frame: lengths, compressed msgpack, then the arrays, each aligned to eight bytes."""
    packed = int.from_bytes(frame[8:16], "little")
    content = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(frame[16:16 + packed]))
    arrays, at = [], 16 + packed
    for size in content["binaryBufferLengths"]:
        at += -at % 8
        arrays.append(frame[at:at + size])
        at += size

    def filled(value: Any) -> Any:
        if isinstance(value, dict):
            if "__binary_index" in value:
                return np.frombuffer(arrays[value["__binary_index"]], dtype=value["dtype"])
            return {k: filled(v) for k, v in value.items()}
        return [filled(v) for v in value] if isinstance(value, list) else value

    return [filled(message) for message in content["messages"]]


def open_socket(port: int, **options: Any) -> Any:
    """A bare websocket with viser's subprotocol."""
    return connect(f"ws://127.0.0.1:{port}", subprotocols=[PROTOCOL], compression=None, max_size=None,
                   open_timeout=20, ping_interval=None, **options)


class FakeBrowser:
    """One page.  `widgets` and `nodes` hold what it shows now, `received` every message in order."""

    def __init__(self, port: int, query: str = "", size: tuple[int, int] = (1000, 700)) -> None:
        self.received: list[Message] = []
        self.widgets: dict[str, Message] = {}
        self.commands: dict[str, str] = {}
        self.nodes: dict[str, Message] = {}
        self.changed = threading.Condition()
        self._query, self._size = query, size
        self._storage: dict[str, str] = {}
        self._camera_set = False
        self._camera = {"position": [3.0, 3.0, 3.0], "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0],
                        "fov": 0.8, "near": 0.01, "far": 1000.0}
        self.socket = open_socket(port, origin=f"http://127.0.0.1:{port}")
        self._reader = threading.Thread(target=self._read, name="fake browser", daemon=True)
        self._reader.start()
        self._report_camera()

    def close(self) -> None:
        self.socket.close()
        self._reader.join(5.0)

    # -- what the user does -------------------------------------------------------------------------------------

    def send(self, kind: str, **fields: Any) -> None:
        self.socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def set(self, label: str, value: object) -> None:
        """Set the widget with this label; a button is pressed with True, a choice in a group with its text."""
        widget = self.widget(label)
        widget["value"] = value
        self.send("GuiUpdateMessage", uuid=widget["uuid"], updates={"value": value})

    def press(self, text: str) -> None:
        """Press the button of a button group that has this option."""
        found = next(w for w in self.widgets.values() if text in (w["props"].get("options") or ())
                     and w["type"] == "GuiButtonGroupMessage")
        self.send("GuiUpdateMessage", uuid=found["uuid"], updates={"value": text})

    def key(self, label: str) -> None:
        """Trigger the command with this label, as its hotkey does."""
        uuid = next(uuid for uuid, found in self.commands.items() if found == label)
        self.send("CommandTriggerMessage", uuid=uuid)

    def drag(self, node: str, to: tuple[float, float, float]) -> None:
        """Drag a node so that the pointer's ray passes through `to` (display units)."""
        where = {"start_position": [0.0, 0.0, 0.0], "start_screen_pos": [0.5, 0.5], "end_screen_pos": [0.5, 0.5],
                 "button": "left", "modifier": None, "instance_index": None, "owner": self.nodes[node]["owner"]}
        for phase in ("start", "update", "end"):
            self.send("SceneNodeDragMessage", phase=phase, name=node, end_position=list(to), **where)

    def click(self, to: tuple[float, float, float]) -> None:
        """Click into the scene where the camera sees the point `to` (display units)."""
        origin = [float(v) for v in self._camera["position"]]
        d = [b - a for a, b in zip(origin, to, strict=True)]
        size = sum(v * v for v in d) ** 0.5
        self.send("ScenePointerMessage", event_type="click", ray_origin=origin, ray_direction=[v / size for v in d],
                  screen_pos=[[0.5, 0.5]], modifier=None)

    def upload(self, label: str, name: str, content: bytes, size: int | None = None, parts: int = 1,
               transfer: str = "t") -> None:
        """Give a file to the upload button with this label; `size`: what is announced, if not the truth."""
        button = self.widget(label)["uuid"]
        self.send("FileTransferStartUpload", source_component_uuid=button, transfer_uuid=transfer, filename=name,
                  mime_type="", part_count=parts, size_bytes=len(content) if size is None else size)
        step = -(-len(content) // max(parts, 1))
        for k in range(parts):
            self.send("FileTransferPart", source_component_uuid=button, transfer_uuid=transfer, part_index=k,
                      content=content[k * step:(k + 1) * step])

    def move_camera(self, position: tuple[float, float, float], look_at: tuple[float, float, float]) -> None:
        self._camera |= {"position": list(position), "look_at": list(look_at)}
        self._report_camera()

    def resize(self, width: int, height: int) -> None:
        self._size = (width, height)
        self._report_camera()

    # -- what the user sees -------------------------------------------------------------------------------------

    def widget(self, label: str) -> Message:
        """The widget whose label is, or begins with, this text."""
        found = [w for w in self.widgets.values() if str(w["props"].get("label", "")).startswith(label)]
        assert found, f"no widget {label!r}, only {[w['props'].get('label') for w in self.widgets.values()]}"
        return found[0]

    @property
    def html(self) -> str:
        """Everything readable that is not hidden."""
        return "".join(str(w["props"].get("content", "")) for w in list(self.widgets.values())
                       if w["props"].get("visible", True))

    def scripts(self, function: str) -> list[str]:
        """Arguments of the calls of window.paikka.<function> so far."""
        head = f"window.paikka.{function}("
        return [m["source"][len(head):-1] for m in list(self.received)
                if m["type"] == "RunJavascriptMessage" and m["source"].startswith(head)]

    @property
    def notes(self) -> list[str]:
        return [m["props"]["body"] for m in list(self.received) if m["type"] == "NotificationShowMessage"]

    def wait(self, seen: Callable[["FakeBrowser"], object], timeout: float = 20.0) -> Any:
        """Wait until seen(self) is true and return it; AssertionError after `timeout` seconds."""
        with self.changed:
            assert self.changed.wait_for(lambda: seen(self), timeout), f"not seen within {timeout:g} s"
            return seen(self)

    # -- the page -----------------------------------------------------------------------------------------------

    def _read(self) -> None:
        try:
            for frame in self.socket:
                with self.changed:
                    for message in decode(frame):
                        self.received.append(message | {"at": time.monotonic()})
                        self._take(message)
                    self.changed.notify_all()
                if self._camera_set:  # a real page reports its camera after each move
                    self._report_camera()
        except ConnectionClosed:
            pass

    def _take(self, m: Message) -> None:
        kind = m["type"]
        if kind == "RunJavascriptMessage":
            if found := STORE.match(m["source"]):
                self._storage[found[1]] = self._query if found[2] == "window.paikka.search" else "true"
        elif kind == "LocalStorageGetItemRequestMessage":
            self.send("LocalStorageGetItemResponseMessage", value=self._storage.get(m["key"]), error=None,
                      request_uuid=m["request_uuid"])
        elif kind == "LocalStorageRemoveItemMessage":
            self._storage.pop(m["key"], None)
        elif kind == "RegisterCommandMessage":
            self.commands[m["uuid"]] = m["props"]["label"]
        elif kind == "GuiUpdateMessage":
            self._update_widget(m["uuid"], m["updates"])
        elif kind == "GuiRemoveMessage":
            self.widgets.pop(m["uuid"], None)
        elif kind.startswith("Gui") and "props" in m:
            self.widgets[m["uuid"]] = m
        elif kind == "SceneNodeUpdateMessage":
            self.nodes[m["name"]]["props"].update(m["updates"])
        elif kind == "RemoveSceneNodeMessage":
            self.nodes.pop(m["name"], None)
        elif kind in CAMERA:
            self._camera[CAMERA[kind]] = m["look_at" if "look_at" in m else "fov" if "fov" in m else "position"]
            self._camera_set = True
        elif kind == "SetPositionMessage":
            self.nodes[m["name"]]["position"] = m["position"]
        elif "name" in m and "props" in m:
            self.nodes[m["name"]] = m

    def _update_widget(self, uuid: str, updates: Mapping[str, Any]) -> None:
        widget = self.widgets[uuid]
        for name, value in updates.items():
            (widget if name == "value" and "value" in widget else widget["props"])[name] = value

    def _report_camera(self) -> None:
        self._camera_set = False
        width, height = self._size
        self.send("ViewerCameraMessage", wxyz=[1.0, 0.0, 0.0, 0.0], image_width=width, image_height=height,
                  **self._camera)
