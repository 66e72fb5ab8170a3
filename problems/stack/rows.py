"""The rows of the convex form of a stack: variations, half-widths and yields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr, ndtri

from ...models.capability.knowledge import Surplus, divide_or_default
from ...models.roots import bracketed_roots
from ...models.stack.mechanism import SIGMAS, Law
from ...section import Array, Flags
from ..forms import Piece, Quantile
from ..settings import ASSURED, PLUG_IN, PROMISED, YIELD
from .outputs import VARIATIONS
from .promises import WINDOW, Measured

if TYPE_CHECKING:
    from .problem import Stack

# Two limits about a mean that moves, as limits of straight lines.
#
# A normal deviation with the mean m and the standard deviation s keeps -T and T with the probability
# P where s <= s(|m|), Phi((T - m)/s) + Phi((T + m)/s) - 1 = P. The curve s falls from T/z((1 + P)/2)
# at m = 0 towards (T - |m|)/z(P); it is concave, so that its tangents
#
#     side m + z s <= room,    z = -1/s'(d),    room = d + z s(d)
#
# lie above it, and what breaks one of them breaks P. Concavity is tried at `TRIED` points for every
# P. The line at m = 0 holds for every deviation that is even and unimodal about its mean: none keeps
# more of it between two limits than when these are even about the mean (Anderson 1955, The integral
# of a symmetric unimodal function, Proc. American Mathematical Society 6(2), 170-176).


AT = np.array([0.1, 0.21, 0.35, 0.55])
"""Means, in standard deviations, at which tangents are drawn: at P = 0.9973 s is then at most
0.14 % too large, at 0.99 0.18 %."""
FAR, TRIED = 6.0, 65
"""Means, in standard deviations, up to which the curve is tried, and at how many."""


def tangents(p: float) -> tuple[tuple[float, float], ...]:
    """Factors z and rooms, in units of T, of tangents of the curve at the probability p > 1/2.

    None where the curve is not concave at the points that are tried.
    """
    slopes = _curve(p, np.linspace(0.0, FAR, TRIED))[2]
    if not np.all(np.diff(slopes) <= 1e-9):
        return ()
    d, s, slope = _curve(p, AT)
    z = -1.0 / slope
    return tuple(zip(z.tolist(), (d + z * s).tolist(), strict=True))


def _curve(p: float, delta: Array) -> tuple[Array, Array, Array]:
    """Means d, standard deviations s and slopes of s by d for T = 1 at d = delta s."""

    def excess(k: Array, delta: Array) -> Array:
        return np.asarray(ndtr(k - delta) + ndtr(k + delta) - 1.0 - p)

    low = np.full(len(delta), float(ndtri(p)))
    k = bracketed_roots(excess, (low, low + delta + 8.0), delta).x
    near, far = (np.exp(-0.5 * (k - sign * delta) ** 2) for sign in (1.0, -1.0))
    slope = -(near - far) / ((k - delta) * near + (k + delta) * far)
    return delta / k, 1.0 / k, slope


APART = 1e-9
"""Fraction by which the ends of a bracket lie beyond it: at a mean near 0 they differ by rounding alone."""


def _largest_deviation(p: float, d: float) -> float:
    """The same curve at one mean d < 1, by a root for its inverse."""

    def excess(k: Array) -> Array:
        return np.asarray(ndtr(k * (1.0 - d)) + ndtr(k * (1.0 + d)) - 1.0 - p)

    least = np.full(1, float(ndtri(0.5 * (1.0 + p))))
    ends = (1.0 - APART) * least, (1.0 + APART) * least / (1.0 - d)
    return 1.0 / float(bracketed_roots(excess, ends).x[0])


CENTRED = 1e-7
"""Relative difference of two limits' distances from the mean that counts as none: a yield changes by
its square. Limits about a nominal a million times as large are rounded to less."""
WHOLE = 100.0
ENDS, BOTH = {1.0: "upper limit", -1.0: "lower limit"}, "both limits"
"""The limit that a row keeps, by its side, and the words for both."""


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A requirement of the form: its output, coefficients (parts,), and its quantile if it is one.

    A root has its spread in `spread`; of a quantile that is its weight for each part. `most` is an
    upper limit of its own. `bias` (parts,) is by how much it rises with the mean of a part that a
    machine makes, `shift` (parts,) with the size of that mean, `doubt` what is not known of
    the processes of the parts adds, `by_process` (w, parts) by how much the spread of each process
    is wider than that of the first; nothing where they are not given. No tolerance changes `constant`.
    Without `even_doubt` the processes of a part are not known alike, and its doubt is that of the best known.
    """

    output: str
    measured: Measured
    method: str
    linear: Array
    spread: Array
    probability: float | None = None
    most: float = np.inf
    bias: Array | None = None
    shift: Array | None = None
    doubt: Surplus | None = None
    by_process: Array | None = None
    even_doubt: bool = True
    constant: float = 0.0
    limit: str = ""
    """Which limits of the requirement a row keeps, in words; empty for a variation."""

    @property
    def label(self) -> str:
        """What it is of its requirement, in words: "upper limit of gap", "rss of gap"."""
        name = self.measured.requirement.key or self.measured.requirement.name
        return f"{self.limit or self.method}{f' of {name}' if name else ''}"

    def spread_of(self, at: int, number: int) -> float:
        """The spread of a part by one of its processes: doubt widens that of a sampled one."""
        wider = 1.0 if self.by_process is None else float(self.by_process[number, at])
        return wider * float(self.spread[at])

    @property
    def promised(self) -> bool:
        """Whether it keeps a promise, between both limits as one."""
        return self.output.endswith(PROMISED)

    def bias_of(self, at: int) -> float:
        """By how much it rises with the mean of a part."""
        return 0.0 if self.bias is None else float(self.bias[at])

    def shift_of(self, at: int) -> float:
        """By how much it rises with the size of the mean of a part."""
        return 0.0 if self.shift is None else float(self.shift[at])


