"""The null model and its noise, readings of an instrument, and whether a selected effect has the right form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...journal import Arrays, recall_arrays
from ...models.effects.instrument import step_of
from ...models.effects.unresolved import STEP, SWING, Form
from ...models.measurable import Role
from ...section import Array, Output
from .blocks import block_labels, coarsest_split
from .fit import Fit, Fitter, Space
from .generic import PREDICTED
from .library import Candidate, Columns
from .linear import Groups, basis, products, project_out, ranking
from .noise import Noise, autocorrelation, outliers, residual_scale, robust_scale, size_follows
from .population import Batch, Scatter, setup_with_scatter
from .scan import Dictionary, GenericResidual, Remaining, Thresholds, evidence, generic_residual, thresholds
from .selection import SAME_CAUSE, Search
from .setup import Setup, values_of


@dataclass(frozen=True)
class NullModel:
    """The null model with all that is searched, in the space of its noise, and the generic columns
    (N, C) of `forms` in the outputs' units.
    """

    setup: Setup
    noises: tuple[Noise, ...]
    search: Search
    generic: Remaining
    forms: Groups

    @cached_property
    def null_fit(self) -> Fit:
        """The null fit: the model without any effect."""
        return self.search.fitter.fit(())

    @cached_property
    def residual_forms(self) -> GenericResidual:
        """The generic forms tested against the residual of the null fit."""
        return generic_residual(self.null_fit, self.search.fitter, self.generic)

    @property
    def detected(self) -> bool:
        """Whether a generic form is significant in the residual of the null fit."""
        return bool(self.residual_forms.evidence.max(initial=0.0) > self.search.thresholds.generic)

    @cached_property
    def batch(self) -> Batch:
        """The units as a batch of a population."""
        return Batch(self.setup, self.search)

    def with_scatter(self, effect: Scatter) -> NullModel:
        """The same for a model that contains an effect on the scatter."""
        setup, fitter = setup_with_scatter(self.setup, effect), self.search.fitter
        moved = fitter.space.whiten(self.setup.residual - setup.residual)
        search = replace(self.search, fitter=fitter.of_record(fitter.y - moved))
        return replace(self, setup=setup, search=search)


PRICE = {1: 5.0, 2: -6.0}
"""By how much a generic form must fit better than so many selected effects to displace them: a
single cause is likelier than two."""
PART = 0.999
"""Fraction of a form in the span of some members from which it counts as a part of them."""
FOLLOWS = 3.3
"""Standard errors of the autocorrelation from which successive units are correlated (1 in 1000)."""
MIN_EXPLAINED_FRACTION = 0.01
"""Fraction of what the effects of units explain below which a remainder is no fault of their form.
"""


@dataclass(frozen=True)
class Identified:
    """Members that stay identified, withdrawn members, and the generic forms that remain."""

    confirmed: tuple[int, ...]
    withdrawn: tuple[int, ...]
    residual_forms: GenericResidual
    significant: tuple[int, ...]


def withdraw_members(null_model: NullModel, fit: Fit) -> Identified:
    """Test the members: those are withdrawn that a freer form in the same variable displaces, or
    that leave a large residual in their variable.
    """
    search, generic = null_model.search, null_model.generic
    residual_forms = generic_residual(fit, search.fitter, generic)
    significant = _large_forms(null_model, fit, residual_forms)
    withdrawn = set(displaced(search, fit, generic))
    for at in significant[:20]:
        withdrawn |= _members_in_variable(search, fit, generic, at)
    if withdrawn:
        withdrawn |= _no_longer_significant(search, fit, generic, withdrawn)
    kept = tuple(k for k in range(len(fit.members)) if k not in withdrawn)
    return Identified(kept, tuple(sorted(withdrawn)), residual_forms, significant)


def significant_forms(search: Search, residual_forms: GenericResidual) -> tuple[int, ...]:
    """The generic forms that remain beyond chance and above the practical limit, strongest first.

    The test is against the noise; how much the effects explain does not matter.
    """
    limit = search.thresholds.generic
    return tuple(
        int(at)
        for at in residual_forms.best
        if residual_forms.evidence[at] > limit and residual_forms.gains[at] > search.least_gain
    )


def _large_forms(null_model: NullModel, fit: Fit, residual_forms: GenericResidual) -> tuple[int, ...]:
    """The significant forms that are not small against what the effects of units explain."""
    least = MIN_EXPLAINED_FRACTION * max(null_model.null_fit.rss - fit.rss, 0.0)
    significant = significant_forms(null_model.search, residual_forms)
    return tuple(at for at in significant if residual_forms.gains[at] > least)


def has_structured_residuals(null_model: NullModel, fit: Fit) -> bool:
    """Whether the residuals of units of a population have a structure given a fit: they depend on a
    variable or on the preceding unit. An offset common to all units does not count.
    """
    fitter, generic = null_model.search.fitter, null_model.generic
    space = fitter.space
    if any(abs(noise.rho) * np.sqrt(space.rows_per_output) > FOLLOWS for noise in space.noises):
        return True
    large_forms = _large_forms(null_model, fit, generic_residual(fit, fitter, generic))
    return any(generic.forms[at].kind != "distribution" for at in large_forms)


def displaced(search: Search, fit: Fit, generic: Remaining) -> Sequence[int]:
    """The members that a single generic form replaces with a better fit, unless an effect explains
    nearly as much as the form: it is the cause, and its formula is off.
    """
    count = len(fit.members)
    worst: tuple[float, Sequence[int]] = (0.0, ())
    numbers = generic.white.sizes + np.array([more_numbers(form) for form in generic.forms])
    of_prediction = [form.variable.startswith(PREDICTED) for form in generic.forms]
    sets = [*((k,) for k in range(count)), *combinations(range(count), 2)]
    for removed in sets:
        reduced_fit = search.fitter.fit(fit.without(*removed))
        gains = search.fitter.gains(generic.white, reduced_fit.members)
        score = reduced_fit.score - gains + search.fitter.penalty * numbers + PRICE[len(removed)]
        score[of_prediction] = np.inf
        best = int(ranking(-score)[0])
        while fit.score - score[best] > worst[0] and _is_part(search, fit, generic, best, removed):
            score[best] = np.inf
            best = int(ranking(-score)[0])
        margin = fit.score - float(score[best])
        if margin > worst[0] and (surplus := _without_dominant(search, fit, removed, reduced_fit, gains[best])):
            worst = (margin, surplus)
    return worst[1]


def _without_dominant(
    search: Search, fit: Fit, removed: Sequence[int], reduced_fit: Fit, explained: float
) -> Sequence[int]:
    """The removed members without the one that alone explains nearly as much as a form does."""
    fits = {k: search.fitter.fit((*reduced_fit.members, fit.members[k])) for k in removed}
    best = min(fits, key=lambda k: fits[k].rss)
    dominates = reduced_fit.rss - fits[best].rss > SAME_CAUSE * explained
    return tuple(k for k in removed if k != best) if dominates else removed


def _is_part(search: Search, fit: Fit, generic: Remaining, at: int, removed: Sequence[int]) -> bool:
    """Whether a form is a special case of members, some of their parameters being 0."""
    fitter = search.fitter
    form = project_out(generic.white.of(at), fitter.q)
    removed_columns = np.hstack([fitter.white(fit.members[k]) for k in removed])
    q = basis(project_out(removed_columns, fitter.q))
    return float(np.sum((q.T @ form) ** 2)) > PART * float(np.sum(form**2))


def _no_longer_significant(search: Search, fit: Fit, generic: Remaining, withdrawn: set[int]) -> set[int]:
    """The other members that are not significant given the form that displaced the withdrawn ones:
    they compensated for the residual of a wrong form.
    """
    fitter, kept = search.fitter, [k for k in range(len(fit.members)) if k not in withdrawn]
    reduced_fit = fitter.fit(fit.without(*withdrawn))
    form = generic.white.of(int(generic_residual(reduced_fit, fitter, generic).best[0]))
    insignificant = set()
    for k in kept:
        others = [fitter.white(fit.members[j]) for j in kept if j != k]
        q = basis(np.hstack([fitter.base, form, *others]))
        member_basis = basis(project_out(fitter.white(fit.members[k]), q))
        if float(np.sum((member_basis.T @ project_out(fitter.y, q)) ** 2)) < search.thresholds.library:
            insignificant.add(k)
    return insignificant


def more_numbers(form: Form) -> int:
    """Parameters of a form in addition to its coefficients: an exponent, an order, a place."""
    free = form.kind in ("power", "order") or (form.kind == "product" and form.powers is not None)
    return 1 if free or form.shape in (STEP, SWING) else 0


def _members_in_variable(search: Search, fit: Fit, generic: Remaining, at: int) -> set[int]:
    """The members that act in the variable of a generic form that remains."""
    form = generic.forms[at]
    if form.kind == "order":
        return {k for k in range(len(fit.members)) if _overlap(search, fit, generic, at, k) > 0.1}
    variables = {generic.roles.get(name) for name in (form.variable, *form.further_variables)}
    roles_by_member = enumerate(member.candidate.effect.acts_in() for member in fit.members)
    return {
        k
        for k, roles in roles_by_member
        if (roles - {Role.DIRECTION}) & variables or (roles == {Role.DIRECTION} and form.direction)
    }


def _overlap(search: Search, fit: Fit, generic: Remaining, at: int, k: int) -> float:
    """Fraction of a member's contribution that lies in the span of a generic form."""
    contribution = search.fitter.contribution(fit, k)
    span = basis(project_out(generic.white.of(at), search.fitter.q))
    return float(np.sum((span.T @ contribution) ** 2)) / max(float(np.sum(contribution**2)), 1e-300)


