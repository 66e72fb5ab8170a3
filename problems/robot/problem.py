"""Machines of links and reducers: one allocation of gears and links, one front."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import Fault
from ...models.costs import CostCurve
from ...models.robot import CALIBRATED, ratio
from ...section import Array, Assumption, Output, Parameter, Value, Variable
from ..declaration import Declaration, Interval
from ..forms import Feature, Form, Way
from ..limits import descending, narrow_range
from ..nested_reducers import Nested
from ..settings import Bound, Settings, VariableSetting
from ..tolerance_problem import ToleranceProblem
from .gears import RMS, SECONDS, TE, Built, Fitted, Gears, gear_variables
from .machine import Machine, Sampled

if TYPE_CHECKING:
    import pandas as pd

# Parameters and outputs that every machine of links and reducers declares.


Points = Iterable[Sequence[float] | Array]
AXES = ("", "tilt_", "yaw_")
"""Position, squareness and yaw, as mean squares of a machine are named."""
FLANKS = ("gravity", "free", "held")


def assumed_parameter(name: str, default: float, unit: str, meaning: str, high: float) -> Parameter:
    """A positive number that no document prints."""
    return Parameter(name, default, unit, meaning, "assumed", assumed=True, low=0.0, high=high)


PARAMETERS: tuple[Parameter, ...] = (
    Parameter(
        "calibrated",
        "none",
        "",
        "position: commands are corrected for the links of the machine, so that their position errors vanish; the "
        "reducers' errors remain",
        "assumed",
        assumed=True,
        choices=CALIBRATED,
    ),
    Parameter(
        "flanks",
        "gravity",
        "",
        "the flank of a reducer that carries: gravity: that on which gravity holds it at rest, pose by pose; free: "
        "that of the approach; held: always the same",
        "assumed",
        assumed=True,
        choices=FLANKS,
    ),
    assumed_parameter("payload_kg", 10.0, "kg", "mass at the tool", 1e5),
    assumed_parameter(
        "friction_torque_Nm",
        12.4,
        "Nm",
        "friction of a reducer at its output: gravity holds a flank beyond it (3 % of 412 N m)",
        1e6,
    ),
    assumed_parameter("stiffness_Nm_per_arcmin", 108.0, "Nm/arcmin", "stiffness of a reducer", 1e9),
    assumed_parameter(
        "hysteresis_arcmin",
        0.0,
        "arcmin",
        "lost motion of friction, 2 friction torques over the stiffness; it adds to the backlash",
        60.0,
    ),
    assumed_parameter("precision_weight", 5.0, "", "Q of the reducers' adjusted assembly (document A)", 1e6),
    assumed_parameter("reducer_price", 1.0, "", "cost of a reducer in units of the links' cost, as a factor", 1e6),
    Parameter("per_drive", True, "", "reducers may differ; false: all are alike", "assumed", assumed=True),
    Parameter(
        "nested",
        True,
        "",
        "reducers enter by what an rms of their backlash costs; false: every tolerance of them is a variable",
    ),
)

FIXED_OUTPUTS: tuple[Output, ...] = (
    Output("cost", "", "relative cost of links and reducers", low=0.0),
    Output("cost_links", "", "relative cost of the links", low=0.0),
    Output("cost_reducers", "", "relative cost of the reducers", low=0.0),
    Output(
        "pose_accuracy_mm",
        "mm",
        "bidirectional pose accuracy A: quantile of the position error over units, sides of approach, phases and "
        "poses, at the coverage",
        low=0.0,
    ),
    Output("pose_rms_mm", "mm", "R, the rms of the same", low=0.0),
    Output("accuracy_ratio", "", "A/R", low=0.0),
    Output("squareness_mrad", "mrad", "rms tilt of the tool", low=0.0),
    Output("yaw_mrad", "mrad", "rms rotation of the tool about its axis", low=0.0),
    Output(
        "backlash_arcmin", "arcmin", "quantile of a reducer's backlash at its coverage; of the worst drive", low=0.0
    ),
    Output(
        "backlash_rms_arcmin",
        "arcmin",
        "root mean square of a reducer's backlash, hysteresis included; of the worst drive",
        low=0.0,
    ),
    Output(
        "te_amplitude_arcsec",
        "arcsec",
        "quantile of the amplitude of a reducer's transmission error at the coverage; of the worst drive",
        low=0.0,
    ),
    Output(
        "reversal_mm",
        "mm",
        "rms distance of two attained positions, all drives approached from opposite sides",
        low=0.0,
    ),
    Output(
        "iso_vap_mm",
        "mm",
        "multi-directional variation vAP of ISO 9283: largest distance of the means of approaches along three axes; "
        "rms over units and poses",
        low=0.0,
    ),
    Output("path_te_mm", "mm", "rms amplitude of the transmission errors along a path", low=0.0),
    Output(
        "wind_up_mm",
        "mm",
        "rms displacement by gravity's torque on the stiffness of the reducers; no tolerance changes it",
        low=0.0,
    ),
    Output("wind_up_varying_mm", "mm", "rms of the displacement less its mean over the poses", low=0.0),
    Output("held_percent", "%", "poses and drives at which gravity holds a flank", low=0.0, high=100.0),
)
LIMITS: dict[str, Bound] = {}
OBJECTIVES = ("cost", "pose_accuracy_mm", "squareness_mrad", "te_amplitude_arcsec")
STANDS = {"pose_rms_mm": "pose_accuracy_mm", "backlash_rms_arcmin": "backlash_arcmin"}
"""Requirements of the convex form, and the outputs that grow with them."""


def millimetres(points: Points) -> list[list[float]]:
    """Points [m] of a drawing, in tenths of a millimetre."""
    return [[round(1e3 * float(x), 1) + 0.0 for x in point] for point in points]


def sketch_part(name: str, kind: str, points: Points, shares: Sequence[str] = ()) -> dict[str, Any]:
    """A part of the drawing of a machine: its line [m], and the columns of its fractions of R^2."""
    return {"name": name, "kind": kind, "points": millimetres(points), "shares": list(shares)}


def share_name(variable: str) -> str:
    """`share_origin_1_percent` of the variable `origin_1_um`."""
    return f"share_{variable.rpartition('_')[0]}_percent"


def outputs_of(drives: Iterable[str], links: Iterable[str], priced: Iterable[str]) -> tuple[Output, ...]:
    """All outputs: fractions of R^2 of links and joints, prices of the variables."""
    fractions = [
        Output(f"share_joint_{drive}_percent", "%", f"fraction of R^2 of drive {drive}'s reducer", low=0.0, high=100.0)
        for drive in drives
    ]
    fractions += [Output(share_name(name), "%", f"fraction of R^2 of {name}", low=0.0, high=100.0) for name in links]
    prices = [Output(f"price_{name}", "um", f"reduction of R per unit of cost of {name}", low=0.0) for name in priced]
    return (*FIXED_OUTPUTS, *fractions, *prices)


# What a configuration declares of a machine: links, and a reducer on each drive.


@dataclass(frozen=True)
class Drive:
    """A drive with a reducer: `key` numbers it, drives of one `group` have reducers alike.

    Cost, backlash and transmission error are the reducer's times a factor each.
    """

    key: str
    reducer: Nested
    cost_factor: float = 1.0
    backlash_factor: float = 1.0
    te_factor: float = 1.0
    group: str = ""


class Definition(ABC):
    """Links and reducers of a machine."""

    nested: bool
    """Reducers enter by two numbers each; else every tolerance of them is a variable."""
    per_drive: bool
    """Reducers may differ; else all are alike."""

    @property
    @abstractmethod
    def drives(self) -> tuple[Drive, ...]:
        """The drives with a reducer, in the order of the machine's."""

    @property
    @abstractmethod
    def link_variables(self) -> tuple[Variable, ...]:
        """The variables of the links."""

    @property
    @abstractmethod
    def link_costs(self) -> Mapping[str, CostCurve]:
        """Their costs by name."""

    @property
    @abstractmethod
    def link_references(self) -> Mapping[str, float]:
        """Their usual standard deviations by name."""

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Names of the links' variables."""
        return tuple(v.name for v in self.link_variables)

    @cached_property
    def gears(self) -> Mapping[str, Nested]:
        """The reducers that have separate variables, by the key of their first drive."""
        first: dict[str, Drive] = {}
        for fitted in self.drives:
            first.setdefault(self._group(fitted), fitted)
        return {drive.key: drive.reducer for drive in first.values()}

    @cached_property
    def fitted(self) -> tuple[Fitted, ...]:
        """The gear of each drive, with its factors."""
        names = [self._group(drive) for drive in self.drives]
        order = list(dict.fromkeys(names))
        return tuple(
            Fitted(order.index(name), drive.cost_factor, drive.backlash_factor, drive.te_factor)
            for name, drive in zip(names, self.drives, strict=True)
        )

    def _group(self, drive: Drive) -> str:
        return (drive.group or f"drive {drive.key}") if self.per_drive else ""


