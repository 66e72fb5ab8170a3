"""The definition of a stack: its requirements and its parts, as plain frozen records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models.capability import Knowledge, PartSample
from ...models.costs import CostCurve
from ...models.inputs import Distribution, Normal
from ...models.machine_offers import Offer, ways_of
from ...models.machines import GoodPartsBySpread, Machine
from ...models.stack.mechanism import AsMade, Mechanism, Tolerances
from ...section import Array, Integers
from ...units import family
from ..settings import Promise

if TYPE_CHECKING:
    from .features import Feature

METHODS = ("worst_case", "rss", "shifted_rss", "monte_carlo")
"""What `variation` can be."""


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
class Condition:
    """A temperature [degC] at which all requirements hold, and its name."""

    name: str
    temperature_C: float


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
    characteristic (ISO 1101) that its zone is of, `drawn_as` whether it is a diameter or a radius (of a
    feature how its zone "{}" is written), `source` where its tolerance comes from; empty where none is stated.
    `expansion` is the linear one [1/K], None where neither it nor a `material` is stated. `machines` are
    those that some of its processes use, `sample` is what measured parts say about its only one. `present` is
    the half-width of a part to be searched that the drawing has now, within the range or not, None where it
    is not stated. `feature` is how a `[[feature]]` acts, whose half-width is half its zone.
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
    drawn_as: str = ""
    source: str = ""
    expansion: float | None = None
    material: str = ""
    machines: tuple[Offer, ...] = ()
    sample: PartSample | None = None
    present: float | None = None
    feature: Feature | None = None

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
        """What varies by itself: roller_1, roller_2 where the part is built in twice."""
        if self.feature is not None:
            return self.feature.pieces
        if self.count == 1:
            return (self.name,)
        return tuple(f"{self.name}_{at}" for at in range(1, self.count + 1))

    @property
    def written(self) -> tuple[str, ...]:
        """Names that formulas may use."""
        return self.pieces if self.feature is None else self.feature.names

    @property
    def label(self) -> str:
        """What it is called where faults name it."""
        return f"{'part' if self.feature is None else 'feature'} {self.name}"

    @property
    def place(self) -> str:
        """Where the configuration states it, as assumptions name it."""
        return self.label.replace(" ", ".")

    @property
    def names(self) -> tuple[str, ...]:
        """Every name that is taken by the part."""
        return tuple(dict.fromkeys((self.name, *self.pieces, *self.written)))


def place_of(parts: Sequence[Part], at: int) -> str:
    """Where a part stands in the configuration."""
    feature = parts[at].feature
    return f"part[{at}]" if feature is None else feature.place


def base_units(requirement: Requirement, parts: Sequence[Part]) -> dict[str, float]:
    """The units of a formula that depends on `parts`: the SI factor of each kind of quantity.

    Angles are in rad, plain numbers as they are, all lengths in the unit of the requirement if it
    is a length, else in that of the first part that is one; other quantities like lengths.
    """
    base = {"radian": 1.0, "": 1.0}
    for unit in (requirement.unit, *(part.unit for part in parts)):
        base.setdefault(*family(unit))
    return base


@dataclass(frozen=True, slots=True)
class Correlation:
    """Correlation coefficient of the deviations of two pieces."""

    pieces: tuple[str, str]
    coefficient: float


@dataclass(frozen=True, slots=True)
class Sorting:
    """Two parts that are measured with a standard deviation of `u_um`, sorted into `classes` and matched, at a
    `price` a unit; `stated` is what the configuration says at `place`.
    """

    parts: tuple[str, str]
    classes: int
    u_um: float
    price: float
    place: str
    stated: Mapping[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Definition:
    """A stack that has been read and checked: a mechanism for each requirement, over all parts.

    With `conditions` these are the requirements in each of them, and `stated` those of the
    configuration. `intermediate` holds the tables `[[let]]` and `[[loop]]` as they are written.
    """

    requirements: tuple[Requirement, ...]
    parts: tuple[Part, ...]
    mechanisms: tuple[Mechanism, ...]
    correlations: tuple[Correlation, ...] = ()
    sortings: tuple[Sorting, ...] = ()
    promise: Promise | None = None
    conditions: tuple[Condition, ...] = ()
    stated: tuple[Requirement, ...] = ()
    intermediate: Mapping[str, Any] = field(default_factory=dict)

    @property
    def requirement(self) -> Requirement:
        """The first requirement."""
        return self.requirements[0]

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism of the first requirement."""
        return self.mechanisms[0]


