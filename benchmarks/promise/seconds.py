"""`python -m benchmarks.promise.seconds`: CPU of assured optima over that of the plug-in's.

Stacks of 1 to 40 measured parts by their closed form; `rv_backlash` with and without a limit on
interference; `rv_reducer` and `pose_accuracy` by their units (configurations of docs/promise). Each
is searched from nothing; of stacks the least of several runs counts. An assured optimum must take
at most three times the CPU of the plug-in's.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tolevo.commands.run.promise import Least, cheapest_design, solved, with_statement
from tolevo.configuration.reader import read, read_table
from tolevo.problems.settings import ASSURED, PLUG_IN
from tolevo.problems.tolerance_problem import ToleranceProblem

SIZES, RUNS, MOST = (1, 3, 9, 20, 40), 9, 3.0
UNITS = Path(__file__).parents[2] / "docs" / "promise" / "units"
MADE_TO = {"pin_radius_um": 4.0, "pitch_um": 10.0, "eccentricity_um": 5.0}


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve every problem by both statements, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=("stack", "rv_backlash", "units"))
    given = parser.parse_args(arguments)
    print("| problem | cost plug-in | cost assured | CPU plug-in [s] | CPU assured [s] | ratio |\n"
          "|---|---:|---:|---:|---:|---:|")  # fmt: skip
    for name, problem, runs in problems(given.only):
        costs, seconds = zip(*(measured(problem, one, runs) for one in (PLUG_IN, ASSURED)),
                             strict=True)  # fmt: skip
        print(f"| {name} | {costs[0]:.5g} | {costs[1]:.5g} | {seconds[0]:.3g} | {seconds[1]:.3g} "
              f"| {seconds[1] / seconds[0]:.2f} |", flush=True)  # fmt: skip


def problems(only: Sequence[str]) -> Iterator[tuple[str, ToleranceProblem, int]]:
    """Names, problems that promise, and how often each is solved."""
    if "stack" in only:
        for parts in SIZES:
            yield f"stack, {parts} parts", problem_of(stack(parts)), RUNS
    if "rv_backlash" in only:
        yield "rv_backlash, any interference", problem_of(backlash(1.0)), 3
        yield "rv_backlash, interference at most 1 %", problem_of(backlash(0.01)), 3
    if "units" in only:
        for file in ("reducer.toml", "robot.toml"):
            found = read(UNITS / file).problem
            assert found is not None
            yield str(file), found, 1


def problem_of(table: dict[str, Any]) -> ToleranceProblem:
    """The problem of tables, which have no fault."""
    found = read_table(table, []).problem
    assert found is not None
    return found


def measured(problem: ToleranceProblem, statement: str, runs: int) -> tuple[float, float]:
    """Least cost by a statement, and the least CPU seconds of some searches from nothing."""
    seconds, cost = [], np.nan
    for _ in range(runs):
        one = with_statement(problem, statement)
        begun = time.process_time()
        cost = found_by(one)(one).cost
        seconds.append(time.process_time() - begun)
    return cost, min(seconds)


def found_by(problem: ToleranceProblem) -> Callable[[ToleranceProblem], Least]:
    """The closed form, where the optimum is its own; else the search of a run."""
    return closed if "stack" in type(problem).__module__ else cheapest_design


def closed(problem: ToleranceProblem) -> Least:
    """The least cost of a closed form; its design is not of interest."""
    found = solved(problem)
    assert found is not None
    return Least(float(found[1].cost[0]), found[1].t[0])


def stack(parts: int) -> dict[str, Any]:
    """Parts of 20 values each, with prices and slopes a decade apart."""
    rng = np.random.default_rng([53, parts])
    each = [{
        "name": f"p{at}", "unit": "um", "sensitivity": float(rng.uniform(0.5, 2.0)), "t_min": 0.01,
        "t_max": 500.0, "cost": {"model": "reciprocal", "a": 0.0, "b": float(rng.uniform(0.2, 4))},
        "measured": {"values": rng.normal(0.0, 10.0 / 3.0, 20).round(4).tolist(), "made_to": 10.0,
                     "mean": "corrected"},
    } for at in range(parts)]  # fmt: skip
    room = 15.0 * float(np.sqrt(parts))
    return {
        "problem": "stack", "objectives": {"minimise": ["cost"]}, "algorithm": {"name": "exact"},
        "promise": {"yield_percent": 99.73, "statement": ASSURED},
        "requirement": {"unit": "um", "nominal": 0.0, "lower": -room, "upper": room}, "part": each,
    }  # fmt: skip


def backlash(interference: float) -> dict[str, Any]:
    """Three tolerances known from 20 parts each."""
    rng = np.random.default_rng(59)
    known = {name: {"measured": {"values": rng.normal(0.0, t / 3.0, 20).round(4).tolist(),
                                 "made_to": t, "mean": "corrected"}}
             for name, t in MADE_TO.items()}  # fmt: skip
    return {
        "problem": "rv_backlash", "objectives": {"minimise": ["cost"]},
        "limits": {"interference_probability": interference}, "variables": known,
        "promise": {"yield_percent": 99.73, "statement": ASSURED},
    }  # fmt: skip


if __name__ == "__main__":
    main()
