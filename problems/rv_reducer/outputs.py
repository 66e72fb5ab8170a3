"""Outputs of `rv_reducer`, its default limits and objectives."""

from __future__ import annotations

from ...declarations import Output
from ..settings import Bound

MEASURED = {
    "backlash_max_arcmin": "largest backlash of a unit over the positions of a turn",
    "backlash_mean_arcmin": "mean backlash of a unit over the positions of a turn",
}
"""What rigid units show, by output: each has a quantile, a mean and a standard deviation."""
ELASTIC = {
    "lost_motion_arcmin": "rotation between -3 % and +3 % of the rated torque, mean over the turn",
    "transmission_error_arcsec": "half the peak-to-peak transmission error over a turn, under te_torque_Nm",
    "preload_torque_Nm": "torque of the preloaded flanks without load, mean over the turn",
    "peak_pin_force_N": "largest force on a pin over the turn at the rated torque",
}
"""What units show under load, by output."""


def _spread(name: str, meaning: str) -> tuple[Output, ...]:
    unit = name.rpartition("_")[2]
    return (
        Output(name, unit, f"{meaning}: one-sided quantile over units at the coverage", low=0.0),
        Output(f"{name}_mean", unit, f"mean over units of the {meaning}", low=0.0),
        Output(f"{name}_std", unit, f"standard deviation over units of the {meaning}", low=0.0),
    )


RIGID: tuple[Output, ...] = (
    Output("cost", "", "relative manufacturing cost, sum of the cost curves", low=0.0),
    *(output for name, meaning in MEASURED.items() for output in _spread(name, meaning)),
    Output("backlash_rms_arcmin", "arcmin", "root mean square of the backlash over units and positions", low=0.0),
    Output(
        "yield_percent",
        "%",
        "units whose largest backlash over the turn keeps backlash_limit_arcmin",
        100.0,
        larger_is_better=True,
        low=0.0,
        high=100.0,
    ),
    Output(
        "interference_probability",
        "",
        "probability of interference, as the parameter interference defines it; play of the crank bearings included",
        low=0.0,
        high=1.0,
    ),
    Output(
        "interference_share_of_turn",
        "",
        "fraction of all positions of all units at which flanks interfere",
        low=0.0,
        high=1.0,
    ),
    Output("overlap_p95_arcmin", "arcmin", "overlap that 95 % of the units stay below at every position", low=0.0),
    Output("phi_1_arcmin", "arcmin", "mean backlash of the involute stage", low=0.0),
    Output("radial_gap_mm", "mm", "clearance at tooth tip and root, dr_rp - dr_p", 0.03, larger_is_better=True),
    Output("modification_backlash_arcmin", "arcmin", "backlash that the modification itself leaves (first order)"),
)
UNDER_LOAD: tuple[Output, ...] = (
    *(output for name, meaning in ELASTIC.items() for output in _spread(name, meaning)),
    Output(
        "preload_torque_Nm_max",
        "Nm",
        "torque of the preloaded flanks without load, largest over the turn: one-sided quantile over units",
        low=0.0,
    ),
)
SAMPLED = (
    *(f"{name}{part}" for name in MEASURED for part in ("", "_mean", "_std")),
    "backlash_rms_arcmin",
    "yield_percent",
    "interference_probability",
    "interference_share_of_turn",
    "overlap_p95_arcmin",
)
"""Rigid outputs with a standard error."""


SAMPLED_UNDER_LOAD = tuple(output.name for output in UNDER_LOAD)
OUTPUTS = (
    *RIGID,
    *UNDER_LOAD,
    *(
        Output(f"{output.name}_error", output.unit, "standard error of the sample", error_of=output.name)
        for output in (*RIGID, *UNDER_LOAD)
        if output.name in (*SAMPLED, *SAMPLED_UNDER_LOAD)
    ),
)
"""All outputs; those under load come after the rigid ones, the errors last."""

DEFAULT_LIMITS = {
    "dr_rp_mm": Bound(high=0.0),
    "dr_p_mm": Bound(high=0.0),
    "radial_gap_mm": Bound(low=0.03),
    "modification_backlash_arcmin": Bound(low=0.0),
}
"""Radial gap at least 0.03 mm, and g1, g2, g4 of document B."""

DEFAULT_OBJECTIVES = ("cost", "backlash_max_arcmin")
