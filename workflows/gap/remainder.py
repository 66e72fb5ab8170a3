"""The unidentified remainder given the identified effects, as records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...gap_records import Remainder, UnresolvedTerm
from ...models.effects.unresolved import Term
from .analysis import Analysis
from .fit import Member, is_term
from .gaps import gaps
from .generic import LEVELS
from .linear import projected_out
from .result import Ending
from .unresolved import effect_of, table_of

MOST = 3
"""Number of forms listed in addition to the terms."""


def removed_from(analysis: Analysis) -> tuple[str, ...]:
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
        return _of_scatter(end)
    together: dict[tuple[str, frozenset[str]], list[Member]] = {}
    for member in end.fit.terms:
        term = effect_of(member).term
        together.setdefault((term.output, frozenset(term.variables)), []).append(member)
    return (*(_of_terms(end, members) for members in together.values()), *_of_forms(end))


def _of_scatter(end: Ending) -> tuple[Remainder, ...]:
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


def _beyond(end: Ending) -> float:
    """The squared gap in excess of the noise, in noise units."""
    return max(end.analysis.null_model.null_fit.rss - end.analysis.search.fitter.space.count, 1e-300)


def _of_terms(end: Ending, members: Sequence[Member]) -> Remainder:
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
    white = projected_out(white, fitter.q)  # without the part that the zeros and free parameters span
    fraction = min(1.0, float(white @ white) / _beyond(end))
    text = ", and ".join(dict.fromkeys(shape(term) for term in terms))
    return Remainder(first.output, first.variables, text, rms, unit, rms / _level(end, at), fraction)


def _level(end: Ending, output: int) -> float:
    return end.analysis.null_model.noises[output].level


def _of_forms(end: Ending) -> tuple[Remainder, ...]:
    """The strongest form of each variable that is still significant given the terms."""
    generic, remaining = end.analysis.null_model.generic, end.analysis.identified.residual_forms
    remainders: dict[tuple[int, str], Remainder] = {}
    for at in end.analysis.identified.significant:
        form, output = generic.forms[at], int(generic.outputs[at])
        key = (output, form.variable)
        if key in remainders or len(remainders) >= MOST:
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
            min(1.0, float(remaining.gains[at]) / _beyond(end)),
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
