"""A browser as far as the server can tell: one websocket that notes when each message arrives."""

import threading
import time
from typing import Any, NamedTuple

import msgspec.msgpack
import viser
import viser._messages as messages
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

CAMERA = {
    "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, -10.0, 3.0), "fov": 0.6, "near": 0.1, "far": 1000.0,
    "image_height": 900, "image_width": 660, "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 0.0, 1.0),
}


class Frame(NamedTuple):
    at: float                        # time.perf_counter()
    messages: list[dict[str, Any]]


class Wire:
    """One connected client that shows `query`."""

    def __init__(self, port: int, query: str = "") -> None:
        self._query = query
        self._frames: list[Frame] = []
        self._news = threading.Condition()
        self._socket = connect(f"ws://127.0.0.1:{port}", subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore
                               compression=None, max_size=None)
        self._send("ViewerCameraMessage", **CAMERA)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._socket.close()
        self._thread.join(5.0)

    def set_widget(self, uuid: str, value: object) -> float:
        """Move a widget as a user would; the time at which the message left."""
        at = time.perf_counter()
        self._send("GuiUpdateMessage", uuid=uuid, updates={"value": value})
        return at

    def wait_for(self, kind: str, since: int = 0, timeout: float = 60.0, **fields: object) -> dict[str, Any]:
        """The first message of a kind with these fields, among those after number `since`."""
        found: list[dict[str, Any]] = []

        def there() -> bool:
            found[:] = [m for frame in self._frames[since:] for m in frame.messages
                        if m["type"] == kind and all(m.get(k) == v for k, v in fields.items())]
            return bool(found)

        with self._news:
            if not self._news.wait_for(there, timeout):
                raise TimeoutError(f"no {kind} {fields} within {timeout:g} s")
        return found[0]

    def mark(self) -> int:
        """How many frames have come."""
        return len(self._frames)

    def frames(self, since: int) -> list[Frame]:
        return self._frames[since:]

    def everything_sent(self, client: viser.ClientHandle, timeout: float = 60.0) -> None:
        """Return when all that is queued for the client has arrived here."""
        since, key = self.mark(), f"mark-{time.perf_counter_ns()}"
        client._websock_connection.queue_message(messages.LocalStorageRemoveItemMessage(key))
        client.flush()
        self.wait_for("LocalStorageRemoveItemMessage", since, timeout, key=key)

    def _send(self, kind: str, **fields: object) -> None:
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def _listen(self) -> None:
        unpack = zstandard.ZstdDecompressor()
        while True:
            try:
                raw = self._socket.recv()
            except ConnectionClosed:
                return
            at = time.perf_counter()
            size = int.from_bytes(raw[8:16], "little")
            found = list(msgspec.msgpack.decode(unpack.decompress(raw[16:16 + size]))["messages"])
            with self._news:
                self._frames.append(Frame(at, found))
                self._news.notify_all()
            for message in found:
                if message["type"] == "LocalStorageGetItemRequestMessage":
                    self._send("LocalStorageGetItemResponseMessage", value=self._query, error=None,
                               request_uuid=message["request_uuid"])
