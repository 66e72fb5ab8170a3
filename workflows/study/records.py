"""What the parts of a study hand to each other.

The study table, which is `study.csv`, has one row per run, sorted by point and replicate: `point`
(row of the design, from 0), one column per varied key, `replicate` (from 0), `seed` (that of the
run, the same at every point for one replicate), `status` ("done" or "failed"), `reason` (empty
where done), and one column per response (NaN where failed, or where it was not reached).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...errors import Fault
from ...problems.settings import Labels

if TYPE_CHECKING:
    import pandas as pd

    from .curves import Curves

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
