"""The reducers of a robot as columns of its designs: costs, mean squares, quantiles, units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy

from ...models.assembly.assemble import radius_quantile
from ...models.costs import Reciprocal
from ...models.robot import smooth_root
from ...section import Array, Kind, Value, Variable, number
from ...units import ARCMIN, ARCSEC
from ..nested_reducers import Clipped, Nested, PricedCurve
from ..rv_backlash.shift import GRADE
from ..rv_transmission_error import RvTransmissionError
from ..rv_transmission_error.declared import COSTS, DOCUMENT_MRAD, PRECISION, VARIABLES
from ..rv_transmission_error.form import least_ratio
from ..settings import Settings, VariableSetting

# The transmission error of a reducer: document A's twelve angles, at one precision weight.


ANGLES = tuple(DOCUMENT_MRAD)
COST = float(next(curve.b for curve in COSTS.values() if isinstance(curve, Reciprocal)))


@lru_cache(maxsize=8)
def plane_of(precision: float) -> tuple[Array, float]:
    """Components of the wave [arcmin] per mrad of half-width, (2, 12), and what is there without
    any error [arcmin], at a precision weight.
    """
    fixed = {PRECISION: VariableSetting(value=precision)}
    problem = RvTransmissionError(Settings(variables=fixed))
    unit = np.ones((1, len(problem.names)))
    unit[:, problem.names.index(PRECISION)] = precision
    spread = problem.residual(unit).spread[0][:, : len(ANGLES)]
    base = problem.influence.base_amplitude / ARCMIN
    return problem.influence.order_40 @ spread / ARCMIN, float(base)


@lru_cache(maxsize=8)
def angles_of(precision: float) -> Clipped:
    """Cost over the rms of the wave [arcsec] at a precision weight."""
    variable = VARIABLES[0]
    gain = 60.0 * np.sqrt(np.sum(plane_of(precision)[0] ** 2, axis=0) / 2.0)
    return Clipped(gain, np.full(len(ANGLES), COST), variable.low, variable.high)


@dataclass(frozen=True)
class Wave:
    """How half-widths of the angles become a wave of order 40 at a precision weight Q."""

    precision: float = 5.0
    coverage: float = 0.9973
    price: float = 1.0

    @property
    def angles(self) -> Clipped:
        """Cost over the rms of the wave [arcsec] over units and phases: W = sum s_i^2 t_i^2 / 2."""
        return angles_of(self.precision)

    @cached_property
    def curve(self) -> PricedCurve:
        """The same with the factor of the reducers' cost."""
        return replace(self.angles.curve, price=self.price)

    def cost(self, rms: Array) -> Array:
        """Least cost (n,) at an rms of the wave (n,) [arcsec]."""
        return self.curve.cost(rms) + self.price * self.curve.margin

    def rms(self, half_widths: Array) -> Array:
        """Root of W (n,) [arcsec] of half-widths (n, 12) [mrad]."""
        return np.asarray(np.sqrt(half_widths**2 @ self.angles.gain**2))

    def covariance(self, half_widths: Array) -> Array:
        """Covariance (n, 2, 2) [arcmin^2] of the wave's components."""
        plane = plane_of(self.precision)[0]
        return np.asarray(np.einsum("ai,ni,bi->nab", plane, half_widths**2, plane))

    def amplitude(self, half_widths: Array) -> Array:
        """Quantile (n,) [arcsec] of the amplitude at the coverage."""
        radius = radius_quantile(self.covariance(half_widths), self.coverage)
        return np.asarray(60.0 * (radius + plane_of(self.precision)[1]))

    @property
    def base(self) -> float:
        """Amplitude [arcsec] without any error."""
        return 60.0 * plane_of(self.precision)[1]

    @cached_property
    def least(self) -> float:
        """Least quantile of the amplitude, less the base, per rms of the wave."""
        return float(np.sqrt(2.0 * least_ratio(self.coverage)))


SECONDS = ARCSEC / ARCMIN
"""Arcmin in an arcsec."""


