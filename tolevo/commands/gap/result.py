"""The ending of an analysis: the final fit and its verdict, and what generic terms add to its errors."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, product

import numpy as np

from ...models.effects import EffectParameter
from ...models.effects.angle import GearOrder
from ...models.effects.measurements import changes_of_reading
from ...models.effects.memory import Memory
from ...models.effects.shapes import Orders
from ...models.effects.unresolved import CURVED, Resemblance
from ...models.measurable import Role
from ...section import Array
from .analysis import Analysis, analysis_of_fit, analysis_without_effect, settled_again, variables_of, with_curves
from .blocks import HeldOut
from .close import Corrected, corrected
from .fit import MAX_CONTRIBUTION, Fit, Fitter, Member, is_term
from .generic import effect_of, whole_term
from .linear import basis, project_out, ranked
from .scan import scan
from .selection import SAME_CAUSE
from .setup import Setup

# The bias of an effect's parameter due to the form of the generic terms that are fitted with it.
#
# Generic terms are one of many forms that the record allows. Where they contain the column of an
# effect, their common part is attributed to the effect; the squared size of their sum is spread evenly
# over its dimensions, and the common dimension is assumed to have had as much. With g the column of a
# parameter given all other effects, E the squared norm of the sum r in noise units and m its
# dimensions, the variance is then sigma^2 / |g|^2 (1 + E/m). Terms that are fitted jointly may have
# absorbed g' r / |g|^2 of the parameter, between none and all of it: the standard deviation is at
# least 0.6 of it.

NEGLIGIBLE_FRACTION = 0.01
"""Fraction of a parameter's column within a form below which they have nothing in common."""
STEP = 1e-4
"""Relative step of a derivative."""
ALIKE, MORE_ALIKE, TWICE = 0.5, 0.1, 4.0
"""Fractions of the squares of a curve that resembled effects, and each of them, explain; squares of twice its size."""
EITHER = 0.36
"""Variance of a value between two ends, over the square of their distance, such that an interval of
90 % about one end contains the other."""
SIGNIFICANCE_FACTOR = 2.0
"""Standard errors from which two fits differ by more than noise."""
LEAST_CHANCE = 0.05
"""Least variance of their difference, as a fraction of that of the wider fit."""


def misfit_of(analysis: Analysis, fit: Fit, curved: Fit) -> dict[tuple[str, str], float]:
    """Added variance of the effects' parameters, by owner and name, due to the generic terms of a fit;
    in the `curved` one they are curves of which the effects explain nothing.
    """
    fitter, of_forms, fit = analysis.search.fitter, fit, curved
    terms = [k for k, member in enumerate(fit.members) if is_term(member)]
    named = fit.identified if terms else ()
    columns = {at: _columns(fitter, fit, at) for at in named}
    added = np.sum([fitter.contribution(fit, k) for k in terms], axis=0)
    forms = [fitter.white(whole_term(member, analysis.setup.data)) for member in of_forms.terms]
    q = basis(project_out(np.hstack(forms), fitter.q)) if named else added  # of the whole forms of all terms
    count = sum(member.candidate.count for member in of_forms.terms)
    variances: dict[tuple[str, str], float] = {}
    for at in named:
        member = fit.members[at]
        numbers = [parameter.name for parameter in (*member.candidate.linear, *_fitted_parameters(member))]
        others = [columns[k] for k in named if k != at]
        given = {k: np.hstack([fitter.base, np.delete(columns[at], k, axis=1), *others]) for k in range(len(numbers))}
        for k, number in enumerate(numbers):
            g = project_out(columns[at][:, k], basis(given[k]))
            size = float(g @ g)
            common = float(np.sum((q.T @ g) ** 2)) / size if size > 0.0 else 0.0
            if common > NEGLIGIBLE_FRACTION:
                bias, whole = float(g @ added) ** 2 / size, float(added @ added)
                variances[member.name, number] = max(EITHER * bias, (whole - bias) / count * common) / size
    alone, sizes = fitter.fit(fit.effects), _sizes(fit)
    readings = [(other.fit, fit) for other in analysis.rivals if not analysis.search.cancelling(other.fit)]
    readings += [(reading, alone) for at in terms for reading in _readings(analysis, fit, alone, at)]
    for reading, than in readings if named else ():
        before = _sizes(than)
        for key, size in _sizes(reading).items():
            away = abs(size - before.get(key, size)) if size else 0.0
            if FORM_OFF < away / max(abs(sizes.get(key, 0.0)), 1e-300) < OTHER_CAUSE:
                variances[key] = max(variances.get(key, 0.0), EITHER * away**2)
    return variances