def rows_of(stack: Stack, gaussian: bool) -> list[Row]:
    """The rows of everything that is asked for, and the `variation` of one requirement.

    `gaussian` has the root sum square stand for half-widths that have no law in closed form.
    """
    several = bool(stack.definition.requirement.key)
    rows: list[Row] = []
    for measured in stack.measured:
        for kind in VARIATIONS:
            output = measured.name(kind)
            if output in stack.required_outputs or (kind == "variation" and not several):
                rows += _row(stack, output, measured, kind, 1.0, gaussian)
            if several and kind in stack.required_outputs:
                rows += _row(stack, kind, measured, kind, measured.requirement.weight, gaussian)
        if (output := measured.name("std")) in stack.required_outputs:
            rows += _row(stack, output, measured, "rss", 1.0 / SIGMAS, gaussian)
    if not several and not any(row.output == "variation" for row in rows):
        return []
    rows = [
        row
        for row in rows
        if not several
        or row.output not in VARIATIONS
        or sum(other.output == row.output for other in rows) == len(stack.measured)
    ]
    rows += _window_rows(stack) + _yield_rows(stack) + _promise_rows(stack, gaussian)
    first = stack.measured[0]
    return rows or _row(stack, first.name("rss"), first, "rss", 1.0, gaussian)


def _row(stack: Stack, output: str, measured: Measured, kind: str, weight: float, gaussian: bool) -> list[Row]:
    """The row of a kind of variation of one requirement; none where it has no convex form."""
    if measured.rough:
        return []
    method = measured.requirement.method if kind == "variation" else kind
    if method == "monte_carlo":
        if isinstance(measured.law, Law):
            p = 0.5 * (1.0 + stack.settings.propagation.coverage)
            return [_row_at_fraction(output, measured, p, weight)]
        if not gaussian:
            return []
        method = "rss"
    std = SIGMAS * signed_deviations(measured)
    nothing = np.zeros_like(std)
    linear, spread = {
        "worst_case": (measured.linear.worst, nothing),
        "rss": (nothing, std),
        "shifted_rss": (measured.linear.shift, std),
    }[method]
    shift = weight * measured.linear.worst if method == "shifted_rss" else None
    constant = weight * measured.measured_shift if method == "shifted_rss" else 0.0
    return [Row(output, measured, method, weight * linear, weight * spread, shift=shift, constant=constant)]


def signed_deviations(measured: Measured) -> Array:
    """Standard deviation (parts,) of the contributions at t = 1.

    With the sign of the slope where several requirements share the correlation of the parts.
    """
    std = np.sqrt(np.diag(measured.linear.covariance))
    if measured.mechanism.correlation is None or not measured.requirement.key:
        return std
    owners = measured.mechanism.owners
    slope_sums = np.bincount(owners, measured.mechanism.sensitivities, minlength=len(std))
    return np.asarray(np.where(slope_sums < 0.0, -std, std))


def _row_at_fraction(
    output: str,
    measured: Measured,
    p: float,
    weight: float = 1.0,
    side: float = 0.0,
    most: float = np.inf,
    z: float | None = None,
) -> Row:
    """side * mean + the p-quantile of the deviations: a root where all parts are normal, which may
    have another factor `z` than that of p.
    """
    law = measured.law
    assert isinstance(law, Law)
    linear, bias = weight * side * law.mean, weight * side * measured.linear.slope
    if law.covariance is not None:
        factor = float(ndtri(p)) if z is None else z
        spread = np.asarray(weight * factor * signed_deviations(measured), dtype=float)
        return Row(output, measured, "monte_carlo", linear, spread, None, most, bias)
    matters = np.isin(np.arange(len(linear)), law.mechanism.owners)
    spread = np.asarray(weight * matters, dtype=float)
    return Row(output, measured, "monte_carlo", linear, spread, p, most, bias)


