"""The size of the gap before and after with its floor, and what remains of it unidentified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...models.effects.unresolved import Term
from ...section import Array
from .analysis import Analysis
from .fit import Member, is_term
from .generic import LEVELS
from .linear import project_out
from .population import distance, floor, held_out_units
from .records import Remainder, UnresolvedTerm
from .result import Ending, finish_analysis, rmse
from .unresolved import effect_of, table_of

OF_ROWS = "RMSE on held-out rows; the floor is the noise"
OF_UNITS = (
    "distance of the held-out units from the population that the model predicts; it is the 2-Wasserstein "
    "distance, after the effects on single units are subtracted, and the floor is what all but 5 % of "
    "batches of this size stay below, drawn from the corrected model"
)
"""What comes before the semicolon says it in short."""


@dataclass(frozen=True)
class Gaps:
    """Gaps by output, in its unit, and `total` in noise units; `meaning` says what they are."""

    before: Mapping[str, float]
    after: Mapping[str, float]
    floor: Mapping[str, float]
    meaning: str


def gaps(end: Ending) -> Gaps:
    """The gaps of one analysis, without outliers."""
    initial, setup = end.analysis.initial_null_model, end.setup
    before = initial.setup.residual - end.before.fitted
    after = setup.residual - end.after.fitted
    if setup.data.target.population:
        return _population_gaps(end, before, after)
    levels = {o.name: noise.level for o, noise in zip(setup.data.outputs, initial.noises, strict=True)}
    first, last = (_add_total(end, _by_output(end, raw)) for raw in (before, after))
    return Gaps(first, last, levels | {"total": 1.0}, OF_ROWS)


def never_worse(end: Ending) -> Ending:
    """The same result, or one without effects if these bring a batch no nearer to the population.
    The selection on rows ensures this already.
    """
    if end.rows or not (end.identified or end.analysis.scatter):
        return end
    sizes = gaps(end)
    if all(sizes.after[name] <= sizes.before[name] for name in sizes.before):
        return end
    return finish_analysis(end.analysis.without_effects())


def _by_output(end: Ending, raw: Array) -> dict[str, float]:
    outputs, noises = end.setup.data.outputs, end.analysis.initial_null_model.noises
    parts = zip(outputs, np.split(raw, len(outputs)), noises, strict=True)
    return {output.name: rmse(part, noise.good) for output, part, noise in parts}


def _add_total(end: Ending, by_output: dict[str, float]) -> dict[str, float]:
    """Gaps by output with the total: their root mean square, each in units of its noise."""
    levels = [noise.level for noise in end.analysis.initial_null_model.noises]
    scaled = np.array(list(by_output.values())) / np.array(levels)
    return by_output | {"total": float(np.sqrt(np.mean(scaled**2)))}


def _population_gaps(end: Ending, before: Array, after: Array) -> Gaps:
    """The gaps of a population. Effects on the scatter act on its first output, where outliers then
    count as well.
    """
    first, last, least = dict[str, float](), dict[str, float](), dict[str, float]()
    initial, outputs = end.analysis.initial_null_model, end.setup.data.outputs
    parts = (np.split(x, len(outputs)) for x in (before, after))
    for at, (output, x, y) in enumerate(zip(outputs, *parts, strict=True)):
        kept = initial.noises[at].counted
        law = whole = initial.setup.laws[output.name]
        wider = end.analysis.scatter[:1] if at == 0 else ()
        for effect in wider:
            y = y + effect.moves
            y[kept] = held_out_units(initial.batch.units(end.fit), effect, y[kept])
            whole = effect.changed(law)
        if not wider:
            x, y = x[kept], y[kept]
        rng = np.random.default_rng([end.setup.plan.seed, 8, at])
        first[output.name] = distance(law, x)
        last[output.name] = distance(whole, y)
        least[output.name] = floor(whole, len(y), rng)
    return Gaps(_add_total(end, first), _add_total(end, last), _add_total(end, least), OF_UNITS)


MAX_REMAINDERS = 3
"""Number of forms listed in addition to the terms."""


def removed_effects(analysis: Analysis) -> tuple[str, ...]:
    """Effects that were accepted and are not in the answer: their form is not that of the data."""
    return (*(analysis.fit.names[at] for at in analysis.identified.withdrawn), *analysis.removed)


def terms_of(end: Ending) -> tuple[UnresolvedTerm, ...]:
    """The generic terms that are in the corrected model."""
    terms = []
    for at, member in enumerate(end.fit.members):
        if is_term(member):
            term, table = effect_of(member).term, table_of(member, end.model)
            gain = end.analysis.search.fitter.fit(end.fit.without(at)).rss - end.fit.rss
            terms.append(UnresolvedTerm(term.output, term.variables, shape(term), gain, table))
    return tuple(terms)


def remainder_of(end: Ending) -> tuple[Remainder, ...]:
    """The remainder given the identified effects: the generic terms, and other significant forms."""
    if not end.remains:
        return ()
    if not end.rows:
        return _scatter_remainder(end)
    together: dict[tuple[str, frozenset[str]], list[Member]] = {}
    for member in end.fit.terms:
        term = effect_of(member).term
        together.setdefault((term.output, frozenset(term.variables)), []).append(member)
    return (*(_term_remainders(end, members) for members in together.values()), *_form_remainders(end))


def _scatter_remainder(end: Ending) -> tuple[Remainder, ...]:
    """Units with a scatter that no effect explains; the floor is what chance reaches."""
    misfit, output = end.analysis.misfit, end.setup.data.outputs[0]
    if misfit is None:
        return ()
    whole = gaps(end).before[output.name]
    text = f"{misfit.ratio:.2f} times the standard deviation of the population"
    text = f"a shape that differs from the population's, {text}" if misfit.stretched else text
    fraction = min(1.0, (misfit.distance / max(whole, 1e-300)) ** 2)
    far, ratio = misfit.distance, misfit.distance / misfit.limit
    return (Remainder(output.name, ("scatter of the units",), text, far, output.unit, ratio, fraction),)


def _excess_over_noise(end: Ending) -> float:
    """The squared gap in excess of the noise, in noise units."""
    return max(end.analysis.null_model.null_fit.rss - end.analysis.search.fitter.space.count, 1e-300)


def _term_remainders(end: Ending, members: Sequence[Member]) -> Remainder:
    """Terms of the same variables as one: each may be many times larger than their sum."""
    terms, setup = [effect_of(member).term for member in members], end.setup
    first = terms[0]
    at = [o.name for o in setup.data.outputs].index(first.output)
    fitter = end.analysis.search.fitter
    added, white = np.zeros(len(setup.data)), np.zeros(len(fitter.y))
    for member in members:
        coefficients = end.fit.coefficients[end.fit.members.index(member)]
        whole = setup.columns.of(member.candidate, member.shape) @ coefficients
        added = added + whole[setup.data.rows_of(at)]
        white = white + fitter.white(member) @ coefficients
    rms, unit = float(np.std(added)), setup.data.outputs[at].unit
    white = project_out(white, fitter.q)  # without the part that the zeros and free parameters span
    fraction = min(1.0, float(white @ white) / _excess_over_noise(end))
    text = ", and ".join(dict.fromkeys(shape(term) for term in terms))
    return Remainder(first.output, first.variables, text, rms, unit, rms / _level(end, at), fraction)


def _level(end: Ending, output: int) -> float:
    return end.analysis.null_model.noises[output].level


def _form_remainders(end: Ending) -> tuple[Remainder, ...]:
    """The strongest form of each variable that is still significant given the terms."""
    generic, remaining = end.analysis.null_model.generic, end.analysis.identified.residual_forms
    remainders: dict[tuple[int, str], Remainder] = {}
    for at in end.analysis.identified.significant:
        form, output = generic.forms[at], int(generic.outputs[at])
        key = (output, form.variable)
        if key in remainders or len(remainders) >= MAX_REMAINDERS:
            continue
        declared_output = end.setup.data.outputs[output]
        ratio = float(np.sqrt(max(remaining.gains[at], 0.0) / end.analysis.search.fitter.space.rows_per_output))
        name = f"order {form.order:g}" if form.kind == "order" else form.kind
        text = f"an {name}" if name[0] in "aeiou" else f"a {name}"
        text += f" of {form.variable}" + (f", {form.detail}" if form.detail else "")
        text = f"a separate level for each {form.variable}" if form.shape == LEVELS else text
        text += ", opposite in the two directions" if form.direction else ""
        remainders[key] = Remainder(
            declared_output.name,
            (form.variable, *form.further_variables),
            text,
            ratio * _level(end, output),
            declared_output.unit,
            ratio,
            min(1.0, float(remaining.gains[at]) / _excess_over_noise(end)),
        )
    return tuple(remainders.values())


def shape(term: Term) -> str:
    """A term in words."""
    names = " and ".join(term.variables)
    kinds = {
        "constant": "an offset",
        "spline": f"a smooth curve over {term.variable}",
        "power": f"{term.variable} to the power {term.exponent:.3g}",
        "step": f"a step at {term.variable} = {term.zero:.4g}",
        "wave": f"a wave of order {term.order:g}",
        "swing": f"a swing of {term.order:g} cycles over {term.variable}",
        "product": f"a product of {names}",
        "curve": f"a curve over {term.variable}",
        "levels": f"a separate level for each {term.variable}",
    }
    text = kinds[term.shape].removesuffix(" to the power 1")
    if term.shape == "power":
        signs = (term.exponent % 2 == 1) == term.signed
        text += "" if signs or term.zero else ", odd" if term.signed else ", of the magnitude"
    if term.times and term.shape != "product":
        power = f"^{term.times_exponent:g}" if term.times_exponent != 1.0 else ""
        text += f" times {term.times}{power}"
    return text + (", opposite in the two directions" if term.turns else "")
