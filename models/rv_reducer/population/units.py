"""The allocation that a population of units is built to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import scipy
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.special import betainc, ndtr, ndtri

from ....errors import refuse
from ....section import Array, Parameter, Value, number
from ....units import ARCMIN, MM, UM
from ...inputs import Distribution, Uniform
from .. import declared
from .. import geometry as involute
from ..contact.geometry import ContactGeometry, Nominal, lever
from ..tighter_planet import TighterPlanet, tighter_planet_law

ERRORS = (
    "pin_circle_radius",
    "pin_position",
    "pin_hole_radius",
    "pin_radius",
    "pitch",
    "runout",
    "eccentricity",
    "equidistance",
    "shift",
    "crank_bearing",
    "circle_offset",
    "bore",
    "crank_phase",
)
"""The errors of a unit, in the order of `gradient.Gradient.tolerances`."""
CRANK_HOLE = "crank_hole"
"""The error of the carrier's holes, which counts where discs are coupled to all of their cranks."""
GEARS = ("sun", "planet")
"""The gears of the involute stage."""


@dataclass(frozen=True, slots=True)
class UnitDesign:
    """Zones and nominal values that units are built to.

    `half_width` by name of the error [um], of `crank_phase` [mrad]; `crank_bearing` is the full
    clearance c of the zone [0, c] [um]. `mid` are mid-limits [um]; those of pin position move all
    pins alike and turn the unit without backlash. `thickness` has the half-width of the zone of the base
    tangent length [um] of each of `GEARS` whose thickness has a tolerance of its own. `stagger` [arcmin]
    is the angle by which discs are turned, alternately ahead and back; `dr_rp`, `dr_p` [m] are the
    modifications. An omitted name is 0.
    """

    half_width: Mapping[str, float]
    mid: Mapping[str, float] = field(default_factory=dict)
    involute_grade: float = 7.0
    thickness: Mapping[str, float] = field(default_factory=dict)
    stagger: float = 0.0
    dr_rp: float = -40e-6
    dr_p: float = -70e-6

    def width(self, error: str) -> float:
        """Half-width (full clearance of `crank_bearing`) of an error."""
        return float(self.half_width.get(error, 0.0))

    def middle(self, error: str) -> float:
        """Mid-limit of an error."""
        return float(self.mid.get(error, 0.0))


# The base sample of a population: standardised errors of every source, drawn once.


PIN_ERRORS = ("pin_position", "pin_hole_radius", "pin_radius")
DISC_ERRORS = ("equidistance", "shift")
ONCE_PER_TURN_ERRORS = ("pitch", "runout")
CARRIER_ERRORS = ("crank_hole_radial", "crank_hole_tangential")
ECCENTRIC_ERRORS = ("eccentricity", "crank_bearing", "crank_phase", "bore_radial", "bore_tangential")


WAVES, WHITE = ("one_wave", "two_waves", "three_waves"), "white"
ONE_WAVE: Mapping[str, float] = {"one_wave": 1.0}
"""Pitch errors of a disc: one wave per turn."""
PITCH_SPECTRUM = Parameter(
    "pitch_spectrum",
    ONE_WAVE,
    "",
    "pitch errors of a disc per half of its cumulative pitch error: amplitudes of one, two and three waves per turn, "
    "and half-width of the uniform errors that differ from tooth to tooth (white)",
    "no document prints it",
    assumed=True,
    choices=(*WAVES, WHITE),
    low=0.0,
    high=1.0,
)


BEARING_PLAY_FACTOR = Parameter(
    "bearing_play_factor",
    1.0,
    "",
    "turn of a disc by the play of its crank bearings along their loads, over that about the disc's centre; "
    "statics of discs with play: 1.12",
    "no document prints it",
    assumed=True,
    low=0.5,
    high=2.0,
)


def pitch_spectrum(parameters: Mapping[str, Value]) -> dict[str, float]:
    """The sizes above 0 of the pitch errors of discs. Raises InputError where there are none."""
    stated: Any = parameters.get(PITCH_SPECTRUM.name, ONE_WAVE)
    if not any(stated.values()):
        raise refuse(
            f"parameters.{PITCH_SPECTRUM.name}",
            f"has no size above 0: state some of {', '.join(PITCH_SPECTRUM.choices)}",
        )
    return {name: size for name, size in stated.items() if size}


