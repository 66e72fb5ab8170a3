"""The library of effects as columns of a design matrix, the law of units, and the model's prediction."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from math import log
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ... import registry
from ...journal import recall_columns
from ...models.effects import Effect, EffectParameter, Target
from ...models.effects.angle import GearOrder, orders_shown
from ...models.effects.effect import Action, InsideSeveral, Measurements
from ...models.effects.measurements import (
    Active,
    add_zero,
    apply_output_actions,
    changes_of,
    effect_actions,
    labels_of,
    measurements_of,
    target_of,
)
from ...models.effects.population import Law, OfUnits, acts_on_scatter
from ...models.effects.shapes import Shape
from ...models.effects.unresolved import Unresolved
from ...models.measurable import NO_CHANGES, Column, MeasurableModel, Role, Sources
from ...section import Array
from .data import GapData
from .input_changes import UnitLaw
from .plan import GapPlan

DRAWN = 200_000
"""Units from which the density is estimated."""
CELLS = 512
SMOOTHED = 0.1
"""Width of the kernel that smooths the drawn units, as a fraction of their standard deviation."""
MIN_RELATIVE_DENSITY = 1e-12
MAPPED = 8192
"""Units to which an effect without a density formula is applied."""


def estimate_law(drawn: Array, mean: float = 0.0, middle: float = 0.0) -> Law:
    """The smoothed law of units (m,), as deviations from `middle`."""
    from statsmodels.nonparametric.kde import KDEUnivariate  # imports all distributions of scipy

    std = float(drawn.std())
    smooth = KDEUnivariate(drawn - middle)
    smooth.fit(bw=SMOOTHED * std, gridsize=CELLS, cut=0.5 / SMOOTHED)
    chance = np.maximum(smooth.density, MIN_RELATIVE_DENSITY / std)
    return Law(float(smooth.support[0]), float(np.ptp(smooth.support)) / (CELLS - 1), np.log(chance), std, mean)


def law_of(plan: GapPlan, name: str) -> Law:
    """The law of the model's units with the effects on their scatter that the model contains."""
    fields = recall_columns(("law", name), lambda: asdict(_law_with_effects(plan, name)))
    floats: dict[str, Any] = {key: value if np.ndim(value) else float(value) for key, value in fields.items()}
    return Law(**floats)


def _law_with_effects(plan: GapPlan, name: str) -> Law:
    """The inputs are convolved where they add up; otherwise the law is estimated from units."""
    assert plan.model is not None
    mean, sources = float(plan.model.means()[name]), plan.model.sources()
    columns = [c for c in plan.model.columns if c.needed]
    table = _units(columns, MAPPED)
    target = target_of(plan.model, plan.model_name, table)
    measurements = measurements_of(target.columns, table)
    if sources and not sources.widened:
        law = _exact(sources, mean)
    else:
        rng = np.random.default_rng([plan.seed, 5])
        outputs = plan.model.law_sample() or plan.model.predict(_units(columns, DRAWN), rng)
        drawn = np.asarray(outputs[name], dtype=float)
        law = estimate_law(drawn, mean, float(drawn.mean()))
    for active in plan.active:
        if acts_on_scatter(active.effect, active.values, measurements, target):
            law = law_with(law, active.effect, active.values, target)
    return replace(law, low=law.low - float(law.histogram.mean()))


def _exact(sources: Sources, mean: float) -> Law:
    units = UnitLaw(sources)
    density = units.density()
    likely = np.flatnonzero(density > MIN_RELATIVE_DENSITY / units.std)
    kept = slice(likely[0], likely[-1] + 1)
    x, chance = units.x[kept], density[kept]
    std = float(np.sqrt(np.average((x - np.average(x, weights=chance)) ** 2, weights=chance)))
    return Law(float(x[0]) - mean, units.step, np.log(np.maximum(chance, MIN_RELATIVE_DENSITY / std)), std, mean)


def law_with(law: Law, effect: Effect, values: Mapping[str, float], target: Target) -> Law:
    """The law with an effect on the scatter: by its density formula, or by applying it to units."""
    effect_law = effect.law(law, values, target) if isinstance(effect, OfUnits) else None
    return effect_law or _map_law(law, effect, values, target)


