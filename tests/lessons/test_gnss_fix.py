"""The fix from files: what corrections do, RINEX and CSV of our own writing, bad files, and a real station."""

import os
import random
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.gnss import Corrections, fix, simulate
from lessons.kit import files
from lessons.static import gnss_fix as lesson
from lessons.static._gnss_files import NAVIGATION, OBSERVATIONS, broadcast, in_week, measurements
from tests.core.gnss import rinex_writer
from tests.lessons.support import Desk

DESK = Desk(lesson)
MADE = simulate(np.deg2rad(61.45), np.deg2rad(23.86), 120.0, 4 * 86_400.0 + 30.0 * np.arange(8), 0.3,
                np.random.default_rng(3))
FILES = {v: (rinex_writer.observations(MADE, v).encode(), rinex_writer.navigation(MADE, v).encode()) for v in (2, 3)}


def given(observations=None, navigation=None, **changes):
    keys = {name: files.put(f"given.{name[:3]}", content)
            for name, content in (("observations", observations), ("navigation", navigation)) if content is not None}
    return DESK.params(**keys, **changes)


def table():
    """The same epochs as CSV."""
    rows = ["t_s,satellite,x_m,y_m,z_m,pseudorange_m"]
    for e in MADE.epochs:
        f = fix(e, MADE.ephemerides, Corrections(alpha=MADE.alpha, beta=MADE.beta))
        for name, rho, clock, s in zip(e.names, e.pseudoranges_m, f.clock_m, f.satellites_m, strict=True):
            rows.append(f"{e.time_s},{name},{s[0]:.4f},{s[1]:.4f},{s[2]:.4f},{rho + clock:.4f}")
    return ("\n".join(rows) + "\n").encode()


# -- what the lesson claims -----------------------------------------------------------------------------------------


def medians(name):
    return np.nanmedian(DESK.result(DESK.preset(name)).enu, axis=0)


def test_the_default_recovers_the_simulated_place():
    """60 epochs of 0.7 m code noise: within 5 m in space, and without a bias of a metre."""
    found = DESK.readouts()
    assert found["median_flat"] < 2.0 and found["median_all"] < 4.0 and found["used"] >= 6
    assert np.abs(medians("all corrections")[:2]).max() < 1.0


def test_corrections_move_the_cloud_where_the_presets_say():
    best = medians("all corrections")
    up = medians("no atmosphere")[2] - best[2]
    assert 5.0 < up < 20.0 and 0.5 < medians("no ionosphere")[2] - best[2] < up
    slip = medians("the Earth stands still") - best
    assert 12.0 < slip[0] < 35.0 and abs(slip[1]) < 0.5 * slip[0]
    assert np.abs(medians("satellite clocks as they are")).max() > 1000.0


def test_low_satellites_and_a_high_mask_cost():
    spread = {name: np.sqrt(np.trace(DESK.result(DESK.preset(name)).law.cov)) for name in
              ("all corrections", "low satellites, all alike", "a high mask")}
    assert spread["low satellites, all alike"] > 1.2 * spread["all corrections"]
    assert spread["a high mask"] > 1.5 * spread["all corrections"]


def test_stages_and_pictures():
    names = [set(DESK.items(step=3, stage=k)) for k in range(4)]
    assert "bancroft" not in names[1] and "bancroft" in names[2] and "now" not in names[2] and "now" in names[3]
    assert "all_law" not in names[3] and "all_law" in set(DESK.items(DESK.preset("no atmosphere")))
    globe = set(DESK.items(DESK.preset("the globe"), 0, 2))
    assert {"earth", "receiver", "used", "used_lines", "enu", "other_root"} <= globe
    for k, v in enumerate([DESK.view(DESK.default, 0, k) for k in range(4)]):
        current = {e.name for e in v.equations if e.current}
        assert {0: "satellites", 1: "clock", 2: "bancroft", 3: "newton"}[k] in current


def test_nothing_solvable_is_said_in_the_picture():
    view = DESK.view(DESK.params(mask_deg=40.0), 0)
    r = DESK.result(DESK.params(mask_deg=40.0))
    assert any(isinstance(f, str) for f in r.fixes) or all(f.used.sum() >= 4 for f in r.fixes)
    lost = next((k for k, f in enumerate(r.fixes) if isinstance(f, str)), None)
    if lost is not None:
        assert "above the mask of 40" in DESK.view(DESK.params(mask_deg=40.0), lost).note
    assert view.camera is not None


# -- files ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
def test_rinex_of_our_own_is_read_exactly(version):
    observations, navigation = FILES[version]
    m, b = measurements(observations), broadcast(navigation)
    assert m.week == b.week == rinex_writer.WEEK and len(m.epochs) == len(MADE.epochs)
    for ours, theirs in zip(MADE.epochs, m.epochs, strict=True):
        assert theirs.time_s == pytest.approx(ours.time_s, abs=1e-7) and theirs.names == ours.names
        np.testing.assert_allclose(theirs.pseudoranges_m, ours.pseudoranges_m, atol=5.1e-4)
    np.testing.assert_allclose(m.marker, MADE.truth_m, atol=1e-4)
    for name, a, c in zip(b.ephemerides._fields, MADE.ephemerides, b.ephemerides, strict=True):
        if name == "names":
            assert a.tolist() == c.tolist()
        else:
            np.testing.assert_allclose(c.astype(float), a.astype(float), rtol=2e-12, atol=1e-22, err_msg=name)
    np.testing.assert_allclose([*b.alpha, *b.beta], [*MADE.alpha, *MADE.beta], rtol=1e-4)


