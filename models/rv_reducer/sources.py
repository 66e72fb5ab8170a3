"""The toleranced inputs of a unit of a batch, in the order of its sum."""

from __future__ import annotations

import numpy as np

from ...units import ARCMIN, UM
from ..inputs import Distribution
from ..propagation import ClippedSum
from ..sources import Source, Sources
from .backlash import Allocation, BacklashModel
from .cycloid import LINEAR_ERRORS
from .involute import backlash_zone, lever


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