def _map_law(law: Law, effect: Effect, values: Mapping[str, float], target: Target) -> Law:
    rng = np.random.default_rng(0)
    units = law.histogram.ppf((rng.permutation(MAPPED) + 0.5) / MAPPED) + law.mean
    table = _units((c for c in target.columns if c.text), MAPPED)
    action = effect.act(measurements_of(target.columns, table), values, target)
    assert action.population is not None
    return estimate_law(np.asarray(action.population(units, law.mean, rng)), law.mean, law.mean)


def _units(columns: Iterable[Column], count: int) -> dict[str, NDArray[Any]]:
    """A table of units that differ only in their labels."""
    labels = np.arange(count).astype(str)
    return {c.name: labels if c.text else np.zeros(count) for c in columns}


Predict = Callable[[Mapping[str, Array]], Mapping[str, Array]]
"""The model's outputs (n,) by name, at changes inside of it."""

OURS = "tolevo "
"""Prefix of the origin of an effect of this package."""
ELSEWHERE = ("population", "manipulator", "assembly")
"""Families of effects that act only in special models."""
MOVING = (Role.ANGLE, Role.TORQUE, Role.FORCE, Role.SPEED, Role.DIRECTION, Role.TIME, Role.TEMPERATURE)
"""Roles of a test bench that the effects of a drive need."""
BEND = 2.5
"""The least gain of the first nonlinear parameter of an effect."""
BIT = 2.0 * log(2.0)
"""The least gain of a choice of two forms."""
LINEAR_STEP = 0.05
"""A change of an internal quantity, in its unit, at which the outputs are still linear."""
NO_TRACE = "the data contain no trace of it"
LEAST_UNITS = 3
"""Units of a lot from which its separate offset can be estimated."""