CERTAIN = 14.0
"""Evidence from which a generic form is removed before the noise is estimated."""
MAX_OUTLIERS_WITH_LAW = 0.03
"""Fraction of the units of a batch up to which extreme ones count as outliers."""
MAX_OUTLIERS = 0.06
"""Fraction of the measurements up to which extreme ones are outliers; more are a missing effect."""
PASSES = 2
REPEATS = "repeats"
"""Source of a noise whose size is that between repeated measurements."""


@dataclass(frozen=True)
class Remainder:
    """One output: its residual (n,), the columns (n, k) that may explain it and are kept, generic
    forms and whether each is slow, the inputs by name, labels of repeats, and the noise where it is
    known. `law` is the standard deviation of the units of a population in the model, 0 for
    measurements; `resolution` the scatter due to rounded measurements alone, 0 without rounding.
    """

    residual: Array
    certain_columns: Array
    generic: Groups
    inputs: Mapping[str, Array]
    slow: tuple[bool, ...]
    repeats: NDArray[np.int64] | None = None
    known_sigma: Array | None = None
    source: str = "estimated"
    law: float = 0.0
    resolution: float = 0.0

    def least(self, sigma: Array) -> float:
        """The least level of noise of these sizes (n,), as a fraction of them."""
        return max(max(self.law, self.resolution) / float(np.median(sigma)), 1e-12)

    def good(self, residual: Array, sigma: Array) -> NDArray[np.bool_]:
        """False (n,) for outliers; all True where too many are extreme: a separate group."""
        inliers = outliers(residual, sigma, self.least(sigma))
        return (
            np.ones_like(inliers)
            if np.mean(~inliers) > (MAX_OUTLIERS_WITH_LAW if self.law else MAX_OUTLIERS)
            else inliers
        )


