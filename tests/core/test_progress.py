"""What a user sees of a gap analysis while it runs."""

from __future__ import annotations

import pytest

from tolevo.progress import describe_gap, gap_fraction, shown_gap
from tolevo.workflows.gap.progress import GapProgress


def test_line_and_share_of_the_replicates() -> None:
    state = GapProgress("bootstrap", 50, 200, 31.4)
    assert describe_gap(state) == "bootstrap 50/200, 31 s left"
    assert gap_fraction(state) == 0.25
    assert describe_gap(GapProgress("search")) == "search"
    assert gap_fraction(GapProgress("search")) is None


def test_without_a_terminal_each_phase_has_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with shown_gap(quiet=False) as update:
        assert update is not None
        for state in (GapProgress("search"), *(GapProgress("bootstrap", k, 9) for k in range(9))):
            update(state)
    assert capsys.readouterr().err.splitlines() == ["search", "bootstrap 0/9"]


def test_quiet_shows_nothing() -> None:
    with shown_gap(quiet=True) as update:
        assert update is None