def declaration_of(definition: Definition, **more: Any) -> Declaration:
    """Variables, outputs and cost curves of links and reducers; `more` fields as they are."""
    gears = gear_variables(definition.gears, definition.nested)
    variables = (*definition.link_variables, *gears)
    names = [v.name for v in variables if v.tolerance]
    drives = [drive.key for drive in definition.drives]
    return Declaration(
        variables,
        outputs_of(drives, definition.links, names),
        costs=dict(definition.link_costs),
        limits=LIMITS,
        objectives=OBJECTIVES,
        algorithm="exact",
        unconditional=frozenset(["cost", "cost_links", "cost_reducers"]),
        operation={"payload_kg": ("payload_kg",)},
        **more,
    )


# The convex form of a machine of links and reducers.
#
# Every requirement is a root of a sum of squares: variances of links, E b^2 and W of reducers. What a
# reducer costs at an rms of its backlash is a convex curve per grade (problems/reducers), each a way
# of making it; its transmission error has a curve in closed form. The curves are lower bounds, by at
# most 1e-5 of their cost, so that what is proven of the form is proven of all tolerances.


TE_OUTPUT = "te_amplitude_arcsec"


def form_of(problem: RobotProblem) -> Form | None:
    """The form; None where a reducer's front is not proven."""
    if not problem.gears.proven:
        return None
    gears = problem.gears.nested
    shared = ["pose_rms_mm", "squareness_mrad", "yaw_mrad", "reversal_mm", "path_te_mm"]
    outputs = [*shared, *(["backlash_rms_arcmin"] * len(gears)), *([TE_OUTPUT] * len(gears))]
    features = [*_gear_features(problem, len(outputs)), *_link_features(problem, len(outputs))]
    base = (problem.gears.wave.base * problem.gears.largest[1]).tolist()
    offset = np.array([*[0.0] * (len(outputs) - len(base)), *base])
    asked = (*outputs, *problem.cost_names, *STANDS.values(), *(v.name for v in problem.variables))
    relaxed = tuple(
        limit.name
        for limit in problem.limits
        if limit.name not in asked or (np.isfinite(limit.low) and limit.name not in problem.names)
    )
    left_out = f"; limits left out: {', '.join(relaxed)}" if relaxed else ""
    return Form(
        tuple(outputs),
        tuple(features),
        offset,
        _constant(problem, outputs),
        "rms of the position error (first order) and proven fronts of the reducers, phi_2 normal" + left_out,
        exact=False,
        relaxed=relaxed,
        stands=STANDS,
    )


