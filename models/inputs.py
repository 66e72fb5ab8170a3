"""Distributions of toleranced inputs; `DISTRIBUTIONS` maps their configuration names."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import Field, dataclass, field, fields
from functools import cache, lru_cache
from math import comb, gamma, hypot, pi, sqrt
from typing import Any, ClassVar

import numpy as np
import scipy
from scipy.special import betainc, betaincinv, betaln, erf, log_ndtr, ndtr, ndtri, owens_t, xlog1py, xlogy
from scipy.special import gamma as special_gamma

from ..registry import Kinds
from ..section import Array, Range

# The interface of a toleranced input: input = mid + t z, with z in units of the half-width.


GRAIN = 1e-4
"""Half-width [z] of an average that leaves a law with a bounded density as it is, within 1e-9."""
GRAIN_PER_STD = 0.05
"""The same of a law with atoms or poles, in its standard deviations: its variance grows by 0.08 %."""


def declared_range(parameter: Field[Any]) -> Range:
    """The range that a parameter declares in its metadata: low, high, open_low, open_high."""
    return Range(**parameter.metadata)


class Distribution(ABC):
    """Distribution of the standardised deviation z = (x - mid)/t of an input x from its mid-limit.

    z = -1 and z = +1 are the limits of the zone. Because z does not depend on the half-width t, one
    base sample and one set of moments serve every design of a batch. A distribution is a frozen
    dataclass whose fields are its parameters; the metadata of a field states the numbers allowed.
    """

    one_sided: ClassVar[bool] = False
    """Whether z is a radius: never below 0, so that only mid .. mid + t of the zone is used."""

    @property
    @abstractmethod
    def support(self) -> tuple[float, float]:
        """Interval of z outside of which the mass is below 1e-14."""

    @abstractmethod
    def raw_moments(self, order: int) -> Array:
        """E[z^k] for k = 0 .. order, shape (order + 1,)."""

    @abstractmethod
    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        """E[u^k; u <= z] for k = 0, 1, 2, each of the shape of z."""

    @abstractmethod
    def quantile(self, probability: Array) -> Array:
        """The z below which `probability` of the units lie, same shape."""

    @property
    def grain(self) -> float:
        """Half-width [z] over which `averaged` averages this law."""
        return GRAIN

    def averaged(self, z: Array) -> tuple[Array, Array]:
        """P(Z + e <= z) and its derivative, both of the shape of `z`, e uniform on +-`grain`.

        The probability has a derivative for every law, with atoms and poles too, and both agree
        exactly: with G the integral of the distribution function F, G(z) = z F(z) - E[Z; Z <= z],
        they are the differences of G and F over 2 `grain`.
        """
        width, (first, last) = 2.0 * self.grain, self.support
        middle = np.clip(z, first - width, last + width)
        low, high = middle - self.grain, middle + self.grain
        (below, before, _), (above, beyond, _) = self.partial_moments(low), self.partial_moments(high)
        return (high * above - beyond - (low * below - before)) / width, (above - below) / width

    def faults(self) -> list[tuple[str, str]]:
        """(parameter, message) for every parameter that is outside of its range."""
        return [
            (parameter.name, complaint)
            for parameter in fields(self)  # type: ignore[arg-type]
            for value in np.atleast_1d(getattr(self, parameter.name))
            if (complaint := declared_range(parameter).complaint(float(value)))
        ]


def std_of(law: Distribution) -> float:
    """Standard deviation of z."""
    _, first, second = law.raw_moments(2)
    return float(np.sqrt(second - first**2))


class WithinZone(Distribution):
    """A distribution without mass beyond the limits of the zone."""

    @property
    def support(self) -> tuple[float, float]:
        return -1.0, 1.0


# Beta input: any unimodal, skewed, one-ended or U-shaped spread between the limits.


@dataclass(frozen=True, slots=True)
class Beta(WithinZone):
    """z on [-1, 1] with a density proportional to (1 + z)^(alpha - 1) (1 - z)^(beta - 1).

    `alpha`, `beta` > 0 without default: 1, 1 is uniform, below 1 the density has a pole at that
    limit. It fills the zone, so that it has no Cp and no shift. Mean (alpha - beta)/(alpha + beta).

    Integrating d[z^k (1 - z^2) f(z)] gives both the raw moments,
    m_(k+1) = (k m_(k-1) + (alpha - beta) m_k)/(k + alpha + beta), whose terms never cancel, and the
    partial ones, in which (1 - z^2) f(z) is finite where f has its pole.

    Reference: Johnson, Kotz & Balakrishnan (1995), Continuous Univariate Distributions II, ch. 25.
    """

    alpha: float = field(metadata={"low": 0.0, "open_low": True})
    beta: float = field(metadata={"low": 0.0, "open_low": True})

    @property
    def grain(self) -> float:
        return GRAIN if min(self.alpha, self.beta) >= 1.0 else GRAIN_PER_STD * std_of(self)

    def raw_moments(self, order: int) -> Array:
        lean, total = self.alpha - self.beta, self.alpha + self.beta
        moments = np.ones(order + 1)
        for k in range(order):
            before = k * moments[k - 1] if k > 0 else 0.0
            moments[k + 1] = (before + lean * moments[k]) / (k + total)
        return moments

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        u = np.clip(z, -1.0, 1.0)
        x = 0.5 * (1.0 + u)
        lean, total = self.alpha - self.beta, self.alpha + self.beta
        power = xlogy(self.alpha, x) + xlog1py(self.beta, -x)
        edge = 2.0 * np.exp(power - betaln(self.alpha, self.beta))  # (1 - z^2) f(z)
        mass = betainc(self.alpha, self.beta, x)
        first = (lean * mass - edge) / total
        second = (mass + lean * first - u * edge) / (total + 1.0)
        return mass, first, second

    def quantile(self, probability: Array) -> Array:
        return np.asarray(2.0 * betaincinv(self.alpha, self.beta, probability) - 1.0)


# Empirical input: the distribution of measured deviations.


@dataclass(frozen=True, slots=True)
class Empirical(Distribution):
    """z with the piecewise linear quantile function through the sorted `values`.

    `values` are measured deviations from the mid-limit in half-widths, at least two of them
    distinct, in any order; they may lie beyond the limits. The i-th of n sorted values is the
    quantile at (i - 1)/(n - 1), so that 1/(n - 1) of the units is uniform between neighbours, and
    equal values are an atom. All moments are exact for this law. It has no tails beyond the sample,
    and less variance than its values, a third of theirs where there are only two.

    Reference: type 7 of Hyndman & Fan (1996), Sample quantiles in statistical packages, American
    Statistician 50(4), 361-365.
    """

    values: tuple[float, ...] = field(metadata={"low": -1e6, "high": 1e6})

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(float(value) for value in self.values))

    @property
    def support(self) -> tuple[float, float]:
        return min(self.values), max(self.values)

    @property
    def grain(self) -> float:
        return GRAIN_PER_STD * std_of(self)

    def faults(self) -> list[tuple[str, str]]:
        faults = Distribution.faults(self)
        if len(set(self.values)) < 2:
            faults.append(("values", "need at least two distinct deviations, in half-widths"))
        return faults

    def raw_moments(self, order: int) -> Array:
        x = np.sort(self.values)
        low, high = x[:-1], x[1:]
        moments = np.ones(order + 1)
        total = np.ones_like(low)  # sum of low^j high^(k-j), j = 0 .. k
        for k in range(1, order + 1):
            total = total * low + high**k
            moments[k] = np.mean(total) / (k + 1)
        return moments

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        x = np.sort(self.values)
        pieces = len(x) - 1
        at = np.clip(np.searchsorted(x, z, side="right") - 1, 0, pieces - 1)
        low, high = x[at], x[at + 1]
        end, width = np.clip(z, low, high), high - low
        fraction = np.where(width > 0.0, (end - low) / np.where(width > 0.0, width, 1.0), z >= low)
        moments, part = _piece(x[:-1], x[1:]), _piece(low, end)
        before = [np.concatenate([[0.0], np.cumsum(value)])[at] for value in moments]
        mass, first, second = (b + fraction * p for b, p in zip(before, part, strict=True))
        return mass / pieces, first / pieces, second / pieces

    def quantile(self, probability: Array) -> Array:
        x = np.sort(self.values)
        return np.asarray(np.interp(probability, np.linspace(0.0, 1.0, len(x)), x))


def _piece(low: Array, high: Array) -> tuple[Array, Array, Array]:
    """E[u^k] of a uniform u on [low, high], k = 0, 1, 2."""
    return np.ones_like(low), 0.5 * (low + high), (low * low + low * high + high * high) / 3.0


# Normal input with process capability Cp and a mean shift.


TAIL = 8.0
"""Standard deviations on either side that count; beyond them lies 1.2e-15 of the mass."""


def density(x: Array) -> Array:
    """Standard normal density."""
    return np.asarray(np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi))


@dataclass(frozen=True, slots=True)
class Normal(Distribution):
    """z normal with mean `shift` and standard deviation 1/(3 Cp).

    `cp` is the process capability (zone width over six standard deviations), > 0. `shift` is the
    shift of the process mean from the mid-limit as a fraction of the half-width, in [-1, 1]; the
    one-sided capability is then Cpk = Cp (1 - |shift|).

    Reference: Kane (1986), Process capability indices, J. Quality Technology 18(1), 41-52; the
    fractional mean shift is that of Chase & Greenwood (1988), Manufacturing Review 1(1), 50-59.
    """

    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})
    shift: float = field(default=0.0, metadata={"low": -1.0, "high": 1.0})

    @property
    def sigma(self) -> float:
        """Standard deviation of z."""
        return 1.0 / (3.0 * self.cp)

    @property
    def support(self) -> tuple[float, float]:
        return self.shift - TAIL * self.sigma, self.shift + TAIL * self.sigma

    def raw_moments(self, order: int) -> Array:
        moments = np.zeros(order + 1)
        moments[0] = 1.0
        for k in range(1, order + 1):
            before = (k - 1) * self.sigma**2 * moments[k - 2] if k > 1 else 0.0
            moments[k] = self.shift * moments[k - 1] + before
        return moments

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        x = (z - self.shift) / self.sigma
        mass, peak = ndtr(x), self.sigma * density(x)
        first = self.shift * mass - peak
        second = (self.shift**2 + self.sigma**2) * mass - (self.shift + z) * peak
        return mass, first, second

    def quantile(self, probability: Array) -> Array:
        x = np.clip(ndtri(probability), -TAIL, TAIL)
        return np.asarray(self.shift + self.sigma * x)


# Mixture input: parts of several cavities, machines or lots, each normal.


@dataclass(frozen=True, slots=True)
class Mixture(Distribution):
    """z of the i-th of several populations with the fraction `shares[i]`, normal with the mean
    `centres[i]` and the standard deviation `spreads[i]`, in half-widths.

    Without `shares` all populations are of one size.

    Reference: McLachlan & Peel (2000), Finite Mixture Models, section 1.4.
    """

    centres: tuple[float, ...] = field(metadata={"low": -1e6, "high": 1e6})
    spreads: tuple[float, ...] = field(metadata={"low": 0.0, "open_low": True})
    shares: tuple[float, ...] = field(default=(), metadata={"low": 0.0, "open_low": True})

    def __post_init__(self) -> None:
        for name in ("centres", "spreads", "shares"):
            object.__setattr__(self, name, tuple(float(value) for value in getattr(self, name)))

    def _parts(self) -> tuple[Array, list[Normal]]:
        """Fractions, and the normal populations."""
        shares = np.array(self.shares or (1.0,) * len(self.centres))
        populations = zip(self.centres, self.spreads, strict=True)
        return shares / shares.sum(), [Normal(1.0 / (3.0 * spread), centre) for centre, spread in populations]

    @property
    def support(self) -> tuple[float, float]:
        ends = [part.support for part in self._parts()[1]]
        return min(low for low, _ in ends), max(high for _, high in ends)

    def faults(self) -> list[tuple[str, str]]:
        faults = Distribution.faults(self)
        for name in ("spreads", "shares"):
            if len(getattr(self, name)) not in (len(self.centres), 0 if name == "shares" else -1):
                faults.append((name, f"must be as many as centres ({len(self.centres)})"))
        if len(self.centres) < 1:
            faults.append(("centres", "must name a population at least"))
        return faults

    @property
    def sigma(self) -> float:
        """Standard deviation of z."""
        return std_of(self)

    def raw_moments(self, order: int) -> Array:
        shares, parts = self._parts()
        return np.asarray(shares @ np.array([part.raw_moments(order) for part in parts]))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        shares, parts = self._parts()
        of_parts = [part.partial_moments(z) for part in parts]
        mass, first, second = (sum(s * m[k] for s, m in zip(shares, of_parts, strict=True)) for k in range(3))
        return np.asarray(mass), np.asarray(first), np.asarray(second)

    def quantile(self, probability: Array) -> Array:
        """By bisection between the quantiles of the populations."""
        ends = [part.quantile(probability) for part in self._parts()[1]]
        low, high = np.min(ends, axis=0), np.max(ends, axis=0)
        for _ in range(60):
            middle = 0.5 * (low + high)
            below = self.partial_moments(middle)[0] < probability
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return np.asarray(0.5 * (low + high))


# Rayleigh input: the eccentricity of a centre that is off in two directions.


RAYLEIGH_REACH = 8.2
"""Largest radius in units of sigma; beyond them lies 2.5e-15 of the mass."""


@dataclass(frozen=True, slots=True)
class Rayleigh(Distribution):
    """z = radius/t >= 0, the length of a vector whose two components are normal, mean 0, std sigma.

    The tolerance t of an eccentricity (or of a runout, as half its total indicator reading) is the
    largest radius permitted, and the radius lies in [0, t]: of the zone mid +- t only mid .. mid +
    t is used, with mid, the value of a perfect part, at z = 0 and the limit at z = 1. As t shrinks
    the radius goes to 0, not to some value within [0, t]; a zone [0, 2 t] around a fixed mid would
    not do that. So an input that is not mid +- t (a full clearance) cannot have this distribution,
    and where only the component in one direction acts, that component is a `Normal`.

    `cp` is the capability against the only limit: the fraction beyond z = 1 is Phi(-3 Cp), as
    beyond either limit of a centred normal process (0.135 % at Cp = 1), which makes
    sigma = 1/sqrt(-2 ln Phi(-3 Cp)). There is no other limit, so Cpk is Cp, and there is no shift.

    Reference: Rayleigh (1880), On the resultant of a large number of vibrations of the same pitch
    and of arbitrary phase, Philosophical Magazine 10(60), 73-78.
    """

    one_sided: ClassVar[bool] = True

    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})

    @property
    def sigma(self) -> float:
        """Standard deviation of either component, in units of the limit."""
        return float(1.0 / np.sqrt(-2.0 * log_ndtr(-3.0 * self.cp)))

    @property
    def support(self) -> tuple[float, float]:
        return 0.0, RAYLEIGH_REACH * self.sigma

    def raw_moments(self, order: int) -> Array:
        k = np.arange(order + 1)
        return np.asarray((np.sqrt(2.0) * self.sigma) ** k * special_gamma(1.0 + 0.5 * k))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        sigma = self.sigma
        u = np.maximum(z, 0.0)
        power = -0.5 * (u / sigma) ** 2
        mass, beyond = -np.expm1(power), np.exp(power)
        first = sigma * np.sqrt(0.5 * np.pi) * erf(u / (np.sqrt(2.0) * sigma)) - u * beyond
        return mass, first, 2.0 * sigma**2 * mass - u**2 * beyond

    def quantile(self, probability: Array) -> Array:
        radius = np.sqrt(-2.0 * xlog1py(1.0, -probability))
        return np.asarray(self.sigma * np.minimum(radius, RAYLEIGH_REACH))


# One-sided inputs with one tail: deviations of form, runouts, unbalances.


EXPONENTIAL_REACH = 32.5
"""Largest z in units of its mean; beyond it lies 8e-15 of the mass."""


@dataclass(frozen=True, slots=True)
class Exponential(Distribution):
    """z >= 0 with the density exp(-z/m)/m: small deviations are the most frequent ones.

    As for `Rayleigh`, z = 1 is the only limit, and the fraction Phi(-3 Cp) lies beyond it, so that
    the mean and standard deviation are m = -1/ln Phi(-3 Cp).

    Reference: Johnson, Kotz & Balakrishnan (1994), Continuous Univariate Distributions I, ch. 19.
    """

    one_sided: ClassVar[bool] = True

    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})

    @property
    def scale(self) -> float:
        """Mean and standard deviation of z."""
        return float(-1.0 / log_ndtr(-3.0 * self.cp))

    @property
    def support(self) -> tuple[float, float]:
        return 0.0, EXPONENTIAL_REACH * self.scale

    def raw_moments(self, order: int) -> Array:
        k = np.arange(order + 1)
        return np.asarray(self.scale**k * special_gamma(1.0 + k))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        scale, u = self.scale, np.maximum(z, 0.0)
        mass, beyond = -np.expm1(-u / scale), np.exp(-u / scale)
        first = scale * mass - u * beyond
        return mass, first, 2.0 * scale * first - u**2 * beyond

    def quantile(self, probability: Array) -> Array:
        return np.asarray(self.scale * np.minimum(-xlog1py(1.0, -probability), EXPONENTIAL_REACH))


@dataclass(frozen=True, slots=True)
class LogNormal(Distribution):
    """z > 0 whose logarithm is normal with the standard deviation `shape`, without default.

    As for `Rayleigh`, z = 1 is the only limit, and the fraction Phi(-3 Cp) lies beyond it, so that
    ln z has the mean -3 Cp `shape`. At 0.1 z is nearly normal, at 1 it has a long tail.

    Reference: Johnson, Kotz & Balakrishnan (1994), Continuous Univariate Distributions I, ch. 14.
    """

    one_sided: ClassVar[bool] = True

    shape: float = field(metadata={"low": 0.0, "high": 1.0, "open_low": True})
    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})

    @property
    def _median(self) -> float:
        """Mean of ln z."""
        return -3.0 * self.cp * self.shape

    @property
    def support(self) -> tuple[float, float]:
        low, high = np.exp(self._median + self.shape * np.array([-TAIL, TAIL]))
        return float(low), float(high)

    def raw_moments(self, order: int) -> Array:
        k = np.arange(order + 1)
        return np.asarray(np.exp(k * self._median + 0.5 * (k * self.shape) ** 2))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        low, high = self.support
        x = (np.log(np.clip(z, low, high)) - self._median) / self.shape
        whole = self.raw_moments(2)
        mass, first, second = (np.where(z < low, 0.0, whole[k] * ndtr(x - k * self.shape)) for k in range(3))
        return mass, first, second

    def quantile(self, probability: Array) -> Array:
        return np.asarray(np.exp(self._median + self.shape * np.clip(ndtri(probability), -TAIL, TAIL)))


# Skew normal input: a process that is skewed to one side, for example by tool wear or a stop.


OUTER = 1e-9
"""Probability of a tail in which quantiles are computed singly."""
SKEW_NORMAL_REACH, NODES, STEPS = 7.0, 8193, 2
"""Ends of the table of masses, its nodes, and Newton's steps from there."""


