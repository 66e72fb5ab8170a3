"""Backlash of the cycloid stage: contributions of the errors of its parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from ...section import Array
from ...units import UM
from .geometry import RvGeometry, clearance, contact_angle, raw_clearance

LINEAR_ERRORS = (
    "pin_circle_radius",
    "pin_position",
    "pin_hole_radius",
    "pin_radius",
    "pitch",
    "runout",
    "equidistance",
    "shift",
)
"""The errors that act at first order, in the order of document B's table."""
ROTATIONS = ("pin_position", "pitch")
"""Errors whose mean turns all pins, or all teeth, by the same angle: it causes no backlash."""


def coefficients(geometry: RvGeometry) -> dict[str, float]:
    """A of phi_2 = A . delta / (e z_c), by name of the error.

    Twice the relative sensitivities that document B prints: with the factor two the printed
    e z_c/(2 a_0) of the crank bearing agrees with the printed phi_3, the printed optimum with the
    printed 0.11', and exact geometry with the formula (docs/decisions/0030).
    """
    k1, flank = geometry.k1, geometry.flank
    return {
        "pin_circle_radius": 2.0 * flank,
        "pin_position": 2.0 * k1,
        "pin_hole_radius": 2.0,
        "pin_radius": -2.0,
        "pitch": k1,
        "runout": 0.5,
        "equidistance": 2.0,
        "shift": -2.0 * flank,
    }


def pin_circle_growth(geometry: RvGeometry, disc: Array, housing: Array) -> Array:
    """Growth [m] of the pin circle against the disc, (n,), by temperature rises [K] of both.

    alpha r_p (housing - disc): a uniformly warmed unit stays geometrically similar, so that its
    backlash, an angle, does not change.
    """
    return geometry.expansion * geometry.pin_circle_radius * (housing - disc)


@dataclass(frozen=True, slots=True)
class EccentricityLaw:
    """phi_2 changes by factor/(e z_c) (linear d + quadratic d^2) with an eccentricity error d [m].

    Document B has 0 at first order. With a factor of 1 the coefficients are fitted to exact 40-pin
    geometry of the RV-40E-121 (67.8 arcmin/mm times the polynomial) and hold for |d| <= 10 um; a
    factor of 2 counts the error once for each flank, which is twice the correct value.
    """

    linear: float = -0.055
    quadratic: float = -12.6e3
    factor: float = 1.0

    def expanded(self, mid: float) -> tuple[float, float, float]:
        """Constant, linear and quadratic coefficient about d = mid + x."""
        constant = self.linear * mid + self.quadratic * mid**2
        return constant, self.linear + 2.0 * self.quadratic * mid, self.quadratic


# Target clearances of the tooth modification over the profile angle phi in [0, pi].
#
# Document B names its target (near-conjugate, uniform load, adequate lubrication) but prints neither
# its numbers nor the band of angles in which it counts: both are inputs here.


