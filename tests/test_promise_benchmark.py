"""A sample of the repeats of `python -m benchmarks.promise`, and its table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

pytest.importorskip("benchmarks.task", reason="the benchmarks are not shipped")
pytestmark = pytest.mark.source_tree

from benchmarks.promise import machines  # noqa: E402
from benchmarks.promise.__main__ import figures, kept_well, row, table  # noqa: E402
from benchmarks.promise.cases import Case, cases  # noqa: E402
from benchmarks.promise.ranking import drawn, gain  # noqa: E402
from benchmarks.promise.repeated import Repeated, lowest  # noqa: E402
from benchmarks.promise.repeats import SHARE, Repeat, repeat  # noqa: E402
from tolevo.commands.run.promise import shadow_gain  # noqa: E402


def test_assured_promises_are_kept_and_plug_in_ones_are_not() -> None:
    """60 of 1000 repeats: kept 97.7 and 18.6 %; limits at chances of 1e-4 and less."""
    case = Case("9 equal parts", 9, 20)
    plain, share, _, cost = figures([repeat(case, seed) for seed in range(60)])
    assert share >= 86.0
    assert plain <= 45.0
    assert cost == pytest.approx(1.20, abs=0.02)


def test_the_table_says_where_a_promise_is_missed() -> None:
    case = cases()[0]
    fine = [Repeat(1.0, 1.4, 0.99, 0.998, 1e-12)] * 97 + [Repeat(1.0, 1.4, 0.99, 0.99, 1e-12)] * 3
    assert table([(case, fine)]).endswith("Promised: met.")
    assert not kept_well(case, fine[-10:] * 10)
    assert not kept_well(case, [Repeat(1.0, 1.5, 0.99, one.assured_yield, 0.0) for one in fine])
    assert row(case, fine).startswith("| 9 equal parts, n = 10 | 0.0 % | 97.0 % | ")
    assert SHARE == 0.9973


def test_results_are_read_again_but_for_a_line_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "kept.jsonl"
    whole = ('{"case": "a", "seed": 3, "plug_in": 1.0, "assured": 1.2, "plug_in_yield": 0.9, '
             '"assured_yield": 0.99, "gap": 0.0}')  # fmt: skip
    path.write_text(f"{whole}\n{whole[:40]}", encoding="utf-8")
    found = Repeated(path, repeat, Repeat)
    assert found.known() == {("a", 3): Repeat(1.0, 1.2, 0.9, 0.99, 0.0)}


def test_repeats_go_on_where_they_were_interrupted(tmp_path: Path) -> None:
    asked: list[int] = []

    def counted(case: Case, seed: int) -> Repeat:
        asked.append(seed)
        return Repeat(1.0, 1.0 + seed, 0.9, 0.99, 0.0)

    repeats = Repeated(tmp_path / "kept.jsonl", counted, Repeat)
    first = repeats.each(cases()[0], range(2))
    assert repeats.each(cases()[0], range(3))[:2] == first
    assert asked == [0, 1, 2]


def test_the_lower_limit_is_that_of_a_binomial_share() -> None:
    """0.05 of all samples with that true share have as many or more (scipy's survival function)."""
    low = 0.01 * lowest(96, 100)
    assert stats.binom.sf(95, 100, low) == pytest.approx(0.05, rel=1e-9)
    assert lowest(0, 10) == 0.0


def test_the_ranking_is_that_of_re_optimisation() -> None:
    """One of the twelve cases, with 16 outcomes each."""
    stack = drawn(1)
    names = [part.name for part in stack.definition.parts]
    prices = [shadow_gain(stack, name) for name in names]
    full = [gain(stack, name, 16) for name in names]
    assert int(np.argmax(prices)) == int(np.argmax(full))


def test_choices_of_machines_are_kept_when_calibrated_and_not_by_the_estimates() -> None:
    """10 of the repeats: kept 93 and 12 %; limits at chances of 1e-3 and less."""
    own = [machines.repeat(machines.cases()[1], seed) for seed in range(10)]
    plain, kept, _, without, _ = machines.figures(own)
    assert kept >= 60.0
    assert plain <= 50.0
    assert without == 0.0
    assert all(one.level >= 0.98 and one.assured > one.plug_in for one in own)