@dataclass(frozen=True, slots=True)
class SkewNormal(Distribution):
    """z = shift + (Y - E[Y])/(3 Cp std[Y]) with Y of density 2 phi(y) Phi(skew y).

    So z has the mean `shift` and the standard deviation 1/(3 Cp) of `Normal` with the same `cp` and
    `shift`, whatever `skew`: 0 is the normal, +-1000 is the half-normal to 1e-6. With
    delta = skew/sqrt(1 + skew^2), E[Y] = delta sqrt(2/pi) and var[Y] = 1 - E[Y]^2. Raw moments are
    those of Y = delta |U| + sqrt(1 - delta^2) V with independent standard normals U, V.

    Reference: Azzalini (1985), A class of distributions which includes the normal ones,
    Scandinavian J. Statistics 12(2), 171-178; its mass by the function of Owen (1956).
    """

    skew: float = field(metadata={"low": -1000.0, "high": 1000.0})
    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})
    shift: float = field(default=0.0, metadata={"low": -1.0, "high": 1.0})

    @property
    def _delta(self) -> float:
        return self.skew / hypot(1.0, self.skew)

    @property
    def _line(self) -> tuple[float, float]:
        """(c, b) of z = c + b Y."""
        mean = self._delta * sqrt(2.0 / pi)
        scale = 1.0 / (3.0 * self.cp * sqrt(1.0 - mean**2))
        return self.shift - scale * mean, scale

    @property
    def support(self) -> tuple[float, float]:
        origin, scale = self._line
        short = TAIL / hypot(1.0, self.skew)  # the tail that phi(skew y) cuts
        low, high = (short, TAIL) if self.skew > 0.0 else (TAIL, short)
        return origin - scale * low, origin + scale * high

    def raw_moments(self, order: int) -> Array:
        k = np.arange(order + 1)

        def powers(base: float) -> Array:
            return np.asarray(base**k, dtype=float)

        half = np.array([2.0 ** (j / 2) * gamma((j + 1) / 2) / sqrt(pi) for j in k])  # E|U|^j
        even = np.where(k % 2 == 0, half, 0.0)
        centred = _moments_of_sum(half, powers(-sqrt(2.0 / pi)))
        _, scale = self._line
        normal_scale = scale / hypot(1.0, self.skew)
        around = _moments_of_sum(centred * powers(scale * self._delta), even * powers(normal_scale))
        return _moments_of_sum(around, powers(self.shift))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        origin, scale = self._line
        y, far = (z - origin) / scale, hypot(1.0, self.skew)
        peak, mean = 2.0 * density(y) * ndtr(self.skew * y), self._delta * sqrt(2.0 / pi)
        mass = np.clip(_mass(y, self.skew), 0.0, 1.0)
        first = mean * ndtr(far * y) - peak
        second = mass - y * peak - mean / far * density(far * y)
        return (
            mass,
            origin * mass + scale * first,
            origin**2 * mass + 2.0 * origin * scale * first + scale**2 * second,
        )

    def quantile(self, probability: Array) -> Array:
        origin, scale = self._line
        p = np.asarray(probability, dtype=float)
        inner = (p > OUTER) & (p < 1.0 - OUTER)
        y = np.empty_like(p)
        y[inner] = _newton(p[inner], self.skew)
        y[~inner] = scipy.stats.skewnorm.ppf(p[~inner], self.skew)
        return np.clip(origin + scale * y, *self.support)