RMS, TE = "backlash_rms_arcmin", "te_rms_arcsec"
STEP = 1e-4
"""Relative half-step of the derivatives by a reducer's tolerances."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """A reducer on a drive: the place of its `gear` among those that have separate tolerances;
    its cost, backlash and transmission error as factors of the gear's.
    """

    gear: int
    cost_factor: float = 1.0
    backlash_factor: float = 1.0
    te_factor: float = 1.0


def gear_variables(gears: Mapping[str, Nested], nested: bool) -> tuple[Variable, ...]:
    """Variables of reducers by key: two each where they are nested, else all their tolerances."""
    variables = _rms_variables if nested else _reducer_variables
    return tuple(variable for key, reducer in gears.items() for variable in variables(key, reducer))


def _rms_variables(at: str, reducer: Nested) -> list[Variable]:
    low, high = reducer.range
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


def _reducer_variables(at: str, reducer: Nested) -> list[Variable]:
    problem = reducer.problem
    assert problem is not None
    set_to = problem.settings.variables
    variables = []
    for v in problem.free:
        low, high = set_to[v.name].low, set_to[v.name].high
        assert low is not None and high is not None
        variables.append(
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
    return variables + [
        replace(v, name=f"reducer_{at}_{v.name}", meaning=f"reducer {at}: {v.meaning}", random=False)
        for v in VARIABLES[: len(ANGLES)]
    ]


def _excess(rms: float, reducer: Nested, most: float) -> float:
    """Quantile of the backlash [arcmin] at an rms, above the largest that is allowed."""
    return float(reducer.quantile(np.array([rms]))[0]) - most


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
    """The reducers that have separate columns."""

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
        reducers = tuple(reducer.with_(lost, price) for reducer in gears.values())
        return cls(tuple(gears), reducers, fitted, nested, wave, lost, price)

    @cached_property
    def gear_of(self) -> tuple[int, ...]:
        """The gear of each drive."""
        return tuple(drive.gear for drive in self.fitted)

    @cached_property
    def factors(self) -> Array:
        """Backlash (drives,) as a factor of that of the drive's gear."""
        return np.array([drive.backlash_factor for drive in self.fitted])

    @cached_property
    def te_factors(self) -> Array:
        """Transmission error (drives,) as a factor of that of the drive's gear."""
        return np.array([drive.te_factor for drive in self.fitted])

    @cached_property
    def counts(self) -> Array:
        """Sum of the cost factors of the drives that have each gear."""
        costs = [drive.cost_factor for drive in self.fitted]
        return np.bincount(self.gear_of, costs, len(self.nested)).astype(float)

    @cached_property
    def largest(self) -> Array:
        """Largest factors (2, gears) of backlash and transmission error of the drives that have
        each gear.
        """
        gear_of_drive = np.array(self.gear_of)
        return np.array(
            [
                [factors[gear_of_drive == gear].max() for gear in range(len(self.nested))]
                for factors in (self.factors, self.te_factors)
            ]
        )

    @property
    def dimensions(self) -> int:
        """Independent errors of a unit of every drive."""
        return len(self.fitted) * max((reducer.dimensions for reducer in self.nested), default=0)

    # ---------------------------------------------------------------- columns

    def _free(self, gear: int) -> list[str]:
        problem = self.nested[gear].problem
        assert problem is not None
        return [v.name for v in problem.free]

    def _begin(self, gear: int) -> int:
        if self.small:
            return 2 * gear
        return sum(len(self._free(earlier)) + len(ANGLES) for earlier in range(gear))

    def _designs(self, columns: Array, gear: int) -> Array:
        """Full designs (n, all variables) of a reducer's problem."""
        reducer, begin = self.nested[gear], self._begin(gear)
        if self.small:
            return reducer.designs(columns[:, begin])
        assert reducer.problem is not None
        return reducer.problem.complete(columns[:, begin : begin + len(self._free(gear))])

    def _every(self, columns: Array) -> list[Array]:
        """By gear: full designs (n, all variables) of its problem, or the rms (n, 1) of a front of
        points. Gears with the same reducer are computed together.
        """
        if not self.small:
            return [self._designs(columns, gear) for gear in range(len(self.nested))]
        by_gear: dict[int, Array] = {}
        for gear, reducer in enumerate(self.nested):
            if gear in by_gear:
                continue
            alike = [at for at, other in enumerate(self.nested) if other is reducer]
            rms = np.concatenate([columns[:, self._begin(at)] for at in alike])
            whole = rms[:, None] if reducer.problem is None else reducer.designs(rms)
            by_gear |= dict(zip(alike, np.split(whole, len(alike)), strict=True))
        return [by_gear[gear] for gear in range(len(self.nested))]

    def _half_widths(self, columns: Array, gear: int) -> Array:
        """Half-widths (n, 12) [mrad] of the angles of a reducer."""
        begin = self._begin(gear)
        if self.small:
            return self.wave.angles.allocation(columns[:, begin + 1])
        begin += len(self._free(gear))
        return columns[:, begin : begin + len(ANGLES)]

    def at(self, columns: Array) -> At:
        """Costs and mean squares of columns (n, all of the reducers')."""
        by_gear = [self._of_gear(columns, gear) for gear in range(len(self.nested))]
        if not by_gear:  # every joint is driven directly
            return At(*np.zeros((3, len(columns), 0)))
        return At(*(np.stack(part, axis=1) for part in zip(*by_gear, strict=True)))

    def _of_gear(self, columns: Array, gear: int) -> tuple[Array, Array, Array]:
        reducer, begin = self.nested[gear], self._begin(gear)
        if self.small:
            rms, te = columns[:, begin], columns[:, begin + 1]
            return reducer.cost(rms) + self.wave.cost(te), rms**2, te * SECONDS
        assert reducer.problem is not None and reducer.block is not None
        designs, angles = self._designs(columns, gear), self._half_widths(columns, gear)
        cost = reducer.problem.cost_of(designs) + np.sum(COST / angles, axis=1)
        wave = self.wave.rms(angles) * SECONDS
        return self.price * cost, reducer.block.of_designs(designs), wave

    def amplitudes(self, columns: Array) -> Array:
        """Quantile (n,) [arcsec] of the amplitude of the transmission error of the worst drive."""
        by_gear = [
            self.largest[1, gear] * self.wave.amplitude(self._half_widths(columns, gear))
            for gear in range(len(self.nested))
        ]
        return np.asarray(np.max([np.zeros(len(columns)), *by_gear], axis=0))

    def quantiles(self, columns: Array) -> Array:
        """Quantile (n,) [arcmin] of the backlash of the worst drive."""
        by_gear = [self.largest[0, gear] * self._quantile(columns, gear) for gear in range(len(self.nested))]
        return np.asarray(np.max([np.zeros(len(columns)), *by_gear], axis=0))

    def _quantile(self, columns: Array, gear: int) -> Array:
        reducer = self.nested[gear]
        if self.small or reducer.problem is None:
            return reducer.quantile(columns[:, self._begin(gear)])
        outputs = reducer.problem.outputs_of(self._designs(columns, gear), errors=False)
        return outputs["backlash_arcmin"]

    def rms_of_quantile(self, most: float) -> float:
        """The least rms [arcmin] of any drive at which its quantile is `most` [arcmin]."""
        least = []
        for reducer, factor in zip(self.nested, self.largest[0].tolist(), strict=True):
            low, high = reducer.range
            ends = [_excess(t, reducer, most / factor) for t in (low, high)]
            if ends[0] >= 0.0 or ends[1] <= 0.0:
                least.append(factor * (low if ends[0] >= 0.0 else high))
                continue
            at = scipy.optimize.brentq(_excess, low, high, args=(reducer, most / factor))
            least.append(factor * float(at))
        return float(min(least, default=0.0))

    # ---------------------------------------------------------------- Monte Carlo

    def built(self, columns: Array) -> list[Built]:
        """The reducers that units are built to, by columns (n, all of the reducers')."""
        every = self._every(columns)
        half_widths = [self._half_widths(columns, gear) for gear in range(len(every))]
        roots = [smooth_root(self.wave.covariance(of_gear)) for of_gear in half_widths]
        return [
            Built(tuple(whole[at] for whole in every), np.array([root[at] for root in roots]).reshape(-1, 2, 2))
            for at in range(len(columns))
        ]

    def units(self, built: Built, points: Array) -> tuple[Array, Array, Array]:
        """Backlash with hysteresis (units, drives) [arcmin], the hysteresis (drives,) [arcmin], and
        roots (drives, 2, 2) of the waves' covariance [arcmin], of one design.
        """
        width = points.shape[1] // max(1, len(self.fitted))
        play = []
        for drive, gear in enumerate(self.gear_of):
            reducer = self.nested[gear]
            drive_points = points[:, drive * width : drive * width + reducer.dimensions]
            play.append(reducer.backlashes(built.designs[gear], drive_points))
        lost = self.hysteresis * self.factors
        roots = self.te_factors[:, None, None] * built.roots[list(self.gear_of)]
        return self.factors * np.array(play).reshape(len(play), len(points)).T, lost, roots

    # ---------------------------------------------------------------- derivatives

    def slopes(self, columns: Array, gear: int) -> dict[str, tuple[tuple[Array, Array], Array]]:
        """By variable: derivatives of mean square backlash and wave [arcmin^2], and minus that of
        the cost of one reducer, each (n,). The grade counts by the step to the next finer one.
        """
        begin, reducer = self._begin(gear), self.nested[gear]
        names = [RMS, TE] if self.small else [*self._free(gear), *ANGLES]
        by_variable = {}
        for at, name in enumerate(names):
            value = columns[:, begin + at]
            if self.small and name == RMS:
                derivatives = (2.0 * value, 0.0 * value), -reducer.slope(value)
            elif self.small:
                derivatives = (0.0 * value, 2.0 * value * SECONDS**2), -self.wave.curve.slope(value)
            else:
                derivatives = self._difference(columns, gear, begin + at, name)
            by_variable[f"reducer_{self.keys[gear]}_{name}"] = derivatives
        return by_variable

    def _difference(self, columns: Array, gear: int, at: int, name: str) -> tuple[tuple[Array, Array], Array]:
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
            (high - low) / width for high, low in zip(self._of_gear(up, gear), self._of_gear(down, gear), strict=True)
        )
        mean = 0.5 * (self._of_gear(up, gear)[2] + self._of_gear(down, gear)[2])
        return (square, 2.0 * mean * wave), -cost

    # ---------------------------------------------------------------- from the convex form

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """All variables of the reducers from the rms values of a form's optimum."""
        all_columns = dict(columns)
        if self.small:
            return all_columns
        for gear, reducer in zip(self.keys, self.nested, strict=True):
            rms, te = (all_columns.pop(f"reducer_{gear}_{name}") for name in (RMS, TE))
            assert reducer.problem is not None
            designs = reducer.designs(np.asarray(rms)) if len(rms) else np.empty((0, len(reducer.problem.names)))
            names = (*reducer.problem.names, *ANGLES)
            for name, column in zip(names, (*designs.T, *self.wave.angles.allocation(te).T), strict=True):
                all_columns[f"reducer_{gear}_{name}"] = column
        return all_columns

    def document(self) -> list[float]:
        """The documents' tolerances of all reducers, as columns."""
        tolerances: list[float] = []
        for gear, reducer in enumerate(self.nested):
            assert reducer.problem is not None
            printed = {v.name: float(v.document or 0.0) for v in reducer.problem.variables}
            tolerances += [printed[name] for name in self._free(gear)] + list(DOCUMENT_MRAD.values())
        return tolerances

    @cached_property
    def proven(self) -> bool:
        """Whether the least cost of every reducer is proven."""
        return all(reducer.proven for reducer in self.nested)
