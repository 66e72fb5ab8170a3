"""Errors of the cycloid stage with the least backlash within bounds (document B, section 4).

phi_2 = phi_mod + sum c_i delta_i/(e z_c) + f (a d + b d^2)/(e z_c), d the eccentricity error, is a
sum of functions of one error each, so that the optimum over a box is found error by error: a line
is least at an end, the parabola at an end or, where b > 0, at its vertex.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from .cycloid import LINEAR_ERRORS, EccentricityLaw, coefficients
from .geometry import RvGeometry

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


def least(stage: Stage, bounds: Bounds) -> ZoneOptimum:
    """Least phi_2 within bounds [m], as document B writes it: interference counts as less."""
    errors = {name: _best(stage, name, ends) for name, ends in bounds.items()}
    return ZoneOptimum(errors, stage.backlash(errors), stage.lower_bound(bounds))


def least_clipped(stage: Stage, bounds: Bounds) -> ZoneOptimum:
    """Least max(0, phi_2) within bounds [m]: interference is no backlash.

    Where `least` interferes, every point of a whole surface phi_2 = 0 is an optimum; the point on
    the line from the middle of the bounds to that of `least` is returned.
    """
    optimum = least(stage, bounds)
    if optimum.backlash >= 0.0:
        return optimum
    middle = {name: 0.5 * (low + high) for name, (low, high) in bounds.items()}

    def at(fraction: float) -> dict[str, float]:
        return {name: m + fraction * (optimum.errors[name] - m) for name, m in middle.items()}

    if stage.backlash(middle) <= 0.0:
        return ZoneOptimum(middle, stage.backlash(middle), 0.0)
    fraction = scipy.optimize.brentq(lambda s: stage.backlash(at(s)), 0.0, 1.0, xtol=1e-15)
    return ZoneOptimum(at(fraction), stage.backlash(at(fraction)), 0.0)


def _best(stage: Stage, name: str, ends: tuple[float, float]) -> float:
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
