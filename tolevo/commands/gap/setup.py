"""The residuals and columns of a plan and its data, on which the analysis works; doubted signs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any, Literal

import numpy as np
import scipy

from ...errors import raise_all
from ...journal import recall_arrays
from ...models.effects.effect import InsideSeveral, grid, kind_of
from ...models.effects.population import Law
from ...models.effects.shapes import POSITIONS
from ...models.effects.unresolved import Form
from ...models.measurable import NO_CHANGES, Role
from ...section import Array, Output
from .data import GapData
from .fit import Fit
from .generic import generic
from .library import Candidate, Columns, add_lot_offsets, candidates, law_of, not_considered, predictor
from .linear import Groups, basis, join_groups, project_out
from .plan import GapPlan
from .read import finite_faults

# Reversed signs: an output or a column whose sign is opposite to the convention.
#
# An effect has the sign that physics gives it, and a load that resists winds a drive up. Where the
# data fit far better with the opposite sign, a note says so first: effects selected with the wrong
# sign are wrong.

REVERSED_SIGN_RATIO = 0.25
"""Residual squares with the opposite sign, as a fraction of those with the given one, below which a
sign is doubted.
"""
SHAPES = 12
"""Number of points of an effect's grid that are tried."""
ROWS = 600
MIN_ROWS = 20
"""Number of rows from which a sign is tested."""
STEPS = 4
"""Number of effects that are fitted one after the other: a dominating wave has no sign."""
MIN_RSS_RATIO = 0.98
"""Largest fraction of the squares that may remain after a further effect."""
FALLS = -0.7
"""Correlation from which a prediction falls with the load."""


@dataclass(frozen=True)
class _Best:
    """The residual sum of squares after a few effects, and the first of them that has a sign."""

    rss: float
    name: str = ""


def turned(
    data: GapData, predicted: Mapping[str, Array], base: Array, library: Sequence[Candidate], columns: Columns
) -> list[str]:
    """Sentences about outputs that fit far better with the opposite sign; `base` (N, p) is free."""
    if data.target.population or len(data) < MIN_ROWS:
        return []
    rows = np.unique(np.linspace(0, len(data) - 1, min(len(data), ROWS)).astype(np.int64))
    blocks = list(_blocks(data, library, columns))
    sentences = []
    for at, output in enumerate(data.outputs):
        output_rows = rows + at * len(data)
        q = basis(base[output_rows])
        output_blocks = [(candidate, project_out(block[output_rows], q)) for candidate, block in blocks]
        y = project_out(data.measured[output.name][rows], q)
        p = project_out(predicted[output.name][rows], q)
        as_given = _best(y - p, output_blocks)
        reversed_output, reversed_gap = _best(-y - p, output_blocks), _best(p - y, output_blocks)
        best = min(reversed_output, reversed_gap, key=attrgetter("rss"))
        if best.rss < REVERSED_SIGN_RATIO * as_given.rss:
            ratio = float(np.sqrt(as_given.rss / max(best.rss, 1e-300)))
            note = _of_output if best is reversed_output else partial(_of_gap, data, library)
            sentences.append(f"is the sign of {output.name} reversed? {note(output.name, best.name, ratio)}")
        elif text := _falling_prediction_note(data, output, predicted[output.name]):
            sentences.append(text)
    return sentences


def _falling_prediction_note(data: GapData, output: Output, predicted: Array) -> str:
    """The note on a prediction that falls with the load, which winds a drive up, else empty."""
    load = next((c for c in data.inputs if c.role in (Role.TORQUE, Role.FORCE)), None)
    if load is None or kind_of(output.unit) not in POSITIONS or not np.ptp(predicted):
        return ""
    if float(np.corrcoef(data.measurements[load.role], predicted)[0, 1]) > FALLS:
        return ""
    return (
        f"is the sign of {output.name} or of {load.name} reversed? The prediction falls as "
        f"{load.name} rises, and a load that resists winds a drive up: give sense = -1 to what is "
        f"opposite to docs/conventions.md ({output.name} and its prediction, or {load.name})"
    )


