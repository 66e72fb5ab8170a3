"""The tighter of several planets: the least of clearances that share a common cause."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from ...section import Array
from ..inputs import Distribution, Uniform
from .cycloid import LINEAR_ERRORS, EccentricityLaw, coefficients
from .geometry import RvGeometry

UNIFORM = Uniform()
REACH = 37.0
"""Range of y = 2 artanh z in the table: at its ends 1 - |z| is 2e-16."""
CELLS = 6144
WIDTH = 2.0 * REACH / CELLS
FIRST = -float(np.tanh(0.5 * REACH))
ROWS = 2048
"""Values of y whose quadrature is in memory at once: 6 MB."""
COMMON = np.linspace(-9.0, 9.0, 361)
"""Nodes of the common cause [standard deviations]; the trapezoidal rule is exact to rounding."""
COMMON_WEIGHTS = np.exp(-0.5 * COMMON**2) / np.sum(np.exp(-0.5 * COMMON**2))


@dataclass(frozen=True, slots=True)
class TighterPlanet(Distribution):
    """z = min_k z_k with z_k = 2 Phi(sqrt(r) g_0 + sqrt(1 - r) g_k) - 1, g standard normal.

    Each z_k is uniform on [-1, 1]; the `planets` K have the fraction r = `share` of the variance of
    their normal scores in common, because all of them mesh with the same sun. With
    x = Phi^-1((1 + z)/2) the density is f(z) = (K/2) E[Phi(sqrt(r) h - sqrt(1 - r) x)^(K - 1)], h
    standard normal. It is uniform for one planet and for r = 1, and (K/2) ((1 - z)/2)^(K - 1) for
    r = 0.

    The integrals of f are tabulated once for each pair of parameters and interpolated, at some
    20 ns a point: `cdf`, `density` and `partial_moments` are right to 1e-10, for twelve planets to
    3e-10. The defaults, two planets and r = 1/2, are assumptions.
    """

    planets: int = field(default=2, metadata={"low": 1, "high": 12})
    share: float = field(default=0.5, metadata={"low": 0.0, "high": 1.0})

    @property
    def support(self) -> tuple[float, float]:
        return -1.0, 1.0

    def raw_moments(self, order: int) -> Array:
        if self.is_single:
            return UNIFORM.raw_moments(order)
        return np.array(raw_moments(self, UNIFORM, order))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        if self.is_single:
            return UNIFORM.partial_moments(z)
        return partial_moments(self, UNIFORM, z)

    def cdf(self, z: Array) -> Array:
        """P(Z <= z), shape of `z`."""
        if self.is_single:
            return UNIFORM.partial_moments(z)[0]
        return _cubic(_moments(self, UNIFORM)[0], *_place(z))

    def density(self, z: Array) -> Array:
        """f(z), shape of `z`; 0 outside of the zone."""
        inside = np.abs(z) <= 1.0
        if self.is_single:
            return np.where(inside, 0.5, 0.0)
        return np.where(inside, _cubic(_densities(self), *_place(z)), 0.0)

    def quantile(self, probability: Array) -> Array:
        if self.is_single:
            return UNIFORM.quantile(probability)
        return _inverse(_moments(self, UNIFORM)[0], np.asarray(probability, dtype=float))

    @property
    def is_single(self) -> bool:
        """Whether the least clearance has the law of a single planet."""
        return self.planets == 1 or self.share == 1.0


@lru_cache(maxsize=128)
def raw_moments(law: TighterPlanet, planet: Distribution, order: int) -> tuple[float, ...]:
    """E[v^k], k = 0 .. order, of the least v = Q((1 + z)/2), Q the quantiles of each `planet`."""
    y, mass = _nodes(law)
    values = _values(y, planet)
    return tuple(float(np.sum(mass * values**k)) for k in range(order + 1))


def partial_moments(law: TighterPlanet, planet: Distribution, z: Array) -> tuple[Array, Array, Array]:
    """E[v^k; v <= Q((1 + z)/2)], k = 0, 1, 2, of that v, each of the shape of `z`."""
    cell, part = _place(z)
    mass, first, second = (_cubic(c, cell, part) for c in _moments(law, planet))
    return mass, first, second


def _place(z: Array) -> tuple[NDArray[np.intp], Array]:
    """Cell of each z and the fraction of that cell which lies below it."""
    y = 2.0 * np.arctanh(np.clip(z, FIRST, -FIRST))
    at = (y + REACH) / WIDTH
    cell = np.clip(at.astype(np.intp), 0, CELLS - 1)
    return cell, at - cell


def _cubic(c: Array, cell: NDArray[np.intp], part: Array) -> Array:
    """The cubic of each cell at the fraction `part` of it, shape of `cell`."""
    value = ((c[3][cell] * part + c[2][cell]) * part + c[1][cell]) * part + c[0][cell]
    return np.asarray(value)


def _inverse(c: Array, probability: Array) -> Array:
    """z of each probability: its cell by search, then Newton steps on the cubic of that cell."""
    cell = np.clip(np.searchsorted(c[0], probability, side="right") - 1, 0, CELLS - 1)
    part = np.full(cell.shape, 0.5)
    for _ in range(5):
        slope = (3.0 * c[3][cell] * part + 2.0 * c[2][cell]) * part + c[1][cell]
        step = (_cubic(c, cell, part) - probability) / np.maximum(slope, 1e-300)
        part = np.clip(part - step, 0.0, 1.0)
    z = np.tanh(0.5 * ((cell + part) * WIDTH - REACH))
    return np.where(probability <= 0.0, -1.0, np.where(probability >= 1.0, 1.0, z))


def _density(y: Array, law: TighterPlanet) -> Array:
    """f(z) at z = tanh(y/2), shape of `y`, by quadrature over the common cause."""
    score = -np.sign(y) * ndtri(1.0 / (1.0 + np.exp(np.abs(y))))  # from the nearer limit
    flat = np.empty(y.size)
    for rows in np.array_split(np.arange(y.size), 1 + y.size // ROWS):
        scaled = np.sqrt(1.0 - law.share) * score.ravel()[rows, None]
        others = ndtr(np.sqrt(law.share) * COMMON - scaled) ** (law.planets - 1)
        flat[rows] = others @ COMMON_WEIGHTS
    return 0.5 * law.planets * flat.reshape(y.shape)


def _slope(y: Array) -> Array:
    """dz/dy of z = tanh(y/2)."""
    return np.asarray(0.5 / np.cosh(0.5 * y) ** 2)


def _values(y: Array, planet: Distribution) -> Array:
    """v = Q((1 + z)/2) at z = tanh(y/2), shape of `y`."""
    z = np.tanh(0.5 * y)
    if isinstance(planet, Uniform):
        return z
    return planet.quantile(np.clip(0.5 * (1.0 + z), 1e-16, 1.0 - 1.2e-16))


@lru_cache(maxsize=32)
def _nodes(law: TighterPlanet) -> tuple[Array, Array]:
    """Values of y and their probabilities, each (4 CELLS,): Gauss-Legendre in each cell."""
    point, weight = np.polynomial.legendre.leggauss(4)
    y = -REACH + WIDTH * (np.arange(CELLS)[:, None] + 0.5 * (1.0 + point))
    mass = _density(y, law) * _slope(y) * 0.5 * WIDTH * weight
    return y.ravel(), mass.ravel() / np.sum(mass)


@lru_cache(maxsize=32)
def _moments(law: TighterPlanet, planet: Distribution) -> Array:
    """Cubics (3, 4, CELLS) in the fraction of a cell: partial moment, power, cell."""
    y, mass = _nodes(law)
    ends = np.linspace(-REACH, REACH, CELLS + 1)
    tangent = WIDTH * _density(ends, law) * _slope(ends)
    values, at = _values(y, planet), _values(ends, planet)
    steps = [(mass * values**k).reshape(CELLS, 4).sum(axis=1) for k in range(3)]
    return np.array([_hermite(step, tangent * at**k) for k, step in enumerate(steps)])


@lru_cache(maxsize=32)
def _densities(law: TighterPlanet) -> Array:
    """Cubics (4, CELLS) of f(z): a spline through its values at the ends of the cells."""
    density = _density(np.linspace(-REACH, REACH, CELLS + 1), law)
    return np.ascontiguousarray(scipy.interpolate.CubicSpline(np.arange(CELLS + 1), density).c[::-1])


def _hermite(rise: Array, tangent: Array) -> Array:
    """Cubics (4, CELLS) that start at 0, rise by `rise` a cell, with the slopes at its ends."""
    before = np.concatenate([[0.0], np.cumsum(rise)[:-1]])
    start, end = tangent[:-1], tangent[1:]
    return np.array([before, start, 3.0 * rise - 2.0 * start - end, start + end - 2.0 * rise])


# The tighter of several planets whose clearances have any distribution.


@dataclass(frozen=True, slots=True)
class TighterOf(Distribution):
    """z = min_k Q(u_k), Q the quantiles of the clearance of each `planet`, u_k uniform on [0, 1].

    Q rises, so that z = Q(min_k u_k), and 2 min_k u_k - 1 has the law `tighter`.
    """

    planet: Distribution
    tighter: TighterPlanet

    @property
    def support(self) -> tuple[float, float]:
        return self.planet.support

    @property
    def grain(self) -> float:
        return self.planet.grain

    def faults(self) -> list[tuple[str, str]]:
        return [*self.planet.faults(), *self.tighter.faults()]

    def raw_moments(self, order: int) -> Array:
        return np.array(raw_moments(self.tighter, self.planet, order))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        below = self.planet.partial_moments(np.asarray(z, dtype=float))[0]
        return partial_moments(self.tighter, self.planet, 2.0 * below - 1.0)

    def quantile(self, probability: Array) -> Array:
        return self.planet.quantile(0.5 * (1.0 + self.tighter.quantile(probability)))


def tighter_planet_law(planet: Distribution, tighter: TighterPlanet) -> Distribution:
    """The law of the least clearance; that of a single planet where all clearances are equal."""
    if tighter.is_single:
        return planet
    return tighter if planet == Uniform() else TighterOf(planet, tighter)


# Errors of the cycloid stage with the least backlash within bounds (document B, section 4).
#
# phi_2 = phi_mod + sum c_i delta_i/(e z_c) + f (a d + b d^2)/(e z_c), d the eccentricity error, is a
# sum of functions of one error each, so that the optimum over a box is found error by error: a line
# is least at an end, the parabola at an end or, where b > 0, at its vertex.


Bounds = Mapping[str, tuple[float, float]]
ERRORS = (*LINEAR_ERRORS, "eccentricity")


@dataclass(frozen=True, slots=True)
class Stage:
    """The cycloid stage: `offset` [rad] is phi_2 from modification and stagger without errors."""

    geometry: RvGeometry = RvGeometry()
    law: EccentricityLaw = EccentricityLaw()
    offset: float = 0.0

    def contribution(self, name: str, error: float) -> float:
        """Contribution of one error [m] to phi_2 [rad]."""
        if name == "eccentricity":
            law = self.law
            return law.factor * (law.linear + law.quadratic * error) * error / self.geometry.lever
        return coefficients(self.geometry)[name] * error / self.geometry.lever

    def backlash(self, errors: Mapping[str, float]) -> float:
        """phi_2 [rad] of errors [m] by name; below 0 it is interference."""
        return self.offset + sum(self.contribution(name, error) for name, error in errors.items())

    def lower_bound(self, bounds: Bounds) -> float:
        """Lower bound of phi_2 [rad] within the bounds [m].

        It follows from the intervals alone: a linear error is at least its coefficient times the
        worse end, a parabola that bends down lies above its chord, another above its vertex.
        """
        linear = sum(
            min(coefficients(self.geometry)[name] * end for end in ends) / self.geometry.lever
            for name, ends in bounds.items()
            if name != "eccentricity"
        )
        return self.offset + linear + self._parabola(*bounds.get("eccentricity", (0.0, 0.0)))

    def _parabola(self, low: float, high: float) -> float:
        """Lower bound [rad] of the eccentricity's part between two errors [m]."""
        a, b, unit = self.law.linear, self.law.quadratic, self.law.factor
        if b > 0.0:
            vertex = float(np.clip(-0.5 * a / b, low, high))
            return unit * (b * (vertex + 0.5 * a / b) ** 2 - 0.25 * a**2 / b) / self.geometry.lever
        chord = [(a + b * (low + high)) * end - b * low * high for end in (low, high)]
        return unit * min(chord) / self.geometry.lever


