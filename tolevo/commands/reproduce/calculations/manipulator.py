"""Calculations of document M: the manipulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ....algorithms.archive import Box, Course
from ....algorithms.nsga2 import NSGA2
from ....algorithms.search import watch
from ....algorithms.settings import Budget, Crossover, Mutation
from ....directory import incompleteness
from ....errors import Fault, InputError, raise_all, refuse
from ....files import read_own_csv
from ....models.manipulator import pose
from ....models.manipulator.geometry import Manipulator, TaskRing, reach
from ....models.manipulator.maps import (
    NAMES,
    ROWS,
    SCALES,
    SOURCES,
    Maps,
    first_order,
    matrix,
    orientation_combinations,
    position_sources,
)
from ....models.manipulator.ring import INDICES, Sensitivity, grid, sensitivity
from ....problems.pose_accuracy import PoseAccuracy
from ....problems.pose_accuracy.outputs import NINE
from ....problems.settings import Settings
from ....records import Axis
from ....section import Array, Output, Value, number
from ....units import MM, MRAD, UM
from ...study.plan import Yardstick, yardstick
from ..recipes import Calculation, Computed, Quantity, share_error
from ..records import Chart, ComputedTable
from .reducer import assumed, make_table, output, parameter, quantities

KEYS = {
    "population": "algorithm.population",
    "crossover": "algorithm.crossover.probability",
    "mutation": "algorithm.mutation.probability",
}
"""Settings by the keys of a run's configuration."""
BASE = NSGA2(80, Crossover(probability=0.99), Mutation(probability=0.08))
RESPONSES = ("gap_percent", "evaluations_to_99")


class GaSettings(Calculation):
    """Two settings of the genetic algorithm against each other, on common seeds.

    From the table of a study (`study`: its directory) where one is named, else from seeds of its
    own: a genetic algorithm on arrays (the selection of NSGA-II, which with one objective is that
    of a plain GA) on the least-cost problem of document M, whose optimum is known.
    """

    name = "ga_settings"
    about = "Two settings of the genetic algorithm against each other, on common seeds."
    reference = "document M, figures 9 to 11"
    parameters = (
        parameter("setting", "population", "what differs", "document M", choices=tuple(KEYS)),
        parameter("a", 80.0, "its value", "document M", 0.0, 1e6),
        parameter("b", 20.0, "the other value", "document M", 0.0, 1e6),
        parameter("generations", 400, "generations of a run", "document M", 1, 100000),
        assumed("seeds", 10, "number of seeds", low=2, high=10000),
        parameter("study", "", "directory of a study whose runs are taken instead", ""),
    )
    outputs = (
        output("a_gap_percent", "median distance to the optimum with a"),
        output("b_gap_percent", "median distance to the optimum with b"),
        Output("a_evaluations", "1", "median of the evaluations until 99 %, with a"),
        Output("b_evaluations", "1", "the same with b"),
        output("a_nearer_percent", "share of the seeds with which a ends nearer"),
        output("a_slower_percent", "share of the seeds with which a takes more evaluations to 99 %"),
        Output("seeds", "1", "number of seeds"),
    )

    def faults(self, values: Mapping[str, Value]) -> list[Fault]:
        if not values["study"]:
            return [fault for name in "ab" for fault in _setting_fault(str(values["setting"]), name, values)]
        try:
            _study_runs(values)
        except InputError as error:
            return list(error.faults)
        return []

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        raise_all(self.faults(parameters))
        a, b = _study_runs(parameters) if parameters["study"] else _own_runs(parameters, rng)
        return Computed(_quantities(a, b), (_table(parameters, a, b),))


def _quantities(a: Array, b: Array) -> dict[str, Quantity]:
    """Medians and shares of runs (seeds, responses); what was never reached is infinite."""
    numbers = {"seeds": Quantity(float(len(a)), "1")}
    for at, (response, unit) in enumerate((("gap_percent", "percent"), ("evaluations", "1"))):
        for name, runs in (("a", a), ("b", b)):
            values = runs[:, at]
            numbers[f"{name}_{response}"] = Quantity(float(np.median(values)), unit, _error(values))
    (gap_a, evaluations_a), (gap_b, evaluations_b) = a.T, b.T
    numbers["a_nearer_percent"] = _fraction(gap_a < gap_b, gap_a == gap_b)
    numbers["a_slower_percent"] = _fraction(evaluations_a > evaluations_b, evaluations_a == evaluations_b)
    return numbers