def _blocks(data: GapData, library: Sequence[Candidate], columns: Columns) -> Iterator[tuple[Candidate, Array]]:
    """Columns (N, m) of effects that act at the output, for some of their nonlinear parameters."""
    for candidate in library:
        inside = candidate.effect.place(data.target) is not None or isinstance(candidate.effect, InsideSeveral)
        if candidate.is_nonlinear or inside:
            continue
        shapes = grid(candidate.shape, 1.0)
        every = max(1, len(shapes) // SHAPES)
        for shape in shapes[::every]:
            yield candidate, columns.of(candidate, shape)


def _best(gap: Array, blocks: Sequence[tuple[Candidate, Array]]) -> _Best:
    """A few effects on a gap (n,), each the best on the residual of those before it."""
    whole, name, taken = float(gap @ gap), "", set[str]()
    for _ in range(STEPS):
        tried = [
            (*_residual_of(gap, candidate, x), candidate) for candidate, x in blocks if candidate.name not in taken
        ]
        if not tried:
            break
        rss, rest, candidate = min(tried, key=lambda attempt: attempt[0])
        if rss > MIN_RSS_RATIO * whole:
            break
        whole, gap = rss, rest
        taken.add(candidate.name)
        name = name or (candidate.name if (candidate.bounds[0] > -np.inf).any() else "")
    return _Best(whole, name)


def _residual_of(gap: Array, candidate: Candidate, x: Array) -> tuple[float, Array]:
    """The residual sum of squares and the residual of a gap after bounded columns (n, m)."""
    kept = np.linalg.norm(x, axis=0) > 0.0
    low, high = (ends[kept] for ends in candidate.bounds)
    x = x[:, kept]
    sizes, *_ = np.linalg.lstsq(x, gap, rcond=1e-9)
    if (sizes < low).any() or (sizes > high).any():
        one = len(sizes) == 1
        sizes = np.clip(sizes, low, high) if one else scipy.optimize.lsq_linear(x, gap, (low, high), method="bvls").x
    rest = np.asarray(gap - x @ sizes)
    return float(rest @ rest), rest


def _of_output(output: str, effect: str, ratio: float) -> str:
    """The note on an output that is nearer to its prediction with the opposite sign."""
    more = f" with {effect}" if effect else ""
    return (
        f"With the opposite sign it is {ratio:.3g} times nearer to its prediction{more}; give it "
        "sense = -1 if a positive value means the opposite of docs/conventions.md"
    )


def _of_gap(data: GapData, library: Sequence[Candidate], output: str, effect: str, ratio: float) -> str:
    """The note on a gap that effects explain better with the opposite sign."""
    needs = {role for candidate in library if candidate.name == effect for role in candidate.effect.needs}
    acting = [c.name for c in data.target.columns if c.role in needs]
    of = f", or {' or '.join(acting)}," if acting else ""
    first = f" ({effect} first)" if effect else ""
    return (
        f"With the opposite sign of the gap the effects of the library{first} leave a residual that is "
        f"{ratio:.3g} times smaller. If {output} and its prediction{of} are opposite to "
        "docs/conventions.md, give them sense = -1; if not, the simulation contains too much of the effect"
    )


STEP = 0.02
"""Fraction of a tolerance by which a parameter is moved for its column."""
LEAST_NAMED = 20
"""Number of units of a batch below which no cause is identified."""
SAME_UNIT = 0.05
"""Fraction of the population's scatter below which measurements look like those of one unit."""


@dataclass(frozen=True)
class Setup:
    """Residual (N,) of the model at parameters `at`, where it fits best alone; the columns (N, p)
    of its free parameters, each for its whole tolerance, and of the zeros of outputs; `prior` is
    the count of the former. `laws` are those of a population's outputs; `first` are the notes that
    precede all others.
    """

    plan: GapPlan
    data: GapData
    predicted: Mapping[str, Array]
    at: Mapping[str, float]
    residual: Array
    base: Array
    free: tuple[str, ...]
    library: tuple[Candidate, ...]
    on_scatter: tuple[Candidate, ...]
    columns: Columns
    forms: tuple[Form, ...]
    generic: Groups
    laws: Mapping[str, Law]
    notes: tuple[str, ...] = ()
    first: tuple[str, ...] = ()

    @property
    def prior(self) -> int:
        """Free parameters that have a tolerance."""
        return len(self.free)

    @property
    def offset(self) -> Array:
        """Distance (prior,) of the nominal parameters from the recalibrated ones, in tolerances."""
        plan = self.plan
        return np.array([(nominal(plan, name) - self.at[name]) / plan.free[name] for name in self.free], dtype=float)


def prepare_setup(
    plan: GapPlan, full: GapData, accepted: Callable[[], AbstractContextManager[None]] = nullcontext
) -> Setup:
    """The setup of the rows that are used, made within `accepted` once the model has predicted them.

    Raises InputError where it has no prediction.
    """
    data, notes = thin_data(plan, full)
    predicted = predictor(plan, data)({})
    raise_all(finite_faults({o.name: predicted[o.name] for o in data.outputs}, data.rows))
    with accepted():
        return _setup_of(plan, data, predicted, notes)


def _setup_of(plan: GapPlan, data: GapData, predicted: Mapping[str, Array], notes: tuple[str, ...]) -> Setup:
    at = recalibrate(plan, data, predicted)
    if data.target.population and at and plan.rebuild is not None:
        plan = replace(plan, model=plan.rebuild(at))  # the scatter of its units changes too
    parts = _parts(plan, data, at)
    forms, columns = generic(data, parts["predicted"])
    library, more_notes = add_lot_offsets(candidates(plan.library, data, plan.own), data, parts["residual"])
    laws = {o.name: law_of(plan, o.name) for o in data.outputs} if data.target.population else {}
    if why := unidentifiable_reason(data, laws):
        plan = replace(plan, settings=replace(plan.settings, effects_at_most=0))
        more_notes.append(why)
    return Setup(
        plan=plan,
        data=data,
        library=tuple(c for c in library if not c.on_scatter),
        on_scatter=tuple(c for c in library if c.on_scatter and plan.settings.effects_at_most),
        forms=tuple(forms),
        generic=join_groups(columns),
        laws=laws,
        notes=(*notes, *more_notes, *not_considered(plan.library, data)),
        first=tuple(turned(data, parts["predicted"], parts["base"], library, parts["columns"])),
        **parts,
    )


def residual_of(setup: Setup, fit: Fit, but: Sequence[str] = ()) -> Array:
    """Residual (N,) of a fit, in the outputs' units, without subtracting the effects in `but`."""
    residual = setup.residual - setup.base @ fit.free
    for member, coefficients in zip(fit.members, fit.coefficients, strict=True):
        if member.name not in but:
            residual = residual - setup.columns.of(member.candidate, member.shape) @ coefficients
    return np.asarray(residual)


def unidentifiable_reason(data: GapData, laws: Mapping[str, Law]) -> str:
    """Why no cause can be identified from a batch; empty where one can."""
    if laws and len(data) < LEAST_NAMED:
        return f"cannot tell with n = {len(data)}: no cause is identified from fewer than {LEAST_NAMED} units"
    for name, law in laws.items():
        if np.std(data.measured[name]) < SAME_UNIT * law.std:
            return (
                f"cannot tell: {name} is almost constant over the rows, units of the model "
                f"scatter by {law.std:.3g}; was one unit measured many times?"
            )
    return ""


def move_setup(setup: Setup, at: Mapping[str, float], changes: Mapping[str, Array]) -> Setup:
    """The setup with the model at other parameters, its columns with `changes` inside it."""
    return replace(setup, **_parts(setup.plan, setup.data, at, changes))


def _parts(
    plan: GapPlan, data: GapData, at: Mapping[str, float], changes: Mapping[str, Array] = NO_CHANGES
) -> dict[str, Any]:
    """The fields of a setup that depend on the parameters of the model."""
    predict = predictor(plan, data, plan.rebuild(at) if plan.rebuild and at else None)
    predicted = predict({})
    free, gradient = _gradient(plan, data, at, changes)
    return {
        "predicted": predicted,
        "at": at,
        "residual": data.stacked(data.measured) - data.stacked(predicted),
        "base": np.column_stack([gradient, zeros_of(data)]),
        "free": free,
        "columns": Columns(data, predict),
    }


def thin_data(plan: GapPlan, full: GapData) -> tuple[GapData, tuple[str, ...]]:
    """The rows that are used, where there are too many one at random from each stretch of equal
    length; and the note on it.
    """
    most = max(200, plan.settings.rows_used // len(full.outputs))
    if len(full) <= most:
        return full, ()
    rng = np.random.default_rng([plan.seed, 1])
    edges = np.linspace(0, len(full), most + 1)
    rows = np.unique(np.floor(edges[:-1] + rng.random(most) * np.diff(edges)).astype(np.int64))
    text = (
        f"{len(full)} rows: effects are searched on {len(rows)} of them, one at random out of each "
        "stretch of equal length (settings.rows_used)"
    )
    return full.some(rows), (text,)


def recalibrate(plan: GapPlan, data: GapData, predicted: Mapping[str, Array]) -> dict[str, float]:
    """The free parameters, within their tolerances, at which the null model fits best. For a batch,
    the ones nearest to nominal at which the model's mean is that of the units.
    """
    if plan.rebuild is None or not plan.free:
        return {name: nominal(plan, name) for name in plan.free}
    middle = np.array([nominal(plan, name) for name in plan.free])
    half, measured = np.array(list(plan.free.values()), dtype=float), data.stacked(data.measured)
    scatters = [max(float(np.std(data.measured[o.name] - predicted[o.name])), 1e-300) for o in data.outputs]
    scale = np.repeat(scatters, len(data))
    q, population = basis(zeros_of(data) / scale[:, None]), data.target.population

    def parameters(x: Array) -> dict[str, float]:
        return dict(zip(plan.free, (middle + x * half).tolist(), strict=True))

    def residual(x: Array) -> Array:
        scaled = (measured - _predict_moved(plan, data, parameters(x))) / scale
        if population:
            return np.append(np.sqrt(len(data)) * np.mean(scaled), x)
        return project_out(scaled, q)

    def computed() -> tuple[Array]:
        loss: Literal["linear", "soft_l1"] = "linear" if population else "soft_l1"
        found = scipy.optimize.least_squares(
            residual, np.zeros(len(half)), bounds=(-1.0, 1.0), max_nfev=25, diff_step=[1e-3], loss=loss
        )
        return (np.asarray(found.x),)

    return parameters(recall_arrays(("recalibrated", middle, half, measured), computed)[0])


def _gradient(
    plan: GapPlan, data: GapData, at: Mapping[str, float], changes: Mapping[str, Array] = NO_CHANGES
) -> tuple[tuple[str, ...], Array]:
    """Free parameters with an effect on the outputs, and the change (N, p) per tolerance of each."""
    columns = {name: change_of(plan, data, at, name, changes) for name in plan.free if plan.rebuild is not None}
    acting = {name: c for name, c in columns.items() if np.isfinite(c).all() and np.any(c)}
    empty = np.zeros((len(data) * len(data.outputs), 0))
    return tuple(acting), np.column_stack([empty, *acting.values()])


def change_of(
    plan: GapPlan, data: GapData, at: Mapping[str, float], name: str, changes: Mapping[str, Array] = NO_CHANGES
) -> Array:
    """The change (N,) of the outputs per tolerance of a free parameter, by central differences."""
    ends = (at[name] + sign * STEP * plan.free[name] for sign in (1.0, -1.0))
    up, down = (_predict_moved(plan, data, {**at, name: end}, changes) for end in ends)
    return np.asarray((up - down) / (2.0 * STEP))


def nominal(plan: GapPlan, name: str) -> float:
    """The value of a parameter, in a table by its dotted name; 0 where it is not set."""
    table, dot, key = name.partition(".")
    if not dot:
        return float(plan.parameters[name])
    inner = plan.parameters.get(table, {})
    return float(inner.get(key, 0.0)) if isinstance(inner, Mapping) else 0.0


def _predict_moved(
    plan: GapPlan, data: GapData, parameters: Mapping[str, float], changes: Mapping[str, Array] = NO_CHANGES
) -> Array:
    assert plan.rebuild is not None
    return data.stacked(predictor(plan, data, plan.rebuild(parameters))(changes))


def zeros_of(data: GapData) -> Array:
    """A column of ones for each output whose zero is free (N, zeros)."""
    of_zero = np.array([[float(o.name == name) for name in data.zeros] for o in data.outputs])
    return np.asarray(np.kron(of_zero, np.ones((len(data), 1))), dtype=np.float64)


def values_of(data: GapData) -> dict[str, Array]:
    """Inputs that the size of the noise may follow: numbers that vary, also their magnitudes."""
    inputs: dict[str, Array] = {}
    for column in data.inputs:
        if column.role in (Role.DIRECTION, Role.REPEAT):
            continue
        inputs[column.name] = values = data.values(column.name)
        if (values < 0).any() and (values > 0).any():
            inputs[f"|{column.name}|"] = np.abs(values)
    return inputs