def _sizes(fit: Fit) -> dict[tuple[str, str], float]:
    """The linear parameters of the effects of a fit, by owner and name."""
    return {
        (member.name, number.name): size
        for member, sizes in zip(fit.members, fit.coefficients, strict=True)
        if not is_term(member)
        for number, size in zip(member.candidate.linear, sizes.tolist(), strict=False)  # of a delay there are none
    }


def _readings(analysis: Analysis, fit: Fit, whole: Fit, at: int) -> Iterator[Fit]:
    """Fits of the effects (`whole`), one over a curve's variables exchanged, off by at most twice the curve's size, or
    one more that explains most of the curve: by as much is the form of the effects off.
    """
    search, data = analysis.search, analysis.setup.data
    over, most = variables_of(fit.members[at], data), fit.rss + TWICE * (whole.rss - fit.rss)
    if effect_of(fit.members[at]).term.shape not in CURVED:
        return
    for k, member in enumerate(whole.members):
        rest = whole.without(k)
        for other in _over(analysis, rest, over) if variables_of(member, data) == over else ():
            reading = search.fitter.fit((*rest, other))
            if other.name != member.name and reading.rss < most and not search.cancelling(reading):
                yield reading
    for other in _over(analysis, whole.members, over):
        more = search.fitter.refined((*whole.members, other))
        determined = not other.shape or not search.cancelling(more)
        if determined and whole.rss - more.rss > ALIKE * (whole.rss - fit.rss):
            yield more


def _over(analysis: Analysis, members: Sequence[Member], over: tuple[frozenset[str], bool]) -> list[Member]:
    """The effects that act in these variables, or follow the direction alone, as they fit best beside some members."""
    search, data = analysis.search, analysis.setup.data
    others = [result.member for result in scan(search.fitter, search.white, search.dictionary, members)]
    return [other for other in others if variables_of(other, data) in (over, (frozenset(), over[1]))]


def _resemblance(analysis: Analysis, fit: Fit, at: int) -> Resemblance:
    """The one or two effects over the variables of a curve that explain most of it beside those that are there."""
    search, data, members = analysis.search, analysis.setup.data, fit.members
    fitter, over = search.fitter, variables_of(members[at], data)
    if effect_of(members[at]).term.shape not in CURVED:
        return Resemblance()
    beside = [k for k in fit.identified if variables_of(members[k], data) in (over, (frozenset(), over[1]))]
    open_to = [m for m in search.dictionary.members if m.name not in fit.names and variables_of(m, data) == over]
    curve, found = fitter.contribution(fit, at), Resemblance()
    added = [fitter.white(members[k]) for k in beside]
    for _ in range(2 if beside else 0):
        q, best = basis(np.hstack([fitter.base, *added])), (found.fraction + MORE_ALIKE, Resemblance(), curve[:, None])
        for member in open_to:
            columns = fitter.white(member)
            apart = np.linalg.norm(project_out(columns, q), axis=0) > STEP * np.linalg.norm(columns, axis=0)
            low, high = (ends[apart] for ends in member.candidate.bounds)
            whole = np.hstack([*added, columns[:, apart]])
            sizes = np.linalg.lstsq(project_out(whole, fitter.q), curve, rcond=STEP**2)[0]
            off = curve - project_out(whole, fitter.q) @ sizes
            fraction, own = 1.0 - float(off @ off) / float(curve @ curve), sizes[len(sizes) - apart.sum() :]
            if fraction > best[0] and (own >= low).all() and (own <= high).all():
                best = fraction, Resemblance((*found.names, member.name), fraction), columns[:, apart]
        if not best[1].names:
            break
        found, open_to = best[1], [member for member in open_to if member.name not in best[1].names]
        added.append(best[2])
    return found if found.fraction > ALIKE else Resemblance()