def _newton(p: Array, skew: float) -> Array:
    """y (n,) with P(Y <= y) = p: between the nodes of a table, then by Newton's steps.

    A tenth of the time of a root search for each. The mass at y is p to 1e-15; in tails below
    `OUTER` that is too few digits.
    """
    at, mass = _table(skew)
    y = np.interp(p, mass, at)
    for _ in range(STEPS):
        y -= (_mass(y, skew) - p) / (2.0 * density(y) * ndtr(skew * y))
    return y


def _mass(y: Array, skew: float) -> Array:
    return np.asarray(ndtr(y) - 2.0 * owens_t(y, skew))


@lru_cache(maxsize=8)
def _table(skew: float) -> tuple[Array, Array]:
    """Nodes y (`NODES`,) between which p rises in its last digits, and their mass."""
    wide = np.linspace(-SKEW_NORMAL_REACH, SKEW_NORMAL_REACH, NODES)
    y = np.union1d(wide, wide / hypot(1.0, skew))  # there the skewed side falls off
    mass = _mass(y, skew)
    rising = (mass > 0.1 * OUTER) & (mass < 1.0 - 0.1 * OUTER)
    return y[rising], mass[rising]


def _moments_of_sum(first: Array, second: Array) -> Array:
    """Raw moments of the sum of two independent variables from theirs, all of shape (k + 1,)."""
    return np.array([sum(comb(k, j) * first[j] * second[k - j] for j in range(k + 1)) for k in range(len(first))])


