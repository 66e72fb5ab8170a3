"""Configurations that state every optional table once, for the reference of all keys.

They are read, not run, and may contradict themselves.
"""

from __future__ import annotations

from typing import Any

from tolevo import registry

COST = {"model": "reciprocal", "a": 1.0, "b": 0.1}
MEASURED = {
    "values": [10.0, 10.01, 9.99, 10.02, 9.98, 10.0, 10.01, 9.99],
    "made_to": 0.03,
    "mean": "as_found",
    "gauge": {"sigma": 0.001, "df": 40},
    "prior": {"cp": 1.0, "parts": 10},
}
MACHINES = [
    {"name": "lathe", "sigma": 0.004, "mean": 0.0, "price": 2.0, "setup": {"price": 60.0, "lot": 9},
     "t_min": 0.01, "t_max": 0.02,
     "inspection": {"price": 0.3, "u": 0.0003, "guard": 1.0, "required": False, "scrap": True,
                    "rework": {"price": 0.8, "success": 0.9, "side": "upper"}}},
    {"name": "mill", "measured": MEASURED, "price": 3.0},
]  # fmt: skip
PRICES_OF_LATHE = {"per_hour": 3.0, "time": 0.1, "price": 0.3, "setup": 9.0, "inspection": 0.1, "rework": 0.1}
PART = {"nominal": 10.0, "unit": "mm", "sensitivity": {"gap": 1.0, "tilt": 0.1}}
PARTS = [
    {**PART, "name": "a", "t_min": 0.01, "t_max": 0.1, "cost": COST, "count": 2, "drawing": "1",
     "characteristic": "2", "geometry": "position", "setup": {"price": 9.0, "lot": 9},
     "inspection": {"price": 0.3}, "distribution": "normal", "cp": 1.2, "cpk": 1.0},
    {**PART, "name": "b", "machine": MACHINES},
    {**PART, "name": "c", "t_min": 0.01, "t_max": 0.1, "cost": COST, "measured": MEASURED},
    {**PART, "name": "d", "process": [{"name": "p", "t_min": 0.01, "t_max": 0.1, "cost": COST,
                                        "setup": {"price": 9.0, "lot": 9},
                                        "inspection": {"price": 0.3}},
                                       {"name": "q", "tolerance": 0.01, "price": 4.0}],
     "material": "steel", "source": "guess", "drawn_as": "diameter"},
    {**PART, "name": "e", "grade": ["IT5", "IT8"], "price": {"IT5": 4.0, "IT8": 1.0}},
    {**PART, "name": "f", "fit": "25 g6"},
    {**PART, "name": "g", "general": "m", "feature": "radius", "leg": 10.0},
    {**PART, "name": "h", "limits": "+0.02/-0.01", "cost": COST},
    {**PART, "name": "i", "grade": "IT6"},
    {**PART, "name": "j", "tolerance": 0.01, "shift": 0.1, "expansion": 1e-5},
    {**PART, "name": "o", "tolerance": 0.01, "measured": {"values": MEASURED["values"], "mid": 10.0, "made_to": 0.03}},
    {**PART, "name": "m", "tolerance": 0.01, "measured": {"n": 9, "mean": 10.0, "s": 0.003}},
    {**PART, "name": "n", "tolerance": 0.01, "measured": {"n": 9, "cp": 1.2, "cpk": 1.0}},
    {**PART, "name": "k"},
    {**PART, "name": "l"},
]  # fmt: skip
REQUIREMENTS = [
    {"name": "gap", "unit": "mm", "lower": 0.0, "upper": 0.5, "nominal": 0.2, "weight": 1.0},
    {"name": "tilt", "unit": "mm", "lower": 0.0, "method": "rss", "description": "", "drawing": ""},
]
LABELS = {"name": "", "description": "", "drawing": ""}
CHOICE = {
    "choice": {"budget": 1.0, "limits": {"cost": 1.0}, "weights": {"cost": 1.0},
               "roughness_share": 0.1},
    "rounding": {"steps": "preferred"},
}  # fmt: skip
STACK: dict[str, Any] = {
    **LABELS,
    **CHOICE,
    "problem": "stack",
    "currency": "EUR",
    "costs": {"scale_assumed": 1.0, "assumed": ["a"]},
    "requirement": REQUIREMENTS,
    "part": PARTS,
    "fit": [{"parts": ["k", "l"], "size": "25 H7/g6"}],
    "correlation": [{"parts": ["a_1", "c"], "coefficient": 0.5}],
    "matched": [{"parts": ["k", "l"], "classes": 3, "u_um": 0.1, "price": 0.1}],
    "condition": [
        {
            "name": "warm",
            "temperature_C": 60.0,
            "minimise": ["gap.rss"],
            "limits": {"gap": {"variation": {"min": 0.0, "max": 0.2}}},
        }
    ],
    "feature": [
        {
            "name": "m",
            "kind": "position",
            "zone": 0.1,
            "of": "h",
            "size": "h",
            "material": "mmc",
            "internal": True,
            "distribution": "normal",
            "cp": 1.0,
            "unit": "mm",
            "drawing": "1",
            "characteristic": "2",
        },
        {"name": "n", "kind": "perpendicularity", "t_min": 0.01, "t_max": 0.1, "cost": COST, "height": 9.0, "arm": 9.0},
        {"name": "o", "kind": "float", "of": ["h", "f"]},
    ],
    "limits": {"gap": {"variation": {"min": 0.0, "max": 0.2}}, "cost": {"max": 9.0}},
    "objectives": {"minimise": ["cost", "gap.variation"]},
    "promise": {"yield_percent": 99.0, "statement": "assured", "confidence_percent": 95.0},
    "effect": [],
    "unresolved": [],
}
ONE = {
    "problem": "stack",
    "requirement": {"name": "gap", "unit": "mm", "formula": "u + rest", "lower": 0.0, "upper": 30.0},
    "let": [{"name": "rest", "formula": "b"}],
    "cost": [{"name": "co2_kg", "unit": "kg", "curves": {"a": COST, "c": {"lathe": PRICES_OF_LATHE, "mill": 1.0}}},
             {"name": "all", "weights": {"cost": 1.0}}],
    "robust": {"factor": 1.5, "factors": {"a": 1.2}},
    "loop": [{"name": "triangle", "unknown": {"u": 14.0, "phi": "-45 deg"},
              "link": [{"length": "a", "angle": "45 deg"}, {"length": "b", "angle": "phi"},
                       {"length": "u", "direction": [-1, 0]}]}],
    "part": [*({"name": name, "nominal": 10.0, "t_min": 0.01, "t_max": 0.1, "cost": COST} for name in "ab"),
             {"name": "c", "nominal": 10.0, "machine": MACHINES}],
}  # fmt: skip
JOINT = {
    "d_mm": 100.0, "a_mm": 100.0, "alpha_deg": 90.0, "offset_deg": 0.0, "mass_kg": 5.0,
    "centre_of_mass_mm": [0, 0, 0], "range_deg": [-90, 90],
    "zero_mrad": {"low": 0.01, "high": 0.2, "cost": COST, "group": "all"}, "alpha_mrad": 0.1,
    "reducer": {"run": "robot_reducer.toml", "group": "one", "flank": "held"},
}  # fmt: skip
ARM: dict[str, Any] = {
    "problem": "serial_arm",
    "joint": [JOINT, JOINT, JOINT],
    "cell": {"centre_mm": [200, 0, 100], "side_mm": 50, "poses": "iso_cube", "per_edge": 2,
             "tool_mm": [0, 0, 0], "turn_deg": [0, 0, 0], "near_deg": [0, 0, 0], "at": "tool"},
    "base": {"x_mm": 0.0},
    "tool": {"x_mm": 0.0},
    "parameters": {"nested": True, "per_drive": True, "flanks": "held"},
}  # fmt: skip
POSE = {"problem": "pose_accuracy", "grouping": {"rod_length_12_um": ["rod_length_1"]}}
PRICES = {"rms_arcmin": [0.2, 0.5], "cost": [9.0, 5.0], "source": "x"}
MANIPULATOR = {"problem": "robot_joint", "reducers": {"1": PRICES},
               "parameters": {"nested": False, "per_drive": True}}  # fmt: skip
