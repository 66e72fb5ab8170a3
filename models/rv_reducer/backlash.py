"""Geometric backlash of an RV reducer in its three stages, as a sum of toleranced inputs to propagate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...section import Array
from ...units import ARCMIN, UM
from ..inputs import Distribution, Uniform
from ..measurable import Source, Sources
from ..propagation import ClippedSum, Term
from ..propagation.sums import total_cumulants
from . import geometry as involute
from .cycloid import LINEAR_ERRORS, ROTATIONS, EccentricityLaw, coefficients, pin_circle_growth
from .geometry import RvGeometry, backlash_zone, lever, modification_backlash
from .tighter_planet import TighterPlanet, tighter_planet_law

# Geometric backlash of an RV reducer in its three stages (document B), as a sum to propagate.


@dataclass(frozen=True, slots=True)
class Allocation:
    """Tolerances of n designs: lengths in metres, angles in radians, all arrays of shape (n,).

    `half_width` has the eight errors of `LINEAR_ERRORS` and `eccentricity`; `crank_bearing` is the
    full clearance c of the zone [0, c]; `stagger` the angle by which one disc is turned ahead and
    the other back.
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
    the flank clearance j_n of one planet between its two limits, `crank_bearing` for the bearing
    clearance).

    phi_2 below zero is interference, not backlash: it is the clipped part of the sum.

    phi_1 is that of the tighter of the planets (`tighter`). With `sun_held` phi_2 and phi_3, turns
    of the discs, are divided by the turn of a disc per turn of the carrier. The stagger delta of
    the discs reduces phi_2 by `stagger_gain` delta. Without `position_mids_count` the mid-limits of
    `ROTATIONS` do not change the backlash of a unit.
    """

    geometry: RvGeometry = RvGeometry()
    stage: involute.InvoluteStage = involute.InvoluteStage()
    eccentricity: EccentricityLaw = EccentricityLaw()
    mid: Mapping[str, float] = field(default_factory=dict)
    inputs: Mapping[str, Distribution] = field(default_factory=dict)
    tighter: TighterPlanet = TighterPlanet()
    sun_held: bool = True
    stagger_gain: float = 2.0
    position_mids_count: bool = False

    @property
    def output_factor(self) -> float:
        """Turn of the carrier per turn of a disc against its mesh: 117/121 with the sun held."""
        return 1.0 / self.geometry.output_ratio if self.sun_held else 1.0

    def gain(self, name: str) -> float:
        """Change of phi_2 [rad/m] with an error of `LINEAR_ERRORS` that differs between units."""
        return self.output_factor * coefficients(self.geometry)[name] / self.geometry.lever

    def moves(self, name: str) -> bool:
        """Whether an error that is the same in all units changes their backlash."""
        return self.position_mids_count or name not in ROTATIONS

    def opening(self, changes: Mapping[str, Array | float]) -> Array | float:
        """Change of phi_2 [rad] by changes [m] of errors of the whole unit."""
        return sum((self.gain(name) * by for name, by in changes.items() if self.moves(name)), 0.0)

    def thermal_opening(self, disc: Array, housing: Array) -> Array:
        """Change of phi_2 [rad], (n,), by temperature rises [K] of discs and housing."""
        return self.gain("pin_circle_radius") * pin_circle_growth(self.geometry, disc, housing)

    def _input(self, name: str) -> Distribution:
        return self.inputs.get(name, Uniform())

    def involute_term(self, allocation: Allocation) -> Term:
        """phi_1: the clearance of the tighter planet."""
        mid, half = involute.backlash_zone(self.stage, self.geometry, allocation.involute_grade)
        return Term(tighter_planet_law(self._input("involute_grade"), self.tighter), mid, half)

    def output_term(self, allocation: Allocation) -> Term:
        """phi_3 = du/a_0, du the play of the crank-arm bearings in [0, c]."""
        half = self.output_factor * (0.5 * allocation.crank_bearing / self.geometry.centre_distance)
        return Term(self._input("crank_bearing"), half, half)

    def nominal(self, dr_rp: Array, dr_p: Array, stagger: Array) -> Array:
        """phi_2 of parts without errors [rad], (n,), from modification and stagger."""
        play = modification_backlash(self.geometry, dr_rp, dr_p)
        return self.output_factor * (play - self.stagger_gain * stagger)

    def cycloid_terms(self, allocation: Allocation) -> tuple[Term, ...]:
        """phi_2, modification and stagger included in the constant of the first term."""
        fixed = self.nominal(allocation.dr_rp, allocation.dr_p, allocation.stagger)
        terms = []
        for name in LINEAR_ERRORS:
            constant = fixed + self.opening({name: self.mid.get(name, 0.0)})
            linear = self.gain(name) * allocation.half_width[name]
            terms.append(Term(self._input(name), constant, linear))
            fixed = np.zeros_like(fixed)
        return (*terms, self._eccentricity_term(allocation.half_width["eccentricity"]))

    def _eccentricity_term(self, half_width: Array) -> Term:
        unit = self.output_factor * self.eccentricity.factor / self.geometry.lever
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


def flank_clearance(half: float, slope: float, law: Distribution, widest: float) -> Source:
    """The flank clearance of the involute stage, its zone +-`half` [um]; arguments as of `Source`."""
    meaning = "flank clearance j_n of the involute stage"
    return Source("flank_clearance_um", "um", meaning, half, slope, clipped=False, at=0, law=law, widest=widest)


def sources_of(model: BacklashModel, allocation: Allocation, total: ClippedSum) -> Sources:
    """The errors of the cycloid stage, the flank clearance and that of the crank bearings."""
    geometry, law = model.geometry, model.eccentricity
    bent = law.factor * law.expanded(model.mid.get("eccentricity", 0.0))[1] / geometry.lever
    gains = {name: model.gain(name) for name in LINEAR_ERRORS}
    slopes = gains | {"eccentricity": model.output_factor * bent}
    cycloid = tuple(
        Source(
            f"{name}_um",
            "um",
            f"{name.replace('_', ' ')} error",
            float(np.squeeze(allocation.half_width[name])) / UM,
            slopes[name] * UM,
            clipped=True,
            at=at,
            law=total.clipped[at].distribution,
            moves=model.moves(name),
        )
        for at, name in enumerate((*LINEAR_ERRORS, "eccentricity"))
    )
    zone = backlash_zone(model.stage, geometry, allocation.involute_grade)
    mid, half = (float(np.squeeze(limits)) for limits in zone)
    per_um = UM / lever(model.stage, geometry)
    bearing = float(np.squeeze(allocation.crank_bearing)) / UM
    play = model.output_factor * UM / geometry.centre_distance
    return Sources(
        total,
        ARCMIN,
        (
            *cycloid,
            flank_clearance(half / per_um, per_um, total.free[0].distribution, mid / max(half, 1e-300)),
            Source(
                "crank_bearing_um",
                "um",
                "clearance of the crank-arm bearings",
                0.5 * bearing,
                play,
                clipped=False,
                at=1,
                law=total.free[1].distribution,
                from_zero=True,
            ),
        ),
    )