def estimate_noise(remainder: Remainder) -> Noise:
    """The noise of one output; recalled where it was estimated before an interrupt."""
    names = ["", *remainder.inputs]

    def computed() -> Arrays:
        noise = _estimate_noise(remainder)
        good = np.empty(0, dtype=bool) if noise.good is None else noise.good
        ways = np.array([noise.source == REPEATS, names.index(noise.varies_with)])
        return noise.sigma, np.array(noise.rho), good, ways

    inputs = ("noise", remainder.residual, remainder.certain_columns)
    sigma, rho, good, (repeats, follows) = recall_arrays(inputs, computed)
    source = REPEATS if repeats else remainder.source
    return Noise(sigma, source, float(rho), good if len(good) else None, names[int(follows)])


def _estimate_noise(remainder: Remainder) -> Noise:
    n = len(remainder.residual)
    kept = np.column_stack([remainder.certain_columns, _slow(n)])
    sigma = np.ones(n) if remainder.known_sigma is None else remainder.known_sigma
    scatter = robust_scale(project_out(remainder.residual / sigma, basis(kept / sigma[:, None])))
    noise = Noise(sigma * max(scatter, remainder.law, remainder.resolution, 1e-300), remainder.source)
    chosen = kept
    for _ in range(PASSES):
        noise, chosen = _improve_noise(remainder, kept, noise)
    return _scale_noise(remainder, chosen, noise)


def _slow(n: int) -> Array:
    """Columns (n, 4) of a slow curve along the order of measuring."""
    x = np.linspace(-1.0, 1.0, n)
    return np.column_stack([np.ones(n), x, x * x, x**3])


