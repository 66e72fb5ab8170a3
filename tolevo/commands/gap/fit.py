"""Whitened space, and joint fits of the model's free parameters and any effects in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from ...journal import recall_arrays
from ...models.effects.unresolved import Unresolved
from ...section import Array
from .library import Candidate, Columns
from .linear import GONE, ConditionalGroups, Groups, basis, project_out, ranked, unit
from .noise import Noise


@dataclass(frozen=True)
class Space:
    """Rows (N,) of q outputs with n measurements each, and one row for each tolerance (prior,).

    A free parameter that moves by its tolerance costs as much as a measurement that is off by one
    standard deviation: the tolerance is the standard deviation of its prior.
    """

    noises: tuple[Noise, ...]
    prior: int = 0

    @property
    def rows_per_output(self) -> int:
        """Rows of one output."""
        return len(self.noises[0].sigma)

    @property
    def count(self) -> int:
        """The number of measurements that count."""
        return self.rows_per_output * len(self.noises) - sum(noise.outliers for noise in self.noises)

    @property
    def is_plain(self) -> bool:
        """Whether every measurement of an output counts the same."""
        return all(noise.is_plain for noise in self.noises)

    def unweighted(self) -> Space:
        """A space in which every measurement of an output counts the same."""
        return Space(tuple(noise.independent() for noise in self.noises), self.prior)

    def whiten(self, columns: Array) -> Array:
        """Columns (N,) or (N, m) whitened, with zeros in the rows of the prior."""
        if len(self.noises) == 1 and not self.prior:
            return self.noises[0].whiten(columns)
        parts = np.split(columns, len(self.noises))
        white = [noise.whiten(part) for noise, part in zip(self.noises, parts, strict=True)]
        tail = np.zeros((self.prior, *columns.shape[1:]))
        return np.concatenate([*white, tail])

    def with_prior(self, free: Array) -> Array:
        """Columns (N, prior + zeros) of the free parameters, each for its whole tolerance; the last
        ones are zeros of outputs, which have no tolerance.
        """
        white = self.whiten(free)
        white[len(white) - self.prior :, : self.prior] = np.eye(self.prior)
        return white

    def level(self) -> Array:
        """Noise level (q,) of each output, in its unit."""
        return np.array([noise.level for noise in self.noises])


MAX_CONTRIBUTION = 3.0
"""Rms of a number's contribution, over the rms by which the residual falls when it is added last, above
which it cancels against others (variance inflation of 9).
"""
MOVED = 0.05
"""Fraction by which a size is changed to see what it does."""
APART, SURE = 0.5, 4.0
"""Difference of the sizes of an effect in two kinds of rows, as a fraction of its size, and in standard
errors, from which it is not one number.
"""
FORGOTTEN = 1.1
"""Number that says how far a memory reaches, over its least value, up to which it is that one: a filter's."""
REMEMBERED = 400
"""Members whose columns, or products with groups, are kept at most."""


@dataclass(frozen=True)
class Member:
    """An effect in a fit, with its nonlinear parameters."""

    candidate: Candidate
    shape: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.candidate.name

    @property
    def forms(self) -> tuple[Member, ...]:
        """The member in each of its two forms, or alone where it has a single form."""
        two_choices = next((parameter for parameter in self.candidate.shape if len(parameter.choices) == 2), None)
        if two_choices is None:
            return (self,)
        return tuple(replace(self, shape={**self.shape, two_choices.name: choice}) for choice in two_choices.choices)

    @property
    def forgets(self) -> bool:
        """Whether its memory is as short as the rows can show: without one it is another effect."""
        reach, shape = self.candidate.effect.reach, self.candidate.shape
        return any(self.shape[n.name] <= FORGOTTEN * n.low for n in shape if reach and n.stem == reach)

    @property
    def key(self) -> tuple[str, tuple[float, ...]]:
        """The key of its columns in a cache."""
        return self.name, tuple(self.shape.values())


def is_term(member: Member) -> bool:
    """Whether a member of a fit is a generic term."""
    return isinstance(member.candidate.effect, Unresolved)


