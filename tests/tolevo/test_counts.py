"""Counts: what would take too much is refused with what it would take, unless it is asked for."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest
from typer.testing import CliRunner

from tolevo import registry
from tolevo.cli import app
from tolevo.commands.study.designs import DESIGNS
from tolevo.configuration.parameters import read_parameters
from tolevo.configuration.search import settings_of
from tolevo.errors import Fault
from tolevo.section import (
    EVALUATIONS,
    MEMORY,
    PAIRED,
    PLAIN,
    PROCESS,
    TIME,
    Need,
    Parameter,
    Section,
    force_counts,
    is_forced,
    too_many,
    too_many_workers,
)

RUN = """
problem = "rv_backlash"
[limits]
interference_probability = 0.05
"""
STUDY = """
response = "hypervolume"
seeds = 2
[run]
problem = "rv_backlash"
[run.limits]
interference_probability = 0.05
[run.propagation]
method = "moments"
[design]
kind = "factorial"
[vary]
"algorithm.population" = [20, 40]
"algorithm.mutation.probability" = { low = 0.01, high = 0.1, levels = 2 }
"""
GAP = """
model = "rv_batch"
[settings]
simulations = 1000
"""
STACK = """
problem = "stack"
[objectives]
minimise = ["cost", "variation"]
[requirement]
name = "gap"
unit = "mm"
nominal = 0
lower = -1
upper = 1
[[part]]
name = "a"
t_min = 0.01
t_max = 0.1
sensitivity = 1.0
cost = { model = "reciprocal", a = 1.0, b = 0.5 }
[[part]]
name = "b"
count = 900
t_min = 0.01
t_max = 0.1
sensitivity = -1.0
cost = { model = "reciprocal", a = 1.0, b = 0.5 }
"""
REDUCER = """
problem = "rv_reducer"
[limits]
interference_probability = 0.05
"""

REFUSED: list[tuple[str, list[str], str, str]] = [
    (RUN, ["algorithm.population=100000000"], "algorithm.population", "233 GiB of memory"),
    (RUN, ["algorithm.name=nsga3", "algorithm.population=100000"], "algorithm.population",
     "140 GiB of memory"),
    (RUN, ["algorithm.generations=1000000000"], "algorithm.generations", "373 GiB of memory"),
    (RUN, ["algorithm.evaluations=1000000000000"], "algorithm.evaluations", "231 days"),
    (RUN, ["algorithm.population=1000000", "algorithm.generations=1000000"],
     "algorithm.generations", "231 days of computing"),
    (RUN, ["algorithm.points=100000000"], "algorithm.points", "140 GiB"),
    (RUN, ["algorithm.name=exact", "algorithm.points=100000000"], "algorithm.points", "140 GiB"),
    (RUN, ["algorithm.name=hybrid", "algorithm.polish=100000000"], "algorithm.polish", "140 GiB"),
    (STACK, ["propagation.samples=30000000"], "propagation.samples",
     "deviations (samples x pieces), which would need about 403 GiB"),
    (STUDY, ['vary."algorithm.mutation.probability".levels=1000000000'],
     "vary.algorithm.mutation.probability.levels", "18.2 TiB"),
    (STUDY, ["seeds=1000000000"], "seeds", "9.09 TiB"),
    (STUDY, ["seeds=800000"], "seeds", "runs (settings x seeds), which would need about 29.8 GiB"),
    (STUDY, ["run.algorithm.generations=20000000", "seeds=1000"], "seeds",
     "settings x seeds x those of a run"),
    (STUDY, ['vary={"algorithm.population"=[20,100000000]}'], "vary.algorithm.population",
     "233 GiB"),
    (STUDY, ["design={kind='latin_hypercube',samples=1000000000}"], "design.samples", "18.2 TiB"),
    (STUDY, ["design={kind='sobol',samples=262144}"], "design", "give at most 420000"),
    (STUDY, ["design={kind='morris',trajectories=300000}"], "design", "give at most 420000"),
    (STUDY, ["design={kind='morris',levels=10000000000}"], "design.levels", "74.5 GiB"),
    (GAP, ["settings.simulations=100000000"], "settings.simulations", "298 GiB"),
    (GAP, ["settings.bootstrap=1000000000"], "settings.bootstrap", "931 GiB"),
    (GAP, ["settings.rows_used=1000000000"], "settings.rows_used", "9.09 TiB"),
    (REDUCER, ["parameters.search_units=1048576", "parameters.search_positions=103"],
     "parameters.search_units", "12.1 GiB"),
    (REDUCER, ["parameters.positions=100003"], "parameters.report_units", "15.3 GiB"),
]  # fmt: skip
FORCED = {
    "algorithm.population", "algorithm.generations", "algorithm.evaluations", "algorithm.points",
    "settings.simulations", "settings.bootstrap", "settings.rows_used", "parameters.search_units",
}  # fmt: skip
"""Places of counts that cost nothing to check."""


def check(path: Path, text: str, overrides: list[str], *more: str) -> tuple[int, str]:
    """Exit status and stderr of `check`."""
    path.write_text(text, encoding="utf-8")
    sets = [part for one in overrides for part in ("--set", one)]
    result = CliRunner().invoke(app, ["check", str(path), *sets, *more])
    return result.exit_code, result.stderr


@pytest.mark.parametrize(("text", "overrides", "place", "cost"), REFUSED)
def test_a_count_is_refused_with_what_it_would_take(
    tmp_path: Path, text: str, overrides: list[str], place: str, cost: str
) -> None:
    status, said = check(tmp_path / "c.toml", text, overrides)
    (line,) = [one for one in said.splitlines() if one.startswith(f"{place}: ")]
    assert status == 2
    assert cost in line
    assert line.endswith(", or add --force")
    if place in FORCED:
        status, said = check(tmp_path / "c.toml", text, overrides, "--force")
        assert "--force" not in said
        assert status == 0, said


def test_every_fault_of_other_kinds_stays_with_force(tmp_path: Path) -> None:
    overrides = ["algorithm.population=100000000", "algorithm.mutation.probability=2"]
    status, said = check(tmp_path / "c.toml", RUN, overrides, "--force")
    assert status == 2
    assert said == "algorithm.mutation.probability: must lie in [0, 1], got 2\n"


@pytest.mark.parametrize("command", ["run", "study", "gap", "reproduce", "evaluate", "simulate"])
def test_every_command_that_reads_counts_takes_force(command: str) -> None:
    help_ = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200"}).output
    assert "--force" in help_


def test_nothing_is_written_where_a_count_is_refused(tmp_path: Path) -> None:
    path, out = tmp_path / "c.toml", tmp_path / "out"
    path.write_text(RUN, encoding="utf-8")
    result = CliRunner().invoke(app, ["run", str(path), "--out", str(out), "--set", "algorithm.population=100000000"])
    assert result.exit_code == 2
    assert not out.exists()


def counts(kind: Any, place: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Whole numbers among the fields of a dataclass of settings, by their keys."""
    for name, hint in get_type_hints(kind).items():
        if name in {one.name for one in fields(kind)}:
            if is_dataclass(hint):
                yield from counts(hint, (*place, name))
            elif hint is int:
                yield (*place, name)


