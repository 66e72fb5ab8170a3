"""The task workspace of the manipulator: its rectangle, and whether it is reached."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....declarations import Value
from ....models.manipulator import declared
from ....models.manipulator.indices import grid
from ....models.manipulator.inverse import reach
from ....units import MM
from ..calculation import Calculation, Computed
from .results import output, quantities


class TaskRingFigures(Calculation):
    """Rectangle of the task ring in the meridian plane, and the fraction of it that is reached."""

    name = "task_ring"
    about = "Rectangle of the task ring in the meridian plane, and the share that is reached."
    reference = "document M, sensitivity analysis, figure 4"
    sampled = False
    parameters = declared.PARAMETERS
    outputs = (
        output("inner_radius_mm", "distance of the rectangle from the axis"),
        output("length_mm", "its length along the radius"),
        output("height_mm", "its height"),
        output("reached_percent", "share of its poses that all chains reach"),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        machine, ring = declared.manipulator(parameters), declared.task_ring(parameters)
        inside = np.all(np.abs(reach(machine, *grid(ring))) <= 1.0, axis=-1)
        numbers = {
            "inner_radius_mm": ring.r[0] / MM,
            "length_mm": (ring.r[1] - ring.r[0]) / MM,
            "height_mm": (ring.z[1] - ring.z[0]) / MM,
            "reached_percent": 100.0 * float(np.mean(inside)),
        }
        return Computed(quantities(numbers))