@dataclass(frozen=True, slots=True)
class Hierarchy:
    """Dependence between the errors of one unit.

    `share_pins` and `share_discs` are the fractions of variance that the pins, and the discs, of
    one unit have in common; both are assumptions. `inputs` has distributions by name of the error,
    uniform where not named. `pitch_spectrum` has the sizes of pitch errors by the names of `PITCH_SPECTRUM`.
    """

    share_pins: float = 0.0
    share_discs: float = 0.0
    inputs: Mapping[str, Distribution] = field(default_factory=dict)
    pitch_spectrum: Mapping[str, float] = field(default_factory=lambda: ONE_WAVE)

    def of(self, error: str) -> Distribution:
        """Distribution of an error over its zone; both directions of a bore have the same."""
        return self.inputs.get(error.removesuffix("_radial").removesuffix("_tangential"), Uniform())


@dataclass(frozen=True, slots=True, eq=False)
class BaseSample:
    """Standardised errors of n units: error = mid-limit + half-width z.

    `z` by name of the error, units last: (n,) of errors of the whole unit, (pins, n) of pins,
    (discs, n) of discs, (cranks, discs, n) of eccentrics and bores, (cranks, n) of the carrier's holes; `phase` [rad]
    likewise of `pitch`, `runout` (discs, n) and `circle_offset` (n,). `teeth` (discs, teeth, n) are the errors of
    teeth per half of the cumulative pitch error, None for one wave per turn. `planets` (planets + 1, n) are standard
    normal: the common part of all planets, then the part of each planet. `hierarchy` has the laws
    that the errors were drawn from.
    """

    units: int
    z: Mapping[str, Array]
    phase: Mapping[str, Array]
    planets: Array
    hierarchy: Hierarchy = field(default_factory=Hierarchy)
    teeth: Array | None = None

    @classmethod
    def draw(
        cls,
        geometry: ContactGeometry,
        units: int,
        rng: np.random.Generator,
        hierarchy: Hierarchy | None = None,
        kind: Literal["sobol", "random"] = "sobol",
        holes: bool = False,
    ) -> BaseSample:
        """A sample of `units`; sources common to a unit take the first Sobol dimensions. `holes`: whether the carrier's
        crank holes are out of place too.
        """
        laws = hierarchy or Hierarchy()
        source = _Source(geometry, units, rng, kind, holes)
        z = {"pin_circle_radius": laws.of("pin_circle_radius").quantile(source.unit())}
        z["circle_offset"] = laws.of("circle_offset").quantile(source.unit())
        phase = {"circle_offset": 2.0 * np.pi * source.unit()}
        discs, pins = (geometry.discs,), (geometry.pins,)
        common = {
            name: ndtri(source.unit())
            for names, fraction in ((DISC_ERRORS, laws.share_discs), (PIN_ERRORS, laws.share_pins))
            for name in names
            if fraction > 0.0
        }
        for name in DISC_ERRORS:
            u = _couple_by_copula(source.of(discs), common.get(name), laws.share_discs)
            z[name] = laws.of(name).quantile(u)
        for name in ONCE_PER_TURN_ERRORS:
            z[name] = laws.of(name).quantile(source.of(discs))
            phase[name] = 2.0 * np.pi * source.of(discs)
        for name in ECCENTRIC_ERRORS:
            z[name] = laws.of(name).quantile(source.of((geometry.cranks, geometry.discs)))
        planets = ndtri(source.of((geometry.cranks + 1,)))
        for name in PIN_ERRORS:
            u = _couple_by_copula(source.of(pins), common.get(name), laws.share_pins)
            z[name] = laws.of(name).quantile(u)
        for name in CARRIER_ERRORS if holes else ():
            z[name] = laws.of(name).quantile(source.of((geometry.cranks,)))
        teeth = None
        if laws.pitch_spectrum != ONE_WAVE:
            teeth = draw_teeth(laws.pitch_spectrum, geometry.nominal.cycloid_teeth, phase["pitch"], rng)
        return cls(units, z, phase, planets, laws, teeth)

    def part(self, chosen: slice | NDArray[np.int64]) -> BaseSample:
        """Some of the units."""
        z = {name: value[..., chosen] for name, value in self.z.items()}
        phase = {name: value[..., chosen] for name, value in self.phase.items()}
        planets = self.planets[..., chosen]
        teeth = None if self.teeth is None else self.teeth[..., chosen]
        return BaseSample(planets.shape[-1], z, phase, planets, self.hierarchy, teeth)