def _window_rows(stack: Stack) -> list[Row]:
    """Limits on the ends that no unit exceeds, as limits on the worst case about the middles of the zones."""
    rows = []
    for measured in (measured for measured in stack.measured if measured.straight and not measured.rough):
        worst = measured.linear.worst
        for name, side in WINDOW.items():
            if np.isfinite(bound := _window_limit(stack, measured.name(name))):
                most = bound - side * measured.drawn.centre
                row = Row(measured.name(name), measured, "worst_case", worst, np.zeros_like(worst), most=most)
                rows.append(replace(row, limit=ENDS[side]))
    return rows


def _window_limit(stack: Stack, name: str) -> float:
    """What an end, times its side, must not exceed; infinite without a limit."""
    upper = WINDOW[name.rpartition(".")[2]] > 0.0
    return min((limit.high if upper else -limit.low for limit in stack.limits if limit.name == name), default=np.inf)


def _yield_rows(stack: Stack) -> list[Row]:
    """Least yields of one half at least, as quantiles that keep the limits of the requirements.

    A joint yield is kept by no design that does not keep it for every single requirement.
    """
    rows = []
    for measured in stack.measured:
        output = measured.name(YIELD)
        rows += _kept_limits(measured, output, least_yield(stack, output))
        if output != YIELD:
            rows += _kept_limits(measured, YIELD, least_yield(stack, YIELD))
    return rows


def _promise_rows(stack: Stack, gaussian: bool) -> list[Row]:
    """The promise of each requirement: a norm of the tolerances within its limits.

    An expected yield is no such row; where the form is only a guide it is by the mean variance.
    """
    rows: list[Row] = []
    promises = stack.promises
    if promises is None or promises.promise.statement == PLUG_IN:
        return rows
    assured = promises.promise.statement == ASSURED
    for promised in promises.requirement_promises if assured or gaussian else ():
        norms, linear = promised.norms, promised.measured.linear
        spread = promised.quantile * np.sqrt(norms[0].even)
        doubts = [norm.surplus() for norm in norms] if assured else []
        wider = np.array([np.sqrt(divide_or_default(norm.even, norms[0].even, 1.0)) for norm in norms])
        sides, names = promised.sides, ENDS
        if not np.any(linear.mean) and not _is_off_centre(promised.measured):
            names = {1.0: BOTH if len(sides) > 1 else ENDS[sides[0][0]]}
            sides = [(1.0, min(room for _, room in sides))]
        rows += [
            Row(
                promised.measured.name(PROMISED),
                promised.measured,
                "rss",
                side * linear.mean,
                spread,
                most=room,
                bias=side * linear.slope,
                doubt=_least_doubt(doubts),
                by_process=None if len(norms) == 1 else wider,
                even_doubt=_have_equal_knowledge(doubts),
                limit=names[side],
            )
            for side, room in sides
        ]
    return rows


def _least_doubt(doubts: list[Surplus]) -> Surplus | None:
    """The least that uncertain processes add, whichever process makes each part."""
    if not doubts:
        return None
    own, shared, error = (_process_coefficients(doubts, name) for name in ("own", "shared", "error"))
    return Surplus(
        np.min(own, axis=0), np.min(shared, axis=0), error=None if doubts[0].error is None else np.min(error, axis=0)
    )


def _have_equal_knowledge(doubts: list[Surplus]) -> bool:
    """Whether the processes of every part are known alike."""
    coefficients = (_process_coefficients(doubts, name) for name in ("own", "shared", "error"))
    return all(np.allclose(values, values[:1], 1e-12, 0.0) for values in coefficients)


def _process_coefficients(doubts: list[Surplus], name: str) -> Array:
    """Coefficients (w, parts) of every process; nothing where there are none."""
    coefficients = [value for doubt in doubts if (value := getattr(doubt, name)) is not None]
    return np.array(coefficients) if coefficients else np.zeros((1, 1))


def _is_off_centre(measured: Measured) -> bool:
    """Whether a machine makes a part off its mid-limit."""
    return any(offer.machine.mean for part in measured.parts for offer in part.machines)