@dataclass(frozen=True)
class Candidate:
    """An effect of the library for these data, with its linear and nonlinear parameters.

    It is `unread` where a variable that it needs was not measured, or never changed: it then moves
    all units of a population alike, as other causes do, and can only be a rival of them. An effect
    `acts_on_scatter` of a population shifts no unit by a fixed amount.
    """

    effect: Effect
    linear: tuple[EffectParameter, ...]
    shape: tuple[EffectParameter, ...]
    unread: bool = False
    on_scatter: bool = False

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name

    @property
    def count(self) -> int:
        """Number of fitted parameters, those with a few choices included."""
        return len(self.linear) + len(self.shape)

    def price(self, penalty: float) -> float:
        """Least gain of its parameters: `penalty` each, but less for one that only bends a form.

        A bounded exponent or knee changes a column far less than a coefficient does, and a choice
        of two forms is one bit.
        """
        numbers = [parameter for parameter in self.shape if len(parameter.choices) != 2]
        bends = min(BEND, penalty) + penalty * (len(numbers) - 1) if numbers else 0.0
        return penalty * len(self.linear) + bends + BIT * (len(self.shape) - len(numbers))

    @property
    def parameters(self) -> tuple[EffectParameter, ...]:
        """The linear and the nonlinear parameters."""
        return (*self.linear, *self.shape)

    @property
    def one_sided(self) -> bool:
        """Whether it is one column whose coefficient cannot be negative."""
        return self.is_nonlinear or (len(self.linear) == 1 and self.linear[0].low >= 0.0)

    @property
    def is_nonlinear(self) -> bool:
        """Whether it has no linear parameter: its only, nonlinear parameter is its size."""
        return not self.linear

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the coefficients of its columns."""
        if self.is_nonlinear:
            return np.array([1.0]), np.array([1.0 + 1e-9])
        low, high = np.array([(parameter.low, parameter.high) for parameter in self.linear]).T
        return low, high

    def values(self, shape: Mapping[str, float], coefficients: Array) -> dict[str, float]:
        """All parameters by name."""
        parameters = dict(shape)
        for parameter, value in zip(self.linear, coefficients, strict=False):
            parameters[parameter.name] = float(np.clip(value, parameter.low, parameter.high))
        return parameters


MOST_BYTES = 50_000_000
"""Columns that are kept at most."""


class Columns:
    """The additions of candidates to the outputs at the rows of the data, in the outputs' units.

    The effect of an instrument depends on the whole output: the prediction plus `more` (n,), by
    output.
    """

    def __init__(self, data: GapData, predict: Predict, more: Mapping[str, Array] | None = None) -> None:
        self.data = data
        self.predict = predict
        self._base = predict({})
        self._slopes: dict[str, Array] = {}
        self._known: dict[tuple[object, ...], Array] = {}
        self._bytes = 0
        self._whole = {name: y + (more or {}).get(name, 0.0) for name, y in self._base.items()}

    def of(self, candidate: Candidate, shape: Mapping[str, float]) -> Array:
        """Columns (N, m) of a candidate, m its linear parameters (1 where it has none). Searches for a
        nonlinear parameter begin at the same points again and again: the columns there are kept.
        """
        if not shape:
            return self._of(candidate, shape)
        key = candidate.name, *shape.items()
        if key not in self._known:
            if self._bytes > MOST_BYTES:
                self._known.clear()
                self._bytes = 0
            self._known[key] = self._of(candidate, shape)
            self._bytes += self._known[key].nbytes
        return self._known[key]

    def _of(self, candidate: Candidate, shape: Mapping[str, float]) -> Array:
        if candidate.is_nonlinear:
            return self.total(candidate, shape)[:, None]
        if isinstance(candidate.effect, Unresolved):
            return self.of_term(candidate.effect, self.data.measurements)
        if isinstance(candidate.effect, InsideSeveral):
            return self._by_rows(candidate.effect, shape)
        if isinstance(candidate.effect, Shape) and candidate.effect.plain(self.data.target):
            return self._of_shape(candidate.effect, shape)
        steps = {parameter.name: parameter.small for parameter in candidate.linear}
        return np.column_stack([self.total(candidate, {**shape, name: step}) / step for name, step in steps.items()])

    def _of_shape(self, effect: Shape, shape: Mapping[str, float]) -> Array:
        """Columns of an effect at the outputs, each computed once."""
        data, target = self.data, self.data.target
        column_of = effect.columns(data.measurements, shape, target)
        x = np.column_stack([column_of[weight.stem]() for weight in effect.weights(target)])
        if len(data.outputs) == 1:
            return np.asarray(x, dtype=np.float64)
        reached = [o.name for o in effect.reached(target)]
        at = np.array([[float(o.name == name) for name in reached] for o in data.outputs])
        return np.asarray(np.kron(at, x), dtype=np.float64)

    def of_term(self, effect: Unresolved, measurements: Measurements) -> Array:
        """Columns of a generic term, which acts at one output."""
        columns = effect.columns(measurements)
        parts = [columns if o.name == effect.term.output else np.zeros_like(columns) for o in self.data.outputs]
        return np.concatenate(parts)

    def _by_rows(self, effect: InsideSeveral, shape: Mapping[str, float]) -> Array:
        """Columns of quantities that change by a factor of each row: slopes times that factor."""
        factor = np.tile(effect.factor(self.data.measurements, shape), len(self.data.outputs))
        slopes = [self._slope(name) for _, name in effect.numbers(self.data.target)]
        return np.asarray(np.column_stack(slopes) * factor[:, None])

    def _slope(self, name: str) -> Array:
        """Outputs (N,) per unit of an internal quantity, by central differences."""
        if name not in self._slopes:
            ends = [np.full(len(self.data), end) for end in (LINEAR_STEP, -LINEAR_STEP)]
            up, down = (self.data.stacked(self.predict({name: change})) for change in ends)
            self._slopes[name] = (up - down) / (2.0 * LINEAR_STEP)
        return self._slopes[name]

    def total(self, candidate: Candidate, values: Mapping[str, float]) -> Array:
        """What the effect with these values adds (N,)."""
        data = self.data
        action = candidate.effect.act(data.measurements, values, data.target)
        if action.changes:
            return data.stacked(self.predict(action.changes)) - data.stacked(self._base)
        zero = np.zeros(len(data))
        if action.population is not None:
            return self._of_units(action.population)
        if action.reading and data.target.population:
            return zero  # rounding does not move the mean of units that scatter more
        if action.reading:
            return np.concatenate(
                [
                    action.reading[o.name](self._whole[o.name]) - self._whole[o.name]
                    if o.name in action.reading
                    else zero
                    for o in data.outputs
                ]
            )
        return np.concatenate([np.asarray(action.output.get(o.name, zero), dtype=float) for o in data.outputs])

    def kinds_of_rows(self, effect: Effect) -> NDArray[np.int64] | None:
        """The kinds (N,) of rows in which the nonlinear parameters of an effect have to agree."""
        parts = [effect.kinds_of_rows(self.data.measurements, self._whole[o.name]) for o in self.data.outputs]
        known = [part for part in parts if part is not None]
        return np.concatenate(known) if len(known) == len(parts) else None

    def _of_units(self, act: Callable[[Array, float, np.random.Generator], Array]) -> Array:
        """The change (N,) of units at the mean by an effect on a population."""
        rng = np.random.default_rng(0)
        means = [self._base[o.name] for o in self.data.outputs]
        return np.concatenate([act(m, float(m.mean()), rng) - m for m in means])


def candidates(names: Iterable[str], data: GapData, own: Iterable[Effect] = ()) -> list[Candidate]:
    """The effects of these names, and of the user's own, that apply to the model and the columns of the data."""
    applicable = []
    for effect in (*(registry.load("effects", name)() for name in names), *own):
        applies = effect.applies(data.target) and not effect.lacks(data.measurements, data.target)
        known = effect.shown(data.measured, data.target) if applies else None
        if known is not None:
            numbers = effect.parameters(data.target)
            linear = tuple(p for p in numbers if p.linear)
            fixed = {name: (value,) for name, value in known.items()}
            shape = tuple(replace(p, choices=fixed.get(p.name, p.choices)) for p in numbers if not p.linear)
            if isinstance(effect, GearOrder):
                shape = (replace(shape[0], choices=orders_shown(data.target, data.measurements)),)
            candidate = Candidate(effect, linear, shape, _lacks_variable(effect, data))
            applicable.append(replace(candidate, on_scatter=_changes_scatter(candidate, data)))
    return applicable


