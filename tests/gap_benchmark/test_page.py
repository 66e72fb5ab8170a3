"""The run of the benchmark and its page: by baselines, which are quick."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from scipy import stats

from benchmarks.gap import __main__ as command
from benchmarks.gap.answers import code_of, kept, missing
from benchmarks.gap.generator.hysteresis import LOCKED
from benchmarks.gap.generator.mechanisms import ROTATING
from benchmarks.gap.generator.noise import NOISES
from benchmarks.gap.generator.outside import OUTSIDE
from benchmarks.gap.generator.records import BENCH_GROUPS, Hidden, Record, Truth, orthogonal, record
from benchmarks.gap.generator.tables import POOR
from benchmarks.gap.namers.baselines import BASELINES
from benchmarks.gap.page import MEASURED, NEWER, ends_of, figure_table, parts_of, written
from benchmarks.gap.scoring.breakdown import SINGLE, design, levels, misses, of_single, rows, signal, signal_to_noise
from benchmarks.gap.scoring.scorer import Scored, rightly, verdict
from benchmarks.gap.scoring.told import Told
from benchmarks.gap.trial import lines

pytestmark = pytest.mark.source_tree
BEGIN, END = ends_of(MEASURED)
PAGE = Path(__file__).resolve().parents[2] / "docs" / "gap_benchmark.md"
NAMERS = ("always compliance", "best correlation")
ASKED = ("--records", "2", "--first", "7", "--groups", "good", "clean", "--workers", "1")


def always_right(found: Record) -> dict[str, Any]:
    """A namer of somebody's own: it is given the record alone."""
    assert set(vars(found)) == {"name", "configuration", "table"}
    return {"verdict": "unnamed", "effects": [], "alternatives": [], "gap_after": None}


def page_in(folder: Path) -> Path:
    page = folder / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n", encoding="utf-8")
    return page


def run(folder: Path, *more: str) -> int:
    return command.main([*ASKED, "--out", str(folder / "kept.jsonl"), "--namers", *NAMERS, *more])


def test_run_is_kept_and_goes_on(tmp_path: Path) -> None:
    page, file = page_in(tmp_path), tmp_path / "kept.jsonl"
    assert run(tmp_path, "--write", str(page)) == 0
    first = file.read_text(encoding="utf-8")
    assert len(first.splitlines()) == 2 * 2 * len(NAMERS)
    assert run(tmp_path) == 0
    assert file.read_text(encoding="utf-8") == first
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n") and text.endswith("after\n") and "old" not in text
    assert all(f"| {name} | 4 |" in text for name in NAMERS)
    # The last line was cut off, and one is of other code: both are asked anew.
    one_by_one = first.splitlines()
    other = json.dumps(json.loads(one_by_one[0]) | {"code": "other"})
    file.write_text("\n".join([other, *one_by_one[1:-1], one_by_one[-1][:40]]), encoding="utf-8")
    assert len(kept(file)) == len(one_by_one) - 2
    assert run(tmp_path) == 0
    assert len(kept(file)) == len(one_by_one)


def test_ctrl_c_keeps_what_was_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(namers: list[str], group: str, number: int) -> list[dict[str, Any]]:
        if number == 8:
            raise KeyboardInterrupt
        return lines(namers, group, number)

    monkeypatch.setattr(command, "lines", stopped)
    assert run(tmp_path) == 130
    assert {number for _, _, number in kept(tmp_path / "kept.jsonl")} == {7}


def test_each_record_is_asked_once_for_all_namers_that_miss_it() -> None:
    wanted = [("a", "good", 1), ("b", "good", 1), ("a", "good", 0), ("b", "good", 0)]
    found = missing(wanted, {("a", "good", 0): {}})
    assert found == [(["b"], "good", 0), (["a", "b"], "good", 1)]


def test_codes_of_namers_differ() -> None:
    assert len({code_of(name) for name in ("tolevo", "plain BIC", "somebody:else")}) == 3


def test_somebody_s_own_namer(tmp_path: Path) -> None:
    name = f"{__name__}:always_right"
    assert run(tmp_path, name) == 0
    found = kept(tmp_path / "kept.jsonl")
    assert {one["said"]["verdict"] for key, one in found.items() if key[0] == name} == {"unnamed"}


