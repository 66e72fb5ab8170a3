"""The manipulator of document M with reducers: links and gears on one front."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...declarations import Assumption, Output, Parameter, Value, Variable, completed, number
from ...errors import Fault
from ...models.costs import CostCurve
from ...models.manipulator import declared
from ...models.manipulator.faults import faults
from ...models.robot.sample import ratio
from ...section import Section
from ..forms import Form
from ..pose_accuracy.grouping import Grouping, read_grouping
from ..reducers.documents import documents_reducer
from ..reducers.nested import Nested
from ..settings import Bound, Settings
from ..tolerance_problem import Interval, ToleranceProblem
from .form import form_of
from .gears import Built, Gears, gear_variables
from .links import TWENTY_ONE, costs_of, unit_of, variables_of
from .machine import Machine, Sampled
from .outputs import LIMITS, OBJECTIVES, PARAMETERS, outputs_of, share_name
from .remarks import remarks_of

Array = NDArray[np.float64]
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of backlash in R^2 at which the ratio A/R of a search is known."""
SAFE = 1.01
"""Factor of that ratio, so that what a search finds keeps its limits when it is sampled."""
SAMPLED = 200
"""Designs that are sampled at once; of more, those that are reported."""
UNITS = 16_384
"""Units of the ratio that a search uses."""
ROWS = ("pose_rms_mm", "squareness_mrad", "yaw_mrad")


@dataclass(frozen=True)
class Definition:
    """What a configuration declares beside parameters: grouping, reducers, and how they enter."""

    grouping: Grouping
    reducers: tuple[Nested, ...]
    nested: bool = True
    per_drive: bool = True

    @property
    def gears(self) -> tuple[Nested, ...]:
        """The reducers that have variables of their own: one for both drives if they are alike."""
        return self.reducers if self.per_drive else self.reducers[:1]


class RobotKind:
    """What a configuration declares; it makes the problem."""

    parameters: tuple[Parameter, ...] = PARAMETERS
    default_limits: ClassVar[Mapping[str, Bound]] = LIMITS
    default_objectives = OBJECTIVES
    default_model = "manipulator_pose"
    default_algorithm = "exact"

    def __init__(self, definition: Definition) -> None:
        self.definition = definition
        self.variables, self.outputs, self.default_costs = declarations(definition)

    def __call__(self, settings: Settings) -> RobotJoint:
        return RobotJoint(replace(settings, definition=self.definition))


def declarations(
    definition: Definition,
) -> tuple[tuple[Variable, ...], tuple[Output, ...], dict[str, CostCurve]]:
    """Variables, outputs and cost curves of the links."""
    own = variables_of(definition.grouping)
    gears = gear_variables(definition.gears, definition.nested)
    names = [v.name for v in (*own, *gears) if v.tolerance]
    outputs = outputs_of(definition.grouping, names)
    return (*own, *gears), outputs, costs_of(definition.grouping)