def _changes_scatter(candidate: Candidate, data: GapData) -> bool:
    """Whether a candidate changes the scatter of units, at values within its bounds."""
    if not data.target.population:
        return False
    values = {n.name: n.small for n in candidate.linear}
    values |= {n.name: n.choices[0] if n.choices else n.inner for n in candidate.shape}
    return acts_on_scatter(candidate.effect, values, data.measurements, data.target)


def not_considered(names: Iterable[str], data: GapData) -> list[str]:
    """Sentences about effects that are not considered, and why.

    Of the effects of this package these are only those that a further column, gear or output would
    enable; of other packages all.
    """
    by_reason: dict[str, list[str]] = {}
    for name in names:
        effect = registry.load("effects", name)()
        foreign = not registry.origin("effects", name).startswith(OURS)
        if (why := _reason(effect, data)) and (foreign or _matters(effect, why, data)):
            by_reason.setdefault(why, []).append(name)
    return [f"not considered, {why}: {', '.join(effects)}" for why, effects in by_reason.items()]


def _reason(effect: Effect, data: GapData) -> str:
    """The reason why an effect is no candidate, empty where it is a candidate."""
    if why := effect.left_out(data.target):
        return why
    if few := effect.lacks(data.measurements, data.target):
        return few
    return NO_TRACE if effect.shown(data.measured, data.target) is None else ""


def _matters(effect: Effect, why: str, data: GapData) -> bool:
    """Whether to report that an effect of this package does not apply."""
    roles = data.target.roles()
    if data.target.population or effect.family in ELSEWHERE or not roles & set(MOVING):
        return False
    if set(effect.needs) <= roles:
        return why not in (Effect.own_reason(effect, data.target), NO_TRACE)
    return data.target.model == "table"


def _lacks_variable(effect: Effect, data: GapData) -> bool:
    """Whether an effect on units needs a variable that was not measured, or is constant."""
    available = {c.role for c in data.inputs} | {c.role for c in data.target.columns if c.text}
    return data.target.population and not set(effect.needs) - {Role.DIRECTION} <= available


def add_lot_offsets(library: Iterable[Candidate], data: GapData, residual: Array) -> tuple[list[Candidate], list[str]]:
    """The candidates with the offsets of lots that these units identify; sentences about others.

    Offsets of all lots are confounded with that of all units: the lot with the least offset has
    none. Lots of too few units have none either.
    """
    if Role.LOT not in data.measurements:
        return list(library), []
    labels, of_lot = labels_of(data.measurements[Role.LOT])
    counts = np.bincount(of_lot)
    offset = np.abs(np.bincount(of_lot, residual[: len(of_lot)])) / np.sqrt(counts)
    few = labels[counts < LEAST_UNITS]
    lots = [str(lot) for lot in labels[np.sort(np.argsort(offset)[1:])] if lot not in few]
    kept = []
    for candidate in library:
        if Role.LOT in candidate.effect.needs:
            candidate = replace(candidate, linear=_lot_offsets(candidate, lots, data.target))
        if candidate.linear or candidate.shape:
            kept.append(candidate)
    text = f"the offset of lots of fewer than {LEAST_UNITS} units cannot be estimated"
    return kept, [f"{text}: {', '.join(few[:10])}"] if len(few) else []


