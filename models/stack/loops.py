"""Closed vector loops: chains of links that end where they begin, solved for their unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...section import Array
from ..expressions import Formula, Intermediate, Slopes, UnsettledError, domain_margin

ITERATIONS = 8
"""Newton steps from a predicted start; two to four are usual."""
CLOSED = 1e-9
"""Gap of a closed loop before its last Newton step, as a fraction of its links: that step, by
quadratic convergence, leaves rounding alone."""
STAGES = 8
"""Stages from the mid-limits to a unit that Newton does not reach in one."""
HALVINGS = 20
"""Bisections for how far from the mid-limits a loop can be closed."""
FAR = 1e100
"""Gap that stands for one without a value while the start is improved."""
SINGULAR = 1e-5
"""Least singular value of the closure, per unit of each unknown's effect, from which the unknowns
do not follow from the parts."""


@dataclass(frozen=True)
class Loops(Intermediate):
    """Unknowns u of closed loops in parts x, in which the links of each loop sum to 0 along every axis.

        r_a(x, u) = sum_i length_i direction_ia = 0,    du/dx = -(dr/du)^-1 dr/dx.

    `equations` holds, for each axis of each loop, what the links add to r_a; `sources` every formula
    of a length, an angle or a direction with its place, `loops` the place and number of links of each
    loop. There are as many unknowns as equations. `start` is near the assembly mode that is meant:
    units are of the same mode, the branch of solutions on which dr/du does not become singular. A
    unit that has no such solution has the unknowns NaN.

    Reference: Chase, Gao & Magleby (1995), General 2-D tolerance analysis of mechanical assemblies
    with small kinematic adjustments, J. Design and Manufacturing 5(4), 263-274 (the linear model).
    """

    assembles = True

    unknowns: tuple[str, ...]
    start: tuple[float, ...]
    equations: tuple[tuple[Formula, ...], ...]
    sources: tuple[tuple[str, Formula], ...]
    loops: tuple[tuple[str, int], ...]
    middle: Mapping[str, float] = field(default_factory=dict, compare=False, repr=False)
    at_middle: Array = field(default_factory=lambda: np.empty(0), compare=False, repr=False)

    @property
    def place(self) -> str:
        return ", ".join(place for place, _ in self.loops)

    @property
    def names(self) -> tuple[str, ...]:
        return self.unknowns

    @property
    def inputs(self) -> Mapping[str, int]:
        return self._inputs

    @cached_property
    def _inputs(self) -> Mapping[str, int]:
        names = (name for terms in self.equations for term in terms for name in term.names)
        return {name: 1 for name in names if name not in self.unknowns}

    @cached_property
    def inner(self) -> tuple[Intermediate, ...]:  # type: ignore[override]
        return tuple(dict.fromkeys(step for terms in self.equations for term in terms for step in term.given))

    @property
    def kinked(self) -> bool:
        return any(term.kinked for terms in self.equations for term in terms)

    def degree(self, of: Mapping[str, float]) -> float:
        return np.inf if self.inputs else 0.0

    # ---------------------------------------------------------------- the unknowns

    def values(self, x: Mapping[str, Array]) -> dict[str, Array]:
        flat, shape = self._flat(x)
        u = self._solved(flat)
        return {name: row.reshape(shape) for name, row in zip(self.unknowns, u, strict=True)}

    def slopes(self, x: Mapping[str, Array]) -> dict[str, Slopes]:
        """By the implicit function theorem, at the unknowns that `x` holds."""
        flat, shape = self._flat(x)
        u = np.array([np.broadcast_to(x[name], shape).ravel() for name in self.unknowns])
        names = list(self.inputs)
        _, by = self._closure(flat, u, (*self.unknowns, *names))
        m = len(self.unknowns)
        slopes = -_divided(by[:, :, :m], by[:, :, m:])
        return {
            name: {origin: slopes[:, i, k].reshape(shape) for k, origin in enumerate(names)}
            for i, name in enumerate(self.unknowns)
        }

    def _flat(self, x: Mapping[str, Array]) -> tuple[dict[str, Array], tuple[int, ...]]:
        """The inputs (n,), and the shape that they have together."""
        shape = np.broadcast_shapes(*(np.shape(x[name]) for name in self.inputs))
        return {name: np.broadcast_to(x[name], shape).ravel() for name in self.inputs}, shape

    def _solved(self, x: Mapping[str, Array]) -> Array:
        """The unknowns (m, n) at inputs (n,); NaN where the loops cannot be closed."""
        n = len(next(iter(x.values()))) if x else 1
        u, closed = self._newton(x, self._predicted(x, n))
        if len(rest := np.flatnonzero(~closed)):
            away = {name: value[rest] for name, value in x.items()}
            last, reached = self._followed(away)
            u[:, rest] = np.where(reached == 1.0, last, np.nan)
        return u

    def _followed(self, x: Mapping[str, Array]) -> tuple[Array, Array]:
        """The fraction (n,) of the way from the mid-limits up to which the loops stay closed, in
        stages, and the unknowns (m, n) there.
        """
        n = len(next(iter(x.values())))
        last, reached = np.repeat(self.at_middle[:, None], n, axis=1), np.zeros(n)
        rows = np.arange(n)
        for fraction in np.linspace(0.0, 1.0, STAGES + 1)[1:]:
            ahead = self._between({name: value[rows] for name, value in x.items()}, fraction)
            u, closed = self._newton(ahead, last[:, rows])
            rows = rows[closed]
            last[:, rows], reached[rows] = u[:, closed], fraction
        return last, reached

    def _between(self, x: Mapping[str, Array], fraction: Array | float) -> dict[str, Array]:
        """Inputs at a fraction of the way from the mid-limits."""
        return {name: self.middle[name] + fraction * (value - self.middle[name]) for name, value in x.items()}

    def _predicted(self, x: Mapping[str, Array], n: int) -> Array:
        """The unknowns (m, n) to first order about the mid-limits."""
        u = np.repeat(self.at_middle[:, None], n, axis=1)
        for k, name in enumerate(self.inputs):
            u += self._advance[:, k, None] * (x[name] - self.middle[name])
        return u

    @cached_property
    def _advance(self) -> Array:
        """du/dx (m, inputs) at the mid-limits."""
        x = {name: np.asarray(value) for name, value in self.middle.items()}
        own = {name: np.asarray(value) for name, value in zip(self.unknowns, self.at_middle, strict=True)}
        slopes = self.slopes(x | own)
        rows = [[float(slopes[name][origin]) for origin in self.inputs] for name in self.unknowns]
        return np.array(rows).reshape(len(self.unknowns), len(self.inputs))

    @cached_property
    def _determinant(self) -> float:
        """That of dr/du at the mid-limits: its sign is that of the assembly mode."""
        x = {name: np.array([value]) for name, value in self.middle.items()}
        return float(np.linalg.det(self._closure(x, self.at_middle[:, None], self.unknowns)[1])[0])

    def _newton(self, x: Mapping[str, Array], u: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Unknowns (m, n) from a start, and whether they close the loops in the assembly mode (n,)."""
        u, closed = u.copy(), np.zeros(u.shape[1], dtype=bool)
        rows = np.arange(u.shape[1])
        with np.errstate(all="ignore"):
            for _ in range(ITERATIONS):
                near = {name: value[rows] for name, value in x.items()}
                gap, by = self._closure(near, u[:, rows], self.unknowns)
                u[:, rows] -= _divided(by, gap.T[:, :, None])[:, :, 0].T
                done = np.max(np.abs(gap), axis=0) <= CLOSED * self._size
                if np.any(done):
                    sides = np.linalg.det(by[done]) * self._determinant
                    closed[rows[done]] = (sides > 0.0) & np.all(np.isfinite(u[:, rows[done]]), axis=0)
                rows = rows[~done & np.all(np.isfinite(u[:, rows]), axis=0)]
                if not len(rows):
                    break
        return u, closed

    def _closure(self, x: Mapping[str, Array], u: Array, by: tuple[str, ...]) -> tuple[Array, Array]:
        """The gaps r (m, n) at unknowns (m, n), and their derivatives (n, m, len(by))."""
        whole = {**x, **dict(zip(self.unknowns, u, strict=True))}
        gap, slopes = np.zeros(u.shape), np.zeros((u.shape[1], len(self.equations), len(by)))
        for a, terms in enumerate(self.equations):
            for term in terms:
                value, partial = term.dual(whole, by)
                gap[a] += value
                for k, name in enumerate(by):
                    if name in partial:
                        slopes[:, a, k] += partial[name]
        return gap, slopes

    @cached_property
    def _size(self) -> float:
        """The length of the links at the mid-limits, in all."""
        x = {name: np.asarray(value) for name, value in self.middle.items()}
        x |= {name: np.asarray(value) for name, value in zip(self.unknowns, self.at_middle, strict=True)}
        return float(sum(np.abs(term.value(x)) for terms in self.equations for term in terms))

    # ---------------------------------------------------------------- the assembly mode

    def settled(self, nominals: Mapping[str, Array], middle: Mapping[str, Array]) -> Loops:
        """The loops at the assembly mode that the start is near, at the nominals and mid-limits.

        Raises UnsettledError where they cannot be closed, or the unknowns do not follow from the parts.
        """
        first, last = ({name: float(x[name]) for name in self.inputs} for x in (nominals, middle))
        begun = {
            name: np.array([value]) for name, value in (*first.items(), *zip(self.unknowns, self.start, strict=True))
        }
        troubles = [(place, why) for place, formula in self.sources if (why := formula.trouble(begun))]
        if troubles:
            text = "has no value at the nominal sizes and the start"
            raise UnsettledError(*((place, f"{text}: {why}") for place, why in troubles))
        anchored = replace(self, middle=first, at_middle=self._closest(first))
        anchored.require_closed()
        at_middle = anchored._solved({name: np.array([value]) for name, value in last.items()})[:, 0]
        if not np.all(np.isfinite(at_middle)):
            text = "is closed at the nominal sizes but cannot be closed at the mid-limits: correct the lengths"
            raise UnsettledError((self.place, text))
        return replace(self, middle=last, at_middle=at_middle)

    def _closest(self, x: Mapping[str, float]) -> Array:
        """The unknowns (m,) of the smallest gaps, from the start."""
        from scipy.optimize import least_squares

        at = {name: np.array([value]) for name, value in x.items()}

        def finite(values: Array) -> Array:
            return np.asarray(np.nan_to_num(values, nan=FAR, posinf=FAR, neginf=-FAR))

        def gaps(u: Array) -> Array:
            return finite(self._closure(at, u[:, None], self.unknowns)[0][:, 0])

        def slopes(u: Array) -> Array:
            return finite(self._closure(at, u[:, None], self.unknowns)[1][0])

        start = np.array(self.start)
        with np.errstate(all="ignore"):
            found = least_squares(gaps, start, slopes, method="lm", x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
        return np.asarray(found.x)

    def require_closed(self) -> None:
        """Raises UnsettledError where the loops are open, or singular, at the nominal sizes."""
        x = {name: np.array([value]) for name, value in self.middle.items()}
        gap, by = self._closure(x, self.at_middle[:, None], self.unknowns)
        found = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.unknowns, self.at_middle, strict=True))
        open_loops = []
        for (place, links), own in zip(self.loops, np.split(gap[:, 0], len(self.loops)), strict=True):
            if np.max(np.abs(own)) > CLOSED * self._size:
                by_axis = ", ".join(f"{axis} {value:.4g}" for axis, value in zip("xyz", own, strict=False))
                text = (
                    f"cannot be closed at the nominal sizes: the joint of link[{links - 1}] and link[0] stays open by "
                    f"{np.linalg.norm(own):.4g} ({by_axis}) at {found}, the nearest to the start; correct the lengths, "
                    "the angles or the start"
                )
                open_loops.append((place, text))
        if open_loops:
            raise UnsettledError(*open_loops)
        scaled = by[0] / np.maximum(np.linalg.norm(by[0], axis=0), 1e-300)
        if np.linalg.svd(scaled, compute_uv=False)[-1] < SINGULAR:
            text = (
                f"is at a dead centre at the nominal sizes ({found}): the unknowns do not follow from the parts there; "
                "choose other unknowns, or other nominal sizes"
            )
            raise UnsettledError((self.place, text))

    # ---------------------------------------------------------------- where there are none

    def trouble(self, x: Mapping[str, Array]) -> str:
        if not all(np.all(np.isfinite(x[name])) for name in self.unknowns):
            return "the loop cannot be closed for some units"
        return next((f"{place}: {why}" for place, formula in self.sources if (why := formula.trouble(x))), "")

    def margin(self, x: Mapping[str, Array], middle: Mapping[str, Array]) -> Array:
        """The square of det(dr/du), relative to that at the middle: 0 where two assembly modes meet.

        Of a unit that cannot be closed, the fraction of the way from the mid-limits at which it
        opens, minus 1.
        """
        flat, shape = self._flat(x)
        u = np.array([np.broadcast_to(x[name], shape).ravel() for name in self.unknowns])
        closed = np.all(np.isfinite(u), axis=0)
        with np.errstate(invalid="ignore"):
            margin = (np.linalg.det(self._closure(flat, u, self.unknowns)[1]) / self._determinant) ** 2
        if len(rest := np.flatnonzero(~closed)):
            away = {name: value[rest] for name, value in flat.items()}
            last, low = self._followed(away)
            high = low + 1.0 / STAGES
            for _ in range(HALVINGS):
                half = 0.5 * (low + high)
                ahead, reached = self._newton(self._between(away, half), last)
                last = np.where(reached, ahead, last)
                low, high = np.where(reached, half, low), np.where(reached, high, half)
            margin[rest] = low - 1.0
        own = margin.reshape(shape)
        for _, formula in self.sources:
            own = np.asarray(np.fmin(own, domain_margin(formula, x, middle)))
        return np.asarray(own)


def _divided(matrices: Array, right: Array) -> Array:
    """Solutions (n, m, k) of n linear systems; NaN where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, right), dtype=np.float64)
    except np.linalg.LinAlgError:
        singular = np.linalg.det(matrices) == 0.0
        solved = np.linalg.solve(np.where(singular[:, None, None], np.nan, matrices), right)
        return np.asarray(solved, dtype=np.float64)
