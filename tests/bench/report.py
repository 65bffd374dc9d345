"""The one table that every speed test prints into."""

from typing import NamedTuple

ATTEMPTS = 3


class Row(NamedTuple):
    what: str
    ours_ms: float
    reference_ms: float
    ratio: float
    target: str
    met: bool


class Missed(AssertionError):
    """A ratio beyond its target; the test is repeated before it fails, as other programs disturb the clock."""


_rows: dict[str, Row] = {}


def record(what: str, ours_ms: float, reference_ms: float, ratio: float, target: str, met: bool) -> None:
    """A row of the table, in place of an earlier attempt's; Missed when the target is not met."""
    _rows[what] = Row(what, ours_ms, reference_ms, ratio, target, met)
    if not met:
        raise Missed(f"{what}: ours {ours_ms:.3g} ms, reference {reference_ms:.3g} ms, ratio {ratio:.2f}, "
                     f"target {target}")


def table() -> list[str]:
    """The lines of the table; none when nothing was measured."""
    if not _rows:
        return []
    width = max(len(row.what) for row in _rows.values())
    lines = [f"{'what':<{width}}  {'ours (ms)':>10}  {'reference (ms)':>14}  {'ratio':>7}  {'target':<8}  ok"]
    lines += [f"{row.what:<{width}}  {row.ours_ms:>10.3f}  {row.reference_ms:>14.3f}  {row.ratio:>7.2f}  "
              f"{row.target:<8}  {'yes' if row.met else 'NO'}" for row in _rows.values()]
    return lines