def settings() -> Iterator[tuple[type[Any], tuple[str, ...]]]:
    """Every whole number of every algorithm and every design of a study."""
    kinds = [registry.load("algorithms", one) for one in registry.names("algorithms")]
    for kind in (*kinds, *DESIGNS.values()):
        yield from ((kind, place) for place in counts(kind))


@pytest.mark.parametrize("number", [10**12, 10**400])
def test_no_count_of_any_algorithm_or_design_is_without_a_bound(number: int) -> None:
    tried = 0
    for kind, place in settings():
        table: Any = number
        for key in reversed(place):
            table = {key: table}
        faults: list[Fault] = []
        settings_of(Section(table, "", faults), kind)
        assert [one.place for one in faults] == [".".join(place)], f"{kind.__name__}: {place}"
        tried += 1
    assert tried > 12


def test_no_whole_parameter_is_without_a_bound() -> None:
    tried = 0
    for group in ("models", "problems", "calculations"):
        for name in registry.names(group):
            declared = getattr(registry.load(group, name), "parameters", ())
            for one in declared:
                if isinstance(one.default, int) and not isinstance(one.default, bool):
                    faults: list[Fault] = []
                    read_parameters(Section({one.name: 10**12}, "", faults), declared)
                    assert len(faults) == 1, f"{name}: {one.name}"
                    tried += 1
    assert tried > 12


