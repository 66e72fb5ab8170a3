"""What a user sees of a gap analysis while it runs."""

from __future__ import annotations

import pytest

from tolevo.cli import describe_claims, describe_gap, ended_share, progress_reporter
from tolevo.commands.gap.plan import GapProgress
from tolevo.commands.reproduce.claims import ClaimsProgress


def test_line_and_share_of_the_replicates() -> None:
    state = GapProgress("bootstrap", 50, 200, 31.4)
    assert describe_gap(state) == "bootstrap 50/200, 31 s left"
    assert ended_share(state) == 0.25
    assert describe_gap(GapProgress("search")) == "search"
    assert ended_share(GapProgress("search")) is None


def test_without_a_terminal_each_phase_has_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_reporter("gap", quiet=False) as update:
        assert update is not None
        for state in (GapProgress("search"), *(GapProgress("bootstrap", k, 9) for k in range(9))):
            update(state)
    assert capsys.readouterr().err.splitlines() == ["search", "bootstrap 0/9"]


def test_quiet_shows_nothing() -> None:
    with progress_reporter("gap", quiet=True) as update:
        assert update is None


def test_a_reproduction_says_what_is_left() -> None:
    """9 claims in 30 s after 20 of an earlier time: 10 more take some 33 s."""
    assert describe_claims(ClaimsProgress(29, 39, 30.0, "a1", 20)) == ("claims 29/39 checked, 30 s, some 33 s left, a1")
    assert "all of them take some minutes" in describe_claims(ClaimsProgress(0, 39, 0.0))
