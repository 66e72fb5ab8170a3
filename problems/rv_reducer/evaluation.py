"""From the settings of the problem to the model of units."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from math import ceil, log
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from ...models.inputs import Distribution
from ...models.rv_reducer.contact.contact import LOST_MOTION_SHARE
from ...models.rv_reducer.population.contact import NAMES, Fitted, PinClasses, Population, Slopes, Turn, fit_pins
from ...models.rv_reducer.population.elastic import LEAST_SHARE, Elastic, Loading, elastic
from ...models.rv_reducer.population.errors import Lattice, Scaled, Table, change_units, turn_lattice
from ...models.rv_reducer.population.measures import Conditions, Measures
from ...models.rv_reducer.population.units import (
    NO_STAGE,
    Involute,
    Statistic,
    UnitBasis,
    deviation,
    mean,
    ordered_quantile,
    quantile,
    share_above,
    stem,
)
from ...records import UnitsShown
from ...section import Array, Value, number
from ...units import ARCMIN, MM
from ..settings import VariableSetting
from .counterparts import Change, ChangedMeasures
from .declared import JAM, LEAST, LOADED, MEASURES, part_of

if TYPE_CHECKING:
    import pandas as pd


def classes_of(parameters: Mapping[str, Value]) -> PinClasses | None:
    """The classes that pins are sorted into by their diameter, None where they are taken as they come."""
    if "pin_classes" not in parameters:
        return None
    classes, width, error = (number(parameters[name]) for name in ("pin_classes", "pin_class_um", "pin_match_um"))
    return PinClasses(int(classes), 0.5 * width, 0.5 * error)


@dataclass(frozen=True, slots=True, eq=False)
class UnitModel(UnitBasis):
    """The properties common to all units, how units are drawn, and the conditions on them."""

    conditions: Conditions
    loading: Loading
    preload: float
    sorting: PinClasses | None = None
    change: Change = field(default_factory=Change)

    @classmethod
    def of(
        cls, parameters: Mapping[str, Value], variables: Mapping[str, VariableSetting], coverage: float
    ) -> UnitModel:
        """The model of completed settings."""
        inputs: dict[str, Distribution] = {
            stem(name): setting.distribution for name, setting in variables.items() if setting.distribution
        }
        mids = {stem(name): setting.centre for name, setting in variables.items() if setting.centre is not None}
        conditions = Conditions(
            coverage,
            number(parameters["backlash_limit_arcmin"]),
            str(parameters["interference"]),
            number(parameters["overlap_arcmin"]),
        )
        rated = number(parameters["rated_torque_Nm"])
        loading = Loading(
            normal_stiffness=number(parameters["normal_stiffness_N_per_mm"]) / MM,
            series_stiffness=number(parameters["series_stiffness_Nm_per_arcmin"]) / ARCMIN,
            rated_torque=rated,
            te_torque=number(parameters["te_torque_Nm"]) or rated,
            load_torque=number(parameters["load_torque_Nm"]),
            friction=number(parameters["pin_friction"]),
        )
        preload = 0.01 * number(parameters["preload_percent_of_rated"]) * rated
        basis = UnitBasis.from_parameters(parameters, inputs, mids)
        common = {field.name: getattr(basis, field.name) for field in fields(UnitBasis)}
        return cls(**common, conditions=conditions, loading=loading, preload=preload, sorting=classes_of(parameters))

    def changed(self, change: Change) -> UnitModel:
        """The model with what effects change in it."""
        mid = dict(self.mid)
        for error, more in change.inside.items():
            mid[error] = mid.get(error, 0.0) + more
        return replace(self, mid=mid, change=change)

    def measures(self, turn: Turn, involute: Involute | None = None) -> Measures:
        """Statistics of the units of a turn, with what effects change outside their contact; behind another involute
        stage than that of the turn's design where one is given.
        """
        stage = involute or self.involute(turn.design.involute_grade, turn.design.thickness)
        statistics = Measures(turn, stage, self.conditions)
        return ChangedMeasures(statistics, self.change) if self.change.outside else statistics

    def population(self, positions: int, units: int, seed: int, stream: int) -> Population:
        """A population drawn from `seed`; each `stream` is independent of the others."""
        rng = np.random.default_rng([seed, stream])
        return Population.draw(self.geometry, positions, units, rng, self.hierarchy, self.coupling)


# Outputs of one design on a population, and their derivatives.


FITTING = 3
"""Stream of random numbers of the measurement by which pins are fitted."""
SCALE = {"yield_percent": 100.0}
VARIABLE = {"stagger": "stagger_arcmin", "dr_rp": "dr_rp_mm", "dr_p": "dr_p_mm", "crank_phase": "crank_phase_mrad",
            "involute": "involute_grade"}  # fmt: skip
"""Variables of derivatives whose names do not end in `_um`."""
BY_GRADE = 0.5 * log(2.0)
"""Derivative of ln(phi_1) by the ISO grade."""
STEP_OF_GRADE, STEP_OF_THICKNESS = 1e-3, 1e-2
"""Steps [grades], [um] of differences by the involute stage: some 1e-4 of phi_1, of which a statistic is smooth."""


@dataclass(frozen=True, eq=False)
class Populations:
    """The populations of a design: rigid units, units under load, and units for transmission error.

    Each is given as its numbers of positions and units, and drawn when it is first asked for.
    """

    draw: Callable[[int, int], Population]
    sizes: tuple[tuple[int, int], tuple[int, int], tuple[int, int]]
    counted: bool = False
    """Whether pins that are fitted to units are of whole classes, as in a report."""

    @cached_property
    def rigid(self) -> Population:
        """Rigid units."""
        return self.draw(*self.sizes[0])

    @cached_property
    def loaded(self) -> Population:
        """Units under load."""
        return self.draw(*self.sizes[1])

    @cached_property
    def turning(self) -> Population:
        """Units whose transmission error is computed."""
        return self.draw(*self.sizes[2])


def by_variable(slopes: Array) -> dict[str, float]:
    """Derivatives by `NAMES`, by the variable of each."""
    return {VARIABLE.get(error, f"{error}_um"): float(slope) for error, slope in zip(NAMES, slopes, strict=True)}


class Evaluation:
    """One design on populations; each statistic is computed when it is first asked for.

    `means` [um] are the offsets of the means of errors from their mid-limits, by name.
    """

    def __init__(
        self,
        model: UnitModel,
        drawn: Populations,
        row: Mapping[str, float],
        means: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self.model, self.drawn, self.means = model, drawn, means
        self.design = model.design(row, means)
        if model.sorting is not None:  # the pins of a unit are of one class
            within = {**self.design.half_width, "pin_radius": 0.5 * model.sorting.width}
            self.design = replace(self.design, half_width=within)
        self.involute = model.involute(self.design.involute_grade, self.design.thickness)
        self._elastic: dict[bool, Elastic] = {}
        self._statistics: dict[str, Statistic] = {}
        self._others: dict[Involute, Evaluation] = {}

    @cached_property
    def turn(self) -> Turn:
        """Rigid units over the turn."""
        fitted = self._fitted(self.drawn.rigid)
        turn = self.drawn.rigid.turn(self.design, None if fitted is None else fitted.larger, self.planets)
        return turn if fitted is None else replace(turn, fitted=fitted)

    @property
    def planets(self) -> Array | None:
        """Play (planets, n) [arcmin] of planets that are coupled through their cranks, else None."""
        if not self.model.coupled_planets:
            return None
        return self.involute.middle + self.involute.half * self.model.clearances(self.drawn.rigid.sample.planets)

    def _fitted(self, drawn: Population) -> Fitted | None:
        """The pins that are fitted to units, None where they are taken as they come."""
        if (sorting := self.model.sorting) is None:
            return None
        counted = self.drawn.counted
        rng = np.random.default_rng([FITTING, drawn.units, int(counted)])
        return fit_pins(drawn.turn(self.design), sorting, rng, counted)

    @cached_property
    def measures(self) -> Measures:
        """Statistics of rigid units."""
        return self.model.measures(self.turn, self.involute)

    def value(self, name: str) -> float:
        """A sampled output."""
        return SCALE.get(name, 1.0) * self._statistic(name).value

    def error(self, name: str) -> float:
        """Its standard error."""
        return SCALE.get(name, 1.0) * self._statistic(name).error

    def gradient(self, name: str) -> dict[str, float]:
        """Derivatives of a sampled output by variable, in the units of both."""
        statistic, scale = self._statistic(name), SCALE.get(name, 1.0)
        slopes = self._slopes(name)
        slopes["involute_grade"] = BY_GRADE * (slopes["involute_grade"] + scale * statistic.by_involute)
        if self.design.thickness:
            slopes |= self._by_involute(name)
        circle = self.design.width("pin_circle_radius")
        if circle > 0.0:
            slopes["pin_circle_radius_um"] += scale * statistic.by_zone / circle
        return slopes

    def _by_involute(self, name: str) -> dict[str, float]:
        """Derivatives by the grade and by the thickness of teeth, which change the ends of j_n apart.

        By central differences of the statistic: it is smooth in phi_1. The contact is solved again where planets are
        coupled alone.
        """
        grade, thickness = self.design.involute_grade, self.design.thickness
        pairs: dict[str, list[tuple[float, Mapping[str, float]]]] = {
            "involute_grade": [(grade + step * STEP_OF_GRADE, thickness) for step in (1.0, -1.0)],
            **{
                f"thickness_{gear}_um": [(grade, {**thickness, gear: t + s * STEP_OF_THICKNESS}) for s in (1.0, -1.0)]
                for gear, t in thickness.items()
            },
        }
        steps = dict.fromkeys(pairs, STEP_OF_THICKNESS) | {"involute_grade": STEP_OF_GRADE}
        slopes = {}
        for variable, ends in pairs.items():
            high, low = (self._with_involute(self.model.involute(*end)).value(name) for end in ends)
            slopes[variable] = 0.5 * (high - low) / steps[variable]
        return slopes

    def _with_involute(self, involute: Involute) -> Evaluation:
        """The same units behind another involute stage; evaluated once."""
        if involute not in self._others:
            other = copy.copy(self)
            for name in ("measures", "turn") if self.model.coupled_planets else ("measures",):
                other.__dict__.pop(name, None)
            other.involute, other._statistics, other._others = involute, {}, {}
            self._others[involute] = other
        return self._others[involute]

    def by_mean(self, name: str) -> dict[str, float]:
        """Derivatives of a sampled output by the means of errors, by variable.

        A mean moves every unit as its zone does one whose standardised error is 1; that of the
        position of the pins turns the unit, and moves nothing.
        """
        if not any(self.means.values()):
            return {}
        slopes, moving = self.slopes_of_means(name), self.means.keys() - {"pin_position"}
        return {f"{error}_um": slopes[f"{error}_um"] for error in moving}

    def slopes_of_means(self, name: str) -> dict[str, float]:
        """The same by the mean of every error, by variable."""
        return self._slopes(name, alike=True)

    def _slopes(self, name: str, alike: bool = False) -> dict[str, float]:
        """Derivatives of a sampled output over its units, by variable."""
        statistic, scale = self._statistic(name), SCALE.get(name, 1.0)
        if self._under_load(name):
            slopes = self._pulled_back(name, statistic, alike)
        else:
            measure, drawn = self.measures[MEASURES[name]], self.drawn.rigid
            slopes = measure.slopes(self.turn, drawn.alike if alike else drawn.slopes)
        return by_variable(scale * slopes)

    # ---------------------------------------------------------------- statistics

    def _under_load(self, name: str) -> bool:
        preload = self.model.conditions.interference == "preload"
        return name not in MEASURES or (preload and name == "interference_probability")

    def _statistic(self, name: str) -> Statistic:
        if name not in self._statistics:
            under_load = self._under_load(name)
            self._statistics[name] = self._loaded(name) if under_load else self.measures[MEASURES[name]].statistic
        return self._statistics[name]

    def _loaded(self, name: str) -> Statistic:
        """A statistic of units under load."""
        if name == "interference_probability":
            values = self.units_under_load("preload_torque_Nm").values["preload_torque"]
            return share_above(values, self.model.preload)
        output, part = part_of(name)
        values = self.turn.jam.force if output == JAM else self.units_under_load(output).values[LOADED[output]]
        coverage, geared = self.model.conditions.coverage, output == "lost_motion_arcmin"
        coverage = 1.0 - coverage if output in LEAST else coverage
        if part == "quantile":
            return quantile(values, self.involute, coverage) if geared else ordered_quantile(values, coverage)
        return (mean if part == "mean" else deviation)(values, self.involute if geared else NO_STAGE)

    def units_under_load(self, output: str) -> Elastic:
        """Units under load, as an output needs them."""
        turning = output == "transmission_error_arcsec"
        if turning not in self._elastic:
            drawn = self.drawn.turning if turning else self.drawn.loaded
            table = Table.of(drawn.lattice, self.design.dr_rp, self.design.dr_p)
            units = Scaled.of(drawn.lattice.geometry, drawn.sample, self.design)
            if (fitted := self._fitted(self.drawn.loaded)) is not None:
                larger = {"pin_radius_um": fitted.larger}
                units = change_units(drawn.lattice.geometry, units, drawn.sample, larger)
            names = [name for name in LOADED.values() if (name == "transmission_error") == turning]
            self._elastic[turning] = elastic(drawn.lattice, table, units, self.model.loading, names)
        return self._elastic[turning]

    def _pulled_back(self, name: str, statistic: Statistic, alike: bool) -> Array:
        output = "preload_torque_Nm" if name == "interference_probability" else part_of(name)[0]
        if output == JAM:
            rigid = self.drawn.rigid
            return self.turn.jam.slopes(statistic.weight, rigid.alike if alike else rigid.slopes)
        loaded = self.units_under_load(output)
        turning = output == "transmission_error_arcsec"
        drawn = self.drawn.turning if turning else self.drawn.loaded
        errors = drawn.alike if alike else drawn.slopes
        return loaded.pull_back(errors, {LOADED[output]: statistic.weight})


# One unit over a turn and the population of a design, as tables for a reader.


POSITIONS_SHOWN = 1021
"""Positions of a turn at which the one unit is drawn: a prime, 26 to a turn of the crank."""
PARTS_OF_TURN = 8
"""Parts in which that turn is computed: 10 MB each instead of 90."""
BINS = 80
"""Steps of the distribution over units."""
FRACTIONS_OF_TORQUE = (0.01, 0.02, LOST_MOTION_SHARE, 0.05, 0.07, *np.linspace(0.1, 1.0, 19).tolist())
"""Fractions of the rated torque at which the rotation is shown, in either sense; the least is `LEAST_SHARE`."""
INTERFERENCE = {
    "turn_mean": "the mean of the cycloid stage's backlash over the turn is below zero",
    "share_of_turn": "the cycloid stage's backlash is below zero, as a fraction of all positions of all units",
    "overlap": "the flanks overlap by more than {overlap:g} arcmin at one of the positions",
    "preload": "the flanks are preloaded by more than {preload:g} % of the rated torque",
}
"""What counts as interference, by the parameter of that name."""


def unit_tables(evaluation: Evaluation, parameters: Mapping[str, Value]) -> UnitsShown:
    """The tables of an evaluated design, and what they mean in words."""
    turn, curve = _turn(evaluation), _torque_rotation(evaluation)
    words = (*_evaluation_sentences(evaluation, parameters, turn), *_torque_sentences(evaluation, curve))
    return UnitsShown(words, turn, _population(evaluation), curve)


def _rank_at_coverage(evaluation: Evaluation, units: int) -> int:
    """Number from 1 on, of that many units in order, of the unit at the coverage."""
    return min(units, ceil(evaluation.model.conditions.coverage * units))


def _torque_rotation(evaluation: Evaluation) -> pd.DataFrame:
    """Rotation by torque of the units of median and of high lost motion, half the mean of phi_1 on each side."""
    import pandas as pd

    loaded = evaluation.units_under_load("lost_motion_arcmin")
    lost = loaded.values["lost_motion"]
    order = np.argsort(lost, kind="stable")
    chosen = order[[len(order) // 2, _rank_at_coverage(evaluation, len(order)) - 1]]
    parts = np.array([LEAST_SHARE, *FRACTIONS_OF_TORQUE])
    torques = np.concatenate([-parts[::-1], parts]) * evaluation.model.loading.rated_torque
    rotation = loaded.torque_rotation(torques, chosen)
    rotation += 0.5 * evaluation.involute.mean * np.sign(torques)[:, None]
    return pd.DataFrame(
        {
            "torque_Nm": torques,
            "rotation_median_arcmin": rotation[:, 0],
            "rotation_high_arcmin": rotation[:, 1],
            "lost_motion": np.concatenate([parts[::-1], parts]) == LOST_MOTION_SHARE,
        }
    )


def _torque_sentences(evaluation: Evaluation, curve: pd.DataFrame) -> tuple[str, str]:
    """What the torque-rotation curve shows, and what it lacks."""
    units, percent = evaluation.drawn.loaded.units, 100.0 * evaluation.model.conditions.coverage
    at = curve[curve["lost_motion"]]
    lost = [float(np.ptp(at[f"rotation_{name}_arcmin"])) for name in ("median", "high")]
    return (
        f"Of {units} units under load, in the order of their lost motion, the median one and number "
        f"{_rank_at_coverage(evaluation, units)}, that at {percent:g} %, turn by {lost[0]:.4g} and {lost[1]:.4g} "
        f"arcmin from -{100.0 * LOST_MOTION_SHARE:g} to +{100.0 * LOST_MOTION_SHARE:g} % of the rated torque, phi_1 at "
        "its mean; the quantile that the run reports has phi_1 integrated over its distribution.",
        "The torque-rotation curve has no friction: loading and unloading are one line, where a measured curve is a "
        "loop.",
    )


def _largest_backlash(evaluation: Evaluation) -> Array:
    """Largest backlash of the cycloid stage over the turn (units,) [arcmin]."""
    return np.asarray(np.maximum(evaluation.turn.play.max(axis=0).astype(float), 0.0))


def _turn(evaluation: Evaluation) -> pd.DataFrame:
    """The unit whose largest backlash is the median, at the mean of phi_1.

    `measured` marks the positions of the population; between them the turn is drawn finely.
    """
    import pandas as pd

    largest = _largest_backlash(evaluation)
    unit = int(np.argsort(largest, kind="stable")[len(largest) // 2])
    rough = evaluation.turn.play[:, unit].astype(float)
    fine = _fine_turn(evaluation, unit)
    count = (len(rough), len(fine))
    play = np.concatenate([rough, fine])
    frame = pd.DataFrame(
        {
            "turn_deg": np.concatenate([360.0 * (np.arange(n) + 0.5) / n for n in count]),
            "cycloid_arcmin": play,
            "backlash_arcmin": evaluation.involute.mean + np.maximum(play, 0.0),
            "measured": np.arange(sum(count)) < count[0],
        }
    )
    return frame.sort_values(["turn_deg", "measured"], kind="stable", ignore_index=True)


def _fine_turn(evaluation: Evaluation, unit: int) -> Array:
    """Backlash of the cycloid stage of one unit at `POSITIONS_SHOWN` positions [arcmin], part by part."""
    geometry = evaluation.model.geometry
    sample = evaluation.drawn.rigid.sample.part(slice(unit, unit + 1))
    slopes = Slopes.of(geometry, sample)
    parts = np.array_split(turn_lattice(POSITIONS_SHOWN, geometry.nominal.cycloid_teeth), PARTS_OF_TURN)
    coupling, fitted, planets = evaluation.model.coupling, evaluation.turn.fitted, evaluation.planets
    larger = None if fitted is None else fitted.larger[unit : unit + 1]
    play = None if planets is None else planets[:, unit : unit + 1]
    turns = (
        Population(Lattice.of(geometry, angles), sample, slopes, coupling).turn(evaluation.design, larger, play)
        for angles in parts
    )
    return np.concatenate([turn.play[:, 0].astype(float) for turn in turns])


def _population(evaluation: Evaluation) -> pd.DataFrame:
    """Fraction of units up to each value of their largest backlash, phi_1 integrated."""
    import pandas as pd

    largest = _largest_backlash(evaluation)
    low, high = evaluation.involute.ends()
    at = np.linspace(low + largest.min(), high + largest.max(), BINS + 1)
    within = 100.0 * np.array([float(np.mean(evaluation.involute.cdf(v - largest))) for v in at])
    change, mean = evaluation.model.change, float(largest.mean()) + evaluation.involute.mean
    moved = mean + change.effective + (1.0 + change.growth) * (at - mean)  # outside the contact
    return pd.DataFrame(
        {
            "backlash_max_arcmin": moved,
            "share_within_percent": within,
            "share_percent": np.diff(within, prepend=within[0]),
        }
    )


def _evaluation_sentences(
    evaluation: Evaluation, parameters: Mapping[str, Value], turn: pd.DataFrame
) -> tuple[str, ...]:
    conditions, drawn = evaluation.model.conditions, evaluation.drawn.rigid
    positions, percent = drawn.lattice.shape[0], 100.0 * conditions.coverage
    measured = turn.loc[turn["measured"], "backlash_arcmin"].max()
    kind = INTERFERENCE[conditions.interference].format(
        overlap=conditions.overlap, preload=number(parameters["preload_percent_of_rated"])
    )
    stage = (
        f"The involute stage adds the backlash phi_1 of the unit, {evaluation.involute.mean:.3g} arcmin in the mean; "
        "it is the same at all positions, and its distribution over units is integrated exactly, not drawn."
        if parameters["involute_stage"]
        else "There is no involute stage."
    )
    words = [
        "The backlash of a unit at a position is the angle by which the carrier (the output) turns from one flank to "
        "the other with the sun (the input) held: zero torque, rigid parts, play of the crank bearings included.",
        f"It is computed at {positions} positions, evenly over one turn of the output; the largest of them is the "
        "backlash of the unit. Between the positions it can be larger: the unit drawn here reaches "
        f"{turn['backlash_arcmin'].max():.4g} arcmin over the whole turn, and {measured:.4g} at the positions.",
        f"backlash_max_arcmin is the value that {percent:g} % of the units stay within (one-sided quantile, from "
        f"{drawn.units} fresh units); yield_percent is the percentage of units within {conditions.limit:g} arcmin.",
        stage,
        f"Interference: {kind} (interference_probability). Where flanks interfere at zero torque the backlash of the "
        "cycloid stage counts as zero: the flat parts of the first figure.",
    ]
    if evaluation.model.coupled_planets:
        words.append(
            "Two cranks turn apart (planet_coupling): phi_1 is that of the tighter planet, and what the other adds "
            "varies along the turn and is counted with the cycloid stage; interference is that of the cycloid stage "
            "with cranks that the tighter planet holds."
        )
    if evaluation.model.change.outside:
        words.append("What effects add to the contact is in the population and not in the units that are drawn.")
    return tuple(words)
