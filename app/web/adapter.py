"""Everything that reaches behind viser's public interface, pinned to 1.1.1.

The contract is `tests/app/test_adapter.py`.

Why each is needed: viser listens to any origin, opens public tunnels on a client's word, lets a client set any
attribute of a widget, and has no way to read or write the page's address.
"""

import contextlib
import http
import json
import logging
import math
import secrets
import time
import warnings
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import rich
import viser
import viser._messages as messages
import websockets.asyncio.server
from viser.infra import _infra
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from app.scenario import VIEWER_NAMES
from lessons.kit import files

log = logging.getLogger(__name__)

MAX_MESSAGE_BYTES = 48 * 1024 * 1024  # a picture of 3840 x 2160 comes back as one message
HERE = Path(__file__).parent
LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1", "[::1]"})

_UNWANTED = (
    messages.ShareUrlRequest, messages.ShareUrlDisconnect, messages.GuiFormSubmitMessage,
    messages.GuiFormDirtyMessage, messages.FileTransferStartUpload, messages.FileTransferPart,
)
MAX_PARTS = 256


def start_server(host: str, port: int, hosts: frozenset[str] = LOOPBACK) -> viser.ViserServer:
    """A viser server that answers only requests for `hosts`, and websockets only from its own pages.

    port 0 takes any free one.  The share, form and upload messages have no handlers.
    """
    rich.reconfigure(quiet=True)  # viser announces itself with it; the command line says what users need
    warnings.filterwarnings("ignore", "Queued a .* on a closed connection")  # a browser may leave at any moment
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # a browser's spare connections are no errors
    with _guarded_serve(hosts):
        server = viser.ViserServer(host=host, port=port, label="Paikka", verbose=False)
    _forget(server._websock_server)
    server._websock_server.queue_message(messages.RunJavascriptMessage(source=_plotly_js()))
    return server


def prepare_client(client: viser.ClientHandle) -> None:
    """Close the same doors of one client, and run our script in its page."""
    connection = client._websock_connection
    _forget(connection)
    for kind, ours in ((messages.GuiUpdateMessage, _checked_update(client)),
                       (messages.GuiButtonHoldMessage, None)):
        connection.unregister_handler(kind)
        if ours is not None:
            connection.register_handler(kind, ours)
    for kind, ours in ((messages.FileTransferStartUpload, _checked_start(client)),
                       (messages.FileTransferPart, _checked_part(client))):
        connection.register_handler(kind, ours)
    client.gui._setup_plotly_js = True  # broadcast once at the start, for all clients
    run_script(client, _page_js())


def run_script(client: viser.ClientHandle, source: str) -> None:
    """Run JavaScript in the page; build it with json.dumps, never by pasting text."""
    client._websock_connection.queue_message(messages.RunJavascriptMessage(source=source))


def call_page(client: viser.ClientHandle, function: str, *arguments: object) -> None:
    """window.paikka.<function>(arguments)."""
    run_script(client, f"window.paikka.{function}({', '.join(json.dumps(a) for a in arguments)})")


def ask_page(client: viser.ClientHandle, expression: str, timeout: float = 5.0) -> str:
    """The value of a JavaScript expression in the page, as text; empty when the browser does not tell in time.

    Blocks: never call it on the event loop.
    """
    key = f"paikka-{secrets.token_hex(8)}"
    run_script(client, f"localStorage.setItem({json.dumps('viser-user:' + key)}, {expression})")
    try:
        return client.local_storage.get_item(key, timeout=timeout) or ""
    except (RuntimeError, TimeoutError) as error:
        log.warning("the page did not answer: %s", error)
        return ""
    finally:
        client.local_storage.remove_item(key)


def wait_drawn(client: viser.ClientHandle, with_text: bool, timeout: float) -> bool:
    """True when the browser has drawn all that was sent; the glyphs of labels (with_text) take it several frames.

    Blocks: never call it on the event loop.
    """
    deadline = time.monotonic() + timeout
    call_page(client, "mark")
    while time.monotonic() < deadline:
        if ask_page(client, f"String(window.paikka.settled({json.dumps(with_text)}))", timeout) == "true":
            return True
        time.sleep(0.1)
    return False


def set_plot(handle: Any, figure_json: str) -> None:
    """Show a plotly figure that is JSON already; viser's own setter takes a Figure and encodes it twice."""
    handle._plotly_json_str = figure_json


def widget_id(handle: Any) -> str:
    """The id of the widget's element in the page."""
    return str(handle._impl.uuid)


def is_connected(client: viser.ClientHandle) -> bool:
    return client.client_id in client._viser_server._connected_clients


@contextlib.contextmanager
def _guarded_serve(hosts: frozenset[str]) -> Iterator[None]:
    """While a server is made, its listener gets our request check, message size and origin rule."""
    original = websockets.asyncio.server.serve

    def serve(handler: Any, host: str, port: int, **options: Any) -> Any:
        options["max_size"] = MAX_MESSAGE_BYTES
        options["process_request"] = partial(_check_request, hosts, options.get("process_request"))
        return original(handler, host, port, **options)

    _infra.websockets.asyncio.server.serve = serve
    try:
        yield
    finally:
        _infra.websockets.asyncio.server.serve = original


