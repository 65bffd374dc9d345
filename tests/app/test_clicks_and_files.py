"""What a click means, and what becomes of a file that somebody gives."""

import pytest

from app import scenario as scenarios
from app.code_tab import script
from app.uploads import plain_name
from app.web.adapter import MAX_PARTS
from lessons.kit import files
from tests.app.conftest import until

GOOD, BAD, OTHER = b"NOTE 1\nhello", b"NOTE 2", b"something else"
SCALE = 10.0 / 100.0                       # display units per scene unit: 100 m are ten units high


def at(x: float, y: float) -> tuple[float, float, float]:
    return (x * SCALE, y * SCALE, 0.0)


@pytest.fixture
def picked(visit):
    return visit("?lesson=labs.picked")


# -- clicks ---------------------------------------------------------------------------------------------------------


def test_a_click_near_a_target_sets_what_it_says(picked):
    picked.browser.click(at(-39.5, -40.3))
    until(lambda: picked.session.scenario.params.route == ("a",))
    picked.settle()
    picked.browser.click(at(40.0, -40.0))
    until(lambda: picked.session.scenario.params.route == ("a", "b"))
    assert picked.session.scenario.params.start == (0.0, 20.0)


def test_a_click_elsewhere_adds_to_the_list_of_points_up_to_its_limit(picked):
    for k, (x, y) in enumerate(((20.0, -10.0), (-25.0, 5.0)), 2):
        picked.browser.click(at(x, y))
        until(lambda k=k: len(picked.session.scenario.params.fixes) == k)
        picked.settle()
        assert picked.session.scenario.params.fixes[-1] == pytest.approx((x, y), abs=0.3)
    picked.browser.click(at(0.0, -20.0))
    picked.browser.wait(lambda b: any("most" in note for note in b.notes))
    assert len(picked.session.scenario.params.fixes) == 3


def test_a_click_on_a_point_of_the_list_adds_none(picked):
    picked.browser.click(at(10.1, 10.0))
    picked.browser.click(at(-25.0, 5.0))
    until(lambda: len(picked.session.scenario.params.fixes) == 2)
    assert picked.session.scenario.params.fixes[0] == (10.0, 10.0)


def test_without_the_list_a_click_moves_the_point_that_follows_clicks(picked):
    picked.browser.set("Hidden", True)
    until(lambda: picked.session.scenario.params.hidden)
    picked.settle()
    picked.browser.click(at(30.0, -5.0))
    until(lambda: picked.session.scenario.params.start != (0.0, 20.0))
    assert picked.session.scenario.params.start == pytest.approx((30.0, -5.0), abs=0.3)
    assert "/handle.fixes.0" not in picked.browser.nodes


def test_an_offset_has_its_handle_at_the_sum_and_follows_what_it_is_about(picked):
    assert picked.browser.nodes["/handle.tip"]["position"][:2] == pytest.approx(at(10.0, 20.0)[:2], abs=0.03)
    picked.browser.drag("/handle.tip", at(15.0, 30.0))
    until(lambda: picked.session.scenario.params.tip == pytest.approx((15.0, 10.0), abs=0.3))
    picked.settle()
    tip = picked.session.scenario.params.tip
    picked.browser.drag("/handle.start", at(-20.0, 0.0))
    until(lambda: picked.session.scenario.params.start == pytest.approx((-20.0, 0.0), abs=0.3))
    picked.settle()
    assert picked.session.scenario.params.tip == tip
    assert picked.browser.nodes["/handle.tip"]["position"][:2] == pytest.approx(at(-5.0, 10.0)[:2], abs=0.06)


@pytest.mark.parametrize("ray", [([0.0, 0.0, 5.0], [0.0, 0.0, 0.0]), ([0.0, 0.0, float("nan")], [0.0, 0.0, -1.0]),
                                 ([0.0, 0.0, 5.0], [0.0, 0.0, 1.0]), ([1.0], [0.0, 1.0])])
def test_a_ray_that_leads_nowhere_does_nothing(picked, ray):
    origin, direction = ray
    picked.browser.send("ScenePointerMessage", event_type="click", ray_origin=origin, ray_direction=direction,
                        screen_pos=[[0.5, 0.5]], modifier=None)
    picked.browser.set("Hidden", True)
    until(lambda: picked.session.scenario.params.hidden)
    assert picked.session.scenario.params.fixes == ((10.0, 10.0),)


def test_points_of_a_list_are_dragged_one_by_one(picked):
    picked.browser.click(at(20.0, -10.0))
    until(lambda: len(picked.session.scenario.params.fixes) == 2)
    picked.settle()
    picked.browser.drag("/handle.fixes.1", at(-5.0, -5.0))
    until(lambda: picked.session.scenario.params.fixes[1][0] < 0.0)
    assert picked.session.scenario.params.fixes[0] == (10.0, 10.0)


def test_lists_get_shorter_by_their_buttons(picked):
    picked.browser.click(at(-40.0, -40.0))
    until(lambda: picked.session.scenario.params.route == ("a",))
    picked.settle()
    assert picked.browser.widget("Route")["value"] == "a"
    buttons = [w for w in picked.browser.widgets.values() if "Remove last" in (w["props"].get("options") or ())]
    picked.browser.send("GuiUpdateMessage", uuid=buttons[0]["uuid"], updates={"value": "Remove last"})
    until(lambda: picked.session.scenario.params.route == ())


def test_other_lessons_do_not_listen_to_clicks(visit):
    one = visit()
    enabled = [m for m in one.browser.received if m["type"] == "ScenePointerEnableMessage" and m["modifiers"]]
    assert not enabled


# -- files ----------------------------------------------------------------------------------------------------------


