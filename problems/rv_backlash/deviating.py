"""The geometric backlash as a sum of deviations, for promises by measured parts.

Every term constant + b t z + q t^2 z^2 has a mean and a variance; a sample of the process of z
scales the variance. The second-order fraction of the eccentricity's variance is taken to scale
alike: it is less than a thousandth of the variance of its term in the document's case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from ...models.capability import Surplus
from ...units import ARCMIN
from ..deviations import Deviations
from ..forms import Feature, Form
from ..promise import ASSURED, PROMISED
from .form import OUTPUTS, form_of
from .machined_tolerances import TERMS
from .terms import BEARING, GRADE

if TYPE_CHECKING:
    from .problem import RvBacklash

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


def promised_form(problem: RvBacklash) -> Form | None:
    """The form of the geometric backlash, with a further row for an assured promise."""
    form, promised = form_of(problem), problem.promised
    if form is None or promised is None or promised.promise.statement != ASSURED:
        return form
    factors, surplus = doubt_of(problem, [feature.variable for feature in form.features])
    features = tuple(map(_with_row, form.features, factors.tolist()))
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


def _with_row(feature: Feature, factor: float) -> Feature:
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
