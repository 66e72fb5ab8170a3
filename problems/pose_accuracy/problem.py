"""Pose accuracy of a parallel manipulator against cost, by standard deviations of its errors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import Fault
from ...models.manipulator import pose as declared
from ...models.manipulator.maps import first_order, matrix, orientation_combinations, position_sources
from ...models.manipulator.pose import faults
from ...models.manipulator.ring import Field, grid, sensitivity
from ...records import Bars
from ...section import Array, Assumption, Section, Value, number
from ...units import MM, MRAD, UM
from ..declaration import ConfiguredProblem, Declaration, Interval
from ..forms import Feature, Form, Way
from ..limits import narrow_range
from ..settings import ASSURANCE, PROMISED, Settings
from .machines import Population, PromisingPoses
from .outputs import (
    BOUNDS,
    ERRORS,
    EXPLAINED,
    LIMITED,
    LIMITS,
    MACHINES,
    NINE,
    OTHER,
    OUTPUTS,
    OVER_MACHINES,
    PARAMETERS,
    POSE,
    SOURCES,
    UNITS,
    Grouping,
    costs_of,
    read_grouping,
    reference_of,
    unit_of,
    variables_of,
)

if TYPE_CHECKING:
    import pandas as pd

# The one pose that `[parameters.pose]` names.


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


# What a reported allocation means for machines, in words.


PLACES = {
    "plane": "mean effects over the rectangle of the ring",
    "volume": "mean effects over the ring",
    "rms_plane": "root mean square over the rectangle of the ring",
    "rms_volume": "root mean square over the ring",
    "every_pose": "at the worst pose of the ring",
}


def remarks_of(
    row: Mapping[str, float], index: str, limits: Mapping[str, float], coverage: float, pose: str
) -> tuple[str, ...]:
    """A sentence per limited pose error of one design, given its outputs by name.

    `limits` are the bounds of the yields, `pose` says where the outputs at a pose are.
    """
    return tuple(_remark(name, row, index, limits[name], coverage, pose) for name in LIMITED)


def _remark(name: str, row: Mapping[str, float], index: str, limit: float, coverage: float, pose: str) -> str:
    unit, percent = UNITS[name], f"{100.0 * coverage:.6g} %"
    beyond = 100.0 - row[f"{name}_pose_yield_percent"]
    return (
        f"cheapest point: {name}_{unit} {row[f'{name}_{unit}']:.3g} is a standard deviation over machines "
        f"({PLACES[index]}); {pose} it is {row[f'{name}_pose_{unit}']:.3g} {unit}, where {beyond:.3g} % of machines "
        f"exceed {limit:g} {unit} and {percent} keep {row[f'{name}_pose_quantile_{unit}']:.3g} {unit}; over the whole "
        f"ring {percent} keep {row[f'{name}_ring_quantile_{unit}']:.3g} {unit}, and "
        f"{row[f'{name}_ring_yield_percent']:.3g} % keep {limit:g} {unit}"
    )


SCALES: Array = np.array([{"um": UM, "mrad": MRAD}[unit_of(source)] for source in SOURCES])
"""Metres or radians in one unit of each source."""


def declaration_of(grouping: Grouping) -> Declaration:
    """What the problem declares of the kinds of errors that a configuration groups."""
    return Declaration(
        variables_of(grouping),
        OUTPUTS,
        PARAMETERS,
        costs=costs_of(grouping),
        limits=LIMITS,
        objectives=("cost", "squareness_mrad"),
        model="manipulator_pose",
        explained=EXPLAINED,
        reference_ga={"population": 80, "generations": 400, "crossover": 0.99, "mutation": 0.08},
    )


class PoseAccuracy(PromisingPoses):
    """Pose accuracy of the manipulator with full-circle rotation against cost (document M).

    Variables are standard deviations of the orientation sources, grouped into the document's nine
    kinds unless `[grouping]` says otherwise. All outputs but the cost are root sums of squares of
    first-order effects, so that the problem is convex: docs/manipulator.md.
    """

    declaration = declaration_of(NINE)
    _drawn_again = frozenset(("_fields", "population", "_verdicts"))

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings.definition if settings is not None else None
        self.grouping: Grouping = NINE if given is None else given
        self.declaration = declaration_of(self.grouping)
        super().__init__(settings)
        self.machine = declared.manipulator(self.settings.parameters)
        self.ring = declared.task_ring(self.settings.parameters)

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        grouping = read_grouping(top)
        configured = None
        if grouping is not None:
            configured = ConfiguredProblem(declaration_of(grouping), cls, {"definition": grouping})
        return cls.promising(configured, top)

    def more_tables(self) -> dict[str, Any]:
        promised = super().more_tables()
        if self.grouping == NINE:
            return promised
        return promised | {"grouping": {name: list(sources) for name, sources in self.grouping.items()}}

    # ---------------------------------------------------------------- evaluation

    @cached_property
    def _owners(self) -> Array:
        """1 where a source belongs to a variable, else 0, (sources, variables)."""
        groups = self.grouping.values()
        return np.array([[source in group for group in groups] for source in SOURCES], dtype=float)

    @cached_property
    def squares(self) -> dict[str, Array]:
        """Squared effect per squared unit of each variable, (poses or 1, variables), by output."""
        index = str(self.settings.parameters["index"])
        every = self._every_pose() if index == "every_pose" else self._means(index)
        return {
            name: (sizes * SCALES) ** 2 @ self._owners / unit**2
            for (name, sizes), unit in zip(every.items(), (MRAD, MRAD, MM), strict=True)
        }

    def _means(self, index: str) -> dict[str, Array]:
        combinations = orientation_combinations()
        indices = sensitivity(self.machine, self.ring, index, combinations)  # type: ignore[arg-type]
        means = (indices.squareness, indices.yaw, indices.position)
        return {name: mean[None, :] for name, mean in zip(ERRORS, means, strict=True)}

    def _every_pose(self) -> dict[str, Array]:
        maps = first_order(self.machine, *grid(self.ring))
        columns = matrix(orientation_combinations())
        turn, move = maps.orientation @ columns, maps.position @ columns
        return {
            "squareness_mrad": np.hypot(turn[:, 0], turn[:, 1]),
            "yaw_mrad": np.abs(turn[:, 2]),
            "position_mm": np.linalg.norm(move, axis=1),
        }

    @cached_property
    def _fields(self) -> dict[str, Field]:
        """The pose errors by name on the grid of the ring, per unit of each source."""
        return self._errors_at(*grid(self.ring))

    def _errors_at(self, r: Array, z: Array) -> dict[str, Field]:
        maps, columns = first_order(self.machine, r, z), matrix(orientation_combinations())
        turn, move = (jacobian @ columns * SCALES for jacobian in (maps.orientation, maps.position))
        errors = (turn[:, :2] / MRAD, turn[:, 2:] / MRAD, move / MM)
        return {name: Field(effects) for name, effects in zip(UNITS, errors, strict=True)}

    @cached_property
    def population(self) -> Population:
        """The machines of a design."""
        given, spread = self.settings.parameters, self.settings.propagation
        pose = pose_of(given[POSE.name])
        here = {} if pose is None else self._errors_at(*pose)
        limits = {name: number(given[bound.name]) for name, bound in zip(LIMITED, BOUNDS, strict=True)}
        usual = np.array([reference_of(source) for source in SOURCES])
        return Population(
            {name: self._with_others(name, field) for name, field in self._fields.items()},
            {name: self._with_others(name, field) for name, field in here.items()},
            limits,
            spread.coverage,
            spread.samples,
            self.settings.seed,
            self._sources(usual[None])[0],
        )

    @property
    def _other_std(self) -> float:
        return number(self.settings.parameters[OTHER.name])

    def _with_others(self, name: str, field: Field) -> Field:
        """A field with the three components of the other sources, where there are any."""
        if self._other_std == 0.0:
            return field
        poses, size, _ = field.effects.shape
        more = np.eye(3) if name == "position" else np.zeros((size, 3))
        wide = np.broadcast_to(more, (poses, size, 3))
        return Field(np.concatenate([field.effects, wide], axis=2))

    def _sources(self, sigma: Array) -> Array:
        """Standard deviations (n, sources) with those of the other sources, where there are any."""
        if self._other_std == 0.0:
            return sigma
        more = np.full((len(sigma), 3), self._other_std / np.sqrt(3.0))
        return np.hstack([sigma, more])

    def over_machines(self, designs: Array, names: Iterable[str]) -> dict[str, Array]:
        """Outputs (n,) over machines of full designs (n, all), with their errors."""
        return self.population.outputs(self._sources(designs @ self._owners.T), names)

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        """Outputs over machines are NaN unless they are minimised or limited."""
        outputs = {"cost": self.cost_of(designs)}
        for name, squares in self.squares.items():
            worst = np.max(designs**2 @ squares.T, axis=1)
            other_sources = self._other_std**2 if name == "position_mm" else 0.0
            outputs[name] = np.sqrt(worst + other_sources)
        nothing = np.full(len(designs), np.nan)
        unsampled = {output.name: nothing for output in MACHINES}
        return outputs | unsampled | self.over_machines(designs, self.required_outputs)

    def _verified(self, designs: Array, outputs: Mapping[str, Array]) -> dict[str, Array]:
        """Outputs over machines, for the designs that are reported."""
        return self.over_machines(designs, (output.name for output in MACHINES))

    def gradient(self, designs: Array) -> dict[str, Array]:
        """Derivatives of all outputs; at the worst pose where the index is every pose."""
        gradients = {"cost": self.cost_slopes(designs)}
        values = self._outputs(designs, searching=True)
        for name, squares in self.squares.items():
            worst = squares[np.argmax(designs**2 @ squares.T, axis=1)]
            gradients[name] = worst * designs / values[name][:, None]
        return gradients | self.promised_slopes(designs)

    # ---------------------------------------------------------------- what is known

    def interval(self, output: str) -> Interval:
        """Proven bounds: errors rise and costs fall with every standard deviation.

        The fractions of machines that exceed a bound rise as well: the region where the bound is
        kept is convex and symmetric (Anderson 1955, Proc. Am. Math. Soc. 6(2)).
        """
        if output == "cost":
            return self._cost_interval
        ends = np.stack([self.corner(tight=True), self.corner(tight=False)])
        if output in self.squares:
            low, high = self._outputs(ends, searching=True)[output]
            return float(low), float(high)
        if output in OVER_MACHINES:
            return self.population.interval(output, self._sources(ends @ self._owners.T))
        return super().interval(output)

    def least_cost(self) -> tuple[str, PoseAccuracy] | None:
        """The document's task: tolerances as wide as the limits on the orientation allow.

        None where units are tested for a promise: that is not the document's task, and the 32,000
        evaluations of its GA would take 25 times the rest of the run.
        """
        if "cost" not in self.objectives or not self.limits or self.declaration.sampled:
            return None
        label = "GA with the document's settings (not the document's allocation, which is lost)"
        return label, PoseAccuracy(replace(self.given, objectives=("cost",)))

    def form(self) -> Form:
        """Root sums of squares, one per output and pose; exact."""
        named = [name for name in ERRORS if name in self.required_outputs] or ["squareness_mrad"]
        rows = np.sqrt(np.vstack([self.squares[name] for name in named]))
        outputs = tuple(name for name in named for _ in range(len(self.squares[name])))
        ranges = {
            name: narrow_range(self.limits, name, *super(PoseAccuracy, self).interval(name)) for name in self.names
        }
        nothing = (0.0,) * len(rows)
        features = tuple(
            Feature(name, (Way(self.settings.costs[name], *ranges[name], nothing, tuple(rows[:, at].tolist())),))
            for at, name in enumerate(self.names)
        )
        constants = np.array([self._other_std**2 if name == "position_mm" else 0.0 for name in outputs])
        relaxed = tuple(
            limit.name
            for limit in self.limits
            if limit.name in (*OVER_MACHINES, PROMISED, ASSURANCE)
            or (limit.name in (*ERRORS, *self.cost_names) and np.isfinite(limit.low))
        )
        left_out = f"; limits left out: {', '.join(relaxed)}" if relaxed else ""
        return Form(
            outputs,
            features,
            np.zeros(len(rows)),
            constants,
            f"first-order errors, index {self.settings.parameters['index']}{left_out}",
            relaxed=relaxed,
        )

    def bars(self) -> tuple[Bars, ...]:
        """Effect of one reference standard deviation of each source, as document M draws it."""
        index = str(self.settings.parameters["index"])
        mean = "plane" if index == "every_pose" else index
        turning = orientation_combinations()
        moving = {name: {name: 1.0} for name in position_sources()}
        turn = sensitivity(self.machine, self.ring, mean, turning)  # type: ignore[arg-type]
        move = sensitivity(self.machine, self.ring, mean, moving)  # type: ignore[arg-type]
        reference = np.array([reference_of(name) for name in turning]) * SCALES
        step = np.array([1e-5 if name.endswith("_um") else 1e-4 for name in moving])
        charts: tuple[tuple[str, str, Iterable[str], Array], ...] = (
            ("squareness by source", "mrad", turning, 1e3 * turn.squareness * reference),
            ("yaw by source", "mrad", turning, 1e3 * turn.yaw * reference),
            ("position by source (10 um, 0.1 mrad)", "um", moving, 1e6 * move.position * step),
        )
        return tuple(
            Bars(f"{title}, index {mean}", unit, tuple(names), tuple(values.tolist()))
            for title, unit, names, values in charts
        )

    def remarks(self, front: pd.DataFrame) -> tuple[str, ...]:
        """The meaning for machines of the standard deviations of the cheapest point."""
        if front.empty:
            return ()
        cheapest = int(np.argmin(front["cost"].to_numpy()))
        row = {output.name: float(front[output.name].iloc[cheapest]) for output in OUTPUTS}
        given, coverage = self.settings.parameters, self.settings.propagation.coverage
        return remarks_of(row, str(given["index"]), self.population.limits, coverage, words_of(given[POSE.name]))

    # ---------------------------------------------------------------- faults and assumptions

    def faults(self) -> list[Fault]:
        messages = faults(self.machine, self.ring)
        given = self.settings.parameters
        messages += pose_faults(given[POSE.name], given["ring_r_mm"], given["ring_z_mm"])
        return messages or super().faults()

    def assumptions(self) -> tuple[Assumption, ...]:
        reason, limits = "the limits of the standard that the document cites are not at hand", self.settings.limits
        assumed = [
            Assumption(
                f"limits.{name}",
                limits[name].high,
                "mrad",
                reason,
                "configuration" if name in self.given.limits else "default",
            )
            for name in LIMITS
            if name in limits
        ]
        return (*super().assumptions(), *assumed)