def _constant(problem: RobotProblem, outputs: list[str]) -> Array:
    """Squares that no tolerance changes: the hysteresis of drives whose flank is held."""
    mean, gears = problem.machine.squares, problem.gears
    lost = 0.25 * (gears.hysteresis * gears.factors) ** 2
    squares = np.zeros(len(outputs))
    for row, name in enumerate(AXES):
        squares[row] = float((mean[f"{name}wave"] - mean[f"{name}backlash"]) @ lost)
    return squares


def _gear_features(problem: RobotProblem, rows: int) -> list[Feature]:
    spreads = [_spreads(problem, gear, rows) for gear in range(len(problem.gears.nested))]
    play = [_backlash_feature(problem, gear, spread[0]) for gear, spread in enumerate(spreads)]
    return play + [_wave_feature(problem, gear, spread[1]) for gear, spread in enumerate(spreads)]


def _spreads(problem: RobotProblem, gear: int, rows: int) -> Array:
    """Coefficients (2, rows) of a gear's rms backlash [arcmin] and rms wave [arcsec]."""
    mean, gears = problem.machine.squares, problem.gears
    drives = [at for at, gear_of_drive in enumerate(gears.gear_of) if gear_of_drive == gear]
    squares = gears.factors[drives] ** 2, gears.te_factors[drives] ** 2
    play = np.array([float(mean[f"{name}backlash"][drives] @ squares[0]) for name in AXES])
    wave = np.array([float(mean[f"{name}wave"][drives] @ squares[1]) for name in AXES])
    spread = np.zeros((2, rows))
    spread[0, :3], spread[1, :3] = np.sqrt(play / 4.0), SECONDS * np.sqrt(wave)
    spread[0, 3], spread[1, 4] = np.sqrt(play[0]), SECONDS * np.sqrt(2.0 * wave[0])
    spread[0, 5 + gear] = gears.largest[0, gear]
    spread[1, 5 + len(gears.nested) + gear] = gears.largest[1, gear] * gears.wave.least
    return spread