def test_a_good_file_becomes_part_of_the_scenario(picked):
    picked.browser.upload("Load a note", "C:\\notes\\first.note", GOOD, parts=3)
    until(lambda: picked.session.scenario.params.note)
    picked.settle()
    key = picked.session.scenario.params.note
    assert files.get(key) == ("first.note", GOOD)
    assert picked.browser.widget("Note")["value"] == "first.note"
    assert picked.session.view.readouts[0].value == len(GOOD)
    picked.browser.wait(lambda b: f"note={key}" in b.scripts("setQuery")[-1])


@pytest.mark.parametrize("content, says", [(BAD, "line 1: expected NOTE 1"), (OTHER, "expected a note"),
                                           (b"", "empty")])
def test_a_bad_file_is_refused_in_words_and_nothing_else_changes(picked, content, says):
    before = picked.session.scenario
    picked.browser.upload("Load a note", "my.note", content, parts=1 if content else 0)
    picked.browser.wait(lambda b: any("my.note" in note and says in note for note in b.notes))
    assert picked.session.scenario == before and not picked.session.error


def test_a_file_that_is_too_large_is_refused_before_it_comes(picked):
    picked.browser.upload("Load a note", "big.note", GOOD, size=files.MAX_FILE_BYTES + 1)
    picked.browser.wait(lambda b: any("larger than" in note for note in b.notes))
    assert not picked.session.client.gui._current_file_upload_states


def test_an_upload_keeps_to_what_it_announced(picked):
    gui = picked.session.client.gui
    picked.browser.upload("Load a note", "n.note", GOOD * 10, size=20)
    picked.browser.upload("Load a note", "n.note", GOOD, parts=1, size=-5, transfer="u")
    picked.browser.upload("Hidden", "n.note", GOOD, transfer="v")      # no upload button
    button = picked.browser.widget("Load a note")["uuid"]
    for fields in ({"part_count": MAX_PARTS + 1, "size_bytes": 10}, {"part_count": -1, "size_bytes": 10},
                   {"part_count": 1, "size_bytes": 10**12}):
        picked.browser.send("FileTransferStartUpload", source_component_uuid=button, transfer_uuid="w",
                            filename="n", mime_type="", **fields)
    picked.browser.set("Hidden", True)
    until(lambda: picked.session.scenario.params.hidden)
    assert not gui._current_file_upload_states and picked.session.scenario.params.note == ""


def test_only_one_upload_is_kept_at_a_time(picked):
    button = picked.browser.widget("Load a note")["uuid"]
    for name in ("one", "two", "three"):
        picked.browser.send("FileTransferStartUpload", source_component_uuid=button, transfer_uuid=name,
                            filename="n.note", mime_type="", part_count=2, size_bytes=100)
    picked.browser.set("Hidden", True)
    until(lambda: picked.session.scenario.params.hidden)
    assert list(picked.session.client.gui._current_file_upload_states) == ["three"]


def test_an_address_with_a_file_that_is_not_here(visit):
    one = visit("?lesson=labs.picked&note=0123456789abcdef")
    assert any("a note that this server has been given" in note for note in one.browser.notes)
    assert one.session.scenario.params.note == ""


def test_the_script_of_the_code_tab_loads_the_file(registry, tmp_path):
    entry = registry["labs.picked"]
    key = files.put("first.note", GOOD)
    at = scenarios.with_params(scenarios.default(entry), entry, {"note": key})
    text = script(entry, at)
    assert "files.put('first.note', open('first.note', \"rb\").read())" in text
    assert "from lessons.kit import files" in text
    compile(text, "<script>", "exec")


def test_the_store_forgets_the_oldest_when_it_is_full(monkeypatch):
    monkeypatch.setattr(files, "MAX_TOTAL_BYTES", 1000 + sum(len(f.content) for f in files._files.values()))
    keys = [files.put(f"{k}", bytes([k]) * 600) for k in range(3)]
    assert files.has(keys[-1]) and sum(len(f.content) for f in files._files.values()) <= files.MAX_TOTAL_BYTES
    monkeypatch.setattr(files, "MAX_TOTAL_BYTES", 700)
    last = files.put("last", b"z" * 600)
    assert files.has(last) and not any(map(files.has, keys))
    with pytest.raises(ValueError, match="empty"):
        files.put("nothing", b"")
    with pytest.raises(LookupError, match="give it again"):
        files.get("0" * 16)


@pytest.mark.parametrize("given, plain", [("/etc/passwd", "passwd"), ("C:\\x\\y.csv", "y.csv"),
                                          ("a\x00b\n.csv", "ab.csv"), ("", "file"), ("x" * 300, "x" * 80)])
def test_names_of_files_are_made_plain(given, plain):
    assert plain_name(given) == plain


# -- the command line -----------------------------------------------------------------------------------------------


def test_files_on_the_command_line(lesson_folder, tmp_path, capsys):
    from app.cli import main

    good, bad = tmp_path / "good.note", tmp_path / "bad.note"
    good.write_bytes(GOOD)
    bad.write_bytes(BAD)
    labs = ["--lessons", str(lesson_folder)]
    assert main(["run", "labs.picked", *labs, "--data", str(good)]) == 0
    assert "12 B" in capsys.readouterr().out
    assert main(["run", "labs.picked", *labs, "--data", str(bad)]) == 2
    assert "bad.note: line 1: expected NOTE 1" in capsys.readouterr().err
    assert main(["run", "labs.picked", *labs, "--data", str(tmp_path / "none")]) == 2
    assert "can be read" in capsys.readouterr().err
    assert main(["check", *labs, "--map", str(good), "--map", str(bad)]) == 1
    out = capsys.readouterr().out
    assert "a note, and all is well" in out and "expected NOTE 1" in out
