"""Outputs over machines: at a pose exactly, over the ring in part by sampling."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import ClassVar

import numpy as np
from scipy.special import ndtr, ndtri

from ...journal import recall_columns
from ...models.manipulator.ring import (
    GRID,
    Field,
    Machines,
    Sample,
    first_largest,
    main_plane,
    worst_deviation,
    worst_exceedance,
    worst_quantile,
)
from ...section import Array, Integers, number
from ..machined import ProcessProblem, Shortfall
from ..settings import PROMISED, Settings
from .outputs import BOTH, BOUNDS, LIMITED, OVER_MACHINES, UNITS

Rows = Integers
Estimates = tuple[Array, Array]
"""Values (n,) and their standard errors (n,)."""
EVERY = 5
"""Step along each axis between the grid's poses at which machines are sampled: 9 x 9 of 41 x 41.
In between the largest quantiles of the yaw are larger by 0.1 %, of the squareness by 0.01 %."""
PLAIN_SAMPLES = 64
"""Plain samples per sampled machine, which stands for all sizes of its main errors."""
BLOCK = 8
"""Designs that are evaluated at once."""


@dataclass(frozen=True, eq=False)
class Population:
    """Machines with independent normal errors, whose standard deviations are the design.

    `fields` are the pose errors by name on the grid of the ring, in their units per unit of each
    source; `here` those at the one pose of the outputs, empty where that is the worst of the grid.
    `limits` are the bounds of the yields, `typical` (sources,) are usual standard deviations.
    """

    fields: Mapping[str, Field]
    here: Mapping[str, Field]
    limits: Mapping[str, float]
    coverage: float
    samples: int
    seed: int
    typical: Array

    def outputs(self, sigma: Array, wanted: Iterable[str]) -> dict[str, Array]:
        """The outputs `wanted` (n,), with their errors, of standard deviations (n, sources)."""
        names = OVER_MACHINES.intersection(wanted)
        starts = range(0, len(sigma) if names else 0, BLOCK)
        parts = [sigma[at : at + BLOCK] for at in starts]
        blocks = [recall_columns((part, *sorted(names)), partial(self._block, part, names)) for part in parts]
        every = blocks[0] if blocks else ()
        return {name: np.concatenate([block[name] for block in blocks]) for name in every}

    def interval(self, output: str, ends: Array) -> tuple[float, float]:
        """Proven bounds of an output between the tightest and the loosest `ends` (2, sources).

        Limits kept over the ring are kept at the worst pose as well, where nothing is sampled.
        """
        over_ring = output == BOTH or "_ring_" in output
        of = replace(self, here={}) if over_ring else self
        stems = [f"{name}_" for name in LIMITED] if output == BOTH else [""]
        names = [f"{stem}{output}".replace("ring_", "pose_") for stem in stems]
        low, high = np.sort(np.min(list(of.outputs(ends, names).values()), axis=0))
        if over_ring and output.endswith("_percent"):
            return 0.0, float(high)
        return float(low), np.inf if over_ring else float(high)

    def _block(self, sigma: Array, names: frozenset[str]) -> dict[str, Array]:
        errors = [PoseError(self, name, sigma) for name in UNITS]
        outputs: dict[str, Array] = {}
        for error in errors:
            outputs |= error.outputs(names)
        if BOTH in names:
            limited = [error for error in errors if error.name in LIMITED]
            outputs |= _value_and_error(BOTH, fraction_keeping_all(self, limited))
        return outputs

    @cached_property
    def samples_about(self) -> dict[str, Sample]:
        """By pose error, and for those with a yield together, the same machines for every design.

        They are the most even in the main plane at usual deviations.
        """
        rng = np.random.default_rng(self.seed)
        sample = Sample.draw(self.samples // PLAIN_SAMPLES, len(self.typical), rng)
        usual = {name: f.at(self.poses).effects * self.typical for name, f in self.fields.items()}
        both = [usual[name] / self.limits[name] for name in LIMITED]
        planes = {name: main_plane([effects]) for name, effects in usual.items()} | {BOTH: main_plane(both)}
        return {name: sample.about(plane) for name, plane in planes.items()}

    @cached_property
    def poses(self) -> Rows:
        """Poses of the grid at which machines are sampled."""
        along = np.arange(0, GRID, EVERY)
        return np.asarray((GRID * along[:, None] + along).ravel())


@dataclass(eq=False)
class PoseError:
    """One pose error of a block of designs; what several outputs need is computed once."""

    population: Population
    name: str
    sigma: Array

    def outputs(self, names: frozenset[str]) -> dict[str, Array]:
        """Its outputs (n,) that are among the names, with their errors."""
        name, unit = self.name, UNITS[self.name]
        exact = {
            f"{name}_pose_{unit}": self.deviation,
            f"{name}_pose_quantile_{unit}": self.quantile,
            f"{name}_pose_yield_percent": self.keeping,
        }
        by_output = {key: of() for key, of in exact.items() if key in names}
        sampled = (f"{name}_ring_quantile_{unit}", f"{name}_ring_yield_percent")
        return by_output | self._over_ring(*(key if key in names else "" for key in sampled))

    @property
    def limit(self) -> float:
        """Bound of its yields."""
        return self.population.limits[self.name]

    @cached_property
    def variances(self) -> Array:
        """Principal variances (n, poses, 3) on the grid."""
        return self.population.fields[self.name].variances(self.sigma)

    @cached_property
    def worst_quantile(self) -> tuple[Array, Rows]:
        """Largest quantile (n,) on the grid, and its pose."""
        return worst_quantile(self.variances, self.population.coverage)

    @cached_property
    def worst_exceedance(self) -> tuple[Array, Rows]:
        """Largest fraction (n,) of machines that exceed the limit on the grid, and its pose."""
        return worst_exceedance(self.variances, self.limit)

    # ---------------------------------------------------------------- at a pose

    @cached_property
    def _here(self) -> Array | None:
        """Principal variances (n, 1, 3) at the one pose; None where that is the worst."""
        field = self.population.here.get(self.name)
        return None if field is None else field.variances(self.sigma)

    def deviation(self) -> Array:
        """Standard deviation (n,) at the pose."""
        return worst_deviation(self.variances if self._here is None else self._here)

    def quantile(self) -> Array:
        """Quantile (n,) at the pose."""
        if self._here is None:
            return self.worst_quantile[0]
        return worst_quantile(self._here, self.population.coverage)[0]

    def keeping(self) -> Array:
        """Machines (n,) that keep the limit at the pose, in percent."""
        if self._here is None:
            return 100.0 * (1.0 - self.worst_exceedance[0])
        return 100.0 * (1.0 - worst_exceedance(self._here, self.limit)[0])

    # ---------------------------------------------------------------- over the ring

    def _over_ring(self, quantile: str, keeping: str) -> dict[str, Array]:
        """Quantile of the largest over the ring, and machines [%] that keep the limit at every
        pose, by these names, with their errors; nothing by an empty name.
        """
        coverage, last = self.population.coverage, len(self.population.poses)
        estimates: dict[str, list[tuple[float, float]]] = {key: [] for key in (quantile, keeping)}
        for at in range(len(self.sigma) if quantile or keeping else 0):
            first = [int(self.worst_quantile[1][at])] if quantile else []
            after = [int(self.worst_exceedance[1][at])] if keeping else []
            machines = self._machines(at, first, after)
            if quantile:
                least, sampled = float(self.worst_quantile[0][at]), machines.at(slice(0, last + 1))
                estimates[quantile].append(sampled.quantile(coverage, 0, least))
            if keeping:
                sampled = machines.at(slice(len(first), None))
                estimates[keeping].append(sampled.beyond(self.limit, last))
        both = _value_and_error(quantile, _columns(estimates[quantile])) if quantile else {}
        return both | (_value_and_error(keeping, _percent(estimates[keeping])) if keeping else {})

    def _machines(self, at: int, first: Sequence[int], last: Sequence[int]) -> Machines:
        """Machines of one design at the poses `first`, of the sample, and `last`."""
        of = self.population
        poses = np.concatenate([first, of.poses, last]).astype(np.int64)
        plane = main_plane([self.effects(at, of.poses)])
        return Machines.of([self.effects(at, poses)], self.variances[at, poses], of.samples_about[self.name], plane)

    def effects(self, at: int, poses: Rows) -> Array:
        """Pose errors (poses, c, sources) of one standard deviation of each source of a design."""
        return np.asarray(self.population.fields[self.name].effects[poses] * self.sigma[at])


def fraction_keeping_all(of: Population, errors: Sequence[PoseError]) -> Estimates:
    """Machines (n,) that keep the limits of all pose errors at every pose, in percent."""
    beyond = []
    for at in range(len(errors[0].sigma)):
        over = [float(error.worst_exceedance[0][at]) for error in errors]
        poses = [np.append(of.poses, error.worst_exceedance[1][at]) for error in errors]
        pairs = list(zip(errors, poses, strict=True))
        effects = [error.effects(at, at_poses) / error.limit for error, at_poses in pairs]
        variances = [error.variances[at, at_poses] / error.limit**2 for error, at_poses in pairs]
        plane = main_plane([effect[:-1] for effect in effects])
        machines = Machines.of(effects, np.concatenate(variances), of.samples_about[BOTH], plane)
        last = np.cumsum([len(effect) for effect in effects]) - 1
        beyond.append(machines.beyond(1.0, int(last[first_largest(np.array(over))])))
    return _percent(beyond)


def _value_and_error(name: str, estimates: Estimates) -> dict[str, Array]:
    return {name: estimates[0], f"{name}_error": estimates[1]}


def _columns(estimates: Iterable[tuple[float, float]]) -> Estimates:
    values, errors = np.array(list(estimates)).T
    return values, errors


def _percent(beyond: Iterable[tuple[float, float]]) -> Estimates:
    """Machines that keep a limit, in percent, from the fractions that exceed it."""
    fractions, errors = _columns(beyond)
    return 100.0 * (1.0 - fractions), 100.0 * errors


# The promise of `pose_accuracy`: machines that keep both limits at every pose of the ring.
#
# A state of the processes scales the standard deviations that are known by samples. The error
# of a mean moves all machines of a process alike; it counts by the variance that it adds, which is
# the same to second order.


MIN_PROBABILITY = 1e-12
"""Least fraction of machines beyond a limit that is distinguished from none."""
STEPS = 14
"""Halvings of the range in which a search begins."""
STEP = 1e-3
"""Relative step of a standard deviation for the slope of a promised yield."""


class PromisingPoses(ProcessProblem):
    """Machines whose standard deviations are not as the samples say."""

    promised_of: ClassVar[str] = BOTH

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        self.declaration = replace(self.declaration, sampled=self.promises_by_samples)

    @cached_property
    @abstractmethod
    def squares(self) -> Mapping[str, Array]:
        """Squared effect per squared unit of each variable, (poses or 1, variables), by output."""

    @abstractmethod
    def over_machines(self, designs: Array, names: Iterable[str]) -> dict[str, Array]:
        """Outputs (n,) over machines of full designs (n, all), with their errors."""

    def shortfall(self, design: Array, scales: Array, shifts: Array, searching: bool = False) -> Shortfall:
        """Shortfall of the fraction of machines within both limits, as normal quantiles."""
        outputs = self.over_machines(self._at(design, scales, shifts), [BOTH])
        z = ndtri(np.clip(0.01 * outputs[BOTH], MIN_PROBABILITY, 1.0 - MIN_PROBABILITY))
        bell = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi)
        error = float(np.median(0.01 * outputs[f"{BOTH}_error"] / np.maximum(bell, 1e-6)))
        return Shortfall(self._promised_quantile - z, error)

    @property
    def _promised_quantile(self) -> float:
        """Standard normal quantile of the promised fraction."""
        return float(ndtri(self.stated_promise.fraction))

    def _at(self, design: Array, scales: Array, shifts: Array) -> Array:
        """Full designs (q, all) at states (q, k) of the processes."""
        designs = np.repeat(design[None, :], len(scales), axis=0)
        columns = [self.names.index(name) for name in self.known]
        designs[:, columns] *= np.hypot(scales, shifts)
        return designs

    def coordinates(self, scales: Array, shifts: Array) -> Array:
        return np.hypot(scales, shifts) - 1.0

    def steepness(self, design: Array, searching: bool) -> tuple[Array, Array]:
        """By what each process adds to the variances, over the variances that the limits allow."""
        columns = [self.names.index(name) for name in self.known]
        total = np.zeros(len(columns))
        for name, bound in zip(LIMITED, BOUNDS, strict=True):
            added = self.squares[f"{name}_{UNITS[name]}"] * design**2
            worst = added[int(np.argmax(added.sum(axis=1)))]
            total += worst[columns] / number(self.settings.parameters[bound.name]) ** 2
        return total, np.zeros_like(total)

    def yield_at(self, design: Array, scale: Array, shift: Array, searching: bool) -> float:
        designs = self._at(design, scale[None, :], shift[None, :])
        return float(self.over_machines(designs, [BOTH])[BOTH][0])

    def starts(self) -> Array:
        """Equal fractions of all search ranges that just keep the promise, and half of them."""
        if not self.promises_by_samples:
            return super().starts()
        fraction = self._fraction(lambda design: float(self.promised_yields(design[None, :], True)[0]))
        return np.stack([self._along(fraction), self._along(0.5 * fraction)])

    def _along(self, fraction: float) -> Array:
        """The full design (all,) at equal fractions of all search ranges, by their logarithms."""
        return np.asarray(self.complete((self.xl * (self.xu / self.xl) ** fraction)[None, :])[0])

    def _fraction(self, yields: Callable[[Array], float]) -> float:
        """The fraction of the ranges at which a yield just keeps the promise."""
        near, far = 0.0, 1.0
        for _ in range(STEPS):
            fraction = 0.5 * (near + far)
            kept = yields(self._along(fraction)) >= self.stated_promise.yield_percent
            near, far = (fraction, far) if kept else (near, fraction)
        return near

    @cached_property
    def _expecting(self) -> float:
        """How far along the worst direction the yield is the expected one, where the estimates just
        keep what is promised.
        """
        none = np.ones(len(self.known)), np.zeros(len(self.known))
        design = self._along(self._fraction(lambda design: self.yield_at(design, *none, True)))
        wanted, worst = float(self.expected_yields(design[None, :], False)[0]), self.worst(design, True)
        radii = np.linspace(-1.0, 1.0, 21)
        yields = [self.yield_at(design, *worst.at(float(radius)), True) for radius in radii]
        return float(np.interp(-wanted, -np.array(yields), radii))

    def promised_slopes(self, designs: Array) -> dict[str, Array]:
        """Derivatives (n, all variables) of the promised yield, by differences on one sample."""
        if not self.promises_by_samples:
            return {}
        slopes = np.zeros_like(designs)
        for at, v in enumerate(self.variables):
            if v.name not in self.fixed and len(designs):
                ends = [designs.copy() for _ in range(2)]
                ends[0][:, at] *= 1.0 + STEP
                ends[1][:, at] *= 1.0 - STEP
                up, down = (self.promised_yields(end, searching=True) for end in ends)
                slopes[:, at] = (up - down) / (2.0 * STEP * designs[:, at])
        return {PROMISED: slopes}

    def expected_yields(self, designs: Array, searching: bool) -> Array:
        if not searching:
            z = [self._promised_quantile - self.verdict(design).shortfalls for design in designs]
            return np.array([100.0 * float(np.mean(ndtr(design_z))) for design_z in z])
        radius = self._expecting if self.known else 0.0
        return np.array([self.yield_at(design, *self.worst(design, True).at(radius), True) for design in designs])