def draw_teeth(sizes: Mapping[str, float], count: int, phase: Array, rng: np.random.Generator) -> Array:
    """Errors (discs, count, n) of the teeth of discs, in sizes by the names of `PITCH_SPECTRUM`.

    One wave per turn has the `phase` (discs, n) [rad], further ones a random phase each.
    """
    angle = 2.0 * np.pi * np.arange(count)[:, None] / count
    errors = np.zeros((len(phase), count, phase.shape[-1]))
    for waves, name in enumerate(WAVES, 1):
        if name in sizes:
            start = phase if waves == 1 else 2.0 * np.pi * rng.random(phase.shape)
            errors += sizes[name] * np.cos(waves * angle - start[:, None])
    return errors + sizes[WHITE] * rng.uniform(-1.0, 1.0, errors.shape) if WHITE in sizes else errors


def _couple_by_copula(u: Array, common: Array | None, fraction: float) -> Array:
    """Probabilities coupled by a Gaussian copula with a `fraction` of common variance."""
    if common is None:
        return u
    return np.asarray(ndtr(np.sqrt(fraction) * common + np.sqrt(1.0 - fraction) * ndtri(u)))


class _Source:
    """Probabilities in (0, 1), dimension after dimension."""

    def __init__(self, geometry: ContactGeometry, units: int, rng: np.random.Generator, kind: str, holes: bool) -> None:
        most = 10 + 3 * geometry.pins + 8 * geometry.discs
        most += 6 * geometry.cranks * geometry.discs + geometry.cranks
        most += geometry.cranks if holes and geometry.discs == 1 else 0  # of more discs, the rest is enough for holes
        if kind == "sobol":
            power = max(0, int(units - 1).bit_length())
            drawn = scipy.stats.qmc.Sobol(most, scramble=True, rng=rng).random_base2(power)[:units]
        else:
            drawn = rng.random((units, most))
        tiny = 1e-12
        self._probabilities = np.clip(drawn.T, tiny, 1.0 - tiny)
        self._at = 0

    def unit(self) -> Array:
        """Probabilities (n,) of the next dimension."""
        return np.asarray(self.of((1,))[0])

    def of(self, shape: tuple[int, ...]) -> Array:
        """Probabilities (*shape, n) of the next dimensions."""
        size = int(np.prod(shape))
        drawn = self._probabilities[self._at : self._at + size]
        self._at += size
        return np.asarray(drawn.reshape(*shape, -1))


# Statistics over units of a sample in which the involute stage is integrated exactly.
#
# The backlash of a unit is phi_1 + Y, independent, with Y known for every unit of the sample and the
# distribution of phi_1 known: P(phi_1 + Y <= v) = mean_i H((v - Y_i - m)/s). That is smooth in every
# tolerance and scatters by a quarter of the scatter of an order statistic.


SMOOTHING = 0.01
"""Scale [arcmin] at which a stage without backlash is smoothed, far below that of any unit."""
STILL = 1e-9
"""Growth [arcmin] with a standardised error below which a value does not move with it."""
NODES = 8193
"""Nodes of the table of a law, evenly over its support and as many evenly by probability: errors
below 1e-7."""


@lru_cache(maxsize=16)
def _table(law: Distribution) -> tuple[Array, Array, Array]:
    """Nodes over the support of a law, its averaged distribution and density, 0 at the ends."""
    low, high = law.support
    evenly = np.linspace(low - law.grain, high + law.grain, NODES)
    nodes = np.unique(np.concatenate([evenly, law.quantile(np.linspace(1e-9, 1.0 - 1e-9, NODES))]))
    below, density = law.averaged(nodes)
    below[[0, -1]], density[[0, -1]] = (0.0, 1.0), 0.0
    return nodes, below, density


def law_below(law: Distribution, z: Array) -> Array:
    """P(Z <= z) of a law averaged over its grain, shape of `z`, between the nodes of a table."""
    nodes, below, _ = _table(law)
    return np.asarray(np.interp(z, nodes, below))


def law_density(law: Distribution, z: Array) -> Array:
    """Derivative of `law_below`, shape of `z`."""
    nodes, _, density = _table(law)
    return np.asarray(np.interp(z, nodes, density))


