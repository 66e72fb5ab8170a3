"""Two settings of the genetic algorithm against each other, in the documents' allocation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ....algorithms.course import Box, Course
from ....algorithms.nsga2 import NSGA2
from ....algorithms.settings import Budget, Crossover, Mutation
from ....algorithms.watched import watch
from ....arrays import Array
from ....csv_text import read_own_csv
from ....declarations import Output, Value, number
from ....directory import not_whole
from ....errors import Fault, InputError, raise_all, refuse
from ....problems.pose_accuracy import PoseAccuracy
from ....problems.settings import Settings
from ....records import Axis
from ...study.yardstick import Yardstick, yardstick
from ..calculation import Calculation, Computed, ComputedTable, Quantity
from ..sampling import share_error
from .results import assumed, output, parameter

KEYS = {
    "population": "algorithm.population",
    "crossover": "algorithm.crossover.probability",
    "mutation": "algorithm.mutation.probability",
}
"""Settings by the keys of a run's configuration."""
BASE = NSGA2(80, Crossover(probability=0.99), Mutation(probability=0.08))
RESPONSES = ("gap_percent", "evaluations_to_99")


class GaSettings(Calculation):
    """Two settings of the genetic algorithm against each other, on common seeds.

    From the table of a study (`study`: its directory) where one is named, else from seeds of its
    own: a genetic algorithm on arrays (the selection of NSGA-II, which with one objective is that
    of a plain GA) on the least-cost problem of document M, whose optimum is known.
    """

    name = "ga_settings"
    about = "Two settings of the genetic algorithm against each other, on common seeds."
    reference = "document M, figures 9 to 11"
    parameters = (
        parameter("setting", "population", "what differs", "document M", choices=tuple(KEYS)),
        parameter("a", 80.0, "its value", "document M", 0.0, 1e6),
        parameter("b", 20.0, "the other value", "document M", 0.0, 1e6),
        parameter("generations", 400, "generations of a run", "document M", 1, 100000),
        assumed("seeds", 10, "number of seeds", low=2, high=10000),
        parameter("study", "", "directory of a study whose runs are taken instead", ""),
    )
    outputs = (
        output("a_gap_percent", "median distance to the optimum with a"),
        output("b_gap_percent", "median distance to the optimum with b"),
        Output("a_evaluations", "1", "median of the evaluations until 99 %, with a"),
        Output("b_evaluations", "1", "the same with b"),
        output("a_nearer_percent", "share of the seeds with which a ends nearer"),
        output("a_slower_percent", "share of the seeds with which a takes more evaluations to 99 %"),
        Output("seeds", "1", "number of seeds"),
    )

    def faults(self, values: Mapping[str, Value]) -> list[Fault]:
        if not values["study"]:
            return [fault for name in "ab" for fault in _misplaced(str(values["setting"]), name, values)]
        try:
            _of_study(values)
        except InputError as error:
            return list(error.faults)
        return []

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        raise_all(self.faults(parameters))
        a, b = _of_study(parameters) if parameters["study"] else _own_runs(parameters, rng)
        return Computed(_quantities(a, b), (_table(parameters, a, b),))


def _quantities(a: Array, b: Array) -> dict[str, Quantity]:
    """Medians and shares of runs (seeds, responses); what was never reached is infinite."""
    numbers = {"seeds": Quantity(float(len(a)), "1")}
    for at, (response, unit) in enumerate((("gap_percent", "percent"), ("evaluations", "1"))):
        for name, runs in (("a", a), ("b", b)):
            values = runs[:, at]
            numbers[f"{name}_{response}"] = Quantity(float(np.median(values)), unit, _error(values))
    (gap_a, evaluations_a), (gap_b, evaluations_b) = a.T, b.T
    numbers["a_nearer_percent"] = _fraction(gap_a < gap_b, gap_a == gap_b)
    numbers["a_slower_percent"] = _fraction(evaluations_a > evaluations_b, evaluations_a == evaluations_b)
    return numbers


def _error(values: Array) -> float:
    """Standard error of a median, from the normal distribution's 1.2533 s/sqrt(n)."""
    known = values[np.isfinite(values)]
    return float(1.2533 * np.std(known, ddof=1) / np.sqrt(len(known))) if len(known) > 1 else 0.0


def _fraction(won: NDArray[np.bool_], even: NDArray[np.bool_]) -> Quantity:
    fraction = float(np.mean(won + 0.5 * even))
    return Quantity(100.0 * fraction, "percent", 100.0 * share_error(fraction, len(won)))