# Densities that rise in a line, stay level and fall in a line: triangle and trapezoid.


MIN_RAMP_LENGTH = np.finfo(float).tiny


class Plateau(WithinZone):
    """z on [-1, 1] with a density that is level between two points and falls to 0 at the limits.

    With the level part from l to r and the height 1/a, a = 1 + (r - l)/2:
    E[z^k] = (sum_i r^i - sum_i l^i (-1)^(k+1-i)) / (a (k + 1) (k + 2)), i = 0 .. k + 1, from the
    second differences of z^(k+2); no term cancels as a ramp becomes short.
    """

    @property
    @abstractmethod
    def level(self) -> tuple[float, float]:
        """The two ends (l, r) of the level part, -1 <= l <= r <= 1."""

    @property
    def _area(self) -> float:
        """Area under the density of height 1."""
        left, right = self.level
        return 1.0 + 0.5 * (right - left)

    def raw_moments(self, order: int) -> Array:
        left, right = self.level
        i = np.arange(order + 2)
        rising, falling = np.cumsum(right**i), np.cumsum((-left) ** i)
        k = np.arange(order + 1)
        moments = rising[1:] + np.where(k % 2 == 0, 1.0, -1.0) * falling[1:]
        return np.asarray(moments / (self._area * (k + 1) * (k + 2)))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        left, right = self.level
        u = np.clip(z, -1.0, 1.0)
        mass, first, second = _ramp(np.minimum(u, left) + 1.0, 1.0 + left)
        full = _ramp(np.asarray(1.0 - right), 1.0 - right)
        above = _ramp(1.0 - np.maximum(u, right), 1.0 - right)
        flat = np.clip(u, left, right)
        mass = mass + (flat - left) + (full[0] - above[0])
        first = first + 0.5 * (flat**2 - left**2) - (full[1] - above[1])
        second = second + (flat**3 - left**3) / 3.0 + (full[2] - above[2])
        return mass / self._area, first / self._area, second / self._area

    def quantile(self, probability: Array) -> Array:
        left, right = self.level
        below, above = self._area * probability, self._area * (1.0 - probability)
        rising = np.sqrt(2.0 * below * (1.0 + left)) - 1.0
        falling = 1.0 - np.sqrt(2.0 * above * (1.0 - right))
        flat = np.clip(left + below - 0.5 * (1.0 + left), left, right)
        start, end = 0.5 * (1.0 + left), 0.5 * (1.0 - right)
        return np.where(below < start, rising, np.where(above < end, falling, flat))