def _error(values: Array) -> float:
    """Standard error of a median, from the normal distribution's 1.2533 s/sqrt(n)."""
    known = values[np.isfinite(values)]
    return float(1.2533 * np.std(known, ddof=1) / np.sqrt(len(known))) if len(known) > 1 else 0.0


def _fraction(won: NDArray[np.bool_], even: NDArray[np.bool_]) -> Quantity:
    fraction = float(np.mean(won + 0.5 * even))
    return Quantity(100.0 * fraction, "percent", 100.0 * share_error(fraction, len(won)))


def _own_runs(parameters: Mapping[str, Value], rng: np.random.Generator) -> tuple[Array, Array]:
    """Runs (seeds, responses) of both settings, seed by seed alike."""
    problem = PoseAccuracy(Settings(parameters={"index": "rms_plane"}, objectives=("cost",)))
    measure = yardstick(problem)
    seeds = rng.integers(0, 2**31, int(number(parameters["seeds"]))).tolist()
    budget = Budget(generations=int(number(parameters["generations"])))
    settings = [_settings(str(parameters["setting"]), number(parameters[name])) for name in "ab"]
    a, b = (np.array([_run(problem, setting, budget, seed, measure) for seed in seeds]) for setting in settings)
    return a, b


def _setting_fault(setting: str, name: str, values: Mapping[str, Value]) -> list[Fault]:
    """What is wrong with the value `name` of a setting."""
    value = number(values[name])
    if setting == "population" and (value < 2 or value != int(value)):
        return [Fault(name, f"a population must be a whole number from 2, got {value:g}")]
    if setting != "population" and value > 1.0:
        return [Fault(name, f"a probability must lie in [0, 1], got {value:g}")]
    return []


def _settings(setting: str, value: float) -> NSGA2:
    if setting == "population":
        return replace(BASE, population=int(value))
    if setting == "crossover":
        return replace(BASE, crossover=Crossover(probability=value))
    return replace(BASE, mutation=Mutation(probability=value))


def _run(problem: PoseAccuracy, settings: NSGA2, budget: Budget, seed: int, measure: Yardstick) -> tuple[float, float]:
    course = Course(Box(measure.box.ideal, measure.box.nadir), measure.level)
    watch(problem, settings, budget, seed, course, "array")
    course.curve()
    gap = 100.0 * (course.value / measure.value - 1.0)
    reached = course.reached_at[0]
    return (np.inf if np.isnan(gap) else gap), (np.inf if np.isnan(reached) else reached)


def _study_table(parameters: Mapping[str, Value]) -> pd.DataFrame:
    """The finished runs of a study. Raises InputError where it is incomplete, or lacks a column
    that is asked for.
    """
    path = Path(str(parameters["study"])) / "study.csv"
    raise_all(incompleteness(path.parent))
    if not path.is_file():
        raise refuse("study", f"{path} does not exist: name the directory of a finished study")
    table = read_own_csv(path)
    missing = [name for name in (KEYS[str(parameters["setting"])], *RESPONSES) if name not in table]
    if missing:
        raise refuse("study", f"{path} has no {', '.join(missing)}: vary and measure it there")
    return table[table["status"] == "done"]


def _study_runs(parameters: Mapping[str, Value]) -> tuple[Array, Array]:
    """Runs (seeds, responses) of both settings in a study, paired by all else that it varies."""
    table, key = _study_table(parameters), KEYS[str(parameters["setting"])]
    other_keys = [name for name in KEYS.values() if name in table and name != key]
    table = table.drop_duplicates([key, *other_keys, "replicate"])  # one setting may be run twice
    sides = [table[np.isclose(table[key], number(parameters[name]))] for name in "ab"]
    both = sides[0].merge(sides[1], on=[*other_keys, "replicate"], suffixes=("_a", "_b"))
    if len(both) < 2:
        levels = ", ".join(f"{level:g}" for level in sorted(table[key].unique()))
        raise refuse(
            "study",
            f"{parameters['study']} has no two runs of {key} = {parameters['a']} and "
            f"{parameters['b']} alike in all else; it has {levels}",
        )
    a, b = (both[[f"{name}_{side}" for name in RESPONSES]].fillna(np.inf).to_numpy(dtype=float) for side in "ab")
    return a, b