@dataclass(frozen=True, slots=True)
class Involute:
    """phi_1 = middle + half z over units [arcmin], z the standardised clearance of a unit, with the
    law `planet` of that of its tighter planet.

    `half` is 0 for a reducer without involute stage: a quantile is smoothed by `SMOOTHING`.
    """

    middle: float
    half: float
    planet: Distribution

    @property
    def mean(self) -> float:
        """Mean of phi_1 [arcmin]."""
        return self.middle + self.half * float(self.planet.raw_moments(1)[1])

    @property
    def variance(self) -> float:
        """Variance of phi_1 [arcmin^2]."""
        _, first, second = self.planet.raw_moments(2)
        return float(self.half**2 * (second - first**2))

    def cdf(self, excess: Array) -> Array:
        """P(phi_1 <= excess) of [arcmin], smoothed where the stage has no backlash."""
        if self.half == 0.0:
            return np.asarray(ndtr((excess - self.middle) / SMOOTHING))
        return law_below(self.planet, (excess - self.middle) / self.half)

    def density(self, excess: Array) -> Array:
        """Derivative of `cdf` [1/arcmin]."""
        if self.half == 0.0:
            z = (excess - self.middle) / SMOOTHING
            return np.asarray(np.exp(-0.5 * z * z) / (np.sqrt(2.0 * np.pi) * SMOOTHING))
        return law_density(self.planet, (excess - self.middle) / self.half) / self.half

    @property
    def variation(self) -> float:
        """Total variation of the density of `cdf` [1/arcmin], which rises from 0 and falls to 0."""
        if self.half == 0.0:
            return 2.0 * float(self.density(np.array(self.middle)))
        nodes, below, _ = _table(self.planet)
        density = np.diff(below) / np.diff(nodes) / self.half
        return float(np.abs(np.diff(density, prepend=0.0, append=0.0)).sum())

    def ends(self) -> tuple[float, float]:
        """Least and largest phi_1 [arcmin]."""
        if self.half == 0.0:
            return self.middle - 8.0 * SMOOTHING, self.middle + 8.0 * SMOOTHING
        nodes = _table(self.planet)[0]
        return self.middle + self.half * float(nodes[0]), self.middle + self.half * float(nodes[-1])


NO_STAGE = Involute(0.0, 0.0, Uniform())
"""No involute stage at all."""


@dataclass(frozen=True, slots=True, eq=False)
class Statistic:
    """A statistic over units with its derivatives.

    `weight` (n,) is its derivative by the value of each unit, `by_involute` [1/(fraction of phi_1)]
    that by the size of phi_1, ln(middle) = ln(half), `by_zone` that by the size ln(t) of the zone
    whose error a unit is integrated over; `error` is the standard error of a sample of independent
    units, which a Sobol sample stays below.
    """

    value: float
    weight: Array
    by_involute: float
    error: float
    by_zone: float = 0.0


def quantile(values: Array, involute: Involute, coverage: float) -> Statistic:
    """One-sided quantile at `coverage` of phi_1 + Y, `values` (n,) of Y [arcmin]."""
    count, (least, most) = len(values), involute.ends()
    enough = min(int(np.ceil(coverage * count)), count) - 1  # below the sum of its Y and the least phi_1 are too few
    middle = float(np.partition(values, enough)[enough])
    low, high = middle + least, float(values.max()) + most
    open_units = values > low - most  # all others lie within any candidate
    undecided, within = values[open_units], count - int(np.count_nonzero(open_units))
    at = middle + involute.mean
    for _ in range(200):
        below = involute.cdf(at - undecided)
        fraction = (within + float(below.sum())) / count
        low, high = (at, high) if fraction < coverage else (low, at)
        slope = float(involute.density(at - undecided).sum()) / count
        ahead = at - (fraction - coverage) / slope if slope > 0.0 else low
        ahead = ahead if low < ahead < high else 0.5 * (low + high)
        if abs(ahead - at) <= 1e-12 * max(1.0, abs(at)):
            break
        at = ahead
    density = involute.density(at - undecided)
    total = max(float(density.sum()), 1e-300)
    weight = np.zeros(count)
    weight[open_units] = density / total
    below = involute.cdf(at - undecided)
    variance = (np.sum((below - coverage) ** 2) + within * (1.0 - coverage) ** 2) / count
    error = float(np.sqrt(variance)) / (total / count) / np.sqrt(count)
    return Statistic(at, weight, float(np.sum(weight * (at - values))), error)