def _improve_noise(remainder: Remainder, kept: Array, noise: Noise) -> tuple[Noise, Array]:
    """One pass: remove forms, then estimate outliers, size and autocorrelation of the residual."""
    start = _start(remainder, kept, noise)
    whole, trend = _add_certain_forms(remainder, start, np.ones(len(remainder.slow), dtype=bool))
    tried = [(_noise_given_columns(remainder, whole, noise), whole)]
    if trend:  # a trend or autocorrelated noise: the likelier
        plain, _ = _add_certain_forms(remainder, start, ~np.array(remainder.slow))
        tried.append((_noise_given_columns(remainder, plain, noise), plain))
    scores = [_likelihood(remainder.residual, chosen, tried_noise) for tried_noise, chosen in tried]
    return tried[int(np.argmax(scores))]


def _noise_given_columns(remainder: Remainder, chosen: Array, noise: Noise) -> Noise:
    white = replace(noise, rho=0.0, good=None)
    residual = remainder.residual - _robust_fit(remainder, chosen, white)
    good = remainder.good(residual, noise.sigma)
    estimate = replace(white, good=None if good.all() else good)
    if remainder.known_sigma is None:
        follows = size_follows(residual, remainder.inputs, good)
        if follows is not None:
            estimate = replace(estimate, varies_with=follows[0], sigma=follows[1])
        count = max(int(good.sum()) - basis(white.whiten(chosen)).shape[1], 1)
        size = np.sqrt(np.sum((residual[good] / estimate.sigma[good]) ** 2) / count)
        estimate = replace(estimate, sigma=estimate.sigma * size)
    return replace(estimate, rho=autocorrelation(remainder.residual, chosen, estimate))


def _robust_fit(remainder: Remainder, chosen: Array, noise: Noise) -> Array:
    """A fit (n,) that is robust against outliers: they are clipped, and the fit is repeated."""
    y = whole = noise.whiten(remainder.residual)
    q = basis(noise.whiten(chosen))
    for _ in range(4):
        fit = q @ (q.T @ y)
        limit = 2.5 * max(robust_scale(whole - fit), remainder.least(noise.sigma))
        y = fit + np.clip(whole - fit, -limit, limit)
    return np.asarray(q @ (q.T @ y) * noise.sigma)


@dataclass(frozen=True)
class Start:
    """The state before forms are removed: columns that are kept (n, k), their whitened basis q
    (n, r), the whitened residual (n,) orthogonal to it, and the whitened forms with their products
    with both. In uniform noise the forms are not scaled: no gain depends on their lengths.
    """

    certain_columns: Array
    q: Array
    residual: Array
    white: Groups
    projected: Array
    product: Array


def _start(remainder: Remainder, kept: Array, noise: Noise) -> Start:
    groups = remainder.generic
    if not noise.is_plain or noise.good is not None:
        groups = groups.white(noise)
    q = basis(noise.whiten(kept))
    residual = project_out(noise.whiten(remainder.residual), q)
    return Start(kept, q, residual, groups, *products(groups, q, residual))


