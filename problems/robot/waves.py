"""The transmission error of a reducer: document A's twelve angles, at one precision weight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from ...arrays import Array
from ...models.assembly.coverage import radius_quantile
from ...models.costs import Reciprocal
from ...units import ARCMIN, ARCSEC
from ..reducers.curve import Clipped, PricedCurve
from ..rv_transmission_error import RvTransmissionError
from ..rv_transmission_error.declared import COSTS, DOCUMENT_MRAD, PRECISION, VARIABLES
from ..rv_transmission_error.form import least_ratio
from ..settings import Settings, VariableSetting

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
