"""Geometric backlash of an RV reducer in its three stages (document B), as a sum to propagate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..inputs import Distribution, Uniform
from ..propagation import ClippedSum, Term
from ..propagation.sums import total_cumulants
from . import involute, output_stage
from .cycloid import LINEAR_ERRORS, EccentricityLaw, coefficients
from .geometry import RvGeometry
from .modification import modification_backlash

Array = NDArray[np.float64]
STAGGER_GAIN = 4.0
"""phi_2' = phi_2 - 4 delta' of two discs staggered by delta' (document B)."""


@dataclass(frozen=True, slots=True)
class Allocation:
    """Tolerances of n designs: lengths in metres, angles in radians, all arrays of shape (n,).

    `half_width` has the eight errors of `LINEAR_ERRORS` and `eccentricity`; `crank_bearing` is the
    full clearance c of the zone [0, c].
    """

    half_width: Mapping[str, Array]
    crank_bearing: Array
    involute_grade: Array
    stagger: Array
    dr_rp: Array
    dr_p: Array


@dataclass(frozen=True, slots=True)
class BacklashModel:
    """Backlash phi_1 + phi_2 + phi_3 [rad] of units built to an allocation.

    `mid` holds the mid-limits [m] of the cycloid-stage errors (0 where not named), `inputs` the
    distributions of errors over units by name (uniform where not named; `involute_grade` stands for
    the flank clearance j_n between its two limits, `crank_bearing` for the bearing clearance).

    phi_2 below zero is interference, not backlash: it is the clipped part of the sum.
    """

    geometry: RvGeometry = RvGeometry()
    stage: involute.InvoluteStage = involute.InvoluteStage()
    eccentricity: EccentricityLaw = EccentricityLaw()
    mid: Mapping[str, float] = field(default_factory=dict)
    inputs: Mapping[str, Distribution] = field(default_factory=dict)

    def _input(self, name: str) -> Distribution:
        return self.inputs.get(name, Uniform())

    def involute_term(self, allocation: Allocation) -> Term:
        """phi_1."""
        mid, half = involute.backlash_zone(self.stage, self.geometry, allocation.involute_grade)
        return Term(self._input("involute_grade"), mid, half)

    def output_term(self, allocation: Allocation) -> Term:
        """phi_3."""
        mid, half = output_stage.backlash_zone(self.geometry, allocation.crank_bearing)
        return Term(self._input("crank_bearing"), mid, half)

    def cycloid_terms(self, allocation: Allocation) -> tuple[Term, ...]:
        """phi_2, modification and stagger included in the constant of the first term."""
        lever = self.geometry.lever
        fixed = modification_backlash(self.geometry, allocation.dr_rp, allocation.dr_p)
        fixed = fixed - STAGGER_GAIN * allocation.stagger
        terms = []
        for name in LINEAR_ERRORS:
            gain = coefficients(self.geometry)[name] / lever
            constant = fixed + gain * self.mid.get(name, 0.0)
            terms.append(Term(self._input(name), constant, gain * allocation.half_width[name]))
            fixed = np.zeros_like(fixed)
        return (*terms, self._eccentricity_term(allocation.half_width["eccentricity"]))

    def _eccentricity_term(self, half_width: Array) -> Term:
        unit = 2.0 / self.geometry.lever
        about = self.eccentricity.expanded(self.mid.get("eccentricity", 0.0))
        constant, linear, quadratic = (unit * coefficient for coefficient in about)
        return Term(
            self._input("eccentricity"),
            np.full_like(half_width, constant),
            linear * half_width,
            quadratic * half_width**2,
        )

    def total(self, allocation: Allocation) -> ClippedSum:
        """The sum over units: phi_1 + phi_3 + max(0, phi_2)."""
        free = (self.involute_term(allocation), self.output_term(allocation))
        return ClippedSum(free, self.cycloid_terms(allocation))


def stage_means(total: ClippedSum) -> tuple[Array, Array, Array]:
    """Mean phi_1, phi_2 (may be negative) and phi_3 [rad], each (n,)."""
    phi_1, phi_3 = (term.cumulants()[0] for term in total.free)
    return phi_1, total_cumulants(total.clipped)[0], phi_3
