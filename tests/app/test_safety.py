"""The doors that are closed, knocked at from outside: who may connect, and what a browser may say."""

import http.client
import math
import socket
import threading
from typing import Any

import msgspec.msgpack
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from app.server import App
from app.web import adapter
from tests.app.conftest import until
from tests.app.fake_browser import PROTOCOL, decode, open_socket

pytestmark = pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")


# -- who may connect ------------------------------------------------------------------------------------------------


def get(app: App, path: str = "/", **headers: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", app.port, timeout=20)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    return response.status, response.read().decode(errors="replace")


@pytest.mark.parametrize("origin", ["http://evil.example", "https://127.0.0.1:1", "http://localhost.evil.example",
                                    "null", "file://", "http://127.0.0.1", "http://127.0.0.1:{port}.evil.example",
                                    "http://127.0.0.1:{port}@evil.example", "nonsense", ""])
def test_a_foreign_origin_is_refused(app, origin):
    with pytest.raises(InvalidStatus) as error:
        open_socket(app.port, origin=origin.format(port=app.port))
    assert error.value.response.status_code == 403


@pytest.mark.parametrize("origin", ["http://127.0.0.1:{port}", "https://127.0.0.1:{port}", None])
def test_our_own_pages_and_programs_without_origin_are_accepted(app, origin):
    with open_socket(app.port, origin=origin and origin.format(port=app.port)) as bare:
        assert decode(bare.recv(20))


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "localhost.", "", "[::2]", "0.0.0.0"])
def test_a_foreign_host_is_refused(app, host):
    status, body = get(app, Host=f"{host}:{app.port}")
    assert status == 403 and "viser" not in body


def test_dns_rebinding_is_refused(app):
    """A name that leads to this machine, with an origin that agrees with it."""
    with pytest.raises(InvalidStatus) as error, socket.create_connection(("127.0.0.1", app.port)) as sock:
        connect(f"ws://evil.example:{app.port}", sock=sock, origin=f"http://evil.example:{app.port}",
                subprotocols=[PROTOCOL])
    assert error.value.response.status_code == 403


@pytest.mark.parametrize("host", ["127.0.0.1:{port}", "localhost:{port}", "LOCALHOST:{port}", "[::1]:{port}"])
def test_our_own_names_are_answered(app, host):
    status, body = get(app, Host=host.format(port=app.port))
    assert status == 200 and "<html" in body


def test_another_name_may_be_allowed(registry):
    app = App(registry, port=0, allowed_hosts=frozenset({"lab.example"}))
    try:
        assert get(app, Host="lab.example:80")[0] == 200
        assert get(app, Host="evil.example:80")[0] == 403
        with pytest.raises(InvalidStatus):       # the origin must be the host that was asked for
            open_socket(app.port, origin="http://lab.example")
    finally:
        app.stop()


def test_files_outside_the_page_are_not_served(app):
    for path in ("/../../pyproject.toml", "/%2e%2e/%2e%2e/_viser.py", "/..\\..\\_viser.py", "//etc/passwd"):
        assert get(app, path)[0] == 404


def test_the_server_listens_on_this_machine_only(app):
    assert app.host == "127.0.0.1" and app.url == f"http://127.0.0.1:{app.port}"
    with socket.socket() as probe, pytest.raises(OSError):
        probe.settimeout(5)
        probe.connect(("127.0.0.2", app.port))   # another address of the same machine


# -- what may be said -----------------------------------------------------------------------------------------------


