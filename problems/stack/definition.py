"""The definition of a stack: its requirements and its parts, as plain frozen records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...arrays import Array
from ...models.capability import Knowledge, PartSample
from ...models.costs import CostCurve
from ...models.inputs import Distribution
from ...models.machines import Machine
from ...models.machines.offers import Offer
from ...models.stack import Mechanism
from ..promise import Promise

METHODS = ("worst_case", "rss", "shifted_rss", "monte_carlo")
"""What `variation` can be."""
FIRST_ORDER = ("rss", "shifted_rss")
"""Methods that know a formula by its slopes at the mid-limits alone."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """A functional requirement; the formula is empty where the parts state sensitivities.

    `stated_nominal` is the nominal as it was written: its digits say how exact it is. `key` is the
    name that identifies it in outputs and sensitivities, empty for that of `[requirement]`;
    `place` where it stands in the configuration. `description` and `drawing` are for readers.
    """

    name: str
    unit: str
    formula: str = ""
    nominal: float | None = None
    stated_nominal: float | str | None = None
    lower: float | None = None
    upper: float | None = None
    method: str = "rss"
    weight: float = 1.0
    key: str = ""
    place: str = "requirement"
    description: str = ""
    drawing: str = ""

    @property
    def bounded(self) -> bool:
        """Whether it has limits."""
        return self.lower is not None or self.upper is not None

    def output(self, name: str) -> str:
        """The name of one of its outputs: `rss`, or `gap.rss` where there are several."""
        return f"{self.key}.{name}" if self.key else name


@dataclass(frozen=True, slots=True)
class Process:
    """One way of making a part: half-width t from `low` to `high` at a cost.

    The scatter of good parts is in proportion to t, or that of a `machine`. `note` says how its
    range was understood.
    """

    low: float
    high: float
    curve: CostCurve | None = None
    name: str = ""
    machine: Machine | None = None
    note: str = field(default="", compare=False)


def natural_limit(mid: float, half_width: float) -> int:
    """Which limit of a zone is at deviation 0: -1 the lower one, 1 the upper one, 0 none."""
    ends = {-1: mid - half_width, 1: mid + half_width}
    return next((side for side, end in ends.items() if half_width > 0.0 and abs(end) < 1e-9 * half_width), 0)


@dataclass(frozen=True, slots=True)
class Part:
    """A toleranced part, built in `count` times; lengths in its own `unit`.

    `mid` is the mid-limit minus the nominal. A `fixed` part has one process with low = high.
    `alternatives` says that its processes are listed, so that one of them is chosen. `stated` is
    what the configuration says about its zone, `assumed` what it leaves open. `sensitivities` are
    by the key of the requirement, those of formulas left out. `drawing` and `characteristic` are
    the numbers of its drawing and of the characteristic on it, `geometry` is the geometrical
    characteristic (ISO 1101) that its zone is of; empty where none is stated. `machines` are those
    that some of its processes use, `sample` is what measured parts say about its only one.
    """

    name: str
    unit: str
    processes: tuple[Process, ...]
    distribution: Distribution
    nominal: float | None = None
    mid: float = 0.0
    count: int = 1
    fixed: bool = False
    alternatives: bool = False
    sensitivities: Mapping[str, float] = field(default_factory=dict)
    stated: Mapping[str, Any] = field(default_factory=dict)
    assumed: Mapping[str, str] = field(default_factory=dict)
    drawing: str = ""
    characteristic: str = ""
    geometry: str = ""
    machines: tuple[Offer, ...] = ()
    sample: PartSample | None = None

    @property
    def natural(self) -> int:
        """-1 where the lower limit of its zone is the natural limit 0 of a geometrical characteristic
        ("+0.02/0"), 1 where the upper limit is, 0 for any other zone.
        """
        return natural_limit(self.mid, self.high) if self.fixed and self.geometry else 0

    @property
    def one_sided(self) -> bool:
        """Whether it has one limit alone, so that its zone has no middle and its process no Cp."""
        return bool(self.natural) or (self.sample is not None and self.sample.one_sided)

    @property
    def mean(self) -> float:
        """Deviation of the mean from the nominal where the distribution has no shift."""
        return self.mid + (0.0 if self.sample is None else self.sample.offset)

    def knowledge_of(self, number: int) -> Knowledge | None:
        """Knowledge of one of its processes from a sample, None where it counts as known."""
        machine = self.processes[number].machine
        samples = (
            [self.sample]
            if machine is None
            else [offer.sample for offer in self.machines if offer.machine.name == machine.name]
        )
        return next((sample.knowledge for sample in samples if sample is not None), None)

    @property
    def sampled(self) -> bool:
        """Whether some of its processes are known from samples."""
        return any(self.knowledge_of(number) is not None for number in range(len(self.processes)))

    @property
    def by_machine(self) -> bool:
        """Whether some processes are by machines of known scatter."""
        return bool(self.machines)

    @property
    def low(self) -> float:
        """Tightest half-width of any process."""
        return min(process.low for process in self.processes)

    @property
    def high(self) -> float:
        """Loosest half-width of any process."""
        return max(process.high for process in self.processes)

    @property
    def ends(self) -> tuple[Array, Array]:
        """Tightest and loosest half-width of each process."""
        return np.array([p.low for p in self.processes]), np.array([p.high for p in self.processes])

    @property
    def free_of_charge(self) -> bool:
        """Whether no process of it has a cost curve."""
        return all(process.curve is None for process in self.processes)

    @property
    def pieces(self) -> tuple[str, ...]:
        """Names that the part has in a formula: roller_1, roller_2 where it is built in twice."""
        if self.count == 1:
            return (self.name,)
        return tuple(f"{self.name}_{at}" for at in range(1, self.count + 1))


@dataclass(frozen=True, slots=True)
class Correlation:
    """Correlation coefficient of the deviations of two pieces."""

    pieces: tuple[str, str]
    coefficient: float


@dataclass(frozen=True, slots=True, eq=False)
class Definition:
    """A stack that has been read and checked: a mechanism for each requirement, over all parts."""

    requirements: tuple[Requirement, ...]
    parts: tuple[Part, ...]
    mechanisms: tuple[Mechanism, ...]
    correlations: tuple[Correlation, ...] = ()
    promise: Promise | None = None

    @property
    def requirement(self) -> Requirement:
        """The first requirement."""
        return self.requirements[0]

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism of the first requirement."""
        return self.mechanisms[0]
