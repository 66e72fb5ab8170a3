"""Generic forms as terms of the corrected model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter
from typing import Any

import numpy as np
import scipy

from ...models.effects.measurements import labels_of
from ...models.effects.unresolved import RADII, Term, Unresolved, fewest_plays
from ...models.measurable import Column, Role
from ...section import Array
from .close import Corrected
from .data import GapData
from .fit import Fitter, Member, is_term
from .generic import FROM_LEAST, LEVELS, ODD, STEP, SWING, Form, knots, origin, stretches
from .library import Candidate
from .linear import basis, project_out

WITHIN = 0.9
"""Fraction of an effect's column in the span of a form from which the form is taken without it; a
form of one column is then the effect itself.
"""


def effect_of(member: Member) -> Unresolved:
    """The effect of a generic term."""
    effect = member.candidate.effect
    assert isinstance(effect, Unresolved)
    return effect


def is_plays(member: Member) -> bool:
    """Whether a member of a fit is a memory without a name."""
    return is_term(member) and effect_of(member).term.shape == "plays"


def label(member: Member) -> str:
    """The label of a term on the path of a selection."""
    return f"unresolved term of {' x '.join(effect_of(member).term.variables)}"


def table_of(member: Member, model: Corrected) -> dict[str, Any]:
    """The `[[unresolved]]` table of a term in a corrected model."""
    effect = effect_of(member)
    return effect.term.table(effect.coefficients(model.effect(member.name)))


def term_of(form: Form, data: GapData, output: str) -> Term | None:
    """The term of a form for these data; None where the form is no function of their inputs."""
    columns = {c.name: c for c in data.inputs}
    turns = form.direction == "odd"
    if form.kind == "direction":
        name = next(c.name for c in data.inputs if c.role is Role.DIRECTION)
        return Term(output, name, "constant", turns=True)
    if form.shape == LEVELS and not data.target.population:
        labels, _ = labels_of(data.measurements.table[form.variable])
        return Term(output, form.variable, "levels", labels=tuple(labels.tolist()))
    if form.variable not in columns or data.target.population:
        return None
    base = Term(output, form.variable, "constant", turns=turns)
    x = data.values(form.variable)
    if form.kind == "order":
        return _wave(base, form, data)
    if form.kind == "product":
        return _product(base, form, data, columns)
    if form.kind == "power":
        return _power(base, form, x)
    if form.kind == "memory":
        return replace(base, shape="plays", scale=float(np.ptp(x)), radii=RADII)
    if form.shape == STEP:
        at = form.after
        later = bool((x[at:] > x[at - 1]).all() and (x[:at] < x[at]).all())  # not with own clocks
        return replace(base, shape="step", zero=float(x[at])) if later else None
    if form.shape == SWING:
        size = float(np.ptp(x)) / (2.0 * np.pi)
        return replace(base, shape="swing", order=form.order, zero=float(x.min()), scale=size)
    return _spline(base, columns[form.variable], x) if not form.shape else None


def _spline(base: Term, column: Column, x: Array) -> Term:
    inner = knots(x, stretches(column, len(x)))
    if len(inner) < 3:
        return replace(base, shape="power", signed=True)
    return replace(base, shape="spline", knots=tuple(inner.tolist()))


def _power(base: Term, form: Form, x: Array) -> Term:
    term = replace(base, shape="power", exponent=float(form.order), scale=float(np.abs(x).max()))
    if form.shape == FROM_LEAST:
        return replace(term, zero=float(x.min()), scale=float(np.ptp(x)))
    return replace(term, signed=form.shape == ODD)


def _product(base: Term, form: Form, data: GapData, columns: dict[str, Column]) -> Term:
    second = form.further_variables[0]
    x, y = data.values(form.variable), data.values(second)
    if form.powers is None:
        term = replace(base, shape="product", zero=float(x.mean()), scale=float(x.std()))
        return replace(term, times=second, times_zero=float(y.mean()), times_scale=float(y.std()))
    p, q = form.powers
    ends = [origin(columns[n]) for n in (form.variable, second)]
    sizes = [float(np.abs(v - z).max()) for v, z in zip((x, y), ends, strict=True)]
    return replace(
        base,
        shape="power",
        exponent=float(p),
        signed=p == 1,
        zero=ends[0],
        scale=sizes[0],
        times=second,
        times_exponent=float(q),
        times_zero=ends[1],
        times_scale=sizes[1],
    )


def _wave(base: Term, form: Form, data: GapData) -> Term:
    term = replace(base, shape="wave", order=float(form.order))
    if not form.by:
        return term
    by = (*form.further_variables, *(c.name for c in data.inputs if str(c.role) == form.by))[0]
    size = float(np.abs(data.values(by)).max())
    return replace(term, times=by, times_exponent=float(form.by_power), times_scale=size)


def member_of(term: Term, data: GapData, fitter: Fitter, members: Sequence[Member]) -> Member | None:
    """A term as a member of a fit of `members`, orthogonal to the named effects in its span, or None."""
    if term.shape == "plays":
        known = [effect_of(member).term for member in members if is_plays(member)]
        again = (term.variable, term.output) in [(other.variable, other.output) for other in known]
        term = replace(term, radii=()) if again else _choose_plays(term, data, fitter, members)
        if not term.radii:
            return None
    form = project_out(fitter.white(member_with(Unresolved(term), data)), fitter.q)
    q, r, order = scipy.linalg.qr(form, mode="economic", pivoting=True)
    rank = int(np.sum(np.abs(np.diag(r)) > 1e-5 * max(float(np.abs(r[0, 0])), 1e-300)))
    q, r, kept = q[:, :rank], r[:rank, :rank], order[:rank]
    named = (member for member in members if not is_term(member))
    columns = (column for member in named for column in project_out(fitter.white(member), fitter.q).T)
    inside = [q.T @ c for c in columns if float(np.sum((q.T @ c) ** 2)) > WITHIN * float(c @ c) > 0.0]
    if term.shape == "plays" and not inside:
        return member_with(Unresolved(term), data)
    if len(kept) == 1:
        return None if inside else _mix_term(term, data, np.eye(term.count)[:, kept])
    spanned = basis(np.column_stack(inside)) if inside else np.zeros((rank, 0))
    rest = scipy.linalg.null_space(spanned.T) if spanned.shape[1] else np.eye(rank)
    if rest.shape[1] == 0:
        return None
    mix = np.zeros((term.count, rest.shape[1]))
    mix[kept] = np.linalg.solve(r, rest)
    return _mix_term(term, data, mix / np.abs(mix).max(axis=0))


def _choose_plays(term: Term, data: GapData, fitter: Fitter, members: Sequence[Member]) -> Term:
    """The term with the fewest plays, of either sense, that are each worth their price by non-negative least
    squares given the members of a fit; at most MOST_PLAYS, perhaps none.
    """
    q = fitter.spanned(members)
    rotation, columns = np.linalg.qr(project_out(fitter.white(member_with(Unresolved(term), data)), q))
    y = rotation.T @ fitter.y
    fits = [(*fewest_plays(sense * columns, y, fitter.penalty), sense) for sense in (1.0, -1.0)]
    _, kept, sense = min(fits, key=itemgetter(0))
    return replace(term, scale=sense * term.scale, radii=tuple(term.radii[k] for k in kept))


def without_idle_plays(member: Member, coefficients: Array, data: GapData) -> Member:
    """A term of plays without those that have no weight; any other member as it is."""
    if not is_plays(member) or not (0.0 < np.mean(coefficients == 0.0) < 1.0):
        return member
    term = effect_of(member).term
    radii = tuple(radius for radius, weight in zip(term.radii, coefficients, strict=True) if weight)
    return member_with(Unresolved(replace(term, radii=radii)), data)


def whole_term(member: Member, data: GapData) -> Member:
    """A term with all columns of its form."""
    return member_with(Unresolved(effect_of(member).term), data)


def _mix_term(term: Term, data: GapData, mix: Array) -> Member:
    return member_with(Unresolved(term, mix if mix.shape[1] < term.count or term.count > 1 else None), data)


def member_with(effect: Unresolved, data: GapData) -> Member:
    """A term as a member of a fit."""
    return Member(Candidate(effect, effect.own_parameters(data.target), ()))
