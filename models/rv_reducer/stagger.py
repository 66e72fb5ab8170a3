"""Staggered assembly: discs turned against each other, and the parts that do it.

The stagger is the angle by which one disc is turned ahead and the other back. Rigid discs on one
carrier touch forward by the disc that is turned ahead and backward by the other, so that they
reduce the backlash of the cycloid stage by exactly the angle between them: twice the stagger.
Document B writes phi_2' = phi_2 - 4 delta': its delta' is then half of the stagger.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .geometry import RvGeometry


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Alternative part dimensions, each of which turns a disc by the same angle; all (n,).

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


def parts(geometry: RvGeometry, stagger: Array) -> Parts:
    """The part dimensions that turn one disc by `stagger` [rad], exact.

    A disc is placed on its cranks by the holes: holes displaced by s along the tangents of a circle
    of radius a_0 are turned by arctan(s/a_0). A disc whose eccentrics are ahead by epsilon has the
    position that it would have epsilon later, without the turn by epsilon/z_c.
    """
    phase = geometry.cycloid_teeth * stagger
    return Parts(
        hole_offset=geometry.centre_distance * np.tan(stagger),
        blank_angle=np.asarray(stagger),
        at_rim=geometry.pin_circle_radius * stagger,
        journal_phase=phase,
        at_journal=2.0 * geometry.eccentricity * np.sin(0.5 * phase),
    )