def mean(values: Array, involute: Involute) -> Statistic:
    """Mean of phi_1 + Y."""
    count = len(values)
    error = np.sqrt((float(np.var(values)) + involute.variance) / count)
    return Statistic(float(np.mean(values)) + involute.mean, np.full(count, 1.0 / count), involute.mean, error)


def deviation(values: Array, involute: Involute) -> Statistic:
    """Standard deviation of phi_1 + Y."""
    count, centred = len(values), values - np.mean(values)
    value = float(np.sqrt(np.mean(centred**2) + involute.variance))
    safe = max(value, 1e-300)
    fourth = float(np.mean(centred**4))
    error = np.sqrt(max(fourth - np.mean(centred**2) ** 2, 0.0) / count) / (2.0 * safe)
    return Statistic(value, centred / (count * safe), involute.variance / safe, float(error))


def share_within(values: Array, involute: Involute, limit: float) -> Statistic:
    """P(phi_1 + Y <= limit)."""
    within, density = involute.cdf(limit - values), involute.density(limit - values)
    count = len(values)
    return Statistic(
        float(np.mean(within)),
        -density / count,
        -float(np.mean(density * (limit - values))),
        float(np.std(within)) / np.sqrt(count),
    )


def ordered_quantile(values: Array, coverage: float) -> Statistic:
    """Quantile of `values` (n,) themselves (Harrell & Davis 1982): smooth in each of them."""
    count = len(values)
    a, b = coverage * (count + 1.0), (1.0 - coverage) * (count + 1.0)
    edges = betainc(a, b, np.linspace(0.0, 1.0, count + 1))
    weight = np.empty(count)
    order = np.argsort(values, kind="stable")
    weight[order] = np.diff(edges)
    value = float(weight @ values)
    error = float(np.sqrt(weight @ (values - value) ** 2))
    return Statistic(value, weight, 0.0, error)


def share_below(values: Array, limit: float, growth: Array, z: Array, law: Distribution) -> Statistic:
    """P(Y < limit), each unit integrated over its standardised error z, which has the `law`.

    Y of unit i grows by `growth` (n,) per unit of `z` (n,): with u_i the z at which it would meet
    the limit, its probability is P(z < u_i), P(z > u_i) where it falls, and 0 or 1 where it stays.
    """
    steep = np.abs(growth)
    moves = steep > STILL
    meets = z + (limit - values) / np.where(moves, growth, 1.0)
    probability = law_below(law, meets)
    below = np.where(moves, np.where(growth > 0.0, probability, 1.0 - probability), values < limit)
    count = len(values)
    weight = np.where(moves, -law_density(law, meets) / np.where(moves, steep, 1.0), 0.0) / count
    error = float(np.std(below)) / np.sqrt(count)
    by_zone = float(np.sum(weight * (limit - values)))
    return Statistic(float(np.mean(below)), weight, 0.0, error, by_zone)


def share_above(values: Array, limit: float) -> Statistic:
    """P(Y > limit) with a normal kernel of Silverman's width, so that it has derivatives."""
    count, spread = len(values), max(float(np.std(values)), 1e-12)
    width = 0.9 * spread * count**-0.2
    z = (values - limit) / width
    above, density = ndtr(z), np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
    by_width = -float(np.mean(density * z)) / spread  # the width grows with the spread
    by_spread = (values - np.mean(values)) / (count * spread)
    weight = density / (width * count) + by_width * by_spread
    error = float(np.std(above)) / np.sqrt(count)
    return Statistic(float(np.mean(above)), weight, 0.0, error)


# The properties that all units of an RV reducer have in common, and their construction.


@dataclass(frozen=True, slots=True)
class Coupling:
    """How discs sit on all of their cranks at once.

    `stiffness` [N/m] is that of a crank bearing beyond its clearance, `torque` [N m] that on a disc at which backlash
    is read. Both are assumptions.
    """

    stiffness: float
    torque: float


def stem(name: str) -> str:
    """Name of the error that a variable is the zone of."""
    return name.removesuffix("_um").removesuffix("_mrad")