def _table(parameters: Mapping[str, Value], a: Array, b: Array) -> ComputedTable:
    columns = [np.arange(len(a)), a[:, 0], b[:, 0], a[:, 1], b[:, 1]]
    names = ("a_gap_percent", "b_gap_percent", "a_evaluations_to_99", "b_evaluations_to_99")
    return ComputedTable(
        str(parameters["setting"]),
        f"{parameters['setting']} {parameters['a']} (a) against {parameters['b']} (b), "
        "seed by seed; infinite: 99 % was never reached",
        (Axis("seed", "1"), *(Axis(name, "percent" if "gap" in name else "1") for name in names)),
        tuple(columns),
    )


# Whether the manipulator is equally accurate in all directions.


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
    parameters = pose.PARAMETERS
    outputs = (
        *(output(f"{group}_percent", f"sources fixed to the {group}, one by one") for group in GROUPS),
        output("all_percent", "all sources, one by one"),
        output("base_together_percent", "base-fixed errors along x and y of one size together"),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        r, z = grid(pose.task_ring(parameters), POSES)
        machine = pose.manipulator(parameters)
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
        table = make_table("change", meaning, {"source": NAMES, "change_percent": change})
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


# Error sources of the manipulator: how many turn it, how many move it, which matter most.


SOURCE_POSES = 9
"""Poses per axis at which the maps are evaluated."""
NEGLIGIBLE_EFFECT = 1e-9
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
    parameters = pose.PARAMETERS
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
        machine, ring = pose.manipulator(parameters), pose.task_ring(parameters)
        turning = orientation_combinations()
        names = list(turning)
        maps = first_order(machine, *grid(ring, SOURCE_POSES))
        index = str(parameters["index"])
        mean = index if index in INDICES else INDICES[0]
        weight = sensitivity(machine, ring, mean, turning)
        slopes = np.stack([weight.squareness, weight.yaw], axis=1)  # per metre or radian
        steps = np.array([ANGLE if name.startswith("joint_line") else LENGTH for name in names])
        effect = slopes * steps[:, None] / MRAD
        numbers = _counts(maps, names) | _slopes(names, slopes) | _ranking(names, effect)
        moved = sensitivity(machine, ring, mean, {name: {name: 1.0} for name in position_sources()})
        return Computed(numbers, (_source_table(names, effect), _position_table(moved)))


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
        "orientation_acting": np.sum(size > NEGLIGIBLE_EFFECT * size.max()),
        "orientation_rank": np.linalg.matrix_rank(turn.reshape(-1, len(names))),
        "position_sources": len(moving),
        "position_acting": np.sum(moved > NEGLIGIBLE_EFFECT * moved.max()),
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
    for column, angle in enumerate(("squareness", "yaw")):
        effects_by_kind = {kind: effect[[name.startswith(kind) for name in names], column] for kind in KINDS}
        sizes = {
            "": {kind: float(effects.max()) for kind, effects in effects_by_kind.items()},
            "rss_": {kind: float(np.linalg.norm(effects)) for kind, effects in effects_by_kind.items()},
        }
        for how, kinds in sizes.items():
            rod = kinds.pop("rod_length")
            numbers[f"{angle}_{how}rank"] = 1 + sum(size > rod for size in kinds.values())
            numbers[f"{angle}_{how}lead"] = rod / max(kinds.values())
    return quantities(numbers)


def _source_table(names: list[str], effect: Array) -> ComputedTable:
    meaning = (
        "Effect of 10 um or 0.1 mrad of each orientation source on squareness and yaw (document M, figures 5 and 6), "
        "mean over the task ring; by the model at the dimensions in use, not read from the figures"
    )
    columns = {"source": names, "squareness_mrad": effect[:, 0], "yaw_mrad": effect[:, 1]}
    return make_table("effects", meaning, columns, Chart("bars", "source", ("squareness_mrad", "yaw_mrad"), of="angle"))


def _position_table(moved: Sensitivity) -> ComputedTable:
    meaning = (
        "Effect of 10 um or 0.1 mrad of each source of chain 1 (document M, figure 7) and of chain 3 (figure 8) on the "
        "position, mean over the task ring; by the model at the dimensions in use, not read from the figures"
    )
    unit = dict(zip(NAMES, SCALES.tolist(), strict=True))
    size = {
        name: slope * (LENGTH if unit[name] == UM else ANGLE) / UM
        for name, slope in zip(moved.names, moved.position.tolist(), strict=True)
    }
    rows = [name for name in size if SOURCES[NAMES.index(name)].chain == 1]
    third = dict(zip(rows, (size[n] for n in size if SOURCES[NAMES.index(n)].chain == 3), strict=True))
    columns = {
        "source": [ROWS[NAMES.index(name)][0].replace("{i}", "").replace("__", "_").rstrip("_") for name in rows],
        "chain_1_um": [size[name] for name in rows],
        "chain_3_um": [third[name] for name in rows],
    }
    return make_table(
        "position", meaning, columns, Chart("bars", "source", ("chain_1_um", "chain_3_um"), of="position")
    )


# The task workspace of the manipulator: its rectangle, and whether it is reached.


class TaskRingFigures(Calculation):
    """Rectangle of the task ring in the meridian plane, and the fraction of it that is reached."""

    name = "task_ring"
    about = "Rectangle of the task ring in the meridian plane, and the share that is reached."
    reference = "document M, sensitivity analysis, figure 4"
    sampled = False
    parameters = pose.PARAMETERS
    outputs = (
        output("inner_radius_mm", "distance of the rectangle from the axis"),
        output("length_mm", "its length along the radius"),
        output("height_mm", "its height"),
        output("reached_percent", "share of its poses that all chains reach"),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        machine, ring = pose.manipulator(parameters), pose.task_ring(parameters)
        inside = np.all(np.abs(reach(machine, *grid(ring))) <= 1.0, axis=-1)
        numbers = {
            "inner_radius_mm": ring.r[0] / MM,
            "length_mm": (ring.r[1] - ring.r[0]) / MM,
            "height_mm": (ring.z[1] - ring.z[0]) / MM,
            "reached_percent": 100.0 * float(np.mean(inside)),
        }
        return Computed(quantities(numbers), (_workspace_table(machine, ring),))


RADII, HEIGHTS = 141, 4001
"""Radii and heights at which the workspace is looked at."""


def _workspace_table(machine: Manipulator, ring: TaskRing) -> ComputedTable:
    """The heights that all chains reach at each radius, connected with the middle of the ring, and the ring's."""
    longest = max(np.add(machine.arm_length, machine.rod_length)) + machine.half_width
    middle, r = 0.5 * sum(ring.z), np.linspace(0.0, longest, RADII)
    z = middle + np.linspace(-2.0 * longest, 2.0 * longest, HEIGHTS)
    beyond = np.abs(reach(machine, r[:, None], z)).max(axis=-1) - 1.0  # (radii, heights), at most 0 where reached
    half, columns = HEIGHTS // 2, {"r_mm": r / MM}
    for name, side in (("reached_from_z_mm", slice(half, None, -1)), ("reached_to_z_mm", slice(half, None))):
        missed, heights = np.nan_to_num(beyond[:, side], nan=np.inf), z[side]
        at = np.argmax(missed > 0.0, axis=1)
        inside, outside = (np.take_along_axis(missed, k[:, None], axis=1)[:, 0] for k in (at - 1, at))
        with np.errstate(invalid="ignore"):
            edge = heights[at - 1] + (heights[at] - heights[at - 1]) * inside / (inside - outside)
        columns[name] = np.where(at > 0, edge, np.nan) / MM
    within = (r >= ring.r[0]) & (r <= ring.r[1])
    columns |= {f"task_{n}_z_mm": np.where(within, e / MM, np.nan) for n, e in zip(("from", "to"), ring.z, strict=True)}
    meaning = (
        "Section of the workspace through the axis (document M, figure 4): heights that all chains reach at a radius, "
        "and those of the task ring; by the model at the dimensions in use"
    )
    marks = {"inner radius": ring.r[0] / MM, "outer radius": ring.r[1] / MM}
    return make_table("workspace", meaning, columns, Chart("lines", "r_mm", tuple(columns)[1:], marks, "z"))