def variance_of_weights(model: Corrected, plain: Corrected) -> dict[tuple[str, str], float]:
    """Added variance of numbers that differ between the weighted fit and one with equal weights: if
    the form is right they differ by noise alone.

    Reference: DuMouchel and Duncan, J. Am. Stat. Assoc. 78, 1983.
    """
    away = plain.values - model.values
    variance, plain_variance = (np.diag(fitted_model.covariance) for fitted_model in (model, plain))
    chance = np.maximum(plain_variance - variance, LEAST_CHANCE * plain_variance)
    sure = away**2 > SIGNIFICANCE_FACTOR**2 * chance
    return {
        (number.owner, number.name): EITHER * float(square)
        for number, square, significant in zip(model.numbers, away**2, sure, strict=True)
        if significant and np.isfinite(square)
    }


def _fitted_parameters(member: Member) -> list[EffectParameter]:
    """The nonlinear parameters that are fitted."""
    return [parameter for parameter in member.candidate.shape if not parameter.choices and member.candidate.linear]


def _columns(fitter: Fitter, fit: Fit, at: int) -> Array:
    """Whitened derivatives (N, k) of the outputs with respect to each parameter of a member."""
    member, columns = fit.members[at], [fitter.white(fit.members[at])]
    for parameter in _fitted_parameters(member):
        here = member.shape[parameter.name]
        step = STEP * (abs(here) or 1.0) * (-1.0 if here >= parameter.high else 1.0)
        moved = {**member.shape, parameter.name: here + step}
        raw = fitter.columns.of(member.candidate, moved)
        change = (fitter.space.whiten(raw) - columns[0]) @ fit.coefficients[at]
        columns.append(change[:, None] / step)
    return np.hstack(columns)


OTHER_CAUSE = 0.5
"""Fraction of a size by which another reading of the form moves it, beyond which it is another cause."""
FORM_OFF, FORM_FAR_OFF, FORM_ALIKE = 0.05, 0.12, 0.3
"""Limits of the part of an effect that is orthogonal to a larger effect of its variables, as a
fraction of the latter (the second where what remains over them is no small part of it), and of their
correlation. Below the former and above the latter, the effect may be an error of the larger one's form,
which no formula has exactly.
"""
VISIBLE = 0.4
"""What remains over an effect's variables, over its part apart from a larger one, from which both forms are off."""