@dataclass(frozen=True, slots=True, eq=False)
class UnitBasis:
    """Geometry, involute stage, hierarchy of errors and mid-limits [um] of all units.

    `planet` is the law of the standardised clearance of the tighter planet, whose planets have
    `planet_share` of their variance in common. Where there is no involute stage (`geared` false)
    phi_1 is 0. `allowances` [um] are the magnitudes |Es_s| of gears whose thickness has a tolerance of its own.
    """

    geometry: ContactGeometry
    stage: involute.InvoluteStage
    hierarchy: Hierarchy
    planet: Distribution
    planet_share: float
    mid: Mapping[str, float]
    geared: bool
    allowances: Mapping[str, float]
    coupling: Coupling | None
    """None: discs turn about their centres by the mean play of their bearings."""
    coupled_planets: bool
    """Whether planets are coupled through their cranks; else the tighter one holds all of these."""

    @classmethod
    def from_parameters(
        cls, parameters: Mapping[str, Value], inputs: Mapping[str, Distribution], mids: Mapping[str, float]
    ) -> UnitBasis:
        """The basis of complete parameters; `inputs` and `mids` [um] by name of the error.

        `mids` take the place of those in `parameters`.
        """
        base = declared.backlash_model(parameters, None, {})
        mid = {name: number(parameters.get(f"{name}_mid_um", 0.0)) for name in ERRORS}
        mid |= dict(mids)
        mid["pin_position"] = 0.0  # it turns the unit
        cranks = int(number(parameters["cranks"]))
        geometry = ContactGeometry(
            nominal=base.geometry,
            discs=int(number(parameters["discs"])),
            cranks=cranks,
            true_levers=True,
            involute_stage=bool(parameters["involute_stage"]),
            play_factor=number(parameters.get(BEARING_PLAY_FACTOR.name, 1.0)),
        )
        coupling = coupling_of(parameters, geometry)
        shares = number(parameters["share_pins"]), number(parameters["share_discs"])
        hierarchy = Hierarchy(*shares, inputs, pitch_spectrum(parameters))
        planet_share = number(parameters.get("planet_share", 0.5))
        return cls(
            geometry,
            base.stage,
            hierarchy,
            tighter_planet_law(hierarchy.of("involute_grade"), TighterPlanet(cranks, planet_share)),
            planet_share,
            mid,
            bool(parameters["involute_stage"]),
            {gear: number(parameters.get(f"thickness_allowance_{gear}_um", 0.0)) for gear in GEARS},
            coupling,
            bool(parameters.get("planet_coupling", False)),
        )

    def involute(self, grade: float, thickness: Mapping[str, float] = MappingProxyType({})) -> Involute:
        """phi_1 of units at an ISO grade [arcmin]; `thickness` as of `UnitDesign`."""
        if thickness:
            ends = self.flank_clearances(np.array(float(grade)), thickness)
            unit = 1.0 / involute.lever(self.stage, self.geometry.nominal) / ARCMIN
            least, most = (float(end) * unit for end in ends)
            return Involute(0.5 * (most + least), 0.5 * (most - least), self.planet)
        middle, half = involute.backlash_zone(self.stage, self.geometry.nominal, np.array(float(grade)))
        unit = 1.0 / ARCMIN if self.geared else 0.0
        return Involute(float(middle) * unit, float(half) * unit, self.planet)

    def flank_clearances(self, grade: Array, thickness: Mapping[str, Array | float]) -> tuple[Array, Array]:
        """j_nmin and j_nmax [m] of a pair of gears at ISO grades; `thickness` as of `UnitDesign`."""
        zones = [
            (self.allowances[gear] * UM, (self.allowances[gear] + 2.0 * thickness[gear]) * UM)
            if gear in thickness
            else None
            for gear in GEARS
        ]
        return involute.clearance_limits(self.stage, grade, zones)

    def clearances(self, planets: Array) -> Array:
        """Standardised clearances (planets, n), of normal numbers (planets + 1, n)."""
        share = self.planet_share
        scores = np.sqrt(share) * planets[0] + np.sqrt(1.0 - share) * planets[1:]
        return self.hierarchy.of("involute_grade").quantile(ndtr(scores))

    def tightest(self, planets: Array) -> Array:
        """Standardised clearance (n,) of the tighter planet."""
        return np.asarray(self.clearances(planets).min(axis=0))

    def design(self, row: Mapping[str, float], means: Mapping[str, float] = MappingProxyType({})) -> UnitDesign:
        """The design of one row of variables by name, in their units.

        `means` [um] are the deviations of the means of errors from their mid-limits; that of the
        position of the pins turns the unit.
        """
        mids = {name: self.mid.get(name, 0.0) + mean for name, mean in means.items() if name != "pin_position"}
        return UnitDesign(
            half_width={
                error: row[name]
                for error in (*ERRORS, CRANK_HOLE)
                for name in (f"{error}_um", f"{error}_mrad")
                if name in row
            },
            mid={**self.mid, **mids},
            involute_grade=row["involute_grade"],
            thickness={gear: row[name] for gear in GEARS if (name := f"thickness_{gear}_um") in row},
            stagger=row["stagger_arcmin"],
            dr_rp=row["dr_rp_mm"] * MM,
            dr_p=row["dr_p_mm"] * MM,
        )