def _ramp(run: Array, length: float) -> tuple[Array, Array, Array]:
    """Integrals of u^k (u + 1)/length from -1 to -1 + run, k = 0, 1, 2."""
    fraction = run / max(length, MIN_RAMP_LENGTH)  # a ramp of no length has run = 0
    square = run * fraction
    return (0.5 * square, square * (run / 3.0 - 0.5), square * (0.25 * run**2 - 2.0 * run / 3.0 + 0.5))


# Trapezoidal input: level in the middle of the zone, falling to its limits.


@dataclass(frozen=True, slots=True)
class Trapezoid(Plateau):
    """z symmetric on [-1, 1] with a level density on [-top, top]: variance (1 + top^2)/6.

    `top` in [0, 1] is the fraction of the zone that is level: 0 is the triangle, 1 is uniform. It
    fills the zone, so it has no Cp and no shift. It is the sum of two independent uniform errors of
    half-widths (1 + top)/2 and (1 - top)/2.

    Reference: JCGM 100:2008 (GUM), 4.3.9.
    """

    top: float = field(default=0.5, metadata={"low": 0.0, "high": 1.0})

    @property
    def level(self) -> tuple[float, float]:
        return -self.top, self.top


# Triangular input: most units near a value of the zone, none beyond its limits.


@dataclass(frozen=True, slots=True)
class Triangular(Plateau):
    """z triangular on [-1, 1] with its peak at `mode`: mean mode/3, variance (3 + mode^2)/18.

    It fills the zone, so it has no Cp and no shift; `mode` in [-1, 1] is 0 (symmetric) by default.

    Reference: Johnson, Kotz & Balakrishnan (1995), Continuous Univariate Distributions II, 26.9.
    """

    mode: float = field(default=0.0, metadata={"low": -1.0, "high": 1.0})

    @property
    def level(self) -> tuple[float, float]:
        return self.mode, self.mode


