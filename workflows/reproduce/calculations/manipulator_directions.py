"""Whether the manipulator is equally accurate in all directions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....arrays import Array
from ....declarations import Value
from ....models.manipulator import declared
from ....models.manipulator.indices import grid
from ....models.manipulator.maps import first_order
from ....models.manipulator.sources import NAMES
from ..calculation import Calculation, Computed
from .results import output, quantities, tabulated

POSES, AZIMUTHS = 5, 24
GROUPS = {
    "base": ("origin",),
    "arm": ("arm_", "drive_zero", "joint_line_arm", "joint_distance_arm"),
    "rod": ("rod_length",),
    "platform": ("platform_attachment", "joint_line_platform", "joint_distance_platform"),
}
"""Where the parts with the error are fixed, by how the names of the sources begin."""


class ManipulatorDirections(Calculation):
    """How much the effect of an error source changes with the direction the manipulator faces.

    Largest less smallest size of the pose error over a full circle, of the largest, worst pose and
    source of each group.
    """

    name = "manipulator_directions"
    about = "How much the effect of an error source changes with the direction of the manipulator."
    reference = "document M, sensitivity analysis"
    sampled = False
    parameters = declared.PARAMETERS
    outputs = (
        *(output(f"{group}_percent", f"sources fixed to the {group}, one by one") for group in GROUPS),
        output("all_percent", "all sources, one by one"),
        output("base_together_percent", "base-fixed errors along x and y of one size together"),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        r, z = grid(declared.task_ring(parameters), POSES)
        machine = declared.manipulator(parameters)
        around = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
        sizes = np.stack([_sizes(first_order(machine, r, z, phi)) for phi in around])
        change = _change(sizes).max(axis=0)  # of every source, at its worst pose and output
        largest = {
            f"{group}_percent": max(change[at] for at, name in enumerate(NAMES) if name.startswith(stems))
            for group, stems in GROUPS.items()
        }
        largest["all_percent"] = max(largest.values())
        pairs = [(NAMES.index(f"origin_{i}_x_um"), NAMES.index(f"origin_{i}_y_um")) for i in (1, 2, 3)]
        together = np.stack([np.hypot(sizes[..., a], sizes[..., b]) for a, b in pairs], axis=-1)
        largest["base_together_percent"] = float(_change(together).max())
        meaning = "Change of the effect of each error source over a full circle"
        table = tabulated("change", meaning, {"source": NAMES, "change_percent": change})
        return Computed(quantities(largest), (table,))


def _sizes(maps: object) -> Array:
    """Sizes (2 poses, 63) of turn and movement per unit of each source."""
    turn, move = (np.linalg.norm(getattr(maps, field), axis=1) for field in ("orientation", "position"))
    return np.concatenate([turn, move])


def _change(sizes: Array) -> Array:
    """Range over the first axis of the largest there, in percent; 0 where nothing acts."""
    most = sizes.max(axis=0)
    acts = most > 1e-9 * most.max()
    return np.where(acts, 100.0 * np.ptp(sizes, axis=0) / np.where(acts, most, 1.0), 0.0)