def coupling_of(parameters: Mapping[str, Value], geometry: ContactGeometry) -> Coupling | None:
    """The coupling of discs to their cranks, None without. A stiffness of 0 makes that of the disc on its cranks."""
    if not parameters.get("over_constraint", False):
        return None
    series = number(parameters["series_stiffness_Nm_per_arcmin"]) / ARCMIN
    of_series = series / (geometry.cranks * geometry.nominal.centre_distance**2)
    stated = number(parameters["crank_bearing_stiffness_N_per_mm"]) / MM
    return Coupling(stated or of_series, number(parameters["measuring_torque_Nm"]))


# The nominal profile at many contacts, as a polynomial in the shift modification.
#
# Distance, normal and lever arm are smooth in the phase of a pin and in the modification: they are
# computed at Chebyshev nodes of both, and a table at any modification is a short sum. Towards the
# bottom of a tooth space the curve bends ever more sharply, the more so the closer k1 comes to 1, and
# the polynomial follows it less well: nodes are doubled until distances are right within `ACCURACY`.
# For the RV-40E (k1 = 0.81) they are within 5 nm below 6 degrees of phase, 0.1 nm from 10 degrees and
# 1e-5 nm from 30 degrees, where backlash is closed; for k1 = 0.975 the most nodes leave 0.1 um below
# a degree and 0.1 nm from 10 degrees.


