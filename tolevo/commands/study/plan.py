"""What a study needs and what it returns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, isnan, nan
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...algorithms.archive import Box, Course
from ...algorithms.exact.bounds import proof, reason
from ...algorithms.exact.solver import closed_form
from ...algorithms.settings import AlgorithmSettings, Budget
from ...errors import Fault, ModelError
from ...problems.settings import Labels
from ...problems.tolerance_problem import ToleranceProblem
from ...records import CommandOutcome

if TYPE_CHECKING:
    import pandas as pd

    from .trial import Curves

# What the parts of a study hand to each other.
#
# The study table, which is `study.csv`, has one row per run, sorted by point and replicate: `point`
# (row of the design, from 0), one column per varied key, `replicate` (from 0), `seed` (that of the
# run, the same at every point for one replicate), `status` ("done" or "failed"), `reason` (empty
# where done), and one column per response (NaN where failed, or where it was not reached).


Level = float | int | str
RESPONSES = ("hypervolume_ratio", "hypervolume", "gap_percent", "evaluations_to_99", "cpu_s_to_99", "feasible_fraction")
"""Responses in the order in which they are known."""
LARGER_IS_BETTER = frozenset({"hypervolume_ratio", "hypervolume", "feasible_fraction"})


@dataclass(frozen=True, slots=True)
class Factor:
    """A varied key of the run configuration (`algorithm.population`).

    Either `levels` (numbers, whole numbers or names) or a range from `low` to `high`, in which
    `count` levels (None where not given) are meant by a design that needs levels.
    """

    key: str
    levels: tuple[Level, ...] = ()
    low: float = float("nan")
    high: float = float("nan")
    log: bool = False
    integer: bool = False
    count: int | None = None

    @property
    def ranged(self) -> bool:
        """Whether it is a range, not a list of levels."""
        return not self.levels

    @property
    def categorical(self) -> bool:
        """Whether its levels are names."""
        return any(isinstance(level, str) for level in self.levels)

    def at(self, share: float) -> Level:
        """The value at the fraction `share` in [0, 1] of the range, or of the list of levels."""
        if self.levels:
            return self.levels[min(int(share * len(self.levels)), len(self.levels) - 1)]
        if self.integer and not self.log:  # every whole number has the same share
            return int(min(self.low + np.floor(share * (self.high - self.low + 1)), self.high))
        value = self.low * (self.high / self.low) ** share if self.log else self.low + share * (self.high - self.low)
        value = min(max(value, self.low), self.high)
        return round(value) if self.integer else float(value)

    def grid(self) -> tuple[Level, ...]:
        """The levels, or `count` values evenly over the range, both ends included."""
        if self.levels or not self.count:
            return self.levels
        fractions = np.linspace(0.0, 1.0, self.count)
        ends = (np.log(self.low), np.log(self.high)) if self.log else (self.low, self.high)
        values = ends[0] + fractions * (ends[1] - ends[0])
        values = np.exp(values) if self.log else values
        values[[0, -1]] = self.low, self.high
        if self.integer:
            return tuple(dict.fromkeys(int(value) for value in np.rint(values)))
        return tuple(float(value) for value in values)


class Design(ABC):
    """A design of experiments: a frozen dataclass whose fields are the keys of `[design]`.

    `metadata` of a field may give low, high, choices, as with algorithms. It is an entry point of
    `tolevo.designs`, under the name `kind`.
    """

    kind: ClassVar[str]
    analysis: ClassVar[str] = "latin_hypercube"
    """The kind of design whose analysis its results get: by default a response surface."""

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        """What is wrong with it for these factors and replicates (too small: what it needs).

        The place of a fault is a key of `[design]` ("samples"), or "vary.<key>", or "seeds".
        """
        return []

    def size(self, factors: tuple[Factor, ...]) -> int:
        """How many settings it has, as far as that is known before they are made."""
        return 0

    @abstractmethod
    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        """One row per setting, one column per key of the factors, plus what the analysis needs.

        `base` holds the values of the varied keys in the run configuration. Names of columns other
        than the keys begin with an underscore.
        """


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """An interpretation of a figure: at level `a` of a key a run is better than at level `b`.

    `better` False: it is worse. `says` is its wording, `figure` is where it stands.
    """

    figure: str
    says: str
    key: str
    a: Level
    b: Level
    response: str
    better: bool = True


@dataclass(frozen=True, slots=True)
class StudySettings:
    """What is studied. `base` holds the run configuration's own values of the varied keys."""

    title: str
    factors: tuple[Factor, ...]
    design: Design
    responses: tuple[str, ...]
    seeds: int
    seed: int
    base: Mapping[str, Level] = field(default_factory=dict)
    objectives: tuple[str, ...] = ()
    """Objectives of the run: one, or a front."""
    hypotheses: tuple[Hypothesis, ...] = ()
    configuration: str = field(default="", repr=False)
    """The resolved configuration as TOML."""
    labels: Labels = Labels()
    """What readers know the mechanism by."""
    hopeless: bool = False
    """Whether settings that are behind beyond chance are stopped."""