def _own_runs(parameters: Mapping[str, Value], rng: np.random.Generator) -> tuple[Array, Array]:
    """Runs (seeds, responses) of both settings, seed by seed alike."""
    problem = PoseAccuracy(Settings(parameters={"index": "rms_plane"}, objectives=("cost",)))
    measure = yardstick(problem)
    seeds = rng.integers(0, 2**31, int(number(parameters["seeds"]))).tolist()
    budget = Budget(generations=int(number(parameters["generations"])))
    settings = [_settings(str(parameters["setting"]), number(parameters[name])) for name in "ab"]
    a, b = (np.array([_run(problem, setting, budget, seed, measure) for seed in seeds]) for setting in settings)
    return a, b


def _misplaced(setting: str, name: str, values: Mapping[str, Value]) -> list[Fault]:
    """What is wrong with the value `name` of a setting."""
    value = number(values[name])
    if setting == "population" and (value < 2 or value != int(value)):
        return [Fault(name, f"a population must be a whole number from 2, got {value:g}")]
    if setting != "population" and value > 1.0:
        return [Fault(name, f"a probability must lie in [0, 1], got {value:g}")]
    return []


def _settings(setting: str, value: float) -> NSGA2:
    if setting == "population":
        return replace(BASE, population=int(value))
    if setting == "crossover":
        return replace(BASE, crossover=Crossover(probability=value))
    return replace(BASE, mutation=Mutation(probability=value))


def _run(problem: PoseAccuracy, settings: NSGA2, budget: Budget, seed: int, measure: Yardstick) -> tuple[float, float]:
    course = Course(Box(measure.box.ideal, measure.box.nadir), measure.level)
    watch(problem, settings, budget, seed, course, "array")
    course.curve()
    gap = 100.0 * (course.value / measure.value - 1.0)
    reached = course.reached_at[0]
    return (np.inf if np.isnan(gap) else gap), (np.inf if np.isnan(reached) else reached)


def _study_table(parameters: Mapping[str, Value]) -> pd.DataFrame:
    """The finished runs of a study. Raises InputError where it is incomplete, or lacks a column
    that is asked for.
    """
    path = Path(str(parameters["study"])) / "study.csv"
    raise_all(not_whole(path.parent))
    if not path.is_file():
        raise refuse("study", f"{path} does not exist: name the directory of a finished study")
    table = read_own_csv(path)
    missing = [name for name in (KEYS[str(parameters["setting"])], *RESPONSES) if name not in table]
    if missing:
        raise refuse("study", f"{path} has no {', '.join(missing)}: vary and measure it there")
    return table[table["status"] == "done"]


def _of_study(parameters: Mapping[str, Value]) -> tuple[Array, Array]:
    """Runs (seeds, responses) of both settings in a study, paired by all else that it varies."""
    table, key = _study_table(parameters), KEYS[str(parameters["setting"])]
    other_keys = [name for name in KEYS.values() if name in table and name != key]
    table = table.drop_duplicates([key, *other_keys, "replicate"])  # one setting may be run twice
    sides = [table[np.isclose(table[key], number(parameters[name]))] for name in "ab"]
    both = sides[0].merge(sides[1], on=[*other_keys, "replicate"], suffixes=("_a", "_b"))
    if len(both) < 2:
        levels = ", ".join(f"{level:g}" for level in sorted(table[key].unique()))
        raise refuse(
            "study",
            f"{parameters['study']} has no two runs of {key} = {parameters['a']} and "
            f"{parameters['b']} alike in all else; it has {levels}",
        )
    a, b = (both[[f"{name}_{side}" for name in RESPONSES]].fillna(np.inf).to_numpy(dtype=float) for side in "ab")
    return a, b


def _table(parameters: Mapping[str, Value], a: Array, b: Array) -> ComputedTable:
    columns = [np.arange(len(a)), a[:, 0], b[:, 0], a[:, 1], b[:, 1]]
    names = ("a_gap_percent", "b_gap_percent", "a_evaluations_to_99", "b_evaluations_to_99")
    return ComputedTable(
        str(parameters["setting"]),
        f"{parameters['setting']} {parameters['a']} (a) against {parameters['b']} (b), "
        "seed by seed; infinite: 99 % was never reached",
        (Axis("seed", "1"), *(Axis(name, "percent" if "gap" in name else "1") for name in names)),
        tuple(columns),
    )