# Parts as their machines make them: what their tolerances and choices of process come to.


def processes_of(offers: Sequence[Offer]) -> tuple[Process, ...]:
    """Each machine, with and without inspection, as a process."""
    return tuple(Process(way.low, way.high, way.curve, way.label, way.machine) for way in ways_of(offers))


def scale_of(part: Part) -> float:
    """Half-width t of the part per standard deviation, by its own (normal) distribution."""
    assert isinstance(part.distribution, Normal)
    return 1.0 / part.distribution.sigma


def process_by_spread(part: Part, process: Process) -> GoodPartsBySpread:
    """An inspected process by the spread of its good parts, in units of half-widths t."""
    assert process.machine is not None
    return GoodPartsBySpread(process.machine, process.low, process.high, scale_of(part))


def spread_and_mean(part: Part, process: Process, t: Array) -> tuple[Array, Array]:
    """Spread, as a half-width of the part's distribution, and mean of good parts (n,)."""
    if process.machine is None:
        return t, np.zeros_like(t)
    good_parts = process.machine.good_parts(t)
    return scale_of(part) * good_parts.std, good_parts.mean


def parts_by_process(parts: Sequence[Part], t: Array, chosen: Integers) -> Tolerances:
    """Parts of n designs of half-widths t (n, p) by the processes chosen (n, p)."""
    if not any(part.by_machine for part in parts):
        return t
    spread, mean = t.copy(), np.zeros_like(t)
    for at, part in enumerate(parts):
        for number, process in enumerate(part.processes):
            rows = chosen[:, at] == number
            if process.machine is not None and np.any(rows):
                spread[rows, at], mean[rows, at] = spread_and_mean(part, process, t[rows, at])
    return AsMade(t, spread, mean, chosen)


def ranges_by_process(parts: Sequence[Part]) -> tuple[Tolerances, Tolerances]:
    """Least and largest limit, spread and size of the mean of each part, (1, p) each."""
    ends = [_ends(part) for part in parts]
    low, high = (np.array([[pair[side] for pair in part_ends] for part_ends in ends]) for side in (0, 1))
    if not any(part.by_machine for part in parts):
        return low[:, 0].reshape(1, -1), high[:, 0].reshape(1, -1)
    return (
        AsMade(*(low[:, at].reshape(1, -1) for at in range(3))),
        AsMade(*(high[:, at].reshape(1, -1) for at in range(3))),
    )


def _ends(part: Part) -> list[tuple[float, float]]:
    """Least and largest limit, spread, and size of the mean of a part.

    The spread of good parts rises with the limit; their mean is nearest to 0 at the tightest.
    """
    limits, spreads, means = [], [], []
    for process in part.processes:
        t = np.array([process.low, process.high])
        spread, mean = spread_and_mean(part, process, t)
        limits += t.tolist()
        spreads += spread.tolist()
        means += np.abs(mean).tolist()
    return [(min(values), max(values)) for values in (limits, spreads, means)]


def limits_of(part: Part, spread: Array, chosen: Integers) -> Array:
    """Half-widths t (n,) of a part at spreads (n,) of its good parts, by the process chosen."""
    t = spread.copy()
    for number, process in enumerate(part.processes):
        rows = chosen == number
        if process.machine is None or not np.any(rows):
            continue
        if process.low == process.high:
            t[rows] = process.low
        else:
            t[rows] = process_by_spread(part, process).limit(spread[rows])
    return t
