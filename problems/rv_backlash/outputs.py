"""Outputs of `rv_backlash`, its default limits and objectives."""

from __future__ import annotations

from ...declarations import Output
from ..settings import Bound

OUTPUTS = (
    Output("cost", "", "relative manufacturing cost, sum of the cost curves", low=0.0),
    Output("phi_1_arcmin", "arcmin", "mean backlash of the involute stage"),
    Output("phi_2_arcmin", "arcmin", "mean of the cycloid stage, stagger included; below zero: interference"),
    Output("phi_3_arcmin", "arcmin", "mean backlash of the output stage"),
    Output("backlash_geometric_mean_arcmin", "arcmin", "mean of phi_1 + phi_2 + phi_3"),
    Output("backlash_geometric_std_arcmin", "arcmin", "standard deviation of the same", low=0.0),
    Output(
        "backlash_geometric_arcmin",
        "arcmin",
        "mean + k standard deviations of the same, k the standard normal quantile at the coverage",
    ),
    Output("backlash_mean_arcmin", "arcmin", "mean of phi_1 + max(0, phi_2) + phi_3", low=0.0),
    Output("backlash_std_arcmin", "arcmin", "standard deviation of the same", low=0.0),
    Output("backlash_rms_arcmin", "arcmin", "root mean square of the same over units", low=0.0),
    Output("backlash_arcmin", "arcmin", "one-sided quantile of phi_1 + max(0, phi_2) + phi_3 at the coverage", low=0.0),
    Output(
        "yield_percent",
        "%",
        "units whose effective backlash keeps backlash_limit_arcmin",
        100.0,
        larger_is_better=True,
        low=0.0,
        high=100.0,
    ),
    Output("interference_probability", "", "probability of phi_2 < 0 (preload)", low=0.0, high=1.0),
    Output("radial_gap_mm", "mm", "clearance at tooth tip and root, dr_rp - dr_p (g3)", 0.03, larger_is_better=True),
    Output("clearance_min_mm", "mm", "least raw flank clearance of the modification", 0.03, larger_is_better=True),
    Output("conjugate_clearance_min_mm", "mm", "least clearance after first contact (g5)", 0.03, larger_is_better=True),
    Output("modification_backlash_arcmin", "arcmin", "backlash that the modification itself leaves (g4)"),
    Output("backlash_mean_arcmin_error", "arcmin", "stated numerical error", error_of="backlash_mean_arcmin"),
    Output("backlash_std_arcmin_error", "arcmin", "stated numerical error", error_of="backlash_std_arcmin"),
    Output("backlash_rms_arcmin_error", "arcmin", "stated numerical error", error_of="backlash_rms_arcmin"),
    Output("backlash_arcmin_error", "arcmin", "stated numerical error", error_of="backlash_arcmin"),
    Output("yield_percent_error", "%", "stated numerical error", error_of="yield_percent"),
    Output("interference_probability_error", "", "stated numerical error", error_of="interference_probability"),
)

DEFAULT_LIMITS = {
    "dr_rp_mm": Bound(high=0.0),
    "dr_p_mm": Bound(high=0.0),
    "radial_gap_mm": Bound(low=0.03),
    "modification_backlash_arcmin": Bound(low=0.0),
    "conjugate_clearance_min_mm": Bound(low=0.0),
}
"""Radial gap at least 0.03 mm, and g1 to g5 of document B (g3 is implied by the gap)."""

DEFAULT_OBJECTIVES = ("cost", "backlash_arcmin")