def _check_request(hosts: frozenset[str], inner: Callable[..., Any], connection: Any, request: Request) -> Any:
    """403 for a Host that is not ours (DNS rebinding) and for a websocket from another site's page."""
    host = request.headers.get("Host", "")
    origin = request.headers.get("Origin")
    if "*" not in hosts and _name(host) not in hosts:
        return _refuse(f"this server does not answer for {host[:80]!r}")
    if origin is not None and urlsplit(origin).netloc != host:
        return _refuse(f"pages of {origin[:80]!r} may not use this server")
    return inner(connection, request)


def _name(host: str) -> str:
    return (host.rpartition("]")[0] + "]" if host.startswith("[") else host.partition(":")[0]).lower()


def _refuse(reason: str) -> Response:
    log.warning("refused a request: %s", reason)
    body = (reason + "\n").encode()
    headers = Headers({"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))})
    return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", headers, body)


def _forget(connection: Any) -> None:
    for kind in _UNWANTED:
        if kind in connection._incoming_handlers:
            connection.unregister_handler(kind)


def _checked_update(client: viser.ClientHandle) -> Callable[..., Any]:
    """A widget update that sets `value` only, to something finite of the type it has, or one of its options."""
    inner = client.gui._handle_gui_updates

    async def handle(client_id: int, message: messages.GuiUpdateMessage) -> None:
        widget = client.gui._gui_input_handle_from_uuid.get(message.uuid)
        if widget is None or not isinstance(message.updates, dict) or set(message.updates) != {"value"}:
            return
        value, options = message.updates["value"], getattr(widget._impl.props, "options", None)
        if not acceptable(widget._impl.value, value) or (options is not None and value not in options):
            log.warning("client %s: ignored the value %.80r of a widget", client_id, value)
            return
        await inner(client_id, message)

    return handle


def _checked_start(client: viser.ClientHandle) -> Callable[..., Any]:
    """An upload begins only at an upload button of this client, one at a time, and no larger than a file may be."""
    gui = client.gui

    async def handle(client_id: int, message: messages.FileTransferStartUpload) -> None:
        button = gui._gui_input_handle_from_uuid.get(message.source_component_uuid)
        well_formed = (isinstance(message.filename, str) and len(message.filename) <= 1000
                       and isinstance(message.transfer_uuid, str) and len(message.transfer_uuid) <= 100
                       and all(isinstance(n, int) for n in (message.part_count, message.size_bytes))
                       and 0 <= message.part_count <= MAX_PARTS)
        if not isinstance(button, viser.GuiUploadButtonHandle) or not well_formed:
            log.warning("client %s: refused an upload", client_id)
        elif not 0 <= message.size_bytes <= files.MAX_FILE_BYTES:
            client.add_notification("This file cannot be used", f"It is larger than {files.MAX_FILE_BYTES // 2**20} "
                                    "MiB.", auto_close_seconds=12.0)
        else:
            gui._drop_uploads_from_client(client_id)
            gui._handle_file_transfer_start(client_id, message)

    return handle


def _checked_part(client: viser.ClientHandle) -> Callable[..., Any]:
    """Parts are taken while they fit into the size that was announced; else the upload is dropped."""
    gui = client.gui

    async def handle(client_id: int, message: messages.FileTransferPart) -> None:
        state = gui._current_file_upload_states.get(message.transfer_uuid)
        if state is None:
            return
        fits = (isinstance(message.content, bytes) and isinstance(message.part_index, int)
                and state["transferred_bytes"] + len(message.content) <= state["total_bytes"])
        if not fits:
            log.warning("client %s: an upload does not keep to its size", client_id)
            gui._drop_uploads_from_client(client_id)
            return
        gui._handle_file_transfer_part(client_id, message)

    return handle


def acceptable(current: object, new: object) -> bool:
    """Whether a widget that shows `current` may be set to `new` by a browser."""
    if isinstance(current, bool):
        return isinstance(new, bool)
    if isinstance(current, (int, float)):
        return isinstance(new, (int, float)) and not isinstance(new, bool) and math.isfinite(new) and abs(new) < 1e15
    if isinstance(current, str):
        return isinstance(new, str) and len(new) <= 1000
    if isinstance(current, tuple):
        return isinstance(new, (tuple, list)) and len(new) == len(current) and all(
            acceptable(c, n) for c, n in zip(current, new, strict=True))
    return False


@cache
def _plotly_js() -> str:
    import plotly

    return (Path(plotly.__file__).parent / "package_data" / "plotly.min.js").read_text(encoding="utf-8")


@cache
def _page_js() -> str:
    script = (HERE / "page.js").read_text(encoding="utf-8")
    style = (HERE / "page.css").read_text(encoding="utf-8")
    return script.replace("__CSS__", json.dumps(style)).replace("__VIEWER__", json.dumps(sorted(VIEWER_NAMES)))
