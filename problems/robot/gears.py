"""The reducers of a robot as columns of its designs: costs, mean squares, quantiles, units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ...declarations import Kind, Value, Variable, number
from ...models.robot.sample import smooth_root
from ..reducers.block import GRADE
from ..reducers.nested import Nested
from ..rv_transmission_error.declared import DOCUMENT_MRAD
from ..rv_transmission_error.declared import VARIABLES as WAVES
from .waves import ANGLES, COST, SECONDS, Wave

Array = NDArray[np.float64]
RMS, TE = "backlash_rms_arcmin", "te_rms_arcsec"
STEP = 1e-4
"""Relative half-step of the derivatives by a reducer's tolerances."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """A reducer on a drive: the place of its `gear` among those that have tolerances of their own;
    its cost, backlash and transmission error as factors of the gear's.
    """

    gear: int
    cost_factor: float = 1.0
    backlash_factor: float = 1.0
    te_factor: float = 1.0


def gear_variables(gears: Mapping[str, Nested], nested: bool) -> tuple[Variable, ...]:
    """Variables of reducers by key: two each where they are nested, else all their tolerances."""
    found: list[Variable] = []
    for key, one in gears.items():
        found += _nested(key, one) if nested else _whole(key, one)
    return tuple(found)


def _nested(at: str, one: Nested) -> list[Variable]:
    low, high = one.range
    te = Wave().angles.ends
    return [
        Variable(
            f"reducer_{at}_{RMS}",
            "arcmin",
            Kind.STANDARD_DEVIATION,
            low,
            high,
            f"root mean square of the backlash of reducer {at}, hysteresis included",
            valid_low=low,
            valid_high=1e3,
        ),
        Variable(
            f"reducer_{at}_{TE}",
            "arcsec",
            Kind.STANDARD_DEVIATION,
            *te,
            f"root mean square of the transmission error of reducer {at}, order 40",
            valid_low=te[0],
            valid_high=te[1],
        ),
    ]


def _whole(at: str, one: Nested) -> list[Variable]:
    problem = one.problem
    assert problem is not None
    set_to = problem.settings.variables
    found = []
    for v in problem.free:
        low, high = set_to[v.name].low, set_to[v.name].high
        assert low is not None and high is not None
        found.append(
            Variable(
                f"reducer_{at}_{v.name}",
                v.unit,
                v.kind,
                low,
                high,
                f"reducer {at}: {v.meaning}",
                v.document,
                integer=v.integer,
                valid_low=v.valid_low,
                valid_high=v.valid_high,
            )
        )
    for v in WAVES[: len(ANGLES)]:
        found.append(
            replace(
                v, name=f"reducer_{at}_{v.name}", meaning=f"reducer {at}: {v.meaning}", random=False
            )
        )
    return found


def _excess(rms: float, one: Nested, most: float) -> float:
    """Quantile of the backlash [arcmin] at an rms, less the most that it may be."""
    return float(one.quantile(np.array([rms]))[0]) - most


@dataclass(frozen=True, slots=True, eq=False)
class At:
    """Reducers of n designs: costs, mean square backlashes [arcmin^2], rms waves [arcmin]; each
    (n, gears).
    """

    cost: Array
    square: Array
    wave: Array


@dataclass(frozen=True, slots=True, eq=False)
class Built:
    """Reducers of one design: full designs of their problems, or the rms of a front of points, and
    roots (gears, 2, 2) of the covariance of their waves [arcmin].
    """

    designs: tuple[Array, ...]
    roots: Array


@dataclass(frozen=True, eq=False)
class Gears:
    """The reducers that have columns of their own."""

    keys: tuple[str, ...]
    nested: tuple[Nested, ...]
    fitted: tuple[Fitted, ...]
    """Those of the drives, in their order."""
    small: bool
    """Two columns per reducer rather than all of its tolerances."""
    wave: Wave
    hysteresis: float
    price: float

    @classmethod
    def of(
        cls,
        gears: Mapping[str, Nested],
        fitted: tuple[Fitted, ...],
        nested: bool,
        p: Mapping[str, Value],
        coverage: float,
    ) -> Gears:
        """The reducers at the parameters of a problem."""
        lost, price = number(p["hysteresis_arcmin"]), number(p["reducer_price"])
        wave = Wave(number(p["precision_weight"]), coverage, price)
        own = tuple(one.with_(lost, price) for one in gears.values())
        return cls(tuple(gears), own, fitted, nested, wave, lost, price)

    @cached_property
    def gear_of(self) -> tuple[int, ...]:
        """The gear of each drive."""
        return tuple(one.gear for one in self.fitted)

    @cached_property
    def factors(self) -> Array:
        """Backlash (drives,) as a factor of that of the drive's gear."""
        return np.array([one.backlash_factor for one in self.fitted])

    @cached_property
    def te_factors(self) -> Array:
        """Transmission error (drives,) as a factor of that of the drive's gear."""
        return np.array([one.te_factor for one in self.fitted])

    @cached_property
    def counts(self) -> Array:
        """Sum of the cost factors of the drives that have each gear."""
        costs = [one.cost_factor for one in self.fitted]
        return np.bincount(self.gear_of, costs, len(self.nested)).astype(float)

    @cached_property
    def largest(self) -> Array:
        """Largest factors (2, gears) of backlash and transmission error of the drives that have
        each gear.
        """
        own = np.array(self.gear_of)
        return np.array(
            [
                [factors[own == gear].max() for gear in range(len(self.nested))]
                for factors in (self.factors, self.te_factors)
            ]
        )

    @property
    def dimensions(self) -> int:
        """Independent errors of a unit of every drive."""
        return len(self.fitted) * max(one.dimensions for one in self.nested)

    # ---------------------------------------------------------------- columns

    def _free(self, gear: int) -> list[str]:
        problem = self.nested[gear].problem
        assert problem is not None
        return [v.name for v in problem.free]

    def _begin(self, gear: int) -> int:
        if self.small:
            return 2 * gear
        return sum(len(self._free(one)) + len(ANGLES) for one in range(gear))

    def _designs(self, columns: Array, gear: int) -> Array:
        """Full designs (n, all variables) of a reducer's problem."""
        one, begin = self.nested[gear], self._begin(gear)
        if self.small:
            return one.designs(columns[:, begin])
        assert one.problem is not None
        return one.problem.complete(columns[:, begin : begin + len(self._free(gear))])

    def _every(self, columns: Array) -> list[Array]:
        """By gear: full designs (n, all variables) of its problem, or the rms (n, 1) of a front of
        points. Gears that are one reducer are worked out together.
        """
        if not self.small:
            return [self._designs(columns, gear) for gear in range(len(self.nested))]
        found: dict[int, Array] = {}
        for gear, one in enumerate(self.nested):
            if gear in found:
                continue
            alike = [at for at, other in enumerate(self.nested) if other is one]
            rms = np.concatenate([columns[:, self._begin(at)] for at in alike])
            whole = rms[:, None] if one.problem is None else one.designs(rms)
            found |= dict(zip(alike, np.split(whole, len(alike)), strict=True))
        return [found[gear] for gear in range(len(self.nested))]

    def _half_widths(self, columns: Array, gear: int) -> Array:
        """Half-widths (n, 12) [mrad] of the angles of a reducer."""
        begin = self._begin(gear)
        if self.small:
            return self.wave.angles.allocation(columns[:, begin + 1])
        begin += len(self._free(gear))
        return columns[:, begin : begin + len(ANGLES)]

    def at(self, columns: Array) -> At:
        """Costs and mean squares of columns (n, all of the reducers')."""
        each = [self._one(columns, gear) for gear in range(len(self.nested))]
        return At(*(np.stack(part, axis=1) for part in zip(*each, strict=True)))

    def _one(self, columns: Array, gear: int) -> tuple[Array, Array, Array]:
        one, begin = self.nested[gear], self._begin(gear)
        if self.small:
            rms, te = columns[:, begin], columns[:, begin + 1]
            return one.cost(rms) + self.wave.cost(te), rms**2, te * SECONDS
        assert one.problem is not None and one.block is not None
        designs, angles = self._designs(columns, gear), self._half_widths(columns, gear)
        cost = one.problem.cost_of(designs) + np.sum(COST / angles, axis=1)
        wave = self.wave.rms(angles) * SECONDS
        return self.price * cost, one.block.of_designs(designs), wave

    def amplitudes(self, columns: Array) -> Array:
        """Quantile (n,) [arcsec] of the amplitude of the transmission error; of the worst drive."""
        each = [
            self.largest[1, gear] * self.wave.amplitude(self._half_widths(columns, gear))
            for gear in range(len(self.nested))
        ]
        return np.asarray(np.max(each, axis=0))

    def quantiles(self, columns: Array) -> Array:
        """Quantile (n,) [arcmin] of the backlash; of the worst drive."""
        each = [
            self.largest[0, gear] * self._quantile(columns, gear)
            for gear in range(len(self.nested))
        ]
        return np.asarray(np.max(each, axis=0))

    def _quantile(self, columns: Array, gear: int) -> Array:
        one = self.nested[gear]
        if self.small or one.problem is None:
            return one.quantile(columns[:, self._begin(gear)])
        found = one.problem.outputs_of(self._designs(columns, gear), errors=False)
        return found["backlash_arcmin"]

    def rms_of_quantile(self, most: float) -> float:
        """The least rms [arcmin] of any drive at which its quantile is `most` [arcmin]."""
        found = []
        for one, factor in zip(self.nested, self.largest[0].tolist(), strict=True):
            low, high = one.range
            ends = [_excess(t, one, most / factor) for t in (low, high)]
            if ends[0] >= 0.0 or ends[1] <= 0.0:
                found.append(factor * (low if ends[0] >= 0.0 else high))
                continue
            at = scipy.optimize.brentq(_excess, low, high, args=(one, most / factor))
            found.append(factor * float(at))
        return float(min(found))

    # ---------------------------------------------------------------- Monte Carlo

    def built(self, columns: Array) -> list[Built]:
        """What units of the reducers are made to, of columns (n, all of the reducers')."""
        every = self._every(columns)
        parts = [
            (whole, smooth_root(self.wave.covariance(self._half_widths(columns, gear))))
            for gear, whole in enumerate(every)
        ]
        return [
            Built(tuple(whole[at] for whole, _ in parts), np.stack([r[at] for _, r in parts]))
            for at in range(len(columns))
        ]

    def units(self, built: Built, points: Array) -> tuple[Array, Array, Array]:
        """Backlash with hysteresis (units, drives) [arcmin], the hysteresis (drives,) [arcmin], and
        roots (drives, 2, 2) of the waves' covariance [arcmin], of one design.
        """
        width = points.shape[1] // len(self.fitted)
        play = []
        for drive, gear in enumerate(self.gear_of):
            one = self.nested[gear]
            own = points[:, drive * width : drive * width + one.dimensions]
            play.append(one.backlashes(built.designs[gear], own))
        lost = self.hysteresis * self.factors
        roots = self.te_factors[:, None, None] * built.roots[list(self.gear_of)]
        return self.factors * np.stack(play, axis=1), lost, roots

    # ---------------------------------------------------------------- derivatives

    def slopes(self, columns: Array, gear: int) -> dict[str, tuple[tuple[Array, Array], Array]]:
        """By variable: derivatives of mean square backlash and wave [arcmin^2], and minus that of
        the cost of one reducer, each (n,). The grade counts by the step to the next finer one.
        """
        begin, one = self._begin(gear), self.nested[gear]
        names = [RMS, TE] if self.small else [*self._free(gear), *ANGLES]
        found = {}
        for at, name in enumerate(names):
            value = columns[:, begin + at]
            if self.small and name == RMS:
                own = (2.0 * value, 0.0 * value), -one.slope(value)
            elif self.small:
                own = (0.0 * value, 2.0 * value * SECONDS**2), -self.wave.curve.slope(value)
            else:
                own = self._difference(columns, gear, begin + at, name)
            found[f"reducer_{self.keys[gear]}_{name}"] = own
        return found

    def _difference(
        self, columns: Array, gear: int, at: int, name: str
    ) -> tuple[tuple[Array, Array], Array]:
        up, down = columns.copy(), columns.copy()
        if name == GRADE:
            block = self.nested[gear].block
            assert block is not None
            down[:, at] = np.maximum(down[:, at] - 1.0, block.grades[0])
        else:
            up[:, at], down[:, at] = up[:, at] * (1.0 + STEP), down[:, at] * (1.0 - STEP)
        width = up[:, at] - down[:, at]
        width = np.where(width == 0.0, np.inf, width)
        cost, square, wave = (
            (high - low) / width
            for high, low in zip(self._one(up, gear), self._one(down, gear), strict=True)
        )
        mean = 0.5 * (self._one(up, gear)[2] + self._one(down, gear)[2])
        return (square, 2.0 * mean * wave), -cost

    # ---------------------------------------------------------------- from the convex form

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """All variables of the reducers from the rms of each that a form has found."""
        found = dict(columns)
        if self.small:
            return found
        for gear, one in zip(self.keys, self.nested, strict=True):
            rms, te = found.pop(f"reducer_{gear}_{RMS}"), found.pop(f"reducer_{gear}_{TE}")
            assert one.problem is not None
            designs = (
                one.designs(np.asarray(rms)) if len(rms) else np.empty((0, len(one.problem.names)))
            )
            for name, column in zip(one.problem.names, designs.T, strict=True):
                found[f"reducer_{gear}_{name}"] = column
            for name, column in zip(ANGLES, self.wave.angles.allocation(te).T, strict=True):
                found[f"reducer_{gear}_{name}"] = column
        return found

    def document(self) -> list[float]:
        """The documents' tolerances of all reducers, as columns."""
        found: list[float] = []
        for gear, one in enumerate(self.nested):
            assert one.problem is not None
            printed = {v.name: float(v.document or 0.0) for v in one.problem.variables}
            found += [printed[name] for name in self._free(gear)] + list(DOCUMENT_MRAD.values())
        return found

    @cached_property
    def proven(self) -> bool:
        """Whether the least cost of every reducer is proven."""
        return all(one.proven for one in self.nested)