@pytest.fixture
def tunnel(app: App, monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Set when anybody makes viser open, or close, its public tunnel."""
    called = threading.Event()
    monkeypatch.setattr(app.server, "request_share_url", called.set)
    monkeypatch.setattr(app.server, "disconnect_share_url", called.set)
    return called


def test_share_form_and_upload_do_nothing(app, visit, tunnel):
    one, other = visit(), visit()
    button = one.browser.widget("New seed")["uuid"]
    before = len(other.heard())
    one.browser.send("ShareUrlRequest")
    one.browser.send("ShareUrlDisconnect")
    one.browser.send("GuiFormSubmitMessage", uuid=button)
    one.browser.send("GuiFormDirtyMessage", uuid=button)
    one.browser.send("GuiButtonHoldMessage", uuid=button, frequency=10.0)
    one.browser.send("FileTransferStartUpload", source_component_uuid=button, transfer_uuid="t", filename="f",
                     mime_type="m", part_count=2, size_bytes=10)
    one.browser.send("FileTransferPart", source_component_uuid=button, transfer_uuid="t", part_index=0, content=b"12")
    one.browser.set("Amplitude", 5.0)            # handled after all of these
    until(lambda: one.session.scenario.params.amplitude == 5.0)
    assert not tunnel.is_set()
    for gui in (app.server.gui, one.session.client.gui):
        assert not gui._current_file_upload_states
    assert not [m for m in one.browser.received if m["type"].startswith(("FileTransfer", "ShareUrl", "GuiForm"))]
    assert len(other.heard()) == before


@pytest.mark.parametrize("updates", [
    {"value": math.nan}, {"value": math.inf}, {"value": -math.inf}, {"value": "5"}, {"value": None}, {"value": True},
    {"value": [5.0]}, {"value": {"a": 1}}, {"value": 1e16}, {"value": b"5"}, {"label": "<b>"}, {"min": -1e9},
    {"visible": False}, {"value": 5.0, "visible": False}, {"_impl": 1}, {"__class__": "x"}, {"removed": True}, {},
    {"update_cb": []}, ["value"], {"value": 5.0, "uuid": "x"},
], ids=str)
def test_anything_but_a_finite_value_is_ignored(visit, updates):
    one = visit()
    widget = one.browser.widget("Amplitude")
    handle = one.session._controls._widgets["amplitude"]
    before = vars(handle._impl.props).copy(), one.session.scenario
    one.browser.send("GuiUpdateMessage", uuid=widget["uuid"], updates=updates)
    one.browser.set("Order", 7)                  # handled after it
    until(lambda: one.session.scenario.params.order == 7)
    assert vars(handle._impl.props) == before[0] and not handle._impl.removed
    assert one.session.scenario.params.amplitude == before[1].params.amplitude == handle.value


@pytest.mark.parametrize(("label", "value"), [
    ("Start", [1.0]), ("Start", [1.0, math.nan]), ("Start", [1.0, 2.0, 3.0]), ("Start", ["1", "2"]), ("Start", 3.0),
    ("Filled", 1), ("Filled", "yes"), ("Shape", 3), ("Shape", "s" * 5000), ("Shape", ["round"]), ("Last step", "6"),
])
def test_values_of_another_type_are_ignored(visit, label, value):
    one = visit()
    before = one.session.scenario
    one.browser.send("GuiUpdateMessage", uuid=one.browser.widget(label)["uuid"], updates={"value": value})
    one.browser.set("Order", 7)
    until(lambda: one.session.scenario.params.order == 7)
    changed = {name for name in type(before.params).__dataclass_fields__
               if getattr(before.params, name) != getattr(one.session.scenario.params, name)}
    assert changed == {"order"}


@pytest.mark.parametrize(("label", "value", "name", "taken"), [
    ("Amplitude", 99.0, "amplitude", 10.0), ("Amplitude", -5, "amplitude", 0.0), ("Order", 1e12, "order", 9),
    ("Start", [1e6, -1e6], "start", (10.0, -10.0)), ("Runs", 99.0, "runs", 100_000), ("Seed", -3, "seed", 0),
])
def test_values_out_of_range_become_the_nearest(visit, label, value, name, taken):
    one = visit()
    one.browser.set(label, value)
    until(lambda: getattr(one.session.scenario.params, name) == taken)


@pytest.mark.parametrize("label", ["Shape", "Size", "Background", "Speed"])
def test_a_choice_that_is_not_offered_is_ignored(visit, label):
    one = visit()
    before = one.session.scenario.params.shape
    uuid = one.browser.widget(label)["uuid"]
    handle = one.session.client.gui._gui_input_handle_from_uuid[uuid]
    shown = handle.value
    for value in ("nonsense", "", "round"):      # the last is the option's id, not its name
        one.browser.send("GuiUpdateMessage", uuid=uuid, updates={"value": value})
    one.browser.set("Order", 7)
    until(lambda: one.session.scenario.params.order == 7)
    assert handle.value == shown and one.session.scenario.params.shape == before


@pytest.mark.parametrize(("current", "new", "expected"), [
    (True, False, True), (True, 1, False), (1, 2.5, True), (1.5, 2, True), (1.5, True, False), (1.5, math.nan, False),
    (1.5, 1e15, False), (1, 2**62, False), ("a", "b" * 1000, True), ("a", "b" * 1001, False), ("a", 1, False),
    ((1.0, 2.0), [3.0, 4], True), ((1.0, 2.0), (3.0,), False), ((1.0, 2.0), [3.0, math.inf], False),
    ((1.0, 2.0), "ab", False), (None, 1.0, False), (None, None, False), (np.float64(1.0), 2.0, True),
    ([1.0], [2.0], False), ({}, {}, False),
])
def test_what_a_widget_may_be_set_to(current, new, expected):
    assert adapter.acceptable(current, new) is expected


@pytest.mark.parametrize("frame", [
    b"", b"\xff\xff\xff", b"\x00" * 50, msgspec.msgpack.encode({"type": "NoSuchMessage"}),
    msgspec.msgpack.encode([1, 2]),
    msgspec.msgpack.encode({"kind": "x"}), msgspec.msgpack.encode({"type": "GuiUpdateMessage"}),
    msgspec.msgpack.encode({"type": "ViewerCameraMessage", "position": "x"}), msgspec.msgpack.encode({"type": 5}),
    msgspec.msgpack.encode({"type": "Message"}), "text", msgspec.msgpack.encode({"type": "GuiUpdateMessage", "x": 1}),
], ids=lambda frame: repr(frame)[:40])
def test_garbage_closes_only_its_own_socket(app, visit, frame):
    other = visit()
    with open_socket(app.port) as bare:
        bare.send(frame)
        with pytest.raises(ConnectionClosed):
            while True:
                bare.recv(20)
    other.browser.set("Amplitude", 5.0)
    until(lambda: other.session.scenario.params.amplitude == 5.0)


@pytest.mark.parametrize(("kind", "fields"), [
    ("GuiUpdateMessage", {"uuid": "none", "updates": {"value": 1}}), ("GuiUpdateMessage", {"uuid": 3, "updates": []}),
    ("GuiUpdateMessage", {"uuid": "x", "updates": ["value"]}), ("CommandTriggerMessage", {"uuid": "none"}),
    ("LocalStorageGetItemResponseMessage", {"value": "x", "error": None, "request_uuid": "none"}),
    ("RunJavascriptMessage", {"source": "alert(1)"}), ("GuiRemoveMessage", {"uuid": "none"}),
    ("RemoveSceneNodeMessage", {"name": "/wave", "owner": ""}), ("ResetGuiMessage", {}),
    ("SceneNodeUpdateMessage", {"name": "/wave", "updates": {"visible": False}, "owner": ""}),
    ("TransformControlsUpdateMessage", {"name": "/wave", "wxyz": [1, 0, 0, 0], "position": [0, 0, 0], "owner": ""}),
], ids=lambda value: value if isinstance(value, str) else "")
def test_messages_about_nothing_do_nothing(app, visit, kind, fields):
    one, other = visit(), visit()
    before = len(other.heard())
    one.browser.send(kind, **fields)
    one.browser.set("Amplitude", 5.0)
    until(lambda: one.session.scenario.params.amplitude == 5.0)
    assert len(other.heard()) == before
    one.settle()
    assert "/wave" in one.browser.nodes and one.browser.nodes["/wave"]["props"].get("visible", True)


@pytest.mark.parametrize("camera", [
    {"position": [math.nan] * 3}, {"position": [math.inf, 0.0, 0.0], "look_at": [math.nan] * 3},
    {"position": [1.0], "look_at": [2.0]}, {"position": [1e300] * 3}, {"look_at": [3.0, 3.0, 3.0]},
    {"image_width": 0, "image_height": 0}, {"image_width": -5, "image_height": -5},
    {"image_width": 10**12, "image_height": 1}, {"fov": math.nan},
], ids=str)
def test_a_camera_that_makes_no_sense_changes_nothing_for_long(visit, camera):
    one = visit()
    good = {"wxyz": [1.0, 0, 0, 0], "position": [3.0, 3.0, 3.0], "look_at": [0.0, 0.0, 0.0],
            "up_direction": [0, 0, 1.0], "fov": 0.8, "near": 0.01, "far": 1000.0, "image_width": 1000,
            "image_height": 700}
    one.browser.send("ViewerCameraMessage", **(good | camera))
    one.browser.send("ViewerCameraMessage", **good)
    one.browser.set("Amplitude", 5.0)
    until(lambda: one.session.scenario.params.amplitude == 5.0)
    one.settle()
    assert one.session.error == ""


def test_a_message_that_is_too_large_closes_only_its_own_socket(app, visit):
    other = visit()
    with open_socket(app.port) as bare:
        with pytest.raises(ConnectionClosed):
            bare.send(b"\x00" * (adapter.MAX_MESSAGE_BYTES + 1))
            while True:
                bare.recv(20)
        assert bare.close_code in (1009, 1006)          # 1006: the server closed while we were still sending
    other.browser.set("Amplitude", 5.0)
    until(lambda: other.session.scenario.params.amplitude == 5.0)


def test_a_picture_of_the_largest_size_fits():
    assert 3840 * 2160 * 4 < adapter.MAX_MESSAGE_BYTES < 50_000_000 + 2**20


def test_another_version_of_the_page_is_sent_away(app):
    with (connect(f"ws://127.0.0.1:{app.port}", subprotocols=["viser-v0.0.1"]) as old,
          pytest.raises(ConnectionClosed)):
        old.recv(20)


def test_values_cannot_be_set_in_another_session(app, visit):
    """Widgets are found by random ids, and only among the sender's own."""
    one, other = visit(), visit()
    theirs: Any = other.browser.widget("Amplitude")["uuid"]
    one.browser.send("GuiUpdateMessage", uuid=theirs, updates={"value": 5.0})
    one.browser.set("Order", 7)
    until(lambda: one.session.scenario.params.order == 7)
    assert other.session.scenario.params.amplitude == 1.0
