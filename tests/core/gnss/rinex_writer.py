"""Writes small RINEX 2 and 3 files of a simulated morning: numbers of our own for tests of the readers."""

from datetime import datetime, timedelta

from core.gnss import Ephemerides, Simulated

WEEK = 2000
GPS_ZERO = datetime(1980, 1, 6)


def number(v: float) -> str:
    """19 characters, as in navigation files."""
    mantissa, exponent = f"{v: .12E}".split("E")
    return f"{mantissa}D{int(exponent):+03d}".rjust(19)


def header(text: str, label: str) -> str:
    return f"{text:<60.60}{label}"


def when(time_s: float) -> datetime:
    return GPS_ZERO + timedelta(weeks=WEEK) + timedelta(microseconds=round(1e6 * time_s))


def navigation(s: Simulated, version: int = 2) -> str:
    """The navigation file."""
    kind = "N: GPS NAV DATA" if version == 2 else "N: GNSS NAV DATA"
    rows = [header(f"{2.10 if version == 2 else 3.03:9.2f}{'':11}{kind:<20}{'' if version == 2 else 'M: MIXED':<20}",
                   "RINEX VERSION / TYPE"), header("Paikka", "PGM / RUN BY / DATE")]
    for name, short, values in (("ION ALPHA", "GPSA", s.alpha), ("ION BETA", "GPSB", s.beta)):
        numbers = "".join(f"{v:12.4E}".replace("E", "D") for v in values)
        rows.append(header(f"  {numbers}", name) if version == 2 else header(f"{short} {numbers}", "IONOSPHERIC CORR"))
    rows.append(header("", "END OF HEADER"))
    for k in range(len(s.ephemerides.names)):
        rows += record(s.ephemerides, k, version)
    return "\n".join(rows) + "\n"


def record(e: Ephemerides, k: int, version: int) -> list[str]:
    t = when(float(e.toc_s[k]))
    seconds = t.second + t.microsecond / 1e6
    if version == 2:
        first = f"{int(e.names[k][1:]):2d} {t:%y} {t.month:2d} {t.day:2d} {t.hour:2d} {t.minute:2d}{seconds:5.1f}"
    else:
        first = f"{e.names[k]} {t:%Y %m %d %H %M} {int(seconds):02d}"
    lines = [
        (e.af0, e.af1, e.af2), (0.0, e.crs, e.delta_n, e.m0), (e.cuc, e.e, e.cus, e.sqrt_a),
        (e.toe_s, e.cic, e.omega0, e.cis), (e.i0, e.crc, e.omega, e.omega_dot), (e.i_dot, 1.0, float(WEEK), 0.0),
        (2.0, 0.0 if e.healthy[k] else 1.0, e.tgd, 0.0), (e.toe_s - 3600.0, 4.0),
    ]
    made = ["".join(number(float(v if isinstance(v, float) else v[k])) for v in line) for line in lines]
    return [first + made[0], *((" " * (3 if version == 2 else 4)) + row for row in made[1:])]


def observations(s: Simulated, version: int = 2, event: bool = True) -> str:
    """The observation file, with an event in the middle and L1 phases that nobody looks at."""
    rows = [header(f"{2.11 if version == 2 else 3.03:9.2f}{'':11}{'OBSERVATION DATA':<20}{'G (GPS)':<20}",
                   "RINEX VERSION / TYPE"), header("Paikka", "PGM / RUN BY / DATE"),
            header("".join(f"{v:14.4f}" for v in s.truth_m), "APPROX POSITION XYZ"),
            header("     2    L1    C1", "# / TYPES OF OBSERV") if version == 2 else
            header("G    2 L1C C1C", "SYS / # / OBS TYPES"), header("", "END OF HEADER")]
    for k, epoch in enumerate(s.epochs):
        t = when(epoch.time_s)
        seconds = t.second + t.microsecond / 1e6
        if event and k == len(s.epochs) // 2:
            rows += [f"{'':28}4  1" if version == 2 else f">{'':30}4  1", header("a remark in the middle", "COMMENT")]
        names = list(epoch.names)
        if version == 2:
            start = f" {t:%y} {t.month:2d} {t.day:2d} {t.hour:2d} {t.minute:2d}{seconds:11.7f}  0{len(names):3d}"
            rows.append(start + "".join(names[:12]))
            rows += [f"{'':32}{''.join(names[j:j + 12])}" for j in range(12, len(names), 12)]
        else:
            rows.append(f"> {t:%Y %m %d %H %M}{seconds:11.7f}  0{len(names):3d}")
        for name, rho in zip(names, epoch.pseudoranges_m, strict=True):
            rows.append(("" if version == 2 else name) + f"{1e6 + k:14.3f}  {rho:14.3f}  ")
    return "\n".join(rows) + "\n"
