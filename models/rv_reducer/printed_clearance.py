"""The tooth clearance exactly as document B prints it: for comparison, not for use.

Delta(phi) = [dr_rp (1 - sin phi) - dr_p (1 - cos(phi - phi_0)) - d_delta e z_c sin phi]/sqrt(S),
S = 1 + k1^2 - 2 k1 cos(phi - phi_0). It violates the document's constraint g5 at the
document's optimum; `modification` has the corrected forms (docs/decisions/0004).
"""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from .geometry import RvGeometry
from .modification import contact_angle


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