BACKLASH: dict[str, Any] = {
    "problem": "rv_backlash",
    "variables": {
        "pitch_um": {"value": 3.0, "mid": 0.0, "cp": 1.0, "machine": MACHINES},
        "runout_um": {"measured": MEASURED, "low": 1.0, "high": 2.0},
        "shift_um": {"limits": "+0.02/-0.01"},
    },
    "limits": {"backlash_arcmin": {"min": 0.0, "max": 1.0}},
}
EFFECTS = {
    "model": "rv_transmission",
    "effect": [
        {"name": "drift", "parameters": {"rate_arcsec_per_s": 0.1}},
        {"name": "mine", "formula": "a * abs(torque_Nm) ** b", "output": "te_arcsec", "bounds": {"b": [0.5, 2.0]},
         "parameters": {"a": 0.1, "b": 1.0}},
    ],
    "unresolved": [
        {"output": "te_arcsec", "variable": "torque_Nm", "shape": "curve", "exponent": 1.0,
         "zero": 0.0, "scale": 1.0, "signed": True, "order": 1.0, "knots": [0.0, 1.0],
         "heights": [0.0, 1.0], "radii": [0.1], "labels": ["a"], "times": "torque_Nm", "times_exponent": 1.0,
         "times_zero": 0.0, "times_scale": 1.0, "times_magnitude": True, "turns": False,
         "coefficients": [1.0]},
    ],
    "zero": {"te_arcsec": 0.0},
    "record": {"torque_Nm": [0.0, 100.0]},
    "sense": {"te_arcsec": -1},
    "columns": {"x": {"of": "te_arcsec", "unit": "arcsec", "role": "measured", "sense": -1}},
}  # fmt: skip
REDUCER: dict[str, Any] = {
    "problem": "rv_reducer",
    "parameters": {"wear_um_per_1000h": 0.1},
    "objectives": {"minimise": ["cost"]},
    "condition": [
        {"name": "cold", "limits": {"backlash_max_arcmin": 1.0}},
        {"name": "warm", "temperature_C": 40.0, "disc_temperature_C": 42.0, "housing_temperature_C": 40.0, "hours": 9.0,
         "torque_Nm": 300.0, "parameters": {"te_torque_Nm": 100.0}, "limits": {"interference_probability": 0.05},
         "effect": [{"name": "process_mean_shift", "parameters": {"shift_arcmin": 0.1}}]},
    ],
}  # fmt: skip
"""A reducer cold and warm."""
ROBOT: dict[str, Any] = {
    "problem": "robot_joint",
    "parameters": {"nested": False},
    "objectives": {"minimise": ["cost"]},
    "condition": [{"name": "laden", "payload_kg": 10.0, "limits": {"pose_rms_mm": 9.0}}],
}
GAP: dict[str, Any] = {
    **EFFECTS,
    "run": "configs/rv_transmission_error.toml",
    "built_to": {"run": "runs/x", "point": "knee"},
    "free": {"absorption": 0.1},
    "effects": {"consider": ["drift"], "never": ["creep"]},
    "noise": {"te_arcsec": 0.8},
    "validation": {"blocks": "auto"},
    "data": {"drop_bad_rows": True},
    "settings": {"empirical": True},
    "next_measurement": {"readings": 40, "effects": ["drift"], "amount": {"drift": 1.0},
                         "range": {"torque_Nm": {"values": [1.0, 2.0]}}},
}  # fmt: skip
TABLE: dict[str, Any] = {
    "model": "table",
    "columns": {
        "m": {"role": "measured", "unit": "arcsec", "sense": 1},
        "p": {"role": "predicted", "unit": "arcsec", "of": "m"},
    },
    "effects": {"consider": "all"},
}
GEARS = (
    {"kind": "rv", "pins": 40, "cycloid_teeth": 39, "sun_teeth": 12, "planet_teeth": 36},
    {"kind": "cycloidal", "pins": 40, "cycloid_teeth": 39},
    {"kind": "harmonic", "flex_teeth": 100, "circular_teeth": 102},
    {"kind": "planetary", "sun_teeth": 12, "planet_teeth": 36, "ring_teeth": 84, "planets": 3},
    {"orders": {"pin passing": 45}},
)
STUDY: dict[str, Any] = {
    **LABELS,
    "run": {"problem": "pose_accuracy", "objectives": {"minimise": ["cost"]}},
    "seed": 1,
    "seeds": 2,
    "response": ["gap_percent"],
    "time_limit_s": 9.0,
    "vary": {"algorithm.population": [20, 40],
             "algorithm.crossover.probability": {"low": 0.1, "high": 0.9, "levels": 3}},
    "reading": [{"figure": "1", "says": "", "key": "algorithm.population", "a": 20, "b": 40,
                 "response": "gap_percent", "expect": "worse"}],
}  # fmt: skip
CLAIMS: dict[str, Any] = {
    "document": "P",
    "title": "x",
    "reference": "",
    "seed": 1,
    "study": "",
    "claim": [
        {"id": "many", "place": "1", "quantity": "x", "printed": 0.05, "unit": "1",
         "relation": "above", "reading": [
             {"model": "rv_batch", "variables": {"crank_bearing_um": {"value": 20.0}}, "units": 9,
              "output": "backlash_arcmin", "statistic": "fraction_above", "threshold": 1.0},
             {"states": "x", "model": "rv_batch", "units": 9, "output": "backlash_arcmin",
              "statistic": "quantile", "level": 0.9}]},
        {"id": "slope", "place": "2", "quantity": "x", "printed": "-4", "unit": "1",
         "tolerance": 1.0, "tolerance_reason": "x", "reading": [
             {"problem": "rv_backlash", "reference": "document B", "output": "phi_2_arcmin",
              "parameters": {"reading": "printed"},
              "derivative": {"by": "stagger_arcmin", "step": 0.05}}]},
    ],
}  # fmt: skip
"""A file of claims."""


def _of_kinds() -> list[dict[str, Any]]:
    """One sample for each algorithm, cost curve, distribution and study design."""
    ours = {one: [e["name"] for e in entries if e["origin"].startswith("tolevo ")]
            for one, entries in registry.listing().items()}  # fmt: skip
    found: list[dict[str, Any]] = [
        {"problem": "pose_accuracy", "algorithm": {"name": name, "crossover": {}, "mutation": {}}}
        for name in ours["algorithms"]
    ]
    found += [{"problem": "rv_backlash", "costs": {"pitch_um": {"model": name}}}
              for name in ours["curves"]]  # fmt: skip
    found += [{"problem": "rv_backlash",
               "variables": {"pitch_um": {"distribution": name, "value": 2.0}}}
              for name in ours["distributions"]]  # fmt: skip
    found += [STUDY | {"design": {"kind": name}} for name in ours["designs"]]
    return found


SAMPLES: tuple[dict[str, Any], ...] = (
    STACK, ONE, ARM, POSE, MANIPULATOR, BACKLASH, REDUCER, ROBOT, EFFECTS, GAP, TABLE,
    *(TABLE | {"gear": gear} for gear in GEARS), *_of_kinds(),
)  # fmt: skip
"""All of them."""