LEAST_LEVER = 0.3
"""Fraction of the largest lever arm below which pins are omitted: they close no backlash."""
PHASES, SHIFTS = 96, 9
"""Chebyshev nodes over the phase, and over the shift modification, where they are enough."""
DOUBLED = 2
"""Largest number of times the nodes are doubled."""
ACCURACY = 10e-9
"""Error [m] of distances from the curve below which nodes are enough."""
PHASES_AT_ONCE = 4096
"""Phases whose weights of interpolation are in memory at once: 3 MB."""
RANGE = (-150e-6, 30e-6)
"""Shift modifications [m] that one polynomial covers; another polynomial is made for others."""


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Distance from the curve [m], normal's radial and tangential part, and lever arm [m].

    `phase` [rad] (contacts,) are magnitudes of phases, `coefficients` (nodes, 4, contacts) those
    of Chebyshev polynomials over the `shifts` [m], for the equidistance modification 0, and
    `derivative` of the same shape those of their derivatives by the shift [1/m].
    """

    geometry: ContactGeometry
    phase: Array
    shifts: tuple[float, float]
    coefficients: Array
    derivative: Array

    @classmethod
    def of(cls, geometry: ContactGeometry, phase: Array, shifts: tuple[float, float] = RANGE) -> Profile:
        """The profile at phases within those of pins whose lever arms count."""
        nodes, table = _profile_table(geometry, contact_phases(geometry), shifts)
        count = table.shape[1]
        columns = table.reshape(len(nodes), 4 * count)
        blocks = np.array_split(phase, 1 + len(phase) // PHASES_AT_ONCE)
        values = np.concatenate([_interpolation(nodes, block) @ columns for block in blocks])
        basis = chebyshev.chebvander(_nodes(count), count - 1)
        coefficients = np.linalg.solve(basis, values.T.reshape(count, 4 * len(phase)))
        wide = np.asarray(coefficients.reshape(count, 4, len(phase)), dtype=np.float64)
        derivative = np.zeros_like(wide)
        derivative[:-1] = chebyshev.chebder(wide) * (2.0 / (shifts[1] - shifts[0]))
        return cls(geometry, phase, shifts, wide, derivative)

    def at(self, shift: float) -> tuple[Array, Array]:
        """Values and derivatives by the shift [1/m], each (4, contacts)."""
        low, high = self.shifts
        if not low <= shift <= high:
            half = 0.5 * (high - low)
            return Profile.of(self.geometry, self.phase, (shift - half, shift + half)).at(shift)
        basis = chebyshev.chebvander((2.0 * shift - low - high) / (high - low), len(self.coefficients) - 1)[0]
        values, slopes = (np.einsum("k,kic->ic", basis, series) for series in (self.coefficients, self.derivative))
        return values, slopes


@lru_cache(maxsize=16)
def _profile_table(
    geometry: ContactGeometry, phases: tuple[float, float], shifts: tuple[float, float]
) -> tuple[Array, Array]:
    """Phases (n,) and the profile (n, shifts, 4) at Chebyshev nodes, as many as are needed."""
    count, across = PHASES, SHIFTS
    for _ in range(DOUBLED):
        nodes, table = _tabulate_at_nodes(geometry, phases, shifts, count, across)
        if _error(geometry, nodes, table, phases, shifts) <= ACCURACY:
            return nodes, table
        count, across = 2 * count, 2 * across - 1
    return _tabulate_at_nodes(geometry, phases, shifts, count, across)


def _tabulate_at_nodes(
    geometry: ContactGeometry, phases: tuple[float, float], shifts: tuple[float, float], count: int, across: int
) -> tuple[Array, Array]:
    nodes, modified = _points_of_interval(phases, _nodes(count)[::-1]), _points_of_interval(shifts, _nodes(across))
    return nodes, np.stack([_distance_columns(geometry, nodes, float(shift)) for shift in modified], axis=1)


def _error(
    geometry: ContactGeometry, nodes: Array, table: Array, phases: tuple[float, float], shifts: tuple[float, float]
) -> float:
    """Largest error of the distance [m] midway between nodes, in the middle and near both ends."""
    at = _points_of_interval(phases, np.cos(np.pi * np.arange(1, len(nodes)) / len(nodes)))
    count = table.shape[1]
    along = _interpolation(nodes, at) @ table[:, :, 0]
    errors = []
    for x in np.cos(np.pi * np.array([1, count // 2, count - 1]) / count):
        weights = np.linalg.solve(
            chebyshev.chebvander(_nodes(count), count - 1).T, chebyshev.chebvander(np.array([x]), count - 1)[0]
        )
        exact = _distance_columns(geometry, at, float(_points_of_interval(shifts, x)))[:, 0]
        errors.append(float(np.max(np.abs(along @ weights - exact))))
    return max(errors)


def _points_of_interval(ends: tuple[float, float], x: Array) -> Array:
    """Points of an interval by their place x in [-1, 1]."""
    return np.asarray(0.5 * (ends[0] + ends[1]) + 0.5 * (ends[1] - ends[0]) * x)


def _distance_columns(geometry: ContactGeometry, phase: Array, shift: float) -> Array:
    nominal = Nominal.at(replace(geometry, dr_rp=0.0, dr_p=shift), phase)
    columns = [nominal.gap, nominal.normal.real, nominal.normal.imag, nominal.lever]
    return np.stack(columns, axis=1)


def _nodes(count: int) -> Array:
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def contact_phases(geometry: ContactGeometry) -> tuple[float, float]:
    """Phases [rad] between which lever arms count."""
    phase = np.linspace(0.0, np.pi, 20_001)
    counted = phase[lever(geometry, phase) / geometry.nominal.lever >= LEAST_LEVER]
    step = phase[1]
    return max(float(counted[0]) - step, 0.5 * step), float(counted[-1]) + step


def _interpolation(nodes: Array, at: Array) -> Array:
    """Barycentric weights (points, nodes) of Chebyshev interpolation."""
    count = len(nodes)
    node_weights = np.sin(np.pi * (np.arange(count) + 0.5) / count) * (-1.0) ** np.arange(count)
    away = at[:, None] - nodes
    on = np.abs(away) < 1e-14
    weights = node_weights / np.where(on, 1.0, away)
    weights /= weights.sum(axis=1, keepdims=True)
    rows = on.any(axis=1)
    weights[rows] = on[rows]
    return np.asarray(weights)
