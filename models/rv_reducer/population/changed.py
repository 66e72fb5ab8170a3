"""Units whose parts differ from the drawn ones: changes of errors and temperatures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ....arrays import Array
from ....units import UM
from ..contact.geometry import ContactGeometry, unit
from ..cycloid import pin_circle_growth
from .sample import BaseSample
from .scaled import Scaled, pitch_turn


def changed(geometry: ContactGeometry, units: Scaled, sample: BaseSample, changes: Mapping[str, Array]) -> Scaled:
    """Units (n) with their errors [um] and temperatures [K] changed, each by a number or by (n,).

    A change of an error is a change of its mid-limit, the same for every pin and disc of the unit.
    A warmer housing widens the pin circle against the discs; a change of pin position turns the
    unit only.
    """

    def of(error: str) -> Array:
        return np.asarray(changes.get(f"{error}_um", 0.0), dtype=float)

    if not changes:
        return units
    rises = [np.asarray(changes.get(f"{part}_temperature_K", 0.0)) for part in ("disc", "housing")]
    circle = of("pin_circle_radius") + pin_circle_growth(geometry.nominal, *rises) / UM
    across = of("pin_hole_radius") - of("pin_radius")
    pitch = of("pitch") * pitch_turn(geometry) * unit(sample.phase["pitch"])
    return replace(
        units,
        across=(units.across + across).astype(np.float32),
        normal=units.normal + of("equidistance"),
        radial=units.radial + circle - of("shift"),
        offset=units.offset + 0.5 * of("runout") * unit(sample.phase["runout"]),
        pitch=units.pitch + pitch,
    )