def test_a_plugin_declares_its_own_need() -> None:
    """A gigabyte for each: eight of them fit."""
    heavy = Need("grid", bytes=2.0**30)

    @dataclass(frozen=True)
    class Plugin:
        grids: int = field(default=1, metadata={"low": 1, "need": heavy})
        numbers: int = 1

    for given, wrong in (({"grids": 8}, []), ({"grids": 9}, ["grids"]), ({"numbers": 10**8}, []),
                         ({"numbers": 2 * 10**9}, ["numbers"])):  # fmt: skip
        faults: list[Fault] = []
        settings_of(Section(given, "", faults), Plugin)
        assert [one.place for one in faults] == wrong
    parameter = Parameter("grids", 1, "", "grids", need=heavy)
    faults = []
    assert read_parameters(Section({"grids": 9}, "", faults), [parameter]) == {}
    assert str(faults[0]) == (
        "grids: 9 would need about 9 GiB of memory (8 GiB at most): give at most 8, or add --force"
    )


@pytest.mark.parametrize("need", [PLAIN, PAIRED, EVALUATIONS, Need("x", bytes=1e3, seconds=10.0, bytes_per_pair=8.0)])
def test_the_most_is_just_within_the_budgets(need: Need) -> None:
    """Rounded down to two digits, which is 10 % at most."""
    assert need.memory(need.most) <= MEMORY
    assert need.time(need.most) <= TIME
    above = need.most * 11 // 10 + 1
    assert need.memory(above) > MEMORY or need.time(above) > TIME
    assert too_many(need.most, need) == ""
    assert too_many(need.most + 1, need) != ""


def test_what_takes_nothing_has_no_bound() -> None:
    assert too_many(10**90, Need("thing")) == ""


def test_force_ends_where_it_began() -> None:
    assert not is_forced()
    with force_counts():
        assert too_many(10**30, PLAIN) == ""
        with force_counts(False):  # what is asked for stays asked for
            assert is_forced()
    assert not is_forced()
    with pytest.raises(RuntimeError), force_counts():
        raise RuntimeError
    assert not is_forced()


def test_processes_are_bounded_by_the_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 4)
    assert too_many_workers(64) == ""
    assert too_many_workers(65) == (
        "65 processes would need about 12.1 GiB of memory, and the cores are 4: give at most 64, or add --force"
    )
    np.testing.assert_allclose(65 * PROCESS / 2.0**30, 12.1, rtol=1e-2)
    with force_counts():
        assert too_many_workers(10**6) == ""


def test_a_number_of_thousands_of_digits_is_a_fault(tmp_path: Path) -> None:
    """Python refuses to read or to print what has more than 4300 digits."""
    path = tmp_path / "c.toml"
    status, said = check(path, f"seed = {'9' * 5000}\n{RUN}", [])
    assert (status, said.startswith(f"{path}: is not valid TOML")) == (2, True)
    status, said = check(path, f"seed = 0x{'f' * 5000}\n{RUN}", [])
    assert (status, said) == (2, "seed: must be below 1e300\n")
    status, said = check(path, RUN, [f"seed={'9' * 5000}"])
    assert status == 2
    assert said.startswith('seed: must be a whole number, got "999')
    assert len(said) < 200


def test_a_seed_may_be_large(tmp_path: Path) -> None:
    assert check(tmp_path / "c.toml", RUN, ["seed=123456789012345678901234567890"])[0] == 0


def test_check_reads_a_part_of_a_large_design(tmp_path: Path) -> None:
    """A fault at the end of a range is found, wherever it stands in the design."""
    path = tmp_path / "c.toml"
    path.write_text(STUDY, encoding="utf-8")
    design = "design={kind='latin_hypercube',samples=2000}"
    result = CliRunner().invoke(app, ["check", str(path), "--set", design])
    assert result.exit_code == 0, result.stderr
    assert "# 4000 runs: 2000 settings, 2 replicates each" in result.stdout
    assert "of the settings were read as run configurations" in result.stdout
    wide = STUDY.replace("[20, 40]", "{ low = 1, high = 80 }")
    status, said = check(path, wide, [design])
    assert status == 2
    assert said.startswith("vary.algorithm.population: must be at least 2, got 1")