def _lot_offsets(candidate: Candidate, lots: Iterable[str], target: Target) -> tuple[EffectParameter, ...]:
    """The offsets of these lots."""
    unit = candidate.linear[0].name.removeprefix(candidate.linear[0].stem) if candidate.linear else ""
    offsets = (candidate.effect.parameter(f"offset_{lot}{unit}", target) for lot in lots)
    return tuple(parameter for parameter in offsets if parameter is not None)


def carried(active: Iterable[Active], target: Target) -> float:
    """The shift of the mean of a population by effects on its scatter."""
    return sum(each.effect.carried(each.values, target) for each in active if isinstance(each.effect, OfUnits))


POINTS = 9
"""Sizes of a change at which the mean of a population is taken; between them, a cubic."""


def predictor(plan: GapPlan, data: GapData, model: MeasurableModel | None = None) -> Predict:
    """The predictor of the plan's model, or of another one, with its known effects and zeros."""
    model = model or plan.model
    if model is None:
        return OfTable(plan, data)
    return OfMeanUnit(plan, data, model) if model.population else OfRows(plan, data, model)


class OfTable:
    """The prediction that the table carries; nothing can change inside."""

    def __init__(self, plan: GapPlan, data: GapData) -> None:
        actions = effect_actions(plan.active, data.measurements, data.target)
        rng = np.random.default_rng(plan.seed)
        self._outputs = apply_output_actions(add_zero(data.predicted, plan.zero), actions, {}, rng)

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        return self._outputs


class _OfModel:
    """Prediction of a model with the plan's effects that do not change the scatter of units;
    pickled by its arguments.
    """

    means: Mapping[str, float] = MappingProxyType({})
    """The mean of each output of a population."""

    def __init__(self, plan: GapPlan, data: GapData, model: MeasurableModel) -> None:
        self._plan, self._data, self._model = plan, data, model
        measurements, target = data.measurements, data.target
        moving = [o for o in plan.active if not acts_on_scatter(o.effect, o.values, measurements, target)]
        self._actions = effect_actions(moving, measurements, target)

    def __reduce__(self) -> tuple[type[_OfModel], tuple[GapPlan, GapData, MeasurableModel]]:
        return type(self), (self._plan, self._data, self._model)

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        def computed() -> dict[str, Array]:
            rng = np.random.default_rng(self._plan.seed)
            whole = changes_of((*self._actions, Action(changes=changes)))
            return dict(apply_output_actions(self._at(whole, rng), self._actions, self.means, rng))

        return recall_columns(("prediction", *changes, *changes.values()), computed)

    @abstractmethod
    def _at(self, changes: Mapping[str, Array], rng: np.random.Generator) -> Mapping[str, Array]:
        """Outputs (n,) of the model with changes inside."""


class OfRows(_OfModel):
    """Prediction row by row."""

    def _at(self, changes: Mapping[str, Array], rng: np.random.Generator) -> Mapping[str, Array]:
        outputs = self._model.predict(self._data.measurements.table, rng, changes or NO_CHANGES)
        return add_zero(outputs, self._plan.zero)


class OfMeanUnit(_OfModel):
    """The mean unit of a population, with changes inside by row: the reference of a batch's units."""

    def __init__(self, plan: GapPlan, data: GapData, model: MeasurableModel) -> None:
        super().__init__(plan, data, model)
        self.means = model.means()

    def _at(self, changes: Mapping[str, Array], rng: np.random.Generator) -> Mapping[str, Array]:
        """Means with changes; the changes of several quantities are added."""
        by = carried(self._plan.active, self._data.target)
        outputs = {name: np.full(len(self._data), value + by) for name, value in self.means.items()}
        for quantity, values in changes.items():
            at = np.unique(np.linspace(np.min(values), np.max(values), POINTS))
            means = [self._model.means({quantity: size}) for size in at]
            for name, value in self.means.items():
                curve = np.array([mean[name] for mean in means]) - value
                degree = min(3, len(at) - 1)
                outputs[name] += scipy.interpolate.make_interp_spline(at, curve, degree)(values) if degree else curve[0]
        return outputs