@pytest.mark.parametrize("version", [2, 3])
def test_the_lesson_solves_them(version):
    p = given(*FILES[version])
    found = DESK.readouts(p)
    assert found["median_flat"] < 1.5 and found["latitude"] == pytest.approx(61.45, abs=1e-4)
    assert DESK.view(p).caption.startswith("given.obs: epoch 1 of 8")
    assert set(DESK.lesson.unused_at(p)) == {"latitude_deg", "longitude_deg", "height_m", "sigma_m", "seed"}


def test_a_table_gives_the_same_fixes():
    off = {"ionosphere": False, "troposphere": False, "earth_rotation": False}
    rinex, csv = (DESK.result(q) for q in (given(*FILES[2], **off, satellite_clock=True), given(table(), **off)))
    same = fix(MADE.epochs[0], MADE.ephemerides, Corrections(earth_rotation=True, ionosphere=False, troposphere=False))
    np.testing.assert_allclose(csv.fixes[0].x, same.x, atol=2e-3)      # the table's satellites are turned already
    assert len(rinex.fixes) == len(csv.fixes) == 8 and csv.source.marker is None


def test_one_file_alone_asks_for_the_other():
    for p, says in ((given(FILES[2][0]), "now load the navigation"),
                    (given(None, FILES[2][1]), "now load observations")):
        view = DESK.view(p)
        assert says in view.note and view.caption.startswith("simulated")
        assert not DESK.lesson.unused_at(p)


def test_a_navigation_file_of_the_next_week_is_counted_right():
    orbits = broadcast(FILES[2][1])
    shifted = in_week(orbits, rinex_writer.WEEK - 1)
    assert (shifted.toe_s - orbits.ephemerides.toe_s == 604_800.0).all()


def test_files_are_told_apart_by_their_content():
    for version in (2, 3):
        observations, navigation = FILES[version]
        assert OBSERVATIONS.recognise(observations) and not OBSERVATIONS.recognise(navigation)
        assert NAVIGATION.recognise(navigation) and not NAVIGATION.recognise(observations)
    assert OBSERVATIONS.recognise(table()) and not NAVIGATION.recognise(table())
    assert not OBSERVATIONS.recognise(b"\x89PNG\r\n") and not OBSERVATIONS.recognise(b"")


def test_without_the_reader_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyrtklib", None)
    measurements.cache_clear()
    with pytest.raises(ValueError, match=r'pip install "paikka\[gnss\]"'):
        measurements(FILES[2][0])
    assert measurements(table()).epochs                                # a table needs none


# -- files with mistakes --------------------------------------------------------------------------------------------


CHECKS = {"observations": measurements, "navigation": broadcast}


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("which", ["observations", "navigation"])
def test_a_file_that_was_cut_is_refused_or_right(version, which):
    """At 60 places: an error with a line, or exactly the epochs (records) that are complete."""
    content = FILES[version][which == "navigation"]
    whole = CHECKS[which](content)
    for end in random.Random(version).sample(range(len(content)), 60):
        try:
            part = CHECKS[which](content[:end])
        except ValueError as error:
            assert str(error).startswith("line ") and "expected" in str(error)
            continue
        if which == "observations":
            for a, b in zip(part.epochs, whole.epochs, strict=False):
                assert a.names == b.names and a.pseudoranges_m.tolist() == b.pseudoranges_m.tolist()
        else:
            n = len(part.ephemerides.names)
            assert part.ephemerides.m0.tolist() == whole.ephemerides.m0[:n].tolist()


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("which", ["observations", "navigation"])
def test_a_letter_in_a_number_is_named_with_its_line(version, which):
    lines = FILES[version][which == "navigation"].decode().split("\n")
    body = next(k for k, text in enumerate(lines) if "END OF HEADER" in text) + 1
    for k in range(body, min(body + 12, len(lines) - 1)):
        digit = max(i for i, c in enumerate(lines[k]) if c.isdigit())
        spoiled = [*lines[:k], lines[k][:digit] + "x" + lines[k][digit + 1:], *lines[k + 1:]]
        with pytest.raises(ValueError, match=rf"^line {k + 1}: expected"):
            CHECKS[which]("\n".join(spoiled).encode())