Band = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Target clearance [m] at profile angles [rad] and the weights of the angles; all (n + 1,).

    An angle of weight 0 is not in the sum, but the constraints hold there.
    """

    phi: Array
    clearance: Array
    weight: Array


def angles(intervals: int) -> Array:
    """The n + 1 profile angles [rad], evenly spaced over [0, pi]."""
    return np.linspace(0.0, np.pi, intervals + 1)


def within(phi: Array, band: Band) -> Array:
    """Weight 1 where phi lies in the band [rad], ends included, else 0."""
    slack = 1e-9
    return np.where((phi >= band[0] - slack) & (phi <= band[1] + slack), 1.0, 0.0)


def film(phi: Array, thickness: float, band: Band) -> Target:
    """A lubrication film of one thickness [m] over a band [rad]; elsewhere there is no target."""
    return Target(phi, np.full_like(phi, thickness), within(phi, band))


def near_conjugate(geometry: RvGeometry, phi: Array, rotation: float, radial_gap: float, band: Band) -> Target:
    """The rotation-modified profile with relief at tip and root, at all angles.

    Turning by `rotation` [rad] opens e z_c rotation sin(phi)/sqrt(S): all teeth touch together once
    the disc has turned back. Outside of the working band [rad] a parabolic relief, an assumption,
    grows to the radial gap [m] at root (phi = 0) and tip (phi = pi).
    """
    root = np.sqrt(1.0 + geometry.k1**2 - 2.0 * geometry.k1 * np.cos(phi))
    open_flank = geometry.lever * rotation * np.sin(phi) / root
    start, end = band
    below = np.clip((start - phi) / max(start, 1e-12), 0.0, 1.0)
    above = np.clip((phi - end) / max(np.pi - end, 1e-12), 0.0, 1.0)
    relief = radial_gap * (below**2 + above**2)
    return Target(phi, open_flank + relief, np.ones_like(phi))


def table(phi: Array, at: Array, clearance: Array) -> Target:
    """A table of the user: clearance [m] at rising angles `at` [rad], straight in between.

    Angles outside of the table are omitted. Raises ValueError where the angles do not rise.
    """
    if not np.all(np.diff(at) > 0.0):
        raise ValueError(f"the angles of a clearance table must rise, got {at}")
    inside = within(phi, (float(at[0]), float(at[-1])))
    return Target(phi, np.interp(phi, at, clearance), inside)


# Tooth modification by document B: least sum of deviations from a target, under g1 to g5.
#
# Every clearance is linear in (dr_rp, dr_p), so that the problem is a linear programme: minimise
# sum w_i t_i with |clearance(phi_i) - target_i| <= t_i. HiGHS solves it, and its multipliers prove
# it: for multipliers y of any origin, y . b + min over the box of (c - A'y) . x is a lower bound of
# the optimum, which is computed here independently of the solver.


Clearance = Callable[[RvGeometry, Array, Array, Array], Array]
CLEARANCES: dict[str, Clearance] = {"raw": raw_clearance, "after_contact": clearance}
"""D_raw, the profile in its nominal position, and D, after the disc has turned to first contact."""
MAX_MODIFICATION_M = 1e-3
"""Largest size [m] of a modification in the search: ten times the largest modification in use."""


@dataclass(frozen=True, slots=True)
class Fit:
    """The optimum: modifications [m], the sum of deviations [m] and its proven lower bound [m]."""

    dr_rp: float
    dr_p: float
    deviation: float
    bound: float

    @property
    def gap(self) -> float:
        """Deviation minus its proven lower bound [m]."""
        return self.deviation - self.bound


@dataclass(frozen=True, slots=True, eq=False)
class Programme:
    """min cost . x, above x <= below, equal x = to, 0 bound: low <= x <= high."""

    cost: Array
    above: Array
    below: Array
    equal: Array
    to: Array
    low: Array
    high: Array

    def bound(self, upper: Array, equality: Array) -> float:
        """Lower bound of the optimum by multipliers (upper <= 0) of the constraints."""
        upper = np.minimum(upper, 0.0)
        reduced = self.cost - self.above.T @ upper - self.equal.T @ equality
        within = np.minimum(reduced * self.low, reduced * self.high).sum()
        return float(upper @ self.below + equality @ self.to + within)


def fit(geometry: RvGeometry, target: Target, radial_gap: float | None, kind: str = "raw") -> Fit:
    """The modification nearest to `target`; `radial_gap` [m] is kept exactly, or free where None.

    `kind` is one of `CLEARANCES`. g4 is printed as > 0: its closure, >= 0, is used. Raises
    ArithmeticError where no modification meets the constraints (a gap beyond `MAX_MODIFICATION_M`).
    """
    programme = _programme(geometry, target, radial_gap, CLEARANCES[kind])
    solution = scipy.optimize.linprog(
        programme.cost,
        A_ub=programme.above,
        b_ub=programme.below,
        A_eq=programme.equal,
        b_eq=programme.to,
        bounds=list(zip(programme.low.tolist(), programme.high.tolist(), strict=True)),
        method="highs",
    )
    if solution.x is None or solution.fun is None:
        raise ArithmeticError(f"no modification meets the constraints g1 to g5: {solution.message}")
    bound = programme.bound(solution.ineqlin.marginals, solution.eqlin.marginals)
    dr_rp, dr_p = (float(value) * UM for value in solution.x[:2])
    return Fit(dr_rp, dr_p, float(solution.fun) * UM, bound * UM)


def _programme(geometry: RvGeometry, target: Target, radial_gap: float | None, kind: Clearance) -> Programme:
    """In micrometres: x = (dr_rp, dr_p, t of every angle that counts)."""
    zero, unit = np.zeros(1), np.ones(1)
    rows = np.stack([kind(geometry, unit, zero, target.phi), kind(geometry, zero, unit, target.phi)], axis=1)
    counts = target.weight > 0.0
    size, clearance = int(counts.sum()), target.clearance[counts] / UM
    slack = -np.eye(size)
    inside = rows[counts]
    g34 = np.array([[-1.0, 1.0], [-1.0, geometry.flank]])
    nonnegative = np.vstack([g34, -rows])
    above = np.block([[inside, slack], [-inside, slack], [nonnegative, np.zeros((len(nonnegative), size))]])
    below = np.concatenate([clearance, -clearance, np.zeros(len(nonnegative))])
    equal = np.zeros((0 if radial_gap is None else 1, 2 + size))
    equal[:, :2] = (1.0, -1.0)
    to = np.full(len(equal), 0.0 if radial_gap is None else radial_gap / UM)
    most = MAX_MODIFICATION_M / UM
    reach = float(np.abs(clearance).max(initial=0.0)) + most * float(np.abs(rows).sum(axis=1).max())
    low = np.concatenate([[-most, -most], np.zeros(size)])
    high = np.concatenate([[0.0, 0.0], np.full(size, reach)])
    cost = np.concatenate([[0.0, 0.0], target.weight[counts]])
    return Programme(cost, above, below, equal, to, low, high)


# The tooth clearance exactly as document B prints it: for comparison, not for use.
#
# Delta(phi) = [dr_rp (1 - sin phi) - dr_p (1 - cos(phi - phi_0)) - d_delta e z_c sin phi]/sqrt(S),
# S = 1 + k1^2 - 2 k1 cos(phi - phi_0). It violates the document's constraint g5 at the
# document's optimum; `modification` has the corrected forms (docs/decisions/0004).


def printed_clearance(
    geometry: RvGeometry,
    dr_rp: Array | float,
    dr_p: Array | float,
    phi: Array,
    rotation: Array | float = 0.0,
    own_phase: bool = False,
) -> Array:
    """The printed Delta(phi) [m]; with `own_phase` S is taken at phi instead of phi - phi_0."""
    from_contact = phi - contact_angle(geometry)
    at = phi if own_phase else from_contact
    root = np.sqrt(1.0 + geometry.k1**2 - 2.0 * geometry.k1 * np.cos(at))
    modified = dr_rp * (1.0 - np.sin(phi)) - dr_p * (1.0 - np.cos(from_contact))
    return np.asarray((modified - rotation * geometry.lever * np.sin(phi)) / root)