@dataclass(frozen=True)
class Ending:
    """An analysis with the final fit of its identified effects."""

    analysis: Analysis
    fit: Fit
    model: Corrected
    before: HeldOut
    after: HeldOut

    @property
    def setup(self) -> Setup:
        """The setup of the final null model."""
        return self.analysis.setup

    @property
    def verdict(self) -> str:
        """The verdict."""
        if not self.analysis.significant:
            return "no_gap"
        if not self.identified and not self.analysis.scatter:
            return "unnamed"
        if self.remains:
            return "partial"
        rivals = self.analysis.rivals or len(self.analysis.scatter) > 1 or self.on_scatter_instead
        return "ambiguous" if rivals else "named"

    @cached_property
    def resembled(self) -> dict[str, Resemblance]:
        """What each term resembles."""
        terms = [(at, member.name) for at, member in enumerate(self.fit.members) if is_term(member)]
        return {name: _resemblance(self.analysis, self.fit, at) for at, name in terms}

    @property
    def identified(self) -> tuple[int, ...]:
        """The indices of the members that are identified effects."""
        return self.fit.identified

    @property
    def rows(self) -> bool:
        """Whether each row is a measurement, not a unit of a population."""
        return not self.setup.data.target.population

    @property
    def remains(self) -> bool:
        """Whether a residual or a scatter of units beyond the identified effects is significant."""
        forms_remain = self.rows and bool(self.analysis.identified.significant)
        return bool(self.fit.terms) or forms_remain or self.analysis.misfit is not None

    @property
    def on_scatter_instead(self) -> tuple[tuple[str, str, str], ...]:
        """Effects on the scatter that would explain the same as an identified one: their names, that
        of the identified one, and what to record to separate them.
        """
        names = {candidate.name for candidate in self.setup.on_scatter}
        separated = ((member.name, member.candidate.effect.separated_by) for member in self.fit.members)
        return tuple((other, name, by[other]) for name, by in separated for other in by if other in names)


def finish_analysis(analysis: Analysis) -> Ending:
    """The final fit of the identified effects, in the full model. An effect is removed, and the
    others are fitted and tested again, where the joint interval of its parameters given the others
    contains 0. The same holds for an effect that may be an error of a larger one's form, unless
    held-out rows are predicted worse, then or by the answer that all further removals lead to, or a
    wave of the same order takes its place: a form that is off is off in more than one order.

    Every turn excludes an effect for good, or keeps one in `needed`: there are at most as many turns
    as the library has effects for each effect that is kept.
    """
    ending, needed, before = _widen_ending(analysis), set[str](), list[tuple[str, Ending]]()
    while ending.rows:
        name, larger, kept = _weakest_effect(ending, needed) or ("", "", False)
        if not name and (not before or _predicts_as_well(ending)):
            break
        reduced = _widen_ending(analysis_without_effect(ending.analysis, name, larger, kept)) if name else ending
        if larger and _predicts_as_well(reduced) and not _is_renamed(ending, name, reduced):
            before.append((name, ending))
        elif larger:
            needed.add(name)
            continue
        elif not name:
            taken_back, reduced = before.pop()
            needed.add(taken_back)
        ending = reduced
    return _with_names(ending, needed) if ending.rows else ending


def _with_names(end: Ending, needed: Collection[str]) -> Ending:
    """The ending in which an effect replaces the term with its only column, or all curves over its variables where it
    fits better, and nothing speaks against it: what excluded it may be gone, or other effects had to be there first.
    """
    search, analysis, data = end.analysis.search, end.analysis, end.setup.data
    members, best = analysis.fit.members, list[tuple[float, Fit]]()
    for at, other in product(range(len(members)), search.dictionary.members):
        columns, own = (search.fitter.white(member) for member in (members[at], other))
        if not is_term(members[at]) or other.shape or {columns.shape[1], own.shape[1]} != {1}:
            continue
        if np.linalg.norm(project_out(columns, basis(own))) < STEP * np.linalg.norm(columns):
            best.append((0.0, search.fitter.fit(sorted([*members[:at], other, *members[at + 1 :]], key=is_term))))
    curves = [member for member in members if is_term(member) and effect_of(member).term.shape in CURVED]
    for over in dict.fromkeys(variables_of(member, data)[0] for member in curves):
        rest = [member for member in members if member not in curves or variables_of(member, data)[0] != over]
        apart = [member for member in rest if is_term(member) or not variables_of(member, data)[0] <= over]
        alone = (each.member for each in scan(search.fitter, search.white, search.dictionary, apart))
        first = islice((m for m in alone if variables_of(m, data)[0] <= over), STARTS)
        fits = [_searched_over(analysis, start, over) for start in (rest, *([*apart, m] for m in first))]
        without, most = search.fitter.fit(rest).rss, search.fitter.fit(members).rss
        as_much = [fit for fit in fits if without - fit.rss > SAME_CAUSE * (without - most)]
        best += [(search.worse(fit, analysis.fit), fit) for fit in as_much]
    for _, fit in ranked(best, lambda each: -each[0]):
        new = {*fit.names} - {*analysis.fit.names}
        ending = _widen_ending(analysis_of_fit(analysis, fit, analysis.excluded - new))
        if search.worse(fit, analysis.fit) > 0.0:  # a remainder is a term again
            ending = _widen_ending(analysis_of_fit(analysis, settled_again(analysis, fit), analysis.excluded - new))
        fit = ending.analysis.fit
        present = all(np.any(fit.coefficients[k]) for k in fit.identified if fit.names[k] in new)
        more = search.fitter.fit(fit.effects).rss < search.fitter.fit(analysis.fit.effects).rss
        if present and more and not _weakest_effect(ending, needed):
            return ending
    return end


