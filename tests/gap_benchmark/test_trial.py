"""The hidden-effect trial in small: `python -m benchmarks.gap` runs it at its full size.

The bands are those of the notes, widened by what so few records leave open: a figure fails where
its whole 95 % interval lies on the wrong side.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.gap.generator.records import record
from benchmarks.gap.scoring.scorer import Figure, Scored, figures
from benchmarks.gap.trial import WORKFLOW, line, printed, scored

pytestmark = pytest.mark.long

COUNTS = {"clean": 14, "good": 8, "poor": 8, "outside": 5, "size": 4, "delay": 3, "pair": 3}
ROWS = {"outside": 450, "pair": 600}
"""The longest record that is taken, where it is not FEW."""
FEW = 260


def short(group: str) -> Iterator[int]:
    """Numbers of the records of a group that are short, for the time that they take."""
    return (k for k in range(10_000) if len(record(group, k)[1].points) <= ROWS.get(group, FEW))


@pytest.fixture(scope="module")
def found() -> list[Scored]:
    numbers = {group: short(group) for group in COUNTS}
    todo = [(group, next(numbers[group])) for group, count in COUNTS.items() for _ in range(count)]
    return [scored(line(WORKFLOW, group, number)) for group, number in todo]


def test_no_figure_is_out_of_reach(found: list[Scored]) -> None:
    table: list[Figure] = figures(found)
    assert not [one.name for one in table if one.refuted], printed(table)


def test_what_was_named_has_its_evidence(found: list[Scored]) -> None:
    """A verdict and what it lists agree; a set holds more than the name itself."""
    for one in found:
        said = one.said
        assert said.verdict in ("no_gap", "named", "ambiguous", "unnamed")
        assert bool(said.names) == (said.verdict in ("named", "ambiguous"))
        assert bool(said.alternatives) == (said.verdict == "ambiguous")
        for name in said.names:
            assert all(low <= high for low, high in said.intervals[name].values())