class RobotJoint(ToleranceProblem):
    """Pose accuracy of the manipulator with its reducers against cost: one machine, one front.

    Links by standard deviations of their errors, reducers by what an rms of their backlash and of
    their transmission error costs (`[reducers]`): docs/robot_joint.md.
    """

    parameters = PARAMETERS
    default_limits: ClassVar[Mapping[str, Bound]] = LIMITS
    default_objectives = OBJECTIVES
    default_model = "manipulator_pose"
    default_algorithm: ClassVar[str] = "exact"
    drawn_again = frozenset(("_sampled", "_ratios"))
    nests: ClassVar[tuple[str, ...]] = ("1", "2")
    """Keys of `[reducers]`, the drives that have one."""

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings or Settings()
        own: Definition = given.definition or default_definition(given.parameters)
        self.definition = own
        self.variables, self.outputs, self.default_costs = declarations(own)
        super().__init__(given)
        p = self.settings.parameters
        self.machine = Machine(p, own.grouping)
        self.gears = Gears.of(own.gears, own.nested, p, self.settings.propagation.coverage)
        self.gear_of = (0, len(own.gears) - 1)
        """Which of the gears each drive has."""

    @classmethod
    def configured(cls, top: Section) -> Any:
        grouping = read_grouping(top, TWENTY_ONE, unit_of, "an error of a link")
        reducers = top.take("reducers")
        flags = top.section("parameters")
        nested, per_drive = flags.take("nested"), flags.take("per_drive")
        if grouping is None or (reducers is not None and not isinstance(reducers, tuple)):
            return None
        found = reducers or (documents_reducer(),) * 2
        definition = Definition(grouping, found, nested is not False, per_drive is not False)
        if not definition.nested and not all(one.proven for one in found):
            top.fault("reducers", "nested = false needs reducers with tolerances of their own: "
                      "name configurations of rv_backlash")  # fmt: skip
            return None
        return RobotKind(definition)

    def more_tables(self) -> dict[str, Any]:
        own = self.definition
        tables: dict[str, Any] = {
            "reducers": {key: one.tables for key, one in zip(self.nests, own.reducers, strict=True)}
        }
        if own.grouping != TWENTY_ONE:
            tables["grouping"] = {name: list(each) for name, each in own.grouping.items()}
        return tables

    # ---------------------------------------------------------------- evaluation

    @property
    def link_names(self) -> tuple[str, ...]:
        """Variables of the links."""
        return tuple(self.definition.grouping)

    def sigma(self, designs: Array) -> Array:
        """Standard deviations (n, links) of full designs."""
        return designs[:, : len(self.link_names)]

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        sigma, gears = self.sigma(designs), self.gears.at(self._of_gears(designs))
        drives = list(self.gear_of)
        square, wave = gears.square[:, drives], gears.wave[:, drives] ** 2  # (n, 2) arcmin^2
        mean, held = self.machine.squares, self.machine.squares["wave"] - self.machine.squares[
            "backlash"]  # fmt: skip
        lost = 0.25 * self.gears.hysteresis**2
        by_joint = mean["backlash"] * square / 4.0 + held * lost + mean["wave"] * wave
        by_link = self.machine.links[0] * sigma**2
        total = by_joint.sum(axis=1) + by_link.sum(axis=1)
        rms = np.sqrt(total)
        tilt, turn = sigma**2 @ self.machine.links[1], sigma**2 @ self.machine.links[2]
        yaw_held = (mean["yaw_wave"] - mean["yaw_backlash"]).sum() * lost
        turn = turn + square @ mean["yaw_backlash"] / 4.0 + wave @ mean["yaw_wave"] + yaw_held
        cost_links = self.cost_of(designs)
        cost_gears = gears.cost @ self.gears.counts
        nothing = np.full(len(designs), np.nan)
        found = {output.name: nothing for output in self.outputs}
        found |= {
            "cost": cost_links + cost_gears,
            "cost_links": cost_links,
            "cost_reducers": cost_gears,
            "pose_rms_mm": rms,
            "squareness_mrad": np.sqrt(tilt),
            "yaw_mrad": np.sqrt(turn),
            "backlash_rms_arcmin": np.sqrt(square.max(axis=1)),
            "reversal_mm": np.sqrt(square @ mean["backlash"]),
            "path_te_mm": np.sqrt(2.0 * wave @ mean["wave"]),
            "wind_up_mm": np.full(len(designs), self.machine.wind_up),
            "held_percent": np.full(len(designs), self.machine.held_percent),
        }
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = np.where(total > 0.0, 100.0 / total, 0.0)
        found |= {f"share_joint_{at + 1}_percent": by_joint[:, at] * shares for at in range(2)}
        found |= {share_name(n): by_link[:, k] * shares for k, n in enumerate(self.link_names)}
        backlash = by_joint @ np.ones(2) - wave @ mean["wave"]
        if searching or len(designs) > SAMPLED:
            found |= self._accuracy(rms, np.where(total > 0.0, backlash * shares / 100.0, 0.0))
        else:
            found |= self._by_monte_carlo(designs, rms)
        return found | self._asked(designs, searching, np.sqrt(square))

    def _accuracy(self, rms: Array, share: Array) -> dict[str, Array]:
        """A by the ratio that a search uses: interpolated over the share of backlash in R^2."""
        c = SAFE * np.interp(share, SHARES, self._ratios)
        return {"pose_accuracy_mm": c * rms, "accuracy_ratio": c}

    def _asked(self, designs: Array, searching: bool, rms: Array) -> dict[str, Array]:
        """Outputs that take longer, where they are minimised or limited."""
        asked = {*self.objectives, *(limit.name for limit in self.limits)}
        found: dict[str, Array] = {}
        if "te_amplitude_arcsec" in asked:
            found["te_amplitude_arcsec"] = self.gears.amplitudes(self._of_gears(designs))
        if "backlash_arcmin" in asked:
            found["backlash_arcmin"] = self.gears.quantiles(self._of_gears(designs))
        if "iso_vap_mm" in asked:
            found["iso_vap_mm"] = self.machine.variation(rms)
        return found

    def _verified(self, designs: Array, found: Mapping[str, Array]) -> dict[str, Array]:
        """Everything else, of the designs that are reported."""
        own, rms = self._of_gears(designs), found["pose_rms_mm"]
        gears = self.gears.at(own)
        square = np.sqrt(gears.square[:, list(self.gear_of)])
        more = {
            "te_amplitude_arcsec": self.gears.amplitudes(own),
            "backlash_arcmin": self.gears.quantiles(own),
            "iso_vap_mm": self.machine.variation(square),
        }
        accuracy = self._by_monte_carlo(designs, rms) if len(designs) > SAMPLED else {}
        return more | self._prices(designs, rms) | accuracy

    def _by_monte_carlo(self, designs: Array, rms: Array) -> dict[str, Array]:
        built = self.gears.built(self._of_gears(designs))
        coverage = self.settings.propagation.coverage
        c = np.array([ratio(self._errors(sigma, one), coverage)
                      for sigma, one in zip(self.sigma(designs), built, strict=True)])  # fmt: skip
        return {"pose_accuracy_mm": c * rms, "accuracy_ratio": c}

    def _of_gears(self, designs: Array) -> Array:
        return designs[:, len(self.link_names) :]

    # ---------------------------------------------------------------- accuracy

    @cached_property
    def _sampled(self) -> Sampled:
        rng = np.random.default_rng(self.settings.seed)
        samples = self.settings.propagation.samples
        return self.machine.sampled(samples, self.gears.dimensions, rng)

    def _errors(self, sigma: Array, built: Built) -> Array:
        some = self._sampled
        units = self.gears.units(built, some.sample.unit, self.gear_of)
        return some.errors(sigma, some.joint_errors(*units))

    @cached_property
    def _ratios(self) -> Array:
        """c at `SHARES`, of machines whose errors are scaled until backlash has that share."""
        rng = np.random.default_rng(self.settings.seed)
        some = self.machine.sampled(UNITS, self.gears.dimensions, rng)
        middle = np.sqrt(self._corner(tight=True) * np.maximum(self._corner(tight=False), 1e-12))
        own = self.gears.built(self._of_gears(middle[None, :]))[0]
        units = self.gears.units(own, some.sample.unit, self.gear_of)
        nothing = np.zeros_like(units[2])
        play = some.errors(0.0 * self.sigma(middle[None, :])[0],
                           some.joint_errors(units[0], units[1], nothing))  # fmt: skip
        rest = some.errors(self.sigma(middle[None, :])[0],
                           some.joint_errors(0.0 * units[0], 0.0, units[2]))  # fmt: skip
        sizes = [float(np.sqrt(np.mean(np.sum(one**2, axis=1)))) for one in (play, rest)]
        if not sizes[0]:
            return np.full(len(SHARES), ratio(rest, self.settings.propagation.coverage))
        return np.array([
            ratio(np.sqrt(s) * play / sizes[0] + np.sqrt(1.0 - s) * rest / (sizes[1] or 1.0),
                  self.settings.propagation.coverage) for s in SHARES
        ])  # fmt: skip

    # ---------------------------------------------------------------- the next unit of money

    def _prices(self, designs: Array, rms: Array) -> dict[str, Array]:
        """Fall of R [um] per unit of cost spent on each tolerance."""
        sigma = self.sigma(designs)
        found: dict[str, Array] = {}
        for at, name in enumerate(self.link_names):
            fall = self.machine.links[0][at] * sigma[:, at] / rms
            rise = -self.settings.costs[name].slope(sigma[:, at])
            found[f"price_{name}"] = 1e3 * fall / np.maximum(rise, 1e-300)
        mean = self.machine.squares
        for drive, gear in enumerate(self.gear_of):
            weights = (mean["backlash"][drive] / 4.0, mean["wave"][drive])
            for name, (square, cost) in self.gears.slopes(self._of_gears(designs), gear).items():
                fall = (weights[0] * square[0] + weights[1] * square[1]) / (2.0 * rms)
                count = self.gears.counts[gear]
                price = 1e3 * fall / (np.maximum(cost, 1e-300) * count)
                found[f"price_{name}"] = found.get(f"price_{name}", 0.0) + price
        return found

    # ---------------------------------------------------------------- what is known

    def interval(self, output: str) -> Interval:
        """Proven bounds: errors rise and costs fall with every tolerance."""
        if output in self.names:
            return super().interval(output)
        ends = np.stack([self._corner(tight=True), self._corner(tight=False)])
        known = (*ROWS, "backlash_rms_arcmin", "reversal_mm", "path_te_mm", "wind_up_mm")
        if output in known:
            low, high = self._outputs(ends, searching=True)[output]
            return float(low), float(high)
        if output == "cost":
            found = self._outputs(ends, searching=True)["cost"]
            return float(found[1]), float(found[0])
        return super().interval(output)

    def form(self) -> Form | None:
        return form_of(self)

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        return self.gears.form_columns(columns)

    def stand_in_limit(self, name: str, high: float) -> float:
        """The upper limit of the requirement that stands for a limit on an output."""
        if name == "pose_accuracy_mm":
            # of one objective the exact solver moves the limit by what is found to be missing
            extreme = np.min if len(self.objectives) == 1 else np.max
            return high / float(extreme(self._ratios))
        if name == "backlash_arcmin":
            return self.gears.rms_of_quantile(high)
        return high

    def form_values(self, form: Form, designs: Array, found: Mapping[str, Array]) -> Array:
        values = super().form_values(form, designs, found)
        limits = {limit.name: limit.high for limit in self.limits}
        for row, name in enumerate(form.outputs):
            other = form.stands.get(name, "")
            if np.isfinite(limits.get(other, np.inf)):
                per = found[other] / found[name]
                allowed = self.stand_in_limit(other, limits[other])
                values[:, row] = allowed + (found[other] - limits[other]) / per
        return values

    def kept(self) -> dict[str, Array]:
        return {name: each for one in self.gears.nested for name, each in one.kept().items()}

    def adopt(self, arrays: Mapping[str, Array]) -> bool:
        return not [one for one in self.gears.nested if not one.adopt(arrays)]

    def references(self) -> dict[str, Array]:
        """The documents' reducers on links at their references; all variables must be there."""
        if self.definition.nested:
            return {}
        own = [curve.b for curve in self.default_costs.values()]  # type: ignore[attr-defined]
        return {"documents' reducers, reference links":
                np.array([*own, *self.gears.document()])}  # fmt: skip

    # ---------------------------------------------------------------- faults and assumptions

    def faults(self) -> list[Fault]:
        found = faults(self.machine_of(), declared.task_ring(self.settings.parameters))
        if found:
            return found
        return self._without_effect() or super().faults()

    def machine_of(self) -> Any:
        """The nominal manipulator."""
        return declared.manipulator(self.settings.parameters)

    def _without_effect(self) -> list[Fault]:
        """Objectives that calibration, or gravity, removes entirely."""
        found = []
        for at, name in enumerate(self.objectives):
            low, high = self.interval(name)
            if np.isfinite(low) and np.isfinite(high) and high <= low + 1e-15:
                left = "transmission errors and links" if name == "reversal_mm" else "nothing"
                text = (
                    f"{name} is {low:.4g} for every design: calibration and held flanks "
                    f"(calibrated, flanks) remove what tolerances change of it; what is left "
                    f'is due to {left}: minimise another output, or set flanks = "free"'
                )
                found.append(Fault(f"objectives.minimise[{at}]", text))
        return found

    def assumptions(self) -> tuple[Assumption, ...]:
        own = [Assumption(f"reducers.{key}", one.source, "", "whose costs they are")
               for key, one in zip(self.nests, self.definition.reducers, strict=True)]  # fmt: skip
        return (*super().assumptions(), *own)

    def remarks(self, front: pd.DataFrame) -> tuple[str, ...]:
        return remarks_of(front)

    def warnings(self) -> tuple[str, ...]:
        unproven = [key for key, one in zip(self.nests, self.definition.reducers, strict=True)
                    if not one.proven]  # fmt: skip
        if not unproven:
            return ()
        return (f"reducers {', '.join(unproven)}: their fronts are points of a search, of which "
                "nothing is proven: neither is anything of this problem",)  # fmt: skip


def default_definition(parameters: Mapping[str, Value]) -> Definition:
    """Links in 21 kinds, and reducers of document B."""
    given = completed(PARAMETERS, parameters)
    return Definition(TWENTY_ONE, (documents_reducer(),) * 2, bool(number(given["nested"])),
                      bool(number(given["per_drive"])))  # fmt: skip