STARTS, SEARCHED, NEAREST = 4, 5, 3
"""Effects with which a search among those of a curve's variables begins, its steps, and the likeliest of each."""


def _searched_over(analysis: Analysis, start: Sequence[Member], over: frozenset[str]) -> Fit:
    """The fit of some members with effects that act in no other variables, added or exchanged one by one."""
    search, data = analysis.search, analysis.setup.data
    fit = search.fitter.refined(sorted(start, key=is_term))
    for _ in range(SEARCHED):
        exchanged = [k for k in fit.identified if variables_of(fit.members[k], data)[0] <= over]
        near = list[Fit]()
        for base in (fit.members, *map(fit.without, exchanged)):
            found = (each.member for each in scan(search.fitter, search.white, search.dictionary, base))
            more = [m for m in found if variables_of(m, data)[0] <= over and m.name not in analysis.excluded]
            near += search.ordered(search.fitter.fit(sorted([*base, m], key=is_term)) for m in more)[:NEAREST]
        larger = search.ordered(search.fitter.refined(each.members) for each in near)
        best = next((each for each in larger if not search.cancelling(each)), fit)
        if search.worse(best, fit) > -search.thresholds.library:
            break
        fit = best
    return fit


def _weakest_effect(end: Ending, needed: Collection[str]) -> tuple[str, str, bool] | None:
    """The first effect to be removed, the larger effect whose form it may belong to (empty where its parameters may
    be 0), and whether its contribution stays, since it only adds to the others'; None where all effects stay. An
    effect in `needed` belongs to no other form.
    """
    search = end.analysis.search
    effects = search.fitter.fit(end.fit.effects)
    if cancelling := search.cancelling(effects, True):
        at = ranked(list(cancelling), lambda k: -search.fitter.fit(effects.without(k)).rss)[0]  # the least needed
        own, *others = (search.fitter.contribution(effects, k) for k in (at, *range(len(effects.members))))
        adds = len(effects.coefficients[at]) == 1 and all(float(own @ other) > 0.0 for other in others)
        return effects.names[at], "", adds and any(np.sum(other**2) > np.sum(own**2) for other in others)
    size = {
        each.name: float(np.linalg.norm(search.fitter.contribution(effects, k)))
        for k, each in enumerate(effects.members)
    }
    times = {
        k: float(np.linalg.norm(search.fitter.contribution(end.fit, k))) / max(size[end.fit.names[k]], 1e-300)
        for k in end.identified
    }
    if (inflated := max(times, key=times.__getitem__, default=-1)) >= 0 and times[inflated] > MAX_CONTRIBUTION:
        return end.fit.names[inflated], "", False  # it cancels against terms
    for at in end.identified:
        name = end.fit.names[at]
        if name in end.analysis.excluded:
            continue
        larger = "" if name in needed else _form_of(end, at)
        member = end.fit.members[at]
        if larger or end.model.nothing(member) or end.model.undetermined(member) or _sideband(end, at):
            return name, larger, False
        if _warms_late(end, at) or _of_path(end, at):
            return name, "", False
    return None