@dataclass(frozen=True)
class Fit:
    """A joint fit: squared whitened residual `rss`, and the coefficients of each member.

    `score` is rss plus the price of the parameters. `residual` is whitened, with the prior.
    """

    members: tuple[Member, ...]
    rss: float
    score: float
    coefficients: tuple[Array, ...]
    free: Array
    residual: Array = field(repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its effects."""
        return tuple(member.name for member in self.members)

    @property
    def terms(self) -> list[Member]:
        """The members that are generic terms."""
        return [member for member in self.members if is_term(member)]

    @property
    def effects(self) -> list[Member]:
        """The members that are identified effects."""
        return [member for member in self.members if not is_term(member)]

    @property
    def identified(self) -> tuple[int, ...]:
        """The indices of the members that are identified effects."""
        return tuple(k for k, member in enumerate(self.members) if not is_term(member))

    def without(self, *removed: int) -> tuple[Member, ...]:
        """All members but those at these indices."""
        return tuple(member for k, member in enumerate(self.members) if k not in removed)


class Fitter:
    """Fits in one space, with a cache of the columns of effects."""

    def __init__(self, space: Space, y: Array, base: Array, columns: Columns, offset: Array) -> None:
        self.space = space
        self.columns = columns
        self.y = space.whiten(y)
        self.y[len(self.y) - space.prior :] = offset
        self.raw_base = base
        self.base = space.with_prior(base)
        self.q = basis(self.base)
        self._white: dict[tuple[str, tuple[float, ...]], Array] = {}
        self._products: dict[int, tuple[Groups, dict[tuple[object, ...], Array]]] = {}
        self._refined: dict[tuple[object, ...], Fit] = {}

    def of_record(self, y: Array) -> Fitter:
        """The fitter for another whitened record (N,)."""
        fitter = copy(self)
        fitter.y, fitter._refined, fitter._products = y, {}, {}
        return fitter

    @property
    def penalty(self) -> float:
        """ln n, the least gain of a further parameter."""
        return float(np.log(self.space.count))

    def spanned(self, members: Sequence[Member]) -> Array:
        """An orthonormal basis (N, r) of the free parameters and these members."""
        parts = [self.white(member) for member in members]
        return basis(np.hstack([self.base, *parts])) if parts else self.q

    def gains(self, groups: Groups, members: Sequence[Member]) -> Array:
        """Gain (g,) of each group of whitened columns given the free parameters and these members.

        Its products with each member are computed once: a search evaluates the same groups given
        many sets of members.
        """
        keys = [("free",), *(member.key for member in members)]

        def computed() -> tuple[Array]:
            parts = [self.q, *(unit(self.white(member)) for member in members)]
            with_groups = np.vstack([self._product(groups, *pair) for pair in zip(keys, parts, strict=True)])
            z = np.hstack(parts)
            with_y = self._product(groups, ("record",), self.y[:, None])[0]
            return (ConditionalGroups.of(z.T @ z, z.T @ self.y).gains(groups, with_groups, with_y),)

        return recall_arrays(("gains", *keys, self.y), computed)[0]

    def _product(self, groups: Groups, key: tuple[object, ...], columns: Array) -> Array:
        """Products (k, C) of the columns (N, k) of a key with those of groups."""
        _, known = self._products.setdefault(id(groups), (groups, {}))
        if key not in known:
            if len(known) > REMEMBERED:
                known.clear()
            known[key] = columns.T @ groups.columns
        return known[key]

    def white(self, member: Member) -> Array:
        """Whitened columns (N, m) of a member."""
        if member.key not in self._white:
            if len(self._white) > REMEMBERED:
                self._white.clear()
            self._white[member.key] = self.space.whiten(self.columns.of(member.candidate, member.shape))
        return self._white[member.key]

    def contribution(self, fit: Fit, at: int) -> Array:
        """The whitened contribution (N,) of a member that the free parameters cannot explain."""
        return project_out(self.white(fit.members[at]) @ fit.coefficients[at], self.q)

    def cancelling(self, fit: Fit, least: float, nonlinear: bool = True) -> tuple[int, ...]:
        """The indices of effects with a number whose contribution exceeds what it takes away, given all
        other numbers of the effects, by more than a factor: it cancels against others, and the record
        determines only their difference. Contributions with squares under `least` do not count.
        """
        effects = [k for k in fit.identified if np.any(fit.coefficients[k])]
        if not effects:
            return ()
        numbers = np.concatenate([fit.coefficients[k] for k in effects])
        owners = np.repeat(effects, [len(fit.coefficients[k]) for k in effects])[numbers != 0.0]
        whole = np.hstack([self.white(fit.members[k]) for k in effects])[:, numbers != 0.0]
        columns = project_out(whole, self.q)
        size = np.linalg.norm(columns, axis=0)
        moving = size > np.sqrt(GONE) * np.linalg.norm(whole, axis=0)
        columns, owners = columns[:, moving] / size[moving], owners[moving]
        gram = columns.T @ columns + GONE * np.eye(len(owners))
        large = (numbers[numbers != 0.0][moving] * size[moving]) ** 2 > least
        inflated = []
        for at, owner in enumerate(owners):  # sizes that have one sign do not cancel each other
            united = fit.members[owner].candidate.effect.together > 1
            kept = np.flatnonzero((owners != owner) | (np.arange(len(owners)) == at) | (not united))
            inflated.append(np.diag(np.linalg.inv(gram[np.ix_(kept, kept)]))[kept == at][0])
        bad = large & (np.array(inflated) > MAX_CONTRIBUTION**2)
        sized = [
            k
            for k in effects
            if nonlinear and fit.members[k].candidate.is_nonlinear and self._takes_too_little(fit, k, least)
        ]
        return tuple(dict.fromkeys([*(int(k) for k in owners[bad]), *sized]))

    def _takes_too_little(self, fit: Fit, at: int, least: float) -> bool:
        """The same of an effect whose size is no coefficient, hence not the best one beside these others."""
        contributed = float(np.sum(self.contribution(fit, at) ** 2))
        taken = self.fit(fit.without(at)).rss - fit.rss
        return contributed > max(least, MAX_CONTRIBUTION**2 * taken)

    def disagreeing(self, fit: Fit) -> tuple[int, ...]:
        """The index of the effect that contributes most, where its size is another one in some kind of rows
        and has to be one number: by more than `APART` of itself, and by more than `SURE` standard errors. The
        sizes of smaller effects contain the errors of form of that one, and are not compared.
        """
        largest = max(fit.identified, key=lambda k: float(np.linalg.norm(self.contribution(fit, k))), default=None)
        return () if largest is None or not self._disagrees(fit, largest) else (largest,)

    def _disagrees(self, fit: Fit, at: int) -> bool:
        member = fit.members[at]
        kinds = self.columns.kinds_of_rows(member.candidate.effect) if member.candidate.is_nonlinear else None
        if kinds is None:
            return False
        ends = [{name: size * value for name, value in member.shape.items()} for size in (1.0 - MOVED, 1.0 + MOVED)]
        low, high = (self.columns.total(member.candidate, end) for end in ends)
        slope = (high - low) / (2.0 * MOVED)
        parts = np.column_stack([np.where(kinds == kind, slope, 0.0) for kind in np.unique(kinds)])
        others = self.spanned([other for k, other in enumerate(fit.members) if k != at])
        columns = project_out(self.space.whiten(parts), others)
        inverse = np.linalg.pinv(columns.T @ columns, rcond=GONE)
        sizes = inverse @ (columns.T @ fit.residual)
        scale = max(1.0, fit.rss / max(self.space.count, 1))
        variance = scale * (np.diag(inverse)[:, None] + np.diag(inverse)[None, :] - 2.0 * inverse)
        apart = np.abs(sizes[:, None] - sizes[None, :])
        return bool((apart > np.maximum(APART, SURE * np.sqrt(np.maximum(variance, 0.0)))).any())

    def fit(self, members: Sequence[Member]) -> Fit:
        """The fit of these members, their nonlinear parameters as they are."""
        parts = [self.white(member) for member in members]
        x = np.hstack([self.base, *parts])

        def computed() -> tuple[Array]:
            norms = np.linalg.norm(x, axis=0)
            size = np.where(norms > 0.0, norms, 1.0)  # of a column of zeros any number would do
            low, high = self._bounds(members)
            coefficients, *_ = np.linalg.lstsq(x / size, self.y, rcond=1e-9)
            coefficients = coefficients / size
            if (coefficients < low).any() or (coefficients > high).any():
                q, r = np.linalg.qr(x / size)
                ends = (low * size, high * size)
                coefficients = scipy.optimize.lsq_linear(r, q.T @ self.y, ends, method="bvls").x / size
            return (coefficients,)

        (coefficients,) = recall_arrays(("fit", *(member.key for member in members), self.y), computed)
        residual = self.y - x @ coefficients
        sizes = [part.shape[1] for part in parts]
        split = np.split(coefficients, np.cumsum([self.base.shape[1], *sizes])[:-1])
        rss = float(residual @ residual)
        price = sum(member.candidate.price(self.penalty) for member in members)
        return Fit(tuple(members), rss, rss + price, tuple(split[1:]), split[0], residual)

    def _bounds(self, members: Sequence[Member]) -> tuple[Array, Array]:
        free = np.full(self.base.shape[1], np.inf)
        ends = [member.candidate.bounds for member in members]
        low = np.concatenate([-free, *(low for low, _ in ends)])
        return low, np.concatenate([free, *(high for _, high in ends)])

    def refined(self, members: Sequence[Member]) -> Fit:
        """The fit with the nonlinear parameters of each member fitted as well, in turn, twice."""
        key = tuple(member.key for member in members)
        if key not in self._refined:
            refined = list(members)
            for _ in range(2 if len(refined) > 1 else 1):
                for at, member in enumerate(refined):
                    if member.shape:
                        refined[at] = self.shaped(refined, at)
            self._refined[key] = self.fit(refined)
        return self._refined[key]

    def shaped(self, members: Sequence[Member], at: int) -> Member:
        """A member with its nonlinear parameters fitted given the others; the better of two forms."""
        q = self.spanned([member for k, member in enumerate(members) if k != at])
        residual = project_out(self.y, q)
        return ranked([self._shaped(form, q, residual) for form in members[at].forms], lambda shaped: shaped[1])[0][0]

    def _shaped(self, member: Member, q: Array, residual: Array) -> tuple[Member, float]:
        """A member with its nonlinear parameters fitted to a residual (N,) orthogonal to q (N, r),
        and the decrease of its sum of squares.
        """
        candidate = member.candidate
        free = [parameter for parameter in candidate.shape if not parameter.choices]
        if not free:
            return member, 0.0
        start = np.array([member.shape[parameter.name] for parameter in free])
        scale = np.array([parameter.scale(value) for parameter, value in zip(free, start, strict=True)])
        low, high = np.array([(parameter.low, parameter.high) for parameter in free]).T

        def shape(x: Array) -> dict[str, float]:
            values = np.clip(start + x * scale, low, high)
            named = {parameter.name: float(v) for parameter, v in zip(free, values, strict=True)}
            return {**member.shape, **named}

        def loss(x: Array) -> float:
            columns = self.space.whiten(self.columns.of(candidate, shape(x)))
            projected = q.T @ columns
            losses.append(-_gain(candidate, columns.T @ columns - projected.T @ projected, columns.T @ residual))
            return losses[-1]

        def computed() -> tuple[Array, Array]:
            losses.clear()
            simplex = np.vstack([np.zeros(len(free)), 0.5 * np.eye(len(free))])  # half a cell of the grid
            best = scipy.optimize.minimize(
                loss,
                simplex[0],
                method="Nelder-Mead",
                options={"maxiter": 40 * len(free), "xatol": 0.01, "fatol": 0.01, "initial_simplex": simplex},
            )
            return np.asarray(best.x), np.array([losses[0], best.fun])

        losses: list[float] = []
        x, (first, least) = recall_arrays(("shape", *member.key, residual), computed)
        if least >= first:  # no better than the start
            return member, -float(first)
        return Member(candidate, shape(x)), -float(least)


def _gain(candidate: Candidate, gram: Array, product: Array) -> float:
    """Decrease of a squared residual by bounded columns with these products (m, m) and (m,)."""
    if candidate.is_nonlinear:
        return float(2.0 * product[0] - gram[0, 0])
    ridge = 1e-9 * np.trace(gram) + 1e-300
    coefficients = np.clip(np.linalg.solve(gram + ridge * np.eye(len(gram)), product), *candidate.bounds)
    return float(2.0 * coefficients @ product - coefficients @ gram @ coefficients)