# Normal input with sorting: no part outside the zone is assembled.


REACH = 12.0
"""Standard deviations beyond which the density is neglected."""


@dataclass(frozen=True, slots=True)
class TruncatedNormal(WithinZone):
    """z normal with mode `shift` and scale 1/(3 Cp), cut at the limits -1 and +1.

    `cp` and `shift` are those of the process before inspection, as in `Normal`. Raw moments are by
    Gauss-Legendre quadrature: the closed recursion (Johnson, Kotz & Balakrishnan, Continuous
    Univariate Distributions I, ch. 13) loses all digits for small Cp.
    """

    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})
    shift: float = field(default=0.0, metadata={"low": -1.0, "high": 1.0})

    @property
    def sigma(self) -> float:
        """Scale of the process before inspection, in half-widths."""
        return 1.0 / (3.0 * self.cp)

    def _cuts(self) -> tuple[float, float]:
        return (-1.0 - self.shift) / self.sigma, (1.0 - self.shift) / self.sigma

    def raw_moments(self, order: int) -> Array:
        low = max(-1.0, self.shift - REACH * self.sigma)
        high = min(1.0, self.shift + REACH * self.sigma)
        node, gauss = _quadrature()
        z = 0.5 * (low + high) + 0.5 * (high - low) * node
        weight = gauss * density((z - self.shift) / self.sigma)
        return np.asarray(z ** np.arange(order + 1)[:, None] @ weight / weight.sum())

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        low, high = self._cuts()
        x = np.clip((z - self.shift) / self.sigma, low, high)
        edge, start = self.sigma * density(x), self.sigma * float(density(np.array(low)))
        total = float(ndtr(high) - ndtr(low))
        mass = ndtr(x) - ndtr(low)
        u = self.shift + self.sigma * x
        first = self.shift * mass - (edge - start)
        second = (self.shift**2 + self.sigma**2) * mass - ((self.shift + u) * edge - (self.shift - 1.0) * start)
        return mass / total, first / total, second / total

    def quantile(self, probability: Array) -> Array:
        low, high = self._cuts()
        x = ndtri(ndtr(low) + probability * (ndtr(high) - ndtr(low)))
        return np.clip(self.shift + self.sigma * x, -1.0, 1.0)