def _sideband(end: Ending, at: int) -> bool:
    """Whether an order that nobody declared may be part of a larger remainder over the angle (or of a visible one, if
    it is small), of which another effect has the main part, or one of less than a turn an error of a memory's form.
    """
    data, effects = end.setup.data, [member.candidate.effect for member in end.fit.effects]
    effect = end.fit.members[at].candidate.effect
    if not isinstance(effect, (GearOrder, Orders)) or data.target.gear is not None:
        return False
    if np.ptp(data.measurements[Role.ANGLE]) < 2.0 * np.pi and any(isinstance(each, Memory) for each in effects):
        return True
    sizes = {k: float(np.linalg.norm(end.analysis.search.fitter.contribution(end.fit, k))) for k in end.identified}
    larger, remains = max((sizes[k] for k in _containing(end, at)), default=0.0), _remains_of(end, at)
    beyond = VISIBLE if sizes[at] < FORM_FAR_OFF * larger else 1.0
    return isinstance(effect, GearOrder) and larger > 0.0 and remains > beyond * sizes[at]


def _of_path(end: Ending, at: int) -> bool:
    """Whether an effect with a memory may be an error of the form of a larger one over the same path, of which more
    remains.
    """
    effects, target = [member.candidate.effect for member in end.fit.members], end.setup.data.target
    paths = [effect.driven_by(target) if isinstance(effect, Memory) else None for effect in effects]
    same = [k for k in end.identified if k != at and paths[k] is paths[at] is not None]
    return end.remains and any(_is_form(end, at, k, 0.0) for k in same)


def _warms_late(end: Ending, at: int) -> bool:
    """Whether an effect on the reading has mostly what the temperature moves: heat arrives late by itself."""
    fitter, data, fit, effects = end.analysis.search.fitter, end.setup.data, end.fit, end.fit.members
    warm = [k for k in end.identified if Role.TEMPERATURE in effects[k].candidate.effect.acts_in(data.target)]
    moved = [fitter.columns.of(effects[k].candidate, effects[k].shape) @ fit.coefficients[k] for k in warm]
    parts = np.split(sum(moved, 0.0 * end.setup.residual), len(data.outputs))
    named, reads = {o.name: part for o, part in zip(data.outputs, parts, strict=True)}, effects[at]
    late = changes_of_reading(reads.candidate.effect, reads.shape, named, data.measurements, data.target)
    own, of_heat = fitter.contribution(fit, at), project_out(fitter.space.whiten(np.concatenate(late)), fitter.q)
    return float(of_heat @ own) > 0.5 * float(own @ own)


def _predicts_as_well(end: Ending) -> bool:
    """Whether held-out rows are predicted as well as by each accepted step."""
    return end.analysis.search.predicts_as_well(end.after, end.analysis.selection.accepted)


def _is_renamed(end: Ending, name: str, reduced: Ending) -> bool:
    """Whether a wave without a name has the columns of the effect that was removed."""
    fitter = reduced.analysis.search.fitter
    q = fitter.spanned([member for member in end.fit.members if member.name == name])
    waves = [fitter.white(member) for member in reduced.fit.terms if effect_of(member).term.shape == "wave"]
    return any(np.linalg.norm(project_out(wave, q)) < STEP * np.linalg.norm(wave) for wave in waves)


def _form_of(end: Ending, at: int) -> str:
    """The larger effect of the same variables of whose form this effect may be an error, or ""."""
    members, over = end.fit.members, _containing(end, at)
    effect = members[at].candidate.effect
    preferred = [k for k in end.identified if members[k].candidate.effect.family == effect.yields_to]
    forms = [k for k in preferred if _is_form(end, at, k, 0.0)] + [k for k in over if _is_form(end, at, k)]
    return next((members[k].name for k in forms or (over if over and _outdone(end, at) else ())), "")


