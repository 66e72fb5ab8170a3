"""Machines of links and reducers: one allocation of gears and links, one front."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
import pandas as pd

from ...arrays import Array
from ...declarations import Assumption, Value
from ...errors import Fault
from ...models.robot.sample import ratio
from ..declaration import Interval
from ..forms import Form
from ..interfaces import Comparison, Documented, Page, Provable, Stored
from ..settings import Settings, VariableSetting
from ..tolerance_problem import ToleranceProblem
from .definition import Definition, declaration_of
from .form import form_of
from .gears import Built, Gears
from .machine import Machine, Sampled
from .outputs import AXES, share_name
from .remarks import remarks_of

FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Fractions of backlash in R^2 at which the ratio A/R of a search is tabulated."""
SAFE = 1.01
"""Factor of that ratio, so that a design of a search keeps its limits when it is sampled."""
SAMPLED = 200
"""Most designs that are sampled at once; of a larger batch only those that are reported."""
UNITS = 16_384
"""Units of the ratio that a search uses."""
ROWS = ("pose_rms_mm", "squareness_mrad", "yaw_mrad")


class RobotProblem(ToleranceProblem, Provable, Documented, Comparison, Stored, Page):
    """Pose accuracy of a machine with reducers against cost.

    Links by standard deviations of their errors, reducers by what an rms of their backlash and of
    their transmission error costs.
    """

    _drawn_again = frozenset(("_sampled", "_ratios"))

    def __init__(self, settings: Settings, definition: Definition) -> None:
        self.definition = definition
        super().__init__(settings)
        self.gears = Gears.of(
            definition.gears,
            definition.fitted,
            definition.nested,
            self.settings.parameters,
            self.settings.propagation.coverage,
        )

    @property
    @abstractmethod
    def machine(self) -> Machine:
        """The machine at its poses."""

    # ---------------------------------------------------------------- evaluation

    @property
    def link_names(self) -> tuple[str, ...]:
        """Variables of the links."""
        return self.definition.links

    def sigma(self, designs: Array) -> Array:
        """Standard deviations (n, links) of full designs."""
        return designs[:, : len(self.link_names)]

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        outputs = {output.name: np.full(len(designs), np.nan) for output in self.outputs}
        outputs |= self.first_order(designs)
        rms = outputs["pose_rms_mm"]
        if searching or len(designs) > SAMPLED:
            waves = outputs["path_te_mm"] ** 2 / 2.0
            links = sum(outputs[share_name(name)] for name in self.link_names) / 100.0
            fraction = 1.0 - links - waves / np.where(rms > 0.0, rms**2, 1.0)
            outputs |= self._accuracy(rms, np.where(rms > 0.0, fraction, 0.0))
        else:
            outputs |= self._by_monte_carlo(designs, rms)
        return outputs | self._slow_outputs(designs)

    def first_order(self, designs: Array) -> dict[str, Array]:
        """Outputs (n,) of full designs (n, all variables) that need no sample: costs, root mean
        squares and their fractions.
        """
        sigma, gears = self.sigma(designs), self.gears.at(self._of_gears(designs))
        drives = list(self.gears.gear_of)
        square = gears.square[:, drives] * self.gears.factors**2  # (n, drives) arcmin^2
        wave = (gears.wave[:, drives] * self.gears.te_factors) ** 2
        by_joint, by_link = self._parts(square, wave, sigma)
        total = by_joint.sum(axis=1) + by_link.sum(axis=1)
        rms = np.sqrt(total)
        tilt, turn = (self._turned(row, square, wave, sigma) for row in (1, 2))
        mean, machine = self.machine.squares, self.machine
        cost_links, cost_gears = self.cost_of(designs), gears.cost @ self.gears.counts
        outputs = {
            "cost": cost_links + cost_gears,
            "cost_links": cost_links,
            "cost_reducers": cost_gears,
            "pose_rms_mm": rms,
            "squareness_mrad": tilt,
            "yaw_mrad": turn,
            "backlash_rms_arcmin": np.sqrt(square.max(axis=1)),
            "reversal_mm": np.sqrt(square @ mean["backlash"]),
            "path_te_mm": np.sqrt(2.0 * wave @ mean["wave"]),
        }
        outputs |= {
            name: np.full(len(designs), value)
            for name, value in (
                ("wind_up_mm", machine.wind_up),
                ("wind_up_varying_mm", machine.wind_up_varying),
                ("held_percent", machine.held_percent),
            )
        }
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = np.where(total > 0.0, 100.0 / total, 0.0)
        keys = [drive.key for drive in self.definition.drives]
        outputs |= {f"share_joint_{key}_percent": by_joint[:, at] * shares for at, key in enumerate(keys)}
        outputs |= {share_name(n): by_link[:, k] * shares for k, n in enumerate(self.link_names)}
        return outputs

    def _parts(self, square: Array, wave: Array, sigma: Array) -> tuple[Array, Array]:
        """Parts (n, drives) and (n, links) of R^2 [mm^2]."""
        mean = self.machine.squares
        lost = 0.25 * (self.gears.hysteresis * self.gears.factors) ** 2
        held = (mean["wave"] - mean["backlash"]) * lost
        by_joint = mean["backlash"] * square / 4.0 + held + mean["wave"] * wave
        return by_joint, self.machine.links[0] * sigma**2

    def _turned(self, row: int, square: Array, wave: Array, sigma: Array) -> Array:
        """Rms rotation (n,) [mrad] of a row of `ROWS`."""
        mean, name = self.machine.squares, AXES[row]
        backlash, whole = mean[f"{name}backlash"], mean[f"{name}wave"]
        lost = 0.25 * (self.gears.hysteresis * self.gears.factors) ** 2
        by_tolerances = sigma**2 @ self.machine.links[row] + square @ backlash / 4.0 + wave @ whole
        return np.asarray(np.sqrt(by_tolerances + (whole - backlash) @ lost))

    def _accuracy(self, rms: Array, fraction: Array) -> dict[str, Array]:
        """A by the ratio that a search uses: interpolated over the fraction of backlash in R^2."""
        c = SAFE * np.interp(fraction, FRACTIONS, self._ratios)
        return {"pose_accuracy_mm": c * rms, "accuracy_ratio": c}

    def _slow_outputs(self, designs: Array) -> dict[str, Array]:
        """The outputs that take longer, where they are minimised or limited."""
        columns = self._of_gears(designs)
        return {name: output(columns) for name, output in self._slow.items() if name in self.required_outputs}

    @property
    def _slow(self) -> dict[str, Callable[[Array], Array]]:
        return {
            "te_amplitude_arcsec": self.gears.amplitudes,
            "backlash_arcmin": self.gears.quantiles,
            "iso_vap_mm": lambda columns: self.machine.variation(self._play(columns)),
        }

    def _play(self, columns: Array) -> Array:
        """Rms backlash (n, drives) [arcmin]."""
        square = self.gears.at(columns).square[:, list(self.gears.gear_of)]
        return np.sqrt(square) * self.gears.factors

    def _verified(self, designs: Array, outputs: Mapping[str, Array]) -> dict[str, Array]:
        """The remaining outputs, for the designs that are reported."""
        columns, rms = self._of_gears(designs), outputs["pose_rms_mm"]
        more = {name: output(columns) for name, output in self._slow.items()}
        accuracy = self._by_monte_carlo(designs, rms) if len(designs) > SAMPLED else {}
        return more | self._prices(designs, rms) | accuracy

    def _by_monte_carlo(self, designs: Array, rms: Array) -> dict[str, Array]:
        built = self.gears.built(self._of_gears(designs))
        coverage = self.settings.propagation.coverage
        errors = map(self._errors, self.sigma(designs), built)
        c = np.array([ratio(of_design, coverage) for of_design in errors])
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
        sampled = self._sampled
        units = self.gears.units(built, sampled.sample.unit)
        return sampled.errors(sigma, sampled.joint_errors(*units))

    @cached_property
    def _ratios(self) -> Array:
        """c at `FRACTIONS`, of machines whose errors are scaled to that fraction of backlash."""
        rng = np.random.default_rng(self.settings.seed)
        sampled = self.machine.sampled(UNITS, self.gears.dimensions, rng)
        middle = np.sqrt(self._corner(tight=True) * np.maximum(self._corner(tight=False), 1e-12))
        built = self.gears.built(self._of_gears(middle[None, :]))[0]
        units = self.gears.units(built, sampled.sample.unit)
        sigma, nothing = self.sigma(middle[None, :])[0], np.zeros_like(units[2])
        play = sampled.errors(0.0 * sigma, sampled.joint_errors(units[0], units[1], nothing))
        rest = sampled.errors(sigma, sampled.joint_errors(0.0 * units[0], 0.0 * units[1], units[2]))
        sizes = [float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) for errors in (play, rest)]
        coverage = self.settings.propagation.coverage
        if not sizes[0]:
            return np.full(len(FRACTIONS), ratio(rest, coverage))
        return np.array(
            [
                ratio(np.sqrt(s) * play / sizes[0] + np.sqrt(1.0 - s) * rest / (sizes[1] or 1.0), coverage)
                for s in FRACTIONS
            ]
        )

    # ---------------------------------------------------------------- the next unit of money

    def _prices(self, designs: Array, rms: Array) -> dict[str, Array]:
        """Fall of R [um] per unit of cost spent on each tolerance."""
        sigma = self.sigma(designs)
        prices: dict[str, Array] = {}
        for at, name in enumerate(self.link_names):
            fall = self.machine.links[0][at] * sigma[:, at] / rms
            rise = -self.settings.costs[name].slope(sigma[:, at])
            prices[f"price_{name}"] = 1e3 * fall / np.maximum(rise, 1e-300)
        mean = self.machine.squares
        for drive, gear in enumerate(self.gears.gear_of):
            fitted = self.gears.fitted[drive]
            weights = (
                fitted.backlash_factor**2 * mean["backlash"][drive] / 4.0,
                fitted.te_factor**2 * mean["wave"][drive],
            )
            for name, (square, cost) in self.gears.slopes(self._of_gears(designs), gear).items():
                fall = (weights[0] * square[0] + weights[1] * square[1]) / (2.0 * rms)
                count = self.gears.counts[gear]
                price = 1e3 * fall / (np.maximum(cost, 1e-300) * count)
                prices[f"price_{name}"] = prices.get(f"price_{name}", 0.0) + price
        return prices

    # ---------------------------------------------------------------- what is known

    def interval(self, output: str) -> Interval:
        """Proven bounds: errors rise and costs fall with every tolerance."""
        if output in self.names:
            return super().interval(output)
        ends = self.first_order(np.stack([self._corner(tight=True), self._corner(tight=False)]))
        if output == "cost":
            return float(ends[output][1]), float(ends[output][0])
        known = (*ROWS, "backlash_rms_arcmin", "reversal_mm", "path_te_mm", "wind_up_mm")
        if output in known:
            return float(ends[output][0]), float(ends[output][1])
        return super().interval(output)

    def form(self) -> Form | None:
        return form_of(self)

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        return self.gears.form_columns(columns)

    def stand_in_limit(self, name: str, high: float) -> float:
        """The upper limit of the requirement that stands for a limit on an output."""
        if name == "pose_accuracy_mm":
            # with one objective the exact solver moves the limit by what is missing
            extreme = np.min if len(self.objectives) == 1 else np.max
            return high / float(extreme(self._ratios))
        if name == "backlash_arcmin":
            return self.gears.rms_of_quantile(high)
        return high

    def form_values(self, form: Form, designs: Array, outputs: Mapping[str, Array]) -> Array:
        values = super().form_values(form, designs, outputs)
        limits = {limit.name: limit.high for limit in self.limits}
        for row, name in enumerate(form.outputs):
            limited = form.stands.get(name, "")
            if np.isfinite(limits.get(limited, np.inf)):
                per = outputs[limited] / outputs[name]
                allowed = self.stand_in_limit(limited, limits[limited])
                values[:, row] = allowed + (outputs[limited] - limits[limited]) / per
        return values

    def kept(self) -> dict[str, Array]:
        return {name: array for reducer in self.gears.nested for name, array in reducer.stored_arrays().items()}

    def adopt(self, arrays: Mapping[str, Array]) -> bool:
        return not [reducer for reducer in self.gears.nested if not reducer.adopt(arrays)]

    def references(self) -> dict[str, Array]:
        """The documents' reducers on links at their references; all variables must be there."""
        if self.definition.nested:
            return {}
        sigma = [self.definition.link_references[name] for name in self.link_names]
        return {"documents' reducers, reference links": np.array([*sigma, *self.gears.document()])}

    # ---------------------------------------------------------------- alternatives to the machine

    def alternatives(self) -> dict[str, ToleranceProblem]:
        definition, given = self.definition, self.given
        problems: dict[str, ToleranceProblem] = {}
        if len(definition.gears) > 1 and len({drive.reducer.key for drive in definition.drives}) == 1:
            alike = replace(definition, per_drive=False)  # type: ignore[type-var]
            problems["reducers alike in all drives"] = self._with(given, alike, per_drive=False)
        calibration = "none" if self.machine.calibrated else "position"
        label = "calibrated in position" if calibration == "position" else "not calibrated"
        return problems | {label: self._with(given, definition, calibrated=calibration)}

    def _with(self, given: Settings, definition: Definition, **parameters: Value) -> RobotProblem:
        every = {**given.parameters, **parameters}
        # the other machine's least cost is of interest even where it cannot reach the limits
        settings = replace(given, parameters=every, definition=definition, variables=self._still(definition))
        return type(self)(settings)  # type: ignore[call-arg]

    def _still(self, definition: Definition) -> dict[str, VariableSetting]:
        """The settings of the variables that remain."""
        names = {v.name for v in declaration_of(definition).variables}
        return {name: setting for name, setting in self.given.variables.items() if name in names}

    # ---------------------------------------------------------------- faults and assumptions

    def misplacements(self) -> list[Fault]:
        """What keeps the machine from its poses."""
        return []

    def faults(self) -> list[Fault]:
        return self.misplacements() or self._without_effect() or super().faults()

    def _without_effect(self) -> list[Fault]:
        """Objectives that calibration, or gravity, removes entirely."""
        faults = []
        for at, name in enumerate(self.objectives):
            low, high = self.interval(name)
            if np.isfinite(low) and np.isfinite(high) and high <= low + 1e-15:
                cause = "transmission errors and links" if name == "reversal_mm" else "nothing"
                text = (
                    f"{name} is {low:.4g} for every design: calibration and held flanks (calibrated, flanks) remove "
                    f"what tolerances change of it; the residual is due to {cause}: minimise another output, or set "
                    'flanks = "free"'
                )
                faults.append(Fault(f"objectives.minimise[{at}]", text))
        return faults

    def assumptions(self) -> tuple[Assumption, ...]:
        reason = "the reducer whose costs are used"
        drives = self.definition.drives
        sources = [Assumption(f"reducers.{drive.key}", drive.reducer.source, "", reason) for drive in drives]
        return (*super().assumptions(), *sources)

    def remarks(self, front: pd.DataFrame) -> tuple[str, ...]:
        return remarks_of(front)

    def warnings(self) -> tuple[str, ...]:
        unproven = [drive.key for drive in self.definition.drives if not drive.reducer.proven]
        if not unproven:
            return ()
        return (
            f"the fronts of reducers {', '.join(unproven)} are points of a search: nothing is proven of them, nor of "
            "this problem",
        )
