"""The contract with viser's private parts on which app/web/adapter.py stands."""

import inspect
import json
import logging
from importlib.metadata import version

import pytest
import viser
import viser._messages as messages
import websockets.asyncio.server
from viser._gui_api import GuiApi
from viser.infra import _infra

from app.web import adapter
from tests.app.conftest import until
from tests.app.fake_browser import PREFIX

pytestmark = pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")

UNWANTED = ("ShareUrlRequest", "ShareUrlDisconnect", "GuiFormSubmitMessage", "GuiFormDirtyMessage",
            "FileTransferStartUpload", "FileTransferPart", "GuiButtonHoldMessage")


# -- the contract ---------------------------------------------------------------------------------------------------


def test_the_pinned_version():
    assert version("viser") == viser.__version__ == "1.1.1"


def test_the_names_that_we_use_exist():
    assert _infra.websockets.asyncio.server is websockets.asyncio.server
    for name in (*UNWANTED, "RunJavascriptMessage", "GuiUpdateMessage"):
        assert issubclass(getattr(messages, name), messages.Message), name
    assert [f.name for f in messages.RunJavascriptMessage.__dataclass_fields__.values()] == ["source"]
    assert {"uuid", "updates"} <= set(messages.GuiUpdateMessage.__dataclass_fields__)
    assert inspect.iscoroutinefunction(GuiApi._handle_gui_updates)
    assert list(inspect.signature(GuiApi._handle_gui_updates).parameters) == ["self", "client_id", "message"]


def test_a_server_listens_through_the_function_that_we_guard():
    """viser looks `serve` up when it starts, and passes what we change by name."""
    source = inspect.getsource(_infra.WebsockServer._background_worker)
    assert "websockets.asyncio.server.serve(" in source
    assert "max_size=" in source and "process_request=" in source
    assert websockets.asyncio.server.serve.__module__.startswith("websockets")     # ours is gone again


def test_handlers_live_where_we_remove_them(app, visit):
    client = visit().session.client
    for connection in (app.server._websock_server, client._websock_connection):
        assert isinstance(connection._incoming_handlers, dict)
        with pytest.raises(AssertionError):
            connection.unregister_handler(messages.ShareUrlRequest)
    assert client._viser_server is app.server and client.client_id in app.server._connected_clients
    assert adapter.is_connected(client)


def test_no_unwanted_message_has_a_handler(app, visit):
    client = visit().session.client
    kinds = [getattr(messages, name) for name in UNWANTED]
    uploads = (messages.FileTransferStartUpload, messages.FileTransferPart)
    handlers = client._websock_connection._incoming_handlers
    assert [kind for kind in kinds if kind in handlers and kind not in uploads] == []
    for kind in uploads:                        # ours alone, which check what they are told
        assert [handler.__module__ for handler in handlers[kind]] == [adapter.__name__]
    held = app.server._websock_server._incoming_handlers.get(messages.GuiButtonHoldMessage, [])
    assert not [kind for kind in kinds[:-1] if kind in app.server._websock_server._incoming_handlers]
    assert all(handler.__self__ is app.server.gui for handler in held)     # which has no buttons
    assert not app.server.gui._gui_input_handle_from_uuid


def test_widgets_tell_their_value_and_id(visit):
    one = visit()
    handle = one.session._controls._widgets["amplitude"]
    uuid = adapter.widget_id(handle)
    assert one.session.client.gui._gui_input_handle_from_uuid[uuid] is handle
    assert handle._impl.value == handle.value == 1.0
    assert one.browser.widget("Amplitude")["uuid"] == uuid


def test_a_script_runs_in_the_page_and_is_never_dropped(visit):
    one = visit()
    for i in range(5):
        adapter.call_page(one.session.client, "mark", i, '</script>"', [1.5, None, True])
    one.browser.wait(lambda b: len(b.scripts("mark")) == 5)
    assert one.browser.scripts("mark") == [f'{i}, "</script>\\"", [1.5, null, true]' for i in range(5)]


def test_the_page_is_asked_through_its_local_storage(visit):
    one = visit("?lesson=labs.quick&amplitude=3")
    assert adapter.ask_page(one.session.client, "window.paikka.search") == "?lesson=labs.quick&amplitude=3"
    assert PREFIX == "viser-user:"
    until(lambda: not one.browser._storage)      # and cleans up behind itself


def test_a_page_that_does_not_answer_is_not_waited_for_long(visit, caplog):
    one = visit()
    one.browser._storage = type("Mute", (dict,), {"get": lambda self, key: None})()
    assert adapter.ask_page(one.session.client, "window.paikka.search", 1.0) == ""
    silent = type("Silent", (), {"get_item": lambda *a, **k: (_ for _ in ()).throw(TimeoutError("late")),
                                 "remove_item": lambda *a: None})()
    one.session.client.local_storage = silent
    with caplog.at_level(logging.WARNING):
        assert adapter.ask_page(one.session.client, "window.paikka.search", 0.1) == ""
    assert "late" in caplog.text


def test_plotly_is_sent_once_to_each_and_never_by_viser(app, visit):
    one, other = visit(), visit()
    for each in (one, other):
        libraries = [m for m in each.browser.received
                     if m["type"] == "RunJavascriptMessage" and len(m["source"]) > 1_000_000]
        assert len(libraries) == 1 and "plotly" in libraries[0]["source"][:500].lower()
        assert each.session.client.gui._setup_plotly_js is True


def test_a_plot_takes_json(visit):
    one = visit()
    plot = until(lambda: next((w for w in one.browser.widgets.values() if w["type"] == "GuiPlotlyMessage"), None))
    sent = json.loads(plot["props"]["_plotly_json_str"])
    assert sent["layout"]["xaxis"]["title"]["text"] == "x (m)" and sent["config"]["displaylogo"] is False


def test_the_page_s_script_is_complete():
    script = adapter._page_js()
    assert "__CSS__" not in script and "__VIEWER__" not in script
    assert "window.paikka" in script and "fixedDpr" in script
    assert "http://" not in script and "https://" not in script
