"""Yields and half-widths on a sample of which one piece is integrated exactly, with derivatives.

For each unit of all other pieces, the requirement rises or falls with piece i: it is within its limits
between two values of z_i, whose probability is that of the law of z_i (conditional Monte Carlo, Asmussen
& Glynn 2007, ch. V.4). The estimate is smooth in the tolerances, and far more accurate than a count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ...section import Array
from ..inputs import Distribution
from .mechanism import Mechanism, Sample, Tolerances, mean_of, spread_of

NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(5) / 4.0)
"""Values of z_i at which a formula is evaluated, as fractions of the range of z_i."""
CELLS, TAIL = 8192, 1e-8
"""Cells of a table of probabilities, and the probability beyond its ends."""
REACH = 1e-4
"""Probability beyond either end of a piece's reach, by which pieces are compared."""
TRIED = 3
"""Pieces that are tried for a design at most."""
CLOSE, SECANTS = 1e-8, 12
"""Fraction of a requirement's range by which it may miss a limit, and steps to get there."""
STEPS, FIRST, NEAR = 60, 0.02, 1e-8
"""Steps to a quantile, the first one, and the last, as fractions of the range of the requirement."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """P(z <= edge) at evenly spaced edges."""

    low: float
    step: float
    below: Array

    def at(self, z: Array) -> tuple[Array, Array]:
        """Probability up to z and density there, between the edges in a line."""
        place = np.clip((z - self.low) / self.step, 0.0, len(self.below) - 1.0)
        row = np.minimum(place.astype(np.int64), len(self.below) - 2)
        left, right = self.below[row], self.below[row + 1]
        inside = (place > 0.0) & (place < len(self.below) - 1.0)
        return left + (place - row) * (right - left), np.where(inside, (right - left) / self.step, 0.0)


@lru_cache(maxsize=64)
def cells_of(law: Distribution) -> Cells:
    """The table of a distribution."""
    low, high = (float(z) for z in law.quantile(np.array([TAIL, 1.0 - TAIL])))
    edges = np.linspace(low, high, CELLS + 1)
    below = np.asarray(law.partial_moments(edges)[0])
    below[0], below[-1] = 0.0, 1.0
    return Cells(low, (high - low) / CELLS, below)


@dataclass(frozen=True, eq=False)
class Conditioned:
    """Requirements that all depend on the same independent pieces; tolerances of one design (p,).

    A piece can be integrated where every unit rises, or every unit falls, throughout the range of z_i.
    Estimates are None for a design without such a piece among the `TRIED` of the largest shares.
    """

    mechanisms: tuple[Mechanism, ...]
    sample: Sample

    @cached_property
    def _z(self) -> Array:
        """All units (k, m)."""
        deviations = self.sample.deviations
        return np.ascontiguousarray(np.moveaxis(deviations, 0, 1).reshape(deviations.shape[1], -1))

    @cached_property
    def _scales(self) -> Array:
        """Reach of each requirement by each piece (r, k), per unit of spread: the piece of the longest
        tails makes the tails of the sum. 0 for a component of a place that is not independent of the other.
        """
        ends = np.array([law.quantile(np.array([REACH, 1.0 - REACH])) for law in self.mechanisms[0].inputs])
        slopes = np.array([mechanism.sensitivities for mechanism in self.mechanisms])
        for disc in (disc for disc in self.mechanisms[0].discs if disc.dependent):
            slopes[:, list(disc.pieces)] = 0.0
        return np.asarray(np.abs(slopes) * 0.5 * np.ptp(ends, axis=1)[self.mechanisms[0].owners])

    def _shares(self, t: Tolerances) -> Array:
        """Reach of each requirement by each piece (r, k)."""
        return np.asarray(self._scales * spread_of(t)[0][self.mechanisms[0].owners])

    def _tried(self, shares: Array) -> list[int]:
        """The pieces of the largest shares (k,), that there are."""
        return [at for at in np.argsort(-shares, kind="stable")[:TRIED].tolist() if shares[at] > 0.0]

    def within(self, t: Tolerances) -> Array | None:
        """Fraction of units (replicates,) that keep all limits."""
        shares = self._shares(t)
        total = np.sqrt(np.sum(shares**2, axis=1, keepdims=True))
        part = shares / np.where(total > 0.0, total, 1.0)
        least = np.min(part, axis=0)
        tried = self._tried(least if np.any(least > 0.0) else np.max(part, axis=0))
        return next((kept for at in tried if (kept := self._within(t, at)) is not None), None)

    def _within(self, t: Tolerances, at: int) -> Array | None:
        """`within` by one piece."""
        z, (replicates, _, units) = self._z, self.sample.deviations.shape
        cells = cells_of(self.mechanisms[0].inputs[self.mechanisms[0].owner[at]])
        low, high = np.zeros(z.shape[1]), np.ones(z.shape[1])
        for mechanism in self.mechanisms:
            if not _depends_on_piece(mechanism, at):
                y = mechanism.values(t, z)[0]
                high = np.where(mechanism.conforms(y), high, 0.0)
                continue
            course = Course.of(mechanism, t, z, at, cells)
            if course is None:
                return None
            for limit in (mechanism.lower, mechanism.upper):
                edge = course.reached(limit) if np.isfinite(limit) else None
                if edge is None and np.isfinite(limit):
                    return None
                if edge is not None and (limit == mechanism.upper) == course.rising:
                    high = np.minimum(high, cells.at(edge)[0])
                elif edge is not None:
                    low = np.maximum(low, cells.at(edge)[0])
        return np.asarray(np.maximum(high - low, 0.0).reshape(replicates, units).mean(axis=1))

    def within_slopes(self, t: Tolerances) -> Array | None:
        """Derivatives (p,) of the fraction of units that keep all limits.

        Each limit by the piece of the largest share in its requirement.
        """
        shares, z = self._shares(t), self._z
        slopes = np.zeros(spread_of(t).shape[1])
        for row, mechanism in enumerate(self.mechanisms):
            others = [other for other in self.mechanisms if other is not mechanism]
            for limit, sign in ((mechanism.lower, -1.0), (mechanism.upper, 1.0)):
                if not np.isfinite(limit):
                    continue
                tried = self._tried(shares[row])
                edge = next((e for at in tried if (e := _edge(mechanism, t, z, at, limit)) is not None), None)
                if edge is None:
                    return None
                kept = np.ones(z.shape[1], dtype=bool)
                for other in others:
                    y = other.values(t, edge[0])[0]
                    kept &= (y >= other.lower) & (y <= other.upper)
                slopes += sign * np.mean(edge[1] * kept, axis=1)
        return slopes

    def half_width(self, t: Tolerances, coverage: float) -> float | None:
        """Half the width of the interval that holds `coverage` of the units, with equal tails."""
        course = self._course(t)
        ends = [] if course is None else [course.quantile(p) for p in (0.5 - 0.5 * coverage, 0.5 + 0.5 * coverage)]
        return None if len(ends) < 2 or None in ends else 0.5 * (float(ends[1] or 0.0) - float(ends[0] or 0.0))

    def half_width_slopes(self, t: Tolerances, coverage: float) -> Array | None:
        """Derivatives (p,) of the half-width."""
        course, slopes = self._course(t), np.zeros(spread_of(t).shape[1])
        for sign, p in ((-0.5, 0.5 - 0.5 * coverage), (0.5, 0.5 + 0.5 * coverage)):
            level = None if course is None else course.quantile(p)
            edge = None if course is None or level is None else _edge(course.mechanism, t, course.z, course.at, level)
            if edge is None:
                return None
            slopes -= sign * np.mean(edge[1], axis=1) / max(float(np.mean(edge[2])), 1e-300)
        return slopes

    def _course(self, t: Tolerances) -> Course | None:
        """The first requirement along the piece of the largest share in it."""
        mechanism = self.mechanisms[0]
        for at in self._tried(self._shares(t)[0]):
            cells = cells_of(mechanism.inputs[mechanism.owner[at]])
            if (course := Course.of(mechanism, t, self._z, at, cells)) is not None:
                return course
        return None


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A requirement of one design along piece `at`, for units z (k, m): y (nodes, m) at `nodes` of z_i.

    `weight` (nodes, m) are Newton's divided differences of z_i by y.
    """

    mechanism: Mechanism
    t: Tolerances
    z: Array
    at: int
    cells: Cells
    nodes: Array
    y: Array
    weight: Array

    @classmethod
    def of(cls, mechanism: Mechanism, t: Tolerances, z: Array, at: int, cells: Cells) -> Course | None:
        """None where the requirement does not rise or fall throughout."""
        nodes = cells.low + cells.step * CELLS * NODES
        y = np.array([mechanism.values(t, _with_piece_value(z, at, node))[0] for node in nodes])
        steps = np.diff(y, axis=0)
        if not (np.all(steps > 0.0) or np.all(steps < 0.0)):
            return None
        weight = np.repeat(nodes[:, None], y.shape[1], axis=1)
        for order in range(1, len(nodes)):
            weight[order:] = (weight[order:] - weight[order - 1 : -1]) / (y[order:] - y[:-order])
        return cls(mechanism, t, z, at, cells, nodes, y, weight)

    @property
    def rising(self) -> bool:
        """Whether y rises with z_i."""
        return bool(self.y[-1, 0] > self.y[0, 0])

    def interpolated(self, level: float) -> Array:
        """z_i (m,) at which y is a level, by inverse interpolation, within the range of z_i."""
        away = level - self.y
        z = self.weight[-1]
        for difference, weight in zip(away[-2::-1], self.weight[-2::-1], strict=True):
            z = weight + difference * z
        z = np.clip(z, self.nodes[0], self.nodes[-1])
        below, above = (away[0] < 0.0, away[-1] > 0.0) if self.rising else (away[0] > 0.0, away[-1] < 0.0)
        return np.asarray(np.where(below, self.nodes[0], np.where(above, self.nodes[-1], z)))

    def reached(self, level: float) -> Array | None:
        """z_i (m,) at which y is a level, by the secant method; None where it is missed by more than `CLOSE`."""
        z = self.interpolated(level)
        inner = (z > self.nodes[0]) & (z < self.nodes[-1])
        span = self.y[-1] - self.y[0]
        slope = span / (self.nodes[-1] - self.nodes[0])
        miss = self._miss(z, level, inner)
        for _ in range(SECANTS):
            if np.all(np.abs(miss) <= CLOSE * np.abs(span)):
                return z
            moved = np.clip(z - miss / slope, self.nodes[0], self.nodes[-1])
            after = self._miss(moved, level, inner)
            changed = (moved != z) & (after != miss)
            slope = np.where(changed, (after - miss) / np.where(changed, moved - z, 1.0), slope)
            z, miss = moved, after
        return None

    def _miss(self, z: Array, level: float, inner: NDArray[np.bool_]) -> Array:
        """By how much (m,) y exceeds a level at z_i, 0 for units that do not reach it."""
        return np.where(inner, self.mechanism.values(self.t, _with_piece_value(self.z, self.at, z))[0] - level, 0.0)

    def below(self, z: Array) -> float:
        """P(y <= level) of z_i (m,) at which y is that level."""
        probability = float(np.mean(self.cells.at(z)[0]))
        return probability if self.rising else 1.0 - probability

    def quantile(self, p: float) -> float | None:
        """The level that a fraction p of the units does not exceed, by secants and bisection."""
        ends = float(self.y.min()), float(self.y.max())
        (low, high), span = ends, ends[1] - ends[0]
        level = float(np.quantile(self.mechanism.values(self.t, self.z)[0], p))
        shift, rise, before, known = 0.0, 0.0, level, 0.0
        for _ in range(STEPS):
            interpolated = self.below(self.interpolated(level))
            excess = interpolated + shift - p
            low, high = (low, level) if excess >= 0.0 else (level, high)
            if level != before:
                rise = (interpolated - known) / (level - before)
            step = excess / rise if rise > 0.0 else excess / min(p, 1.0 - p) * FIRST * span
            moved = level - step if low < level - step < high else 0.5 * (low + high)
            if abs(step) <= NEAR * span:
                exact = None if shift else self.reached(level)
                if exact is None:
                    return level - step if shift else None
                shift, (low, high) = self.below(exact) - interpolated or np.finfo(float).tiny, ends
                continue
            before, known, level = level, interpolated, moved
        return level


