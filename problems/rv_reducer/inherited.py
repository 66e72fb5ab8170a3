"""Values that are still those of the RV-40E-121 where the geometry is not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from ...declarations import Value
from ..rv_backlash.costs import DEFAULT_COSTS
from ..settings import Settings
from .declared import DISC_TO_DISC, PARAMETERS, VARIABLES

GEOMETRY = (
    "pin_circle_radius_mm",
    "pin_radius_mm",
    "eccentricity_mm",
    "cycloid_teeth",
    "pins",
    "reduction_ratio",
    "sun_pitch_radius_mm",
    "centre_distance_mm",
    "discs",
    "cranks",
    "involute_stage",
)
GEARS = (
    "gear_runout_um",
    "base_pitch_deviation_um",
    "helix_deviation_um",
    "axis_parallelism_x_um",
    "axis_parallelism_y_um",
    "centre_distance_deviation_um",
    "thickness_deviation_upper_um",
    "thickness_deviation_lower_um",
)
STIFFNESS = ("normal_stiffness_N_per_mm", "series_stiffness_Nm_per_arcmin")
TORQUES = ("rated_torque_Nm", "momentary_torque_Nm")
OF_THE_STAGE = ("reduction_ratio", "sun_pitch_radius_mm", "pressure_angle_deg", *GEARS, "involute_grade")
"""What means nothing without an involute stage."""
DEFAULTS = {p.name: p.default for p in PARAMETERS}


def changed(parameters: Mapping[str, Value]) -> tuple[str, ...]:
    """Parameters of the geometry that are not the RV-40E-121's."""
    without = () if parameters["involute_stage"] else OF_THE_STAGE
    return tuple(name for name in GEOMETRY if name not in without and parameters[name] != DEFAULTS[name])


def still_default(given: Settings, parameters: Mapping[str, Value]) -> tuple[str, ...]:
    """One sentence that names every such value, none where the geometry is the RV-40E-121's.

    `given` are the settings as the user gives them, `parameters` the complete ones. A value that
    the user gives counts as the user's own, also where it is the same.
    """
    new = changed(parameters)
    inherited = "; ".join(_groups(given, bool(parameters["involute_stage"]))) if new else ""
    return (f"{', '.join(new)} changed; still the RV-40E-121's: {inherited}",) if inherited else ()


def _groups(given: Settings, stage: bool) -> Iterator[str]:
    values = given.parameters
    mids = [name for name in DEFAULTS if name.endswith("_mid_um")]
    yield from _inherited_names("", (n for n in (*GEOMETRY[:-1], "pressure_angle_deg")), values, stage)
    yield from _inherited_names("gear deviations", GEARS, values, stage)
    yield from _inherited_names("mid-limits", mids, values, stage)
    yield from _inherited_names("", (*STIFFNESS, *TORQUES), values, stage)
    ranges = [v.name for v in VARIABLES if v.name not in DISC_TO_DISC]
    yield from _inherited_names("search ranges", ranges, _set(given), stage)
    yield from _inherited_names("errors between discs", DISC_TO_DISC, _set(given), stage)
    yield from _inherited_names("costs", DEFAULT_COSTS, given.costs, stage)


def _inherited_names(group: str, names: Iterable[str], given: Mapping[str, object], stage: bool) -> Iterator[str]:
    """The names that are not given, all of a group by its name alone."""
    every = [name for name in names if stage or name not in OF_THE_STAGE]
    unstated = [name for name in every if name not in given]
    if group and unstated == every and unstated:
        yield f"all {len(unstated)} {group}"
    elif unstated:
        yield f"{group}: {', '.join(unstated)}" if group else ", ".join(unstated)


def _set(given: Settings) -> dict[str, object]:
    """Variables whose range or value is given."""
    return {
        name: setting
        for name, setting in given.variables.items()
        if (setting.value, setting.low, setting.high) != (None, None, None)
    }
