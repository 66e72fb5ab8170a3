"""Staggered assembly: discs turned against each other, and the parts that do it.

Rigid discs on one carrier touch forward by the one that is turned ahead and backward by the other,
so that turning them apart by an angle takes exactly this angle from the backlash of the cycloid
stage. Document B writes phi_2' = phi_2 - 4 delta': its delta' is then half of what each disc is
turned (one ahead, one back), a quarter of what they are turned apart. Were delta' the turn of each
disc, or their angle apart, 2 delta' or 1 delta' would come out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .backlash import STAGGER_GAIN
from .geometry import RvGeometry

Array = NDArray[np.float64]


def turn_of_disc(stagger: Array) -> Array:
    """Turn [rad] of each disc, one ahead and one back, that makes 4 delta' of a stagger delta'."""
    return 0.5 * STAGGER_GAIN * stagger


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """What turns one disc by an angle, each way alone; all (n,).

    `hole_offset` [m]: all bearing holes of the disc displaced along their circle's tangents.
    `blank_angle` [rad]: the profile machined at this angle to the holes; `at_rim` [m] is the same
    on the radius of the pin circle. `journal_phase` [rad]: the disc's journals of all cranks
    ahead of nominal; `at_journal` [m] is how far that moves the journal's centre.
    """

    hole_offset: Array
    blank_angle: Array
    at_rim: Array
    journal_phase: Array
    at_journal: Array


def parts(geometry: RvGeometry, turn: Array) -> Parts:
    """The part dimensions that turn one disc by `turn` [rad], exact.

    A disc sits on its cranks by the holes: displaced by s along the tangents of a circle of radius
    a_0 they lie turned by arctan(s/a_0). A disc whose eccentrics are ahead by epsilon stands where
    it would stand epsilon later, but has not turned by epsilon/z_c in the meantime.
    """
    phase = geometry.cycloid_teeth * turn
    return Parts(
        hole_offset=geometry.centre_distance * np.tan(turn),
        blank_angle=np.asarray(turn),
        at_rim=geometry.pin_circle_radius * turn,
        journal_phase=phase,
        at_journal=2.0 * geometry.eccentricity * np.sin(0.5 * phase),
    )
