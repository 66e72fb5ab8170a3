"""Changes that effects make in the backlash of an allocation's units."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...models.capability import Surplus
from ...models.effects.measurements import Active
from ...models.propagation import ClippedSum, Estimate, Propagated, Propagation
from ...models.rv_reducer.backlash import BacklashModel
from ...models.rv_reducer.batch import opening
from ...section import Array
from ...units import ARCMIN, UM
from ..deviations import Deviations
from ..forms import Feature, Form
from ..settings import ASSURED, PROMISED
from .form import OUTPUTS, form_of
from .shift import BEARING, GRADE, TERMS

if TYPE_CHECKING:
    from .problem import RvBacklash


@dataclass(frozen=True, slots=True)
class Change:
    """What effects change: `cycloid` is added to phi_2 (before interference is cut off) and
    `effective` to the backlash [rad]; its standard deviation grows by the fraction `growth`.
    """

    cycloid: float = 0.0
    effective: float = 0.0
    growth: float = 0.0

    def __add__(self, other: Change) -> Change:
        return Change(
            self.cycloid + other.cycloid,
            self.effective + other.effective,
            (1.0 + self.growth) * (1.0 + other.growth) - 1.0,
        )

    def opened(self, total: ClippedSum) -> ClippedSum:
        """The sum with the change of phi_2 in its first term."""
        return total if self.cycloid == 0.0 else total.shifted(self.cycloid)

    def propagate(self, method: Propagation, total: ClippedSum, coverage: float, limit: float) -> Propagated:
        """Statistics of the changed backlash; y becomes mean + shift + (1 + growth)(y - mean)."""
        plain = method.propagate(total, coverage, limit - self.effective)
        if self.growth == 0.0:
            return _move_propagated(plain, self.effective, 1.0)
        factor, mean = 1.0 + self.growth, plain.mean.value
        # the changed value keeps the limit where the plain one keeps this, design by design
        kept = mean + (limit - self.effective - mean) / factor
        conforming = method.propagate(total.freed(-kept), coverage, 0.0).conforming
        return _move_propagated(plain, self.effective, factor, conforming)


def _move_propagated(plain: Propagated, shift: float, factor: float, conforming: Estimate | None = None) -> Propagated:
    mean = plain.mean.value
    quantile_error = factor * plain.quantile.error
    if factor != 1.0:
        quantile_error = quantile_error + (factor - 1.0) * plain.mean.error
    return Propagated(
        plain.geometric_mean + shift,
        factor * plain.geometric_std,
        Estimate(mean + shift, plain.mean.error),
        Estimate(factor * plain.std.value, factor * plain.std.error),
        Estimate(mean + shift + factor * (plain.quantile.value - mean), quantile_error),
        conforming or plain.conforming,
        plain.negative,
    )


def _expansion(values: Mapping[str, float], model: BacklashModel) -> Change:
    warmer = np.array(values.get("temperature_difference_K", 0.0))
    return Change(cycloid=float(opening(model, {"disc_temperature_K": warmer})))


def _shift(values: Mapping[str, float], model: BacklashModel) -> Change:
    return Change(effective=values.get("shift_arcmin", 0.0) * ARCMIN)


def _inflation(values: Mapping[str, float], model: BacklashModel) -> Change:
    return Change(growth=values.get("growth", 0.0))


def _gap(values: Mapping[str, float], model: BacklashModel) -> Change:
    """Both halves of a gap that is crossed when the torque changes its sign."""
    play = values.get("bearing_clearance_um", 0.0) * UM / model.geometry.centre_distance
    gap = 2.0 * values.get("half_width_arcmin", 0.0) * ARCMIN
    return Change(effective=gap + model.output_factor * play)


def _wear(values: Mapping[str, float], model: BacklashModel) -> Change:
    """Both halves of a gap between worn flanks, which has grown for `hours`."""
    hours = values.get("hours", 0.0)
    return Change(cycloid=2.0 * values.get("rate_arcmin_per_s", 0.0) * 3600.0 * hours * ARCMIN)


COUNTERPARTS: Mapping[str, tuple[Callable[[Mapping[str, float], BacklashModel], Change], str]] = {
    "differential_thermal_expansion": (
        _expansion,
        "discs and housing differ in temperature: phi_2 changes by {cycloid:+.4g} arcmin",
    ),
    "process_mean_shift": (_shift, "every unit's backlash changes by {effective:+.4g} arcmin"),
    "spread_inflation": (_inflation, "the backlash scatters {growth:.4g} % more about its mean"),
    "wear": (_wear, "worn flanks: phi_2 changes by {cycloid:+.4g} arcmin"),
    "lost_motion": (_gap, "both halves of the gap add {effective:.4g} arcmin of backlash"),
    "bearing_clearance": (_gap, "the clearance adds {effective:.4g} arcmin of backlash"),
}


def change_of(active: Active, model: BacklashModel) -> Change:
    """What one effect changes; nothing where it has no counterpart."""
    counterpart = COUNTERPARTS.get(active.effect.name)
    return counterpart[0](active.values, model) if counterpart else Change()


def changes_of(effects: Iterable[Active], model: BacklashModel) -> Change:
    """What all effects change."""
    return sum((change_of(effect, model) for effect in effects), Change())


def sentence(active: Active, model: BacklashModel) -> str:
    """What one effect does here, empty where it does nothing."""
    change = change_of(active, model)
    if change == Change():
        return ""
    cycloid, effective = change.cycloid / ARCMIN, change.effective / ARCMIN
    text = COUNTERPARTS[active.effect.name][1]
    return text.format(cycloid=cycloid, effective=effective, growth=100.0 * change.growth)


# The geometric backlash as a sum of deviations, for promises by measured parts.
#
# Every term constant + b t z + q t^2 z^2 has a mean and a variance; a sample of the process of z
# scales the variance. The second-order fraction of the eccentricity's variance is taken to scale
# alike: it is less than a thousandth of the variance of its term in the document's case.


MEAN = OUTPUTS.index("backlash_geometric_mean_arcmin")
STD = OUTPUTS.index("backlash_geometric_std_arcmin")


def deviations_of(problem: RvBacklash, designs: Array) -> Deviations:
    """Mean and standard deviations [arcmin] of the geometric backlash, below its limit."""
    total, growth = problem.total(designs), 1.0 + problem.change.growth
    terms = dict(zip((GRADE, BEARING, *TERMS), (*total.free, *total.clipped), strict=True))
    cumulants = {name: term.cumulants()[:2] for name, term in terms.items()}
    mean = np.sum([moments[0] for moments in cumulants.values()], axis=0) + problem.change.effective
    std_by_name = {name: growth * np.sqrt(np.maximum(moments[1], 0.0)) / ARCMIN for name, moments in cumulants.items()}
    return Deviations(mean / ARCMIN, std_by_name, np.zeros(len(designs)), upper=problem.limit)


def form_of_promise(problem: RvBacklash) -> Form | None:
    """The form of the geometric backlash, with a further row for an assured promise."""
    form, promised = form_of(problem), problem.promised
    if form is None or promised is None or promised.promise.statement != ASSURED:
        return form
    factors, surplus = doubt_of(problem, [feature.variable for feature in form.features])
    features = tuple(map(_add_promise_row, form.features, factors.tolist()))
    return replace(
        form,
        outputs=(*form.outputs, PROMISED),
        features=features,
        offset=np.append(form.offset, form.offset[MEAN]),
        constant=np.append(form.constant, 0.0),
        most=(np.inf,) * len(form.outputs) + (problem.limit,),
        surpluses=() if surplus is None else (*(None,) * len(form.outputs), surplus),
        statement=f"{form.statement}; {statement_of(problem)}",
    )


def doubt_of(problem: RvBacklash, variables: Sequence[str]) -> tuple[Array, Surplus | None]:
    """Factors (features,) of the standard deviations in an assured promise, and what uncertain
    processes add; None without any. `variables` are those of the features, or empty.
    """
    promised = problem.promised
    assert promised is not None
    empty = Deviations(np.zeros(1), {}, np.zeros(1), upper=problem.limit)
    norm, at = promised.norm(empty), {name: k for k, name in enumerate(promised.names)}
    doubt, (by_part, error, even) = norm.surplus(), np.zeros((3, len(variables)))
    assert doubt.error is not None
    even += 1.0
    for place, variable in enumerate(variables):
        if (k := at.get(variable)) is not None:
            even[place], by_part[place], error[place] = norm.even[k], doubt.own[k], doubt.error[k]
    surplus = Surplus(by_part, np.zeros_like(by_part), error=error) if np.any(by_part) else None
    return promised.quantile(empty) * np.sqrt(even), surplus


def statement_of(problem: RvBacklash) -> str:
    """The proven statement of an assured promise, in words."""
    return f"promised: {problem.stated_promise.words()}, by the geometric backlash and normal processes as measured"


def _add_promise_row(feature: Feature, factor: float) -> Feature:
    """A feature whose ways add to the promise as well: mean, and so many standard deviations."""
    ways = tuple(
        replace(
            way,
            linear=(*way.linear, way.linear[MEAN]),
            spread=(*way.spread, factor * way.spread[STD]),
            offset=(*way.offset, way.offset[MEAN]) if way.offset else (),
        )
        for way in feature.ways
    )
    return replace(feature, ways=ways)