@pytest.mark.parametrize("content, says", [
    (b"", "line 1: expected a line break"), (b"\x00\x01\x02\xff" * 50, "line 1: expected"),
    (b"hello\nworld\n", "line 1: expected t_s,satellite"),
    (table().replace(b",G", b";G", 1), "line 2: expected 6 values"),
    (table()[:-9], "expected a line break at the end; is the file complete"),
    (b"t_s,satellite,x_m,y_m,z_m,pseudorange_m\n", "at least one row"),
    (b"t_s,satellite,x_m,y_m,z_m,pseudorange_m\n0,G01,1,2,3,4\n", "line 2: expected the position of a satellite"),
    (b"t_s,satellite,x_m,y_m,z_m,pseudorange_m\n0,G01,nan,2e7,3,4\n", "line 2: expected finite"),
    (b"t_s,satellite,x_m,y_m,z_m,pseudorange_m\n" + 2 * b"0,G01,2e7,0,0,2e7\n", "line 3: expected each satellite once"),
    (FILES[2][1], "line 1: expected an observation file"),
    (FILES[2][0].replace(b"2.11", b"4.01", 1), "line 1: expected RINEX 2 or 3"),
    (FILES[2][0].replace(b"    C1", b"    P2", 1), "expected a GPS code on L1"),
    (FILES[3][0].replace(b"C1C", b"C2W", 1), "expected a GPS code on L1"),
    (FILES[2][0].split(b"END OF HEADER")[0], "expected END OF HEADER"),
    (FILES[2][0].replace(b"    L1    C1", "    L1    Ä1".encode("latin-1"), 1), "expected plain text"),
])
def test_what_is_no_observation_file(content, says):
    with pytest.raises(ValueError, match=says):
        measurements(content)


@pytest.mark.parametrize("content, says", [
    (b"", "line 1: expected a GPS navigation file"), (FILES[2][0], "line 1: expected a GPS navigation file"),
    (FILES[2][1].split(b"END OF HEADER")[0] + b"END OF HEADER\n", "expected records of GPS satellites"),
    (FILES[3][1].replace(b"\nG01", b"\nQ01", 1), "expected a record that begins with a satellite"),
])
def test_what_is_no_navigation_file(content, says):
    with pytest.raises(ValueError, match=says):
        broadcast(content)


def test_random_damage_never_crashes_and_never_lies():
    """Bytes at random places: an error in words, or epochs of the right shape."""
    chance = random.Random(7)
    for which in ("observations", "navigation"):
        for version in (2, 3):
            content = FILES[version][which == "navigation"]
            for _ in range(25):
                spoiled = bytearray(content)
                for _ in range(chance.randint(1, 4)):
                    spoiled[chance.randrange(len(spoiled))] = chance.randrange(256)
                try:
                    CHECKS[which](bytes(spoiled))
                except ValueError as error:
                    assert "expected" in str(error)


def test_epochs_without_an_ephemeris():
    old = simulate(np.deg2rad(61.45), np.deg2rad(23.86), 120.0, 2 * 86_400.0 + 30.0 * np.arange(4), 0.3,
                   np.random.default_rng(3))
    p = given(FILES[2][0], rinex_writer.navigation(old, 2).encode())
    assert "no healthy ephemeris within 2 h" in DESK.view(p, 0).note and DESK.readouts(p, 0) == {"used": 0}


# -- a real station -------------------------------------------------------------------------------------------------


def station():
    place = os.environ.get("PAIKKA_GNSS_DATA") or Path(__file__).parents[3] / "shared" / "data" / "gnss"
    paths = [Path(place) / f"07590920.05{kind}" for kind in "on"]
    if not all(path.is_file() for path in paths):
        pytest.skip("PAIKKA_GNSS_DATA does not name the folder with the real station's files")
    return given(*(path.read_bytes() for path in paths))


def test_a_real_station():
    found = DESK.readouts(station())
    assert found["median_flat"] <= 0.6 and found["median_all"] <= 1.0
    assert found["median_flat"] == pytest.approx(0.41, abs=0.01)
    assert found["median_all"] == pytest.approx(0.66, abs=0.01)
    r = DESK.result(station())
    flat = np.sqrt(np.square(r.enu[:, :2]).sum(axis=1))
    assert len(r.fixes) == 120 and np.quantile(flat, 0.95) == pytest.approx(0.81, abs=0.01)


def test_the_real_station_s_first_epoch():
    r = DESK.result(replace(station(), mask_deg=15.0, weighted=False))
    f = r.fixes[0]
    assert {n for n, u in zip(f.names, f.used, strict=True) if u} == {f"G{k:02d}" for k in (7, 8, 11, 19, 20, 24, 28)}
    np.testing.assert_allclose(f.x, [-3976219.305, 3382373.405, 3652513.302, -77244.607], atol=1e-3)
    roots = np.asarray(f.start.roots)
    np.testing.assert_allclose(roots[np.abs(roots[:, 3]).argsort()],
                               [[-3976229.786, 3382384.756, 3652523.336, -77224.183],
                                [6882760.639, -5915131.421, -5568206.247, 57341537.242]], atol=2e-3)


def test_the_real_station_without_atmosphere():
    up = [np.median(DESK.result(replace(station(), **off)).enu[:, 2]) for off in
          ({"ionosphere": False, "troposphere": False}, {"ionosphere": False})]
    assert up[0] == pytest.approx(14.0, abs=0.7) and up[1] == pytest.approx(5.5, abs=0.5)
