"""A sample of the random stacks of `python -m benchmarks.stacks`, and its table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("benchmarks.task", reason="the benchmarks are not shipped")
pytestmark = pytest.mark.source_tree

from benchmarks.stacks.__main__ import main, table  # noqa: E402
from benchmarks.stacks.drawn import Drawn, run  # noqa: E402

KNOWN = Drawn(7, ("centred yield",), True, False, 3.0, 2.999, 0.01, 0.1)


@pytest.mark.parametrize("seed", [3, 6, 8, 14])
def test_no_bound_lies_above_the_best_known_cost(seed: int) -> None:
    """Half-widths, centred yields, several limits; the gap is at most 0.1 %."""
    one = run(seed)
    assert one.found and one.exact and one.sound
    assert one.gap <= 0.1


def test_the_table_says_where_a_bound_or_a_gap_is_wrong() -> None:
    assert table([KNOWN]).endswith(": met.")
    assert table([replace(KNOWN, bound=3.001)]).endswith(": MISSED.")
    assert table([replace(KNOWN, gap=0.2)]).endswith(": MISSED.")
    off = replace(KNOWN, limits=("yield off the middle",), gap=2.0)
    assert table([KNOWN, off]).endswith(": met.")


def test_results_are_kept_and_read_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--seed", "3", "--count", "1", "--kept", str(tmp_path / "kept.jsonl")]
    main(given)
    first = capsys.readouterr().out.partition("\nSeeds")[2]
    main(given)
    assert first and capsys.readouterr().out.partition("\nSeeds")[2] == first
    assert len((tmp_path / "kept.jsonl").read_text("utf-8").splitlines()) == 1