@dataclass(frozen=True, slots=True)
class ZoneOptimum:
    """Errors [m] by name, phi_2 there and its proven lower bound [rad]."""

    errors: Mapping[str, float]
    backlash: float
    bound: float


def least_rotation(stage: Stage, bounds: Bounds) -> ZoneOptimum:
    """Least phi_2 within bounds [m], as document B writes it: interference counts as less."""
    errors = {name: _error_adding_least(stage, name, ends) for name, ends in bounds.items()}
    return ZoneOptimum(errors, stage.backlash(errors), stage.lower_bound(bounds))


def least_clipped_rotation(stage: Stage, bounds: Bounds) -> ZoneOptimum:
    """Least max(0, phi_2) within bounds [m]: interference is no backlash.

    Where `least_rotation` interferes, every point of a whole surface phi_2 = 0 is an optimum; the point on
    the line from the middle of the bounds to that of `least_rotation` is returned.
    """
    optimum = least_rotation(stage, bounds)
    if optimum.backlash >= 0.0:
        return optimum
    middle = {name: 0.5 * (low + high) for name, (low, high) in bounds.items()}

    def at(fraction: float) -> dict[str, float]:
        return {name: m + fraction * (optimum.errors[name] - m) for name, m in middle.items()}

    if stage.backlash(middle) <= 0.0:
        return ZoneOptimum(middle, stage.backlash(middle), 0.0)
    fraction = scipy.optimize.brentq(lambda s: stage.backlash(at(s)), 0.0, 1.0, xtol=1e-15)
    return ZoneOptimum(at(fraction), stage.backlash(at(fraction)), 0.0)


def _error_adding_least(stage: Stage, name: str, ends: tuple[float, float]) -> float:
    """The error [m] within its bounds that adds least."""
    candidates = list(ends)
    if name == "eccentricity" and stage.law.quadratic > 0.0:
        vertex = -0.5 * stage.law.linear / stage.law.quadratic
        candidates.append(float(np.clip(vertex, *ends)))
    return min(candidates, key=lambda error: stage.contribution(name, error))


def equal_shares(stage: Stage, total: float) -> dict[str, float]:
    """Widths [m] of linear zones that move phi_2 by the same fraction of `total` [rad] each."""
    part = total * stage.geometry.lever / len(LINEAR_ERRORS)
    return {name: part / abs(coefficient) for name, coefficient in coefficients(stage.geometry).items()}