@cache
def _quadrature() -> tuple[Array, Array]:
    """Nodes and weights on -1 to 1, exact to rounding for a normal density; 10 ms to find."""
    node, weight = np.polynomial.legendre.leggauss(96)
    node.setflags(write=False)
    weight.setflags(write=False)
    return node, weight


# Uniform input: every value of the zone is equally likely.


@dataclass(frozen=True, slots=True)
class Uniform(WithinZone):
    """z uniform on [-1, 1]: variance t^2/3. It fills the zone, so it has no Cp and no shift."""

    def raw_moments(self, order: int) -> Array:
        k = np.arange(order + 1)
        return np.where(k % 2 == 0, 1.0 / (k + 1.0), 0.0)

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        u = np.clip(z, -1.0, 1.0)
        square = u * u
        return 0.5 * (u + 1.0), 0.25 * (square - 1.0), (square * u + 1.0) / 6.0

    def quantile(self, probability: Array) -> Array:
        return 2.0 * probability - 1.0


# Tolerance zones given by their limits, symmetric or not.


_LIMITS = re.compile(r"^\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*/\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*$")


@dataclass(frozen=True, slots=True)
class Zone:
    """The zone mid +- half_width around the nominal value (unit: the caller's)."""

    mid: float
    half_width: float

    @classmethod
    def of_limits(cls, lower: float, upper: float) -> Zone:
        """The zone between a lower and an upper deviation.

        Raises ValueError where the limits are reversed or equal.
        """
        if not lower < upper:
            raise ValueError(f"the lower limit must be below the upper one, got {lower} and {upper}")
        return cls(0.5 * (lower + upper), 0.5 * (upper - lower))

    @classmethod
    def of_text(cls, text: str) -> Zone:
        """The zone that "+0.02/-0.01" (upper/lower deviation, as on a drawing) states."""
        match = _LIMITS.match(text)
        if match is None:
            raise ValueError(f'write limits as "+0.02/-0.01" (upper/lower), got "{text}"')
        first, second = float(match[1]), float(match[2])
        return cls.of_limits(min(first, second), max(first, second))

    @property
    def lower(self) -> float:
        """Lower limit."""
        return self.mid - self.half_width

    @property
    def upper(self) -> float:
        """Upper limit."""
        return self.mid + self.half_width


DISTRIBUTIONS: Kinds[Distribution] = Kinds("distributions")
"""Plugins included."""