def _containing(end: Ending, at: int) -> list[int]:
    """The other effects that act in all variables of an effect."""
    members, data = end.fit.members, end.setup.data
    inputs, turns = variables_of(members[at], data)
    acting = [(k, *variables_of(members[k], data)) for k in end.identified if k != at]
    return [k for k, others, opposite in acting if (inputs or turns) and inputs <= others and turns <= opposite]


def _outdone(end: Ending, at: int) -> bool:
    """Whether another effect over its variables fits as well beside the others, its numbers undetermined: which of
    the two there is does not show.
    """
    search, member = end.analysis.search, end.fit.members[at]
    rest, here = [each for each in end.fit.effects if each is not member], search.fitter.refined(end.fit.effects)
    for other in _over(end.analysis, rest, variables_of(member, end.setup.data)):
        reading = search.fitter.refined((*rest, other))
        near = search.worse(reading, here) <= search.settings.set_distance
        if other.name != member.name and near and search.cancelling(reading):
            return True
    return False


def _is_form(end: Ending, small: int, large: int, least_alike: float = FORM_ALIKE) -> bool:
    """Whether the small member's contribution may be an error of the large member's form."""
    fitter, fit = end.analysis.search.fitter, end.fit
    a, b = (fitter.contribution(fit, k) for k in (small, large))
    small_norm, large_norm = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    alike = abs(float(a @ b)) / max(small_norm * large_norm, 1e-300)
    apart = small_norm * np.sqrt(max(1.0 - alike**2, 0.0))
    off = FORM_FAR_OFF if _remains_of(end, small) > VISIBLE * apart else FORM_OFF
    return bool(small_norm < large_norm and alike > least_alike and apart < off * large_norm)


def _remains_of(end: Ending, at: int) -> float:
    """The norm of what remains over an effect's variables."""
    fitter, fit, data, identified = end.analysis.search.fitter, end.fit, end.setup.data, end.analysis.identified
    inputs, turns = variables_of(fit.members[at], data)
    over = {k: variables_of(member, data) for k, member in enumerate(fit.members) if is_term(member)}
    added = [
        fitter.contribution(fit, k) for k, (others, opposite) in over.items() if inputs & others and turns == opposite
    ]
    forms = [(k, end.analysis.null_model.generic.forms[k]) for k in identified.significant]
    significant = [k for k, form in forms if inputs & {*form.variables} and turns == bool(form.direction)]
    gains = identified.residual_forms.gains[significant]
    return float(np.sqrt(np.sum(np.sum(added, axis=0) ** 2) + gains.max(initial=0.0)))


def _widen_ending(analysis: Analysis) -> Ending:
    search = analysis.search
    withdrawn = analysis.identified.withdrawn
    kept = analysis.fit.without(*withdrawn)
    fit = search.fitter.refined(kept) if kept else analysis.null_model.null_fit
    if not withdrawn and not analysis.scatter and not analysis.setup.data.target.population:
        fit = analysis.fit  # as it was tested
    tested, curved = search.tested(fit), with_curves(search.fitter, fit, analysis.setup.data)
    extra_widths, fit = misfit_of(analysis, fit, curved), curved
    model = corrected(analysis.setup, search.fitter.space, fit)
    null_model = analysis.initial_null_model
    end = Ending(analysis, fit, model, null_model.search.tested(null_model.null_fit), tested)
    if end.identified and end.rows and not analysis.setup.free and not search.fitter.space.is_plain:
        weighed = variance_of_weights(model, corrected(analysis.setup, search.fitter.space, fit, plain=True))
        extra_widths = {key: extra_widths.get(key, 0.0) + weighed.get(key, 0.0) for key in {**extra_widths, **weighed}}
    return replace(end, model=model.widened(extra_widths))