def _edge(mechanism: Mechanism, t: Tolerances, z: Array, at: int, level: float) -> tuple[Array, Array, Array] | None:
    """Units z (k, m) moved along piece `at` to where y is a level; what each adds to the derivatives
    (p, m) of P(y <= level), and to the density of y there (m,).
    """
    cells = cells_of(mechanism.inputs[mechanism.owner[at]])
    course = Course.of(mechanism, t, z, at, cells)
    edge = None if course is None else course.reached(level)
    if course is None or edge is None:
        return None
    moved = _with_piece_value(z, at, edge)
    by_part, by_piece = _slopes(mechanism, t, moved, at)
    density = cells.at(edge)[1] / np.maximum(np.abs(by_piece), 1e-300)
    return moved, -by_part * density, density


def _slopes(mechanism: Mechanism, t: Tolerances, z: Array, at: int) -> tuple[Array, Array]:
    """Derivatives of y (p, m) by the tolerances of one design, and (m,) by piece `at`."""
    s = spread_of(t)[0]
    by_piece = _gradient(mechanism, t, z)
    by_part = np.zeros((len(s), z.shape[1]))
    np.add.at(by_part, mechanism.owners, by_piece * z)
    return by_part, by_piece[at] * s[mechanism.owner[at]]


def _gradient(mechanism: Mechanism, t: Tolerances, z: Array) -> Array:
    """Derivatives of y by the deviations of the pieces (k, m), each in the unit of its part."""
    if mechanism.formula is None:
        return np.broadcast_to(mechanism.sensitivities[:, None], z.shape)
    formula, mids, scale = mechanism.stated
    reach = (spread_of(t)[0][mechanism.owners] * scale)[:, None] * z
    middle = mids + scale * mean_of(t)[0][mechanism.owners]
    x = {name: middle[i] + reach[i] for i, name in enumerate(mechanism.names)}
    slopes = formula.gradient({name: x[name] for name in formula.names})
    rows = [np.broadcast_to(slopes.get(name, np.asarray(0.0)), z.shape[1:]) for name in mechanism.names]
    return np.asarray(mechanism.gain * np.array(rows) * scale[:, None])


def _depends_on_piece(mechanism: Mechanism, at: int) -> bool:
    """Whether y depends on a piece, though its slope at the mid-limits may be 0."""
    if mechanism.formula is None:
        return bool(mechanism.sensitivities[at] != 0.0)
    return mechanism.names[at] in mechanism.formula.names


def _with_piece_value(z: Array, at: int, value: Array | float) -> Array:
    """Units with another value of one piece."""
    moved = z.copy()
    moved[at] = value
    return moved


def condition_on_piece(mechanisms: Sequence[Mechanism], sample: Sample) -> Conditioned | None:
    """The requirements, with a piece integrated; None where pieces are correlated or matched."""
    correlated = any(mechanism.correlation is not None or mechanism.matches for mechanism in mechanisms)
    return None if correlated else Conditioned(tuple(mechanisms), sample)
