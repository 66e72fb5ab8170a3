"""Errors of the parts of an RV reducer, for batches of units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Self

import numpy as np

from ....arrays import Array

_ERRORS = {
    ("units", "discs", "pins"): ("pin_radius", "hole_radius", "radial_position", "tangential_position"),
    ("units", "discs"): ("equidistance", "shift", "pitch", "pitch_phase", "disc_offset", "disc_offset_phase", "angle"),
    ("units", "cranks", "discs"): (
        "crank_phase",
        "eccentricity",
        "bearing_clearance",
        "bore_radial",
        "bore_tangential",
    ),
    ("units",): ("circle_radius", "circle_offset", "circle_phase"),
}
AXES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {name: axes for axes, names in _ERRORS.items() for name in names}
)
"""The axes of each error; any of them may have length 1 or, from the left, be omitted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartErrors:
    """Deviations from nominal: lengths in metres, angles in radians, zero where not given.

    Shapes broadcast from the right to those of `AXES`: a full-length pin is (units, 1, pins), one
    value per unit of a pin error is (units, 1, 1), a whole crank is (units, cranks, 1).

    `tangential_position` is counter-clockwise. `pitch` is the cumulative pitch error F_p: the tooth
    at angle u of its disc is displaced by F_p/2 cos(u - pitch_phase). `disc_offset` is the distance
    of the profile's centre from the bearings' (half the runout F_r), at `disc_offset_phase` in the
    disc; `circle_offset` that of the pin circle from the main bearing, at `circle_phase` in the
    housing. `angle` turns a disc forward (its angular error, or stagger). `crank_phase`,
    `eccentricity` and `bearing_clearance` (full radial play [0, c]) are of each eccentric.
    `bore_radial` (outwards) and `bore_tangential` (counter-clockwise) are the position errors of
    each bearing bore in its disc, along and across the line from the disc's centre to the bore.
    """

    pin_radius: Array | float = 0.0
    hole_radius: Array | float = 0.0
    radial_position: Array | float = 0.0
    tangential_position: Array | float = 0.0
    equidistance: Array | float = 0.0
    shift: Array | float = 0.0
    pitch: Array | float = 0.0
    pitch_phase: Array | float = 0.0
    disc_offset: Array | float = 0.0
    disc_offset_phase: Array | float = 0.0
    angle: Array | float = 0.0
    crank_phase: Array | float = 0.0
    eccentricity: Array | float = 0.0
    bearing_clearance: Array | float = 0.0
    bore_radial: Array | float = 0.0
    bore_tangential: Array | float = 0.0
    circle_radius: Array | float = 0.0
    circle_offset: Array | float = 0.0
    circle_phase: Array | float = 0.0

    def __post_init__(self) -> None:
        wrong = [
            f"{name} must be finite numbers with the axes {axes} at most, got {value.shape}"
            for name, axes in AXES.items()
            if (value := np.asarray(getattr(self, name), dtype=np.float64)).ndim > len(axes)
            or not np.all(np.isfinite(value))
        ]
        if np.any(np.asarray(self.bearing_clearance) < 0.0):
            wrong.append("bearing_clearance must not be negative")
        if wrong:
            raise ValueError("; ".join(wrong))

    @property
    def units(self) -> int:
        """Number of units; 1 where no error differs between units."""
        lengths = {
            np.shape(getattr(self, name))[0] for name, axes in AXES.items() if np.ndim(getattr(self, name)) == len(axes)
        } - {1}
        if len(lengths) > 1:
            raise ValueError(f"errors have different numbers of units: {sorted(lengths)}")
        return lengths.pop() if lengths else 1

    def full(self, name: str, sizes: Mapping[str, int]) -> Array:
        """The error `name`, broadcast to the axes' lengths in `sizes`."""
        expected = tuple(sizes[axis] for axis in AXES[name])
        try:
            return np.broadcast_to(np.asarray(getattr(self, name), dtype=np.float64), expected)
        except ValueError as error:
            shape = np.shape(getattr(self, name))
            raise ValueError(f"{name} must fit {AXES[name]} = {expected}, got {shape}") from error

    def of_units(self, part: slice) -> Self:
        """The same errors of some units only."""
        chosen = {
            field.name: np.asarray(value)[part]
            for field in fields(self)
            if np.ndim(value := getattr(self, field.name)) == len(AXES[field.name]) and np.shape(value)[0] > 1
        }
        common = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in chosen}
        return type(self)(**chosen, **common)
