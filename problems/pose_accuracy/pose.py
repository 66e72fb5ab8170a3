"""The one pose that `[parameters.pose]` names."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...arrays import Array
from ...declarations import Value
from ...errors import Fault
from ...units import MM

PLACE = "parameters.pose"
ENDS = ("r_mm", "z_mm")


def pose_of(given: Value) -> tuple[Array, Array] | None:
    """Radius and height (1,) [m] of the table; None where it is empty."""
    if not isinstance(given, Mapping) or not given:
        return None
    r, z = (np.array([given[name]]) * MM for name in ENDS)
    return r, z


def words_of(given: Value) -> str:
    """Where the outputs at a pose are, in words."""
    if not isinstance(given, Mapping) or not given:
        return "at the worst pose of the ring"
    return f"at r {given['r_mm']:g} mm, z {given['z_mm']:g} mm"


def pose_faults(given: Value, ring_r: Value, ring_z: Value) -> list[Fault]:
    """A fault where half of the pose is missing, or where it lies outside of the ring [mm]."""
    if not isinstance(given, Mapping) or not given:
        return []
    faults = []
    for name, (low, high) in zip(ENDS, np.array([ring_r, ring_z]).tolist(), strict=True):
        if name not in given:
            faults.append(Fault(f"{PLACE}.{name}", "is missing: a pose has r_mm and z_mm"))
        elif not low <= given[name] <= high:
            text = f"must lie in the ring, [{low:.10g}, {high:.10g}], got {given[name]:.10g}"
            faults.append(Fault(f"{PLACE}.{name}", text))
    return faults
