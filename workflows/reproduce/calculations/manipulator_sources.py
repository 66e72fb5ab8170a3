"""Error sources of the manipulator: how many turn it, how many move it, which matter most."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....arrays import Array
from ....declarations import Output, Value
from ....models.manipulator import declared
from ....models.manipulator.indices import INDICES, grid, sensitivity
from ....models.manipulator.maps import Maps, first_order
from ....models.manipulator.sources import NAMES, matrix, orientation_combinations, position_sources
from ....problems.pose_accuracy.grouping import NINE
from ....units import MM, MRAD
from ..calculation import Calculation, Computed, ComputedTable, Quantity
from .results import quantities, tabulated

POSES = 9
"""Poses per axis at which the maps are evaluated."""
NOTHING = 1e-9
"""Effect per unit, relative to the largest, below which a source does nothing."""
LENGTH, ANGLE = 10e-6, 0.1e-3
"""Standard deviations [m, rad] at which sources of different units are compared."""
KINDS = ("rod_length", "joint_distance", "joint_line")


class ManipulatorSources(Calculation):
    """Number, rank and weight of the error sources of the manipulator with full-circle rotation.

    Weights: effect of 10 um or 0.1 mrad of each source, mean over the task ring's rectangle.
    """

    name = "manipulator_sources"
    about = "Number, rank and weight of the error sources of the manipulator."
    reference = "document M, error separation and sensitivity analysis"
    sampled = False
    parameters = declared.PARAMETERS
    outputs = (
        Output("orientation_sources", "1", "sources that the orientation equations hold"),
        Output("orientation_acting", "1", "those of them that turn the platform"),
        Output("orientation_rank", "1", "rank of their effects over all poses"),
        Output("position_sources", "1", "sources that the position equations hold"),
        Output("position_acting", "1", "those of them that move the platform"),
        Output("kinds", "1", "kinds of orientation sources that share a tolerance"),
        Output("chain_3_squareness", "1", "largest effect of chain 3 on squareness, of chain 1's"),
        Output("joint_distance_3", "1", "effect of chain 3's relative joint distance, of chain 1's"),
        Output("rod_length_1_squareness", "mrad/mm", "squareness per relative rod length, chain 1"),
        Output("rod_length_1_yaw", "mrad/mm", "yaw per relative rod length of chain 1"),
        Output("rod_length_3_yaw", "mrad/mm", "yaw per relative rod length of chain 3"),
        Output("squareness_rank", "1", "place of the relative rod length among the kinds"),
        Output("yaw_rank", "1", "place of the relative rod length among the kinds"),
        Output("squareness_rss_rank", "1", "the same by root sum of squares of each kind"),
        Output("yaw_rss_rank", "1", "the same by root sum of squares of each kind"),
        Output("squareness_lead", "1", "effect of the rod length over that of the next kind"),
        Output("yaw_lead", "1", "effect of the rod length over that of the next kind"),
        Output("squareness_rss_lead", "1", "the same by root sum of squares of each kind"),
        Output("yaw_rss_lead", "1", "the same by root sum of squares of each kind"),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        machine, ring = declared.manipulator(parameters), declared.task_ring(parameters)
        turning = orientation_combinations()
        names = list(turning)
        maps = first_order(machine, *grid(ring, POSES))
        index = str(parameters["index"])
        mean = index if index in INDICES else INDICES[0]
        weight = sensitivity(machine, ring, mean, turning)
        slopes = np.stack([weight.squareness, weight.yaw], axis=1)  # per metre or radian
        steps = np.array([ANGLE if name.startswith("joint_line") else LENGTH for name in names])
        effect = slopes * steps[:, None] / MRAD
        numbers = _counts(maps, names) | _slopes(names, slopes) | _ranking(names, effect)
        return Computed(numbers, (_table(names, effect),))


def _counts(maps: Maps, names: list[str]) -> dict[str, Quantity]:
    """How many sources there are, how many act, and what chain 3 does not do."""
    moving = position_sources()
    turn = maps.orientation @ matrix(orientation_combinations())
    size = np.abs(turn).max(axis=(0, 1))
    moved = np.abs(maps.position[:, :, [NAMES.index(name) for name in moving]]).max(axis=(0, 1))
    squareness = np.hypot(turn[:, 0], turn[:, 1]).max(axis=0)
    third = [at for at, name in enumerate(names) if "_3" in name]
    first, last = (names.index(f"joint_distance_{chain}") for chain in (1, 3))
    counts: dict[str, float] = {
        "orientation_sources": len(names),
        "orientation_acting": np.sum(size > NOTHING * size.max()),
        "orientation_rank": np.linalg.matrix_rank(turn.reshape(-1, len(names))),
        "position_sources": len(moving),
        "position_acting": np.sum(moved > NOTHING * moved.max()),
        "kinds": len(NINE),
        "chain_3_squareness": squareness[third].max() / squareness.max(),
        "joint_distance_3": size[last] / size[first],
    }
    return quantities(counts)


def _slopes(names: list[str], slopes: Array) -> dict[str, Quantity]:
    """Squareness and yaw per relative rod length."""
    places = {"rod_length_1_squareness": (1, 0), "rod_length_1_yaw": (1, 1), "rod_length_3_yaw": (3, 1)}
    return {
        name: Quantity(float(slopes[names.index(f"rod_length_{chain}"), at]) * MM / MRAD, "mrad/mm")
        for name, (chain, at) in places.items()
    }


def _ranking(names: list[str], effect: Array) -> dict[str, Quantity]:
    """Place and lead of the relative rod length, each kind by its largest source or by its rss."""
    numbers: dict[str, float] = {}
    for column, output in enumerate(("squareness", "yaw")):
        effects_by_kind = {kind: effect[[name.startswith(kind) for name in names], column] for kind in KINDS}
        sizes = {
            "": {kind: float(effects.max()) for kind, effects in effects_by_kind.items()},
            "rss_": {kind: float(np.linalg.norm(effects)) for kind, effects in effects_by_kind.items()},
        }
        for how, kinds in sizes.items():
            rod = kinds.pop("rod_length")
            numbers[f"{output}_{how}rank"] = 1 + sum(size > rod for size in kinds.values())
            numbers[f"{output}_{how}lead"] = rod / max(kinds.values())
    return quantities(numbers)


def _table(names: list[str], effect: Array) -> ComputedTable:
    meaning = "Effect of 10 um or 0.1 mrad of each orientation source, mean over the task ring"
    return tabulated("effects", meaning, {"source": names, "squareness_mrad": effect[:, 0], "yaw_mrad": effect[:, 1]})
