"""Reference allocations for a front of `rv_reducer`, all of them tested by contact."""

from __future__ import annotations

_ZONES = (
    "pin_circle_radius_um",
    "pin_position_um",
    "pin_hole_radius_um",
    "pin_radius_um",
    "pitch_um",
    "runout_um",
    "eccentricity_um",
    "equidistance_um",
    "shift_um",
    "crank_bearing_um",
    "involute_grade",
    "stagger_arcmin",
    "dr_rp_mm",
    "dr_p_mm",
)


def _design(*values: float) -> dict[str, float]:
    return dict(zip(_ZONES, values, strict=True))


REFERENCES: dict[str, dict[str, float]] = {
    "document B": {},
    "document B, discs staggered by 0.2 arcmin each": {"stagger_arcmin": 0.2},
    "least cost at 1 arcmin by document B's closed form": _design(
        1.423, 1.275, 1.092, 0.469, 2.430, 1.454, 4.683, 0.618, 0.882, 0.839, 4, 0.0, -0.0474, -0.0863
    ),
    "the same by its genetic algorithm, staggered": _design(
        1.427, 1.123, 1.080, 0.496, 2.566, 1.505, 4.849, 0.665, 0.939, 0.834, 4, 0.3922, -0.03874, -0.0814
    ),
}
"""Designs by label; a variable that is left out has the document's value. The optimum of the closed
form is proven within 1 %; the staggered design is where a genetic algorithm of version 0.1 ended."""