def test_newer_groups_have_a_part_of_their_own(tmp_path: Path) -> None:
    """A run of one part leaves the other as it is; a run of both writes each."""
    page, (first, last) = page_in(tmp_path), ends_of(NEWER)
    page.write_text(f"{first}\nolder\n{last}\n{page.read_text(encoding='utf-8')}", encoding="utf-8")
    assert run(tmp_path, "--write", str(page)) == 0
    assert "older" in page.read_text(encoding="utf-8")
    assert run(tmp_path, "--groups", "good", "memory", "--write", str(page)) == 0
    newer, rest = page.read_text(encoding="utf-8").split(last)
    assert "memory: called a delay" in newer and "memory: called a delay" not in rest
    assert "single named rightly" in rest and "single named rightly" not in newer and "older" not in newer


@pytest.mark.parametrize("name", ["nobody", "no_module:there", "math:nothing"])
def test_a_namer_that_is_none(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        command.main(["--namers", name])
    assert stopped.value.code == 2
    assert "plain BIC" in capsys.readouterr().err


def test_a_page_without_a_place_is_refused_before_the_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"{END}\n{BEGIN}\n", encoding="utf-8")
    with pytest.raises(SystemExit):
        run(tmp_path, "--write", str(page))
    assert BEGIN in capsys.readouterr().err
    assert not (tmp_path / "kept.jsonl").exists()
    with pytest.raises(ValueError, match="needs a line"):
        written(page, "tables")


def said(names: list[str]) -> dict[str, Any]:
    effects = [{"name": one} for one in names]
    word = "named" if names else "unnamed"
    return {"verdict": word, "effects": effects, "alternatives": [], "gap_after": None}


def test_the_page_says_what_is_done() -> None:
    """Every group, design, noise and namer is described; the tables have a place."""
    before, after = parts_of(PAGE)
    assert [one for one in BENCH_GROUPS if f"| {one} | " not in before] == []
    assert [one for one in (*POOR, "independent inputs") if one not in before] == []
    assert [one for one in NOISES if one not in before] == []
    assert [one for one in BASELINES if f"| {one} | " not in before] == []
    assert f"one of {len(OUTSIDE)} causes" in before
    assert f"{len(ROTATING)} on the rotating unit, {len(LOCKED)} on the locked one" in before
    assert after.strip() == ""


def only_itself(truth: Truth, one: Hidden) -> Told:
    """As if every record could tell its effect from all others."""
    strength = float((orthogonal(truth.free, one.added) ** 2).sum()) / truth.sigma**2
    return Told(strength, frozenset([one.name]), frozenset(), one.name)


@pytest.fixture(scope="module")
def half() -> list[Scored]:
    """Forty single effects: named rightly in even records, left unnamed in odd ones."""
    found = []
    for group in ("good", "poor"):
        for k in range(20):
            truth = record(group, k)[1]
            seen = tuple(only_itself(truth, one) for one in truth.hidden)
            found.append(Scored(truth, seen, verdict(said([*truth.names] if k % 2 == 0 else []))))
    return found


def test_levels_count_every_record_once(half: list[Scored]) -> None:
    of = of_single(half)
    for name in SINGLE:
        same = [one for one in of if one.by == name]
        assert sum(one.count for one in same) == 40
        assert sum(one.hits for one in same) == 20
    independent = next(one for one in of if one.level == "independent inputs")
    assert (independent.hits, independent.count) == (10, 20)
    low, high = stats.binomtest(10, 20).proportion_ci(0.95, method="exact")
    assert independent.interval == pytest.approx((low, high), rel=1e-12)


def test_levels_are_those_of_the_records(half: list[Scored]) -> None:
    for one in half:
        low, high = (float(word) for word in rows(one).split(" to "))
        assert low <= len(one.truth.points) <= high
        low, high = (float(word) for word in signal(one).split(" to "))
        assert low - 1e-9 <= signal_to_noise(one) <= high + 1e-9
    by = levels(half, "design", design, rightly)
    assert [one.level for one in by] == sorted({one.truth.poor or design(one) for one in half})


def test_misses_are_those_that_were_left_unnamed(half: list[Scored]) -> None:
    found = misses(half)
    assert {one.said for one in found} == {"unnamed"}
    assert sum(len(one.records) for one in found) == 20
    assert all(number % 2 == 1 for one in found for _, number in one.records)
    assert [len(one.records) for one in found] == sorted((len(one.records) for one in found), reverse=True)


def test_table_of_figures_shows_the_shares(half: list[Scored]) -> None:
    """10 of 20, by Clopper and Pearson 27.2 to 72.8 %: the gate of good designs is failed."""
    table = figure_table({"half": half})
    (line,) = [one for one in table.splitlines() if one.startswith("| single named rightly, good")]
    assert line.endswith("| 50.0 % [27.2, 72.8] of 20 MISSED |")