def least_yield(stack: Stack, name: str) -> float:
    """The least fraction of units that keeps a limit, 0 where there is none."""
    limits = [limit for limit in stack.limits if limit.name == name and np.isfinite(limit.low)]
    ends = [limit.low - (limit.room(limit.low) if limit.low < WHOLE else 0.0) for limit in limits]
    return 0.01 * max(ends, default=0.0)


def _kept_limits(measured: Measured, output: str, p: float) -> list[Row]:
    """The limits of a requirement at a fraction p of the units.

    Exact for one limit, and for two about a mean that does not move with the tolerances where they are even about it
    or all deviations are normal; else rows that are necessary to keep both limits: each at the whole fraction, both
    about the mean, and, where all deviations are normal, the tangents between (`two_sided`).
    """
    law = measured.law
    if not isinstance(law, Law) or not 0.5 <= p < 1.0:
        return []
    mechanism = law.mechanism
    above, below = mechanism.upper - mechanism.centre, mechanism.centre - mechanism.lower
    sides = [(side, room) for side, room in ((1.0, above), (-1.0, below)) if np.isfinite(room)]
    if len(sides) < 2:
        return [
            replace(_row_at_fraction(output, measured, p, side=side, most=room), limit=ENDS[side])
            for side, room in sides
        ]
    half, off = 0.5 * (above + below), 0.5 * (above - below)
    middle = replace(_row_at_fraction(output, measured, 0.5 * (1.0 + p), most=half), limit=BOTH)
    moves = bool(np.any(law.mean)) or _is_off_centre(measured)
    if not moves and abs(off) <= CENTRED * half:
        return [middle]
    if not moves and law.covariance is not None and abs(off) < half:
        most = half * _largest_deviation(p, abs(off) / half)
        return [replace(_row_at_fraction(output, measured, p, most=most, z=1.0), limit=BOTH)]
    lines = tangents(p) if moves and law.covariance is not None else ()
    rows = [
        replace(
            _row_at_fraction(output, measured, p, 1.0 / room, side, half + side * off / room, z),
            limit=f"{ENDS[side]}, tangent {at}" if at else ENDS[side],
        )
        for at, (z, room) in enumerate(((None, 1.0), *lines))
        for side in (1.0, -1.0)
    ]
    return [middle, *rows]


def quantile_of(row: Row, kept: list[int], settled: Flags, t: Array) -> Quantile | None:
    """The deviations of a row: of the parts `kept`, and fixed ones of those that are `settled`."""
    law = row.measured.law
    if row.probability is None or not isinstance(law, Law):
        return None
    pieces: list[list[Piece]] = [[] for _ in t]
    for at, slope, piece_law in zip(law.mechanism.owner, law.slopes, law.laws, strict=True):
        pieces[at].append(Piece(float(slope), piece_law))
    fixed = [
        Piece(float(piece.weight * row.spread[at] * t[at]), piece.law)
        for at in np.flatnonzero(settled).tolist()
        for piece in pieces[at]
    ]
    return Quantile(row.probability, tuple(tuple(pieces[at]) for at in kept), tuple(fixed))


def surplus_of(row: Row, kept: list[int], settled: Flags, t: Array) -> Surplus | None:
    """What uncertain processes add under a row's root, by the squares of the parts `kept`."""
    if (doubt := row.doubt) is None:
        return None
    square = (row.spread * t)[settled] ** 2
    error = np.zeros_like(doubt.own) if doubt.error is None else doubt.error
    return Surplus(
        doubt.own[kept],
        doubt.shared[kept],
        float(np.sqrt(np.sum((doubt.own[settled] * square) ** 2))),
        float(doubt.shared[settled] @ square),
        error=None if doubt.error is None else error[kept],
        fixed_error=float(error[settled] @ square),
        fixed_even=float(square.sum()),
    )


def shortfall(stack: Stack, row: str, designs: Array, outputs: Mapping[str, Array]) -> Array:
    """By how much (n,) the limits of requirements would have to be widened for a required yield.

    One step of Newton's method for the yield `row`, alike for all requirements that it is over.
    """
    least, t = least_yield(stack, row), stack.parts_as_made(designs)
    if stack.promises is not None and (promised := stack.promises.row(row)) is not None:
        return promised.lacking(t)
    if (side := WINDOW.get(row.rpartition(".")[2])) is not None:
        return np.asarray(side * outputs[row] - _window_limit(stack, row))
    laws = [
        measured.law
        for measured in stack.measured
        if isinstance(measured.law, Law) and measured.mechanism.bounded and row in (YIELD, measured.name(YIELD))
    ]
    if not laws or least <= 0.0:
        return np.zeros(len(designs))
    edge = np.sum([law.edge_density(t) for law in laws], axis=0)
    lacking = least - 0.01 * outputs[row]
    return np.asarray(lacking / np.maximum(edge, 1e-300))