@dataclass(frozen=True, slots=True)
class StudyData:
    """What was measured: `statistics.analyse` takes it.

    `design` is the frame of `Design.points`, its row number is `point`. `curves` have, by setting,
    one row per checkpoint of a run: point, replicate, generation, evaluations, cpu_s, `value` and
    feasible_fraction.
    `value` is, of one objective, the least feasible value so far (NaN before the first one), else
    the hypervolume. `exact` has one row per point: point, `value` in the same terms, NaN where
    nothing is proven.
    """

    table: pd.DataFrame
    design: pd.DataFrame
    curves: Curves
    exact: pd.DataFrame
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Point:
    """One setting of the design: what runs there. `problem` is its number in the plan."""

    problem: int
    algorithm: AlgorithmSettings
    budget: Budget
    engine: str


@dataclass(frozen=True)
class StudyPlan:
    """A resolved study: `points` belong to the rows of `design`, `settings` say what it is.

    `time_limit_s` is that of one run (wall time), None where there is none.
    """

    settings: StudySettings
    design: pd.DataFrame
    points: tuple[Point, ...]
    problems: tuple[ToleranceProblem, ...]
    time_limit_s: float | None = None

    @cached_property
    def seeds(self) -> tuple[int, ...]:
        """Seed of each replicate, the same at every point; more replicates keep the first ones."""
        return tuple(
            int(np.random.SeedSequence(self.settings.seed, spawn_key=(k,)).generate_state(1)[0])
            for k in range(self.settings.seeds)
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know before trusting the study."""
        texts = [text for problem in self.problems for text in problem.cautions()]
        if any(point.budget.time_limit_s is not None for point in self.points):
            texts.append("algorithm.time_limit_s ends a run by the clock: no two studies are equal")
        return tuple(dict.fromkeys(texts))

    @property
    def total(self) -> int:
        """Number of runs."""
        return len(self.points) * self.settings.seeds


StudyOutcome = CommandOutcome[StudyData | None]


@dataclass(frozen=True, slots=True)
class StudyProgress:
    """State of a study. `remaining` is a time [s], None before the first run has ended."""

    done: int
    running: int
    failed: int
    total: int
    seconds: float
    remaining: float | None
    note: str = ""


# The reference of the runs of one problem; computed once per problem of a study.


SHARE = 0.99
"""Fraction of the exact hypervolume, and 1 less the relative gap of one objective, that
`..._to_99` waits for."""


@dataclass(frozen=True, slots=True)
class Yardstick:
    """Box of the hypervolume, the exact `value`, and a proven bound of the cost.

    `value` is the exact optimum of one objective, the hypervolume of the exact front of two, NaN
    where neither is known. `bound` is that of one objective, NaN where nothing is proven.
    """

    box: Box
    value: float
    bound: float

    @property
    def level(self) -> float:
        """The value of a curve at which 99 % are reached."""
        if len(self.box.ideal) > 1:
            return SHARE * self.value
        return self.value + (1.0 - SHARE) * abs(self.value)


def reference_box(problem: ToleranceProblem) -> Yardstick:
    """The box alone, with which runs can begin."""
    ideal, nadir = (tuple(float(v) for v in end) for end in problem.box())
    return Yardstick(Box(ideal, nadir), nan, nan)


def yardstick(problem: ToleranceProblem) -> Yardstick:
    """The yardstick of a problem (some seconds where the exact front takes programmes)."""
    from ..run.proofs import exact_front  # with it come the libraries of the page, slow to load

    exact, value, bound = exact_front(problem), nan, nan
    if exact is not None and problem.n_obj > 1:
        value = exact.hypervolume
    elif exact is not None:
        value = float(problem.objective_values(problem.outputs_of(exact.designs[:1], searching=True))[0, 0])
    if problem.n_obj == 1:
        bound = _bound(problem)
    return replace(reference_box(problem), value=value, bound=bound)


def _bound(problem: ToleranceProblem) -> float:
    """The lower bound of a single objective's cost, which does not depend on the design."""
    try:
        return float(proof(problem, {problem.objectives[0]: np.array([inf])}, 1).bound[0])
    except ModelError:
        return nan


# The responses by which runs are compared.


@dataclass(frozen=True, slots=True)
class Ended:
    """A run that has ended."""

    problem: ToleranceProblem
    course: Course
    measure: Yardstick


def _gap(value: float, bound: float) -> float:
    """Distance of a cost from its bound [%], NaN where there is none."""
    return 100.0 * max(value - bound, 0.0) / abs(bound) if value == value and bound else nan


def _gap_percent(run: Ended) -> float:
    """The gap of the best design for one objective, else the median over the front."""
    front = run.course.front
    if not len(front):
        return nan
    if run.problem.n_obj == 1:
        return _gap(float(front.min()), run.measure.bound)
    columns = dict(zip(run.problem.objectives, front.T, strict=True))
    gap = proof(run.problem, columns, len(front)).gap_percent(columns[run.problem.priced])
    return float(np.nanmedian(gap)) if not np.isnan(gap).all() else nan


FORMULAS: MappingProxyType[str, Callable[[Ended], float]] = MappingProxyType(
    {
        "hypervolume_ratio": lambda run: run.measure.box.hypervolume(run.course.front) / run.measure.value,
        "hypervolume": lambda run: run.measure.box.hypervolume(run.course.front),
        "gap_percent": _gap_percent,
        "evaluations_to_99": lambda run: run.course.reached_at[0],
        "cpu_s_to_99": lambda run: run.course.reached_at[1],
        "feasible_fraction": lambda run: run.course.feasible / (run.course.evaluations or nan),
    }
)


def needs_level(names: Iterable[str]) -> bool:
    """Whether a run must know its reference while it runs."""
    return bool({"evaluations_to_99", "cpu_s_to_99"} & set(names))


def response_by_reference(name: str, value: float, end: float, measure: Yardstick) -> float:
    """A response of a run that has ended, by its reference, which may have been measured later.

    `value` is what the run itself computed, `end` the last value of its curve.
    """
    if name == "hypervolume_ratio":
        return end / measure.value
    if name == "gap_percent" and len(measure.box.ideal) == 1:
        return _gap(end, measure.bound)
    return value


def unsuitable_response(name: str, problem: ToleranceProblem) -> str:
    """Why a response has no meaning for a problem, and what to use instead; empty where it has."""
    if name == "hypervolume_ratio" and problem.n_obj == 1:
        return "has no meaning for one objective: use gap_percent"
    if name == "gap_percent":
        text = reason(problem, problem.priced_form())
        return f"cannot be computed ({text}): use hypervolume" if text else ""
    if name in ("hypervolume_ratio", "evaluations_to_99", "cpu_s_to_99"):
        text = _no_exact_front(problem)
        return f"needs the exact front, and {text}: use hypervolume" if text else ""
    return ""


def unknown(name: str, measure: Yardstick) -> str:
    """What is missing for a response after the exact front has been searched."""
    needs_value = name in ("hypervolume_ratio", "evaluations_to_99", "cpu_s_to_99")
    single = len(measure.box.ideal) == 1
    if (needs_value and isnan(measure.value)) or (name == "gap_percent" and single and isnan(measure.bound)):
        return "the exact front of this problem could not be proven: use hypervolume"
    return ""


def _no_exact_front(problem: ToleranceProblem) -> str:
    """Why the exact front is not known, as far as this is known without solving for it."""
    if problem.n_obj > 2:
        return "that of three or more objectives is not known"
    form = closed_form(problem)
    return "" if form is not None and form.exact else "this problem has no exact convex form"