def _backlash_feature(problem: RobotProblem, gear: int, spread: Array) -> Feature:
    """A way per grade; the cost of all drives that have the gear is in its curve."""
    reducer, name = problem.gears.nested[gear], f"reducer_{problem.gears.keys[gear]}"
    low, high = _range(problem, f"{name}_{RMS}", reducer.range)
    price = reducer.price * float(problem.gears.counts[gear])
    ways = []
    for curve, grade in zip(reducer.curves, reducer.grades, strict=True):
        ends = max(low, float(curve.t[0])), min(high, float(curve.t[-1]))
        if ends[0] < ends[1]:
            priced = replace(curve, price=price)
            ways.append(_way(priced, ends, spread, float(grade)))
    return Feature(f"{name}_{RMS}", tuple(ways), f"{name}_grade_of_form")


def _wave_feature(problem: RobotProblem, gear: int, spread: Array) -> Feature:
    curve, name = problem.gears.wave.curve, f"reducer_{problem.gears.keys[gear]}"
    usual = float(curve.t[0]), float(curve.t[-1])
    low, high = _range(problem, f"{name}_{TE}", usual)
    priced = replace(curve, price=curve.price * float(problem.gears.counts[gear]))
    way = _way(priced, (max(low, usual[0]), min(high, usual[1])), spread)
    return Feature(f"{name}_{TE}", (way,))


def _way(curve: CostCurve, ends: tuple[float, float], spread: Array, choice: float = 0.0) -> Way:
    nothing = (0.0,) * len(spread)
    return Way(curve, *ends, nothing, tuple(spread.tolist()), choice=choice)


def _link_features(problem: RobotProblem, rows: int) -> list[Feature]:
    spreads = np.pad(np.sqrt(problem.machine.links), ((0, rows - 3), (0, 0))).T
    return [
        Feature(name, (_way(problem.settings.costs[name], _range(problem, name, problem.interval(name)), spread),))
        for name, spread in zip(problem.link_names, spreads, strict=True)
    ]


def _range(problem: RobotProblem, name: str, usual: tuple[float, float]) -> tuple[float, float]:
    """Range of a variable within the limits on it."""
    return narrow_range(problem.limits, name, *(problem.interval(name) if name in problem.names else usual))


# Where the next unit of cost reduces the error most, in words.


MAX_NAMED_TOLERANCES = 3
"""Tolerances that are named."""


def remarks_of(front: pd.DataFrame) -> tuple[str, ...]:
    """The best prices and the largest fractions of R^2 at the front's middle point by cost."""
    if front.empty:
        return ()
    order = front["cost"].astype(float).argsort(kind="stable")
    row = front.iloc[int(order.iloc[len(front) // 2])]
    values = {str(name): float(value) for name, value in row.items() if str(name).startswith(("price_", "share_"))}
    where = f"at cost {float(row['cost']):.4g} (A {float(row['pose_accuracy_mm']):.3g} mm)"
    bought = ", ".join(f"{name} {value:.3g} um" for name, value in _largest(values, "price_", ""))
    largest = ", ".join(f"{name} {value:.3g} %" for name, value in _largest(values, "share_", "_percent"))
    spent = f"a further unit of cost lowers R most where it is spent on {bought}" if bought else "no cost lowers R"
    return (f"{where} {spent}" + f"; the largest fractions of R^2 are {largest}" * bool(largest),)


def _largest(values: dict[str, float], begins: str, ends: str) -> list[tuple[str, float]]:
    ranked = [
        (name.removeprefix(begins).removesuffix(ends), value)
        for name, value in values.items()
        if name.startswith(begins) and value > 0.0
    ]
    largest = descending(np.array([value for _, value in ranked]))[:MAX_NAMED_TOLERANCES]
    return [ranked[at] for at in largest]


FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Fractions of backlash in R^2 at which the ratio A/R of a search is tabulated."""
RATIO_SAFETY_FACTOR = 1.01
"""Factor of that ratio, so that a design of a search keeps its limits when it is sampled."""
SAMPLED = 200
"""Most designs that are sampled at once; of a larger batch only those that are reported."""
UNITS = 16_384
"""Units of the ratio that a search uses."""
ROWS = ("pose_rms_mm", "squareness_mrad", "yaw_mrad")


class RobotProblem(ToleranceProblem):
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
            "backlash_rms_arcmin": np.sqrt(square.max(axis=1, initial=0.0)),
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
        c = RATIO_SAFETY_FACTOR * np.interp(fraction, FRACTIONS, self._ratios)
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
        middle = np.sqrt(self.corner(tight=True) * np.maximum(self.corner(tight=False), 1e-12))
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
        ends = self.first_order(np.stack([self.corner(tight=True), self.corner(tight=False)]))
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
        for at, name in enumerate(self.objectives if self.free else ()):
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