def _add_certain_forms(remainder: Remainder, start: Start, allowed: NDArray[np.bool_]) -> tuple[Array, bool]:
    """The kept columns and those of `allowed` forms (g,) with certain evidence; and if any is slow."""
    if not allowed.any():
        return start.certain_columns, False
    chosen, q, residual, white = start.certain_columns, start.q, start.residual, start.white
    allowed = allowed.copy()
    projected, product, trend = start.projected, start.product, False
    while chosen.shape[1] < max(len(residual) // 5, start.certain_columns.shape[1] + 2):
        scale = residual @ residual / (len(residual) - q.shape[1])
        level = evidence(white, white.conditional_gains(projected, product) / scale)
        best = int(ranking(np.where(allowed, level, -np.inf))[0])
        if not allowed[best] or level[best] < CERTAIN:
            break
        allowed[best] = False
        chosen = np.column_stack([chosen, remainder.generic.of(best)])
        new = basis(project_out(project_out(white.of(best), q), q))
        residual, q = project_out(residual, new), np.hstack([q, new])
        more, product = products(white, new, residual)
        projected = np.vstack([projected, more])
        trend |= remainder.slow[best]
    return chosen, trend


def _likelihood(residual: Array, chosen: Array, noise: Noise) -> float:
    """Log likelihood less half ln n per column, up to a constant."""
    q = basis(noise.whiten(chosen))
    whitened = project_out(noise.whiten(residual), q)
    n = len(residual)
    spread = -0.5 * (n - 1) * np.log(1.0 - noise.rho**2) - float(np.sum(np.log(noise.sigma)))
    return float(spread - 0.5 * n * np.log(whitened @ whitened / n) - 0.5 * np.log(n) * q.shape[1])


def _scale_noise(remainder: Remainder, chosen: Array, noise: Noise) -> Noise:
    """The noise at its final size, from repeats where there are any."""
    if remainder.known_sigma is not None:
        return replace(noise, sigma=remainder.known_sigma)
    pure = _repeat_std(remainder)
    if pure is not None:
        level = np.sqrt(np.mean(noise.sigma**2))
        return replace(noise, sigma=noise.sigma * pure / level, source=REPEATS)
    q = basis(noise.whiten(chosen))
    whitened = project_out(noise.whiten(remainder.residual), q)
    scale = max(residual_scale(whitened, q.shape[1]), remainder.resolution / noise.level)
    return replace(noise, sigma=noise.sigma * scale)


def _repeat_std(remainder: Remainder) -> float | None:
    """Standard deviation between repeats of the same inputs, where there are ten or more."""
    if remainder.repeats is None:
        return None
    _, number, count = np.unique(remainder.repeats, return_inverse=True, return_counts=True)
    freedom = int(np.sum(count - 1))
    if freedom < 10:
        return None
    means = np.bincount(number, remainder.residual) / count
    return float(np.sqrt(np.sum((remainder.residual - means[number]) ** 2) / freedom))


COARSE_STEP_RATIO = 0.25
"""Fraction of the residual's scatter from which the steps of measurements are noted."""

ITERATIONS, CLOSER = 8, 0.01
"""Largest number of iterations, and the fraction of the squares that a further one must save."""


def setup_as_read(setup: Setup, fit: Fit | None = None) -> Setup:
    """The setup in which an instrument measures the zeros and the effects of a fit as well.

    Without a fit the zero of an output is the median of its residual. The setup is unchanged where
    no effect of its library acts on the measurement itself.
    """
    if not any(_reads(setup, candidate) for candidate in setup.library):
        return setup
    outputs = setup.data.outputs
    if fit is None:
        parts = np.split(setup.residual, len(outputs))
        notes = [_coarse_step_note(setup, o, x) for o, x in zip(outputs, parts, strict=True)]
        setup = replace(setup, notes=(*setup.notes, *(note for note in notes if note)))
        more = {
            o.name: np.full(len(x), np.median(x) if o.name in setup.data.zeros else 0.0)
            for o, x in zip(outputs, parts, strict=True)
        }
    else:
        total = setup.base[:, setup.prior :] @ fit.free[setup.prior :]
        for member, size in zip(fit.members, fit.coefficients, strict=True):
            if not _reads(setup, member.candidate):
                total = total + setup.columns.of(member.candidate, member.shape) @ size
        more = dict(zip((o.name for o in outputs), np.split(total, len(outputs)), strict=True))
    return replace(setup, columns=Columns(setup.data, setup.columns.predict, more))


def reread_by_instrument(setup: Setup, space: Space, fit: Fit) -> tuple[Setup, Fit]:
    """The setup in which the instrument measures what the members of a fit add, and their fit in
    it; iterated to convergence where a member acts on the measurement itself.
    """
    before = np.inf
    for _ in range(ITERATIONS):
        fitter = Fitter(space, setup.residual, setup.base, setup.columns, setup.offset)
        fit = fitter.refined(fit.members)
        if before - fit.rss < CLOSER * fit.rss or not any(_reads(setup, member.candidate) for member in fit.members):
            break
        setup, before = setup_as_read(setup, fit), fit.rss
    return setup, fit


def resolution(setup: Setup, output: str) -> float:
    """The standard deviation due to the steps of an output's measurements, 0 without steps."""
    return float((step_of(setup.data.measured[output]) or 0.0) / np.sqrt(12.0))


def _coarse_step_note(setup: Setup, output: Output, residual: Array) -> str:
    """The note on measurements whose steps are a large part of their residual (n,), else ""."""
    scatter, whole = resolution(setup, output.name), float(np.std(residual))
    if scatter <= COARSE_STEP_RATIO * whole:
        return ""
    step, percent = scatter * np.sqrt(12.0), 100.0 * min(scatter / whole, 1.0)
    return (
        f"{output.name} is measured in steps of {step:.4g} {output.unit}: their scatter alone is "
        f"{percent:.0f} % of the residual"
    )


def _reads(setup: Setup, candidate: Candidate) -> bool:
    """Whether a candidate acts on the measurement itself."""
    values, data = {number.name: max(number.choices, default=1.0) for number in candidate.shape}, setup.data
    return candidate.is_nonlinear and bool(candidate.effect.act(data.measurements, values, data.target).reading)


NOISE_TOLERANCE = 0.02
"""Change of the noise's level and autocorrelation below which they count as unchanged."""


def build_null_model(
    setup: Setup,
    noises: tuple[Noise, ...],
    effects: Dictionary,
    forms: Groups,
    outputs: NDArray[np.int64],
    known: Thresholds | None,
) -> NullModel:
    """The null model in the space of this noise; `forms` (N, C) are generic columns, `outputs` (g,)
    the output of each group of them.
    """
    plan = setup.plan
    space = Space(noises, setup.prior)
    fitter = Fitter(space, setup.residual, setup.base, setup.columns, setup.offset)
    white, generic = effects.raw.white(space), forms.white(space)
    if known is None:
        rng = np.random.default_rng([plan.seed, 2])
        known = thresholds(white, generic, fitter.q, plan.settings.simulations, plan.settings.false_rate, rng)
    labels = np.tile(block_labels(setup.data), len(setup.data.outputs))
    split = None if setup.data.target.population else coarsest_split(setup.data)
    plain = Fitter(space.unweighted(), setup.residual, setup.base, setup.columns, setup.offset)
    search = Search(fitter, effects, white, known, labels, plan.settings, split, fitter if space.is_plain else plain)
    roles = {c.name: c.role for c in setup.data.target.columns}
    remaining = Remaining(generic, setup.forms * len(setup.data.outputs), outputs, roles)
    return NullModel(setup, noises, search, remaining, forms)


def change_noise(null_model: NullModel, noises: tuple[Noise, ...]) -> NullModel:
    """The same null model in the space of another noise, with the same thresholds."""
    search, outputs = null_model.search, null_model.generic.outputs
    return build_null_model(null_model.setup, noises, search.dictionary, null_model.forms, outputs, search.thresholds)


def noise_of(setup: Setup, contributions: Sequence[Array]) -> tuple[Noise, ...]:
    """The noise of each output given the model and the effects' columns (N, m)."""
    data = setup.data
    split = [np.split(x, len(data.outputs)) for x in (setup.residual, setup.base, *contributions)]
    clocks = [c.name for c in data.inputs if c.role is Role.TIME]
    slow, inputs = tuple(form.variable in clocks for form in setup.forms), values_of(data)
    noises = []
    for output, residual, *columns in zip(data.outputs, *split, strict=True):
        known, source = _stated_noise(setup, output.name)
        law = setup.laws[output.name].std if setup.laws else 0.0
        rounding = 0.0 if setup.laws else resolution(setup, output.name)
        kept = np.column_stack(columns)
        remainder = Remainder(residual, kept, setup.generic, inputs, slow, data.repeats, known, source, law, rounding)
        noises.append(estimate_noise(remainder))
    return tuple(noises)


def _stated_noise(setup: Setup, name: str) -> tuple[Array | None, str]:
    """The noise (n,) that the table or the configuration states, and which of the two."""
    if name in setup.data.std:
        return setup.data.std[name], "column"
    if name in setup.plan.noise:
        return np.full(len(setup.data), setup.plan.noise[name]), "configuration"
    return None, "estimated"


def contributions(setup: Setup, fit: Fit) -> list[Array]:
    """Columns of the members in the outputs' units."""
    return [setup.columns.of(member.candidate, member.shape) for member in fit.members]


def spread_of(noises: Sequence[Noise]) -> float:
    """The largest level of the noise of the outputs."""
    return float(max(noise.level for noise in noises))


def alike(first: Sequence[Noise], second: Sequence[Noise]) -> bool:
    """Whether two estimates of the noise are practically the same."""
    return all(
        abs(a.level / b.level - 1.0) < NOISE_TOLERANCE
        and abs(a.rho - b.rho) < NOISE_TOLERANCE
        and a.outliers == b.outliers
        and a.varies_with == b.varies_with
        for a, b in zip(first, second, strict=True)
    )
