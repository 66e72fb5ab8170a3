"""Relative costs of the features of an RV-40E, all of them assumptions.

The documents print no cost data. The unit is the finishing cost of the 40 pin holes at their
document tolerance, divided by two. Each curve is a + b/t^k with t in um; b puts the variable part
at the document's half-width t_0 to the weight below, so C(t_0) = a + weight.

| feature | weight at t_0 | reasoning |
|---|---|---|
| pin holes, radius | 2.0 | 40 half-open bores, honed or ground one by one: the most expensive feature |
| pin position | 1.6 | indexing of the same 40 bores on a jig grinder |
| pin circle radius | 0.8 | one setting of the same machine, drifts with temperature |
| pins, radius | 0.6 | 40 pins, centreless ground in quantity and sorted in classes |
| pitch of the discs | 1.4 | generating grinding of two discs, indexing accuracy |
| runout of the discs | 0.5 | bore and profile ground in one clamping |
| equidistance, shift | 0.6 each | wheel dressing, and grinding centre distance |
| eccentricity | 1.2 | two crankshafts with two eccentrics each, ground out of centre |
| crank bearings | 0.8 | four needle bearings, sorted into clearance classes |
| involute gears | 0.8 .. 3.2 | grade 8 to 4: ground and inspected, about 1.3 to 1.6 per grade |

Exponents: k = 1 (reciprocal) where a size is reached by further passes on one machine, k = 0.6
where parts are sorted (narrower classes cost scrap and handling, not passes). Exponents between
about 0.5 and 1 are what reciprocal-power fits to process data use: Sutherland & Roth (1975);
Chase, Greenwood, Loosli & Hauglund (1990), Manufacturing Review 3(1), 49-59. Absolute values are
not transferable between shops: replace them under `[costs]` in the configuration.
"""

from __future__ import annotations

from ...models.costs import CostCurve, Reciprocal, ReciprocalPower, Table


def _sorted(weight: float, t_0: float) -> ReciprocalPower:
    return ReciprocalPower(a=0.1, b=round(weight * t_0**0.6, 6), k=0.6)


def _ground(weight: float, t_0: float) -> Reciprocal:
    return Reciprocal(a=0.1, b=round(weight * t_0, 6))


DEFAULT_COSTS: dict[str, CostCurve] = {
    "pin_circle_radius_um": _ground(0.8, 3.0),
    "pin_position_um": _ground(1.6, 2.0),
    "pin_hole_radius_um": _ground(2.0, 1.5),
    "pin_radius_um": _sorted(0.6, 1.0),
    "pitch_um": _ground(1.4, 4.0),
    "runout_um": _ground(0.5, 1.0),
    "eccentricity_um": _ground(1.2, 1.0),
    "equidistance_um": _ground(0.6, 1.0),
    "shift_um": _ground(0.6, 1.0),
    "crank_bearing_um": _sorted(0.8, 2.0),
    "involute_grade": Table(t=(4.0, 5.0, 6.0, 7.0, 8.0), cost_at=(3.2, 2.0, 1.4, 1.0, 0.8)),
}
