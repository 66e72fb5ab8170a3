"""A recorded channel that comes late."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from math import inf, sqrt

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import Action, Effect, EffectParameter, Readings, Target, quantity

LONGEST = 20.0
"""Usual steps of the clock that a channel may be late, or early."""
BREAK = 10.0
"""Usual steps after which a record has been interrupted."""
ROUGH = 0.1
"""Squared steps of a channel, as a share of those of rows without an order, above which its noise
is looked at: a channel that goes on beneath it is one that a delay could be seen in."""
JUMP = 2.0
"""A step of the channel, in those beside it together, that is no slope."""
FEWEST = 4
"""Rows, at least."""
PRESENT, FALLS, SIGMAS = 4.0, 0.2, 2.0
"""Standard errors that the correlation of neighbours must have; the share of it that may be gone
one
row further; and standard errors of that."""


class Delay(Effect):
    """What was recorded is the output of a moment before: y(t - T), filters and buses included.

    Only where rows follow each other as a record does: a clock, and a channel whose steps from row
    to row are small. Between rows the channel goes straight, but for where the speed changes its
    sign: what follows the direction jumps there, and not over a whole step. Before the beginning of
    a record, and after an interruption of more than 10 usual steps, it stands at its first value.
    Reference:
    Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998, section 4.3 (transport
    lag).
    """

    name = "delay"
    family = "instrument"
    cause = "The channel of the output is recorded later, or sooner, than those of the inputs."
    formula = "y(t) becomes y(t - T)"
    needs = (Role.TIME,)
    mistaken_for = ("read_out_lag", "viscous_friction", "stribeck")
    reference = "Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998"

    def own_applies(self, target: Target) -> bool:
        return not target.population and super().own_applies(target)

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        end = LONGEST * target.pace if target.pace > 0.0 else inf
        meaning = "T, by how much the channel is late (negative: early)"
        return tuple(
            quantity(f"{target.prefix(output)}delay", "s", meaning, -end, end, linear=False)
            for output in target.outputs
        )

    def shown(self, measured: Mapping[str, Array], target: Target) -> dict[str, float] | None:
        numbers = dict(
            zip((o.name for o in target.outputs), self.own_parameters(target), strict=True)
        )
        rough = [name for name in numbers if not _continuous(measured[name])]
        if target.pace <= 0.0 or len(rough) == len(numbers):
            return None
        return {numbers[name].name: 0.0 for name in rough}

    def own_action(self, readings: Readings, values: Mapping[str, float], target: Target) -> Action:
        names = [own_parameter.name for own_parameter in self.own_parameters(target)]
        delays = {
            o.name: values.get(name, 0.0) for o, name in zip(target.outputs, names, strict=True)
        }
        time = np.asarray(readings[Role.TIME], dtype=float)
        signed = Role.SPEED in readings and Role.DIRECTION in readings
        speed = np.asarray(readings[Role.SPEED] * readings[Role.DIRECTION]) if signed else None
        late_by = partial(delayed, time=time, order=readings.order, speed=speed)
        return Action(
            reading={name: partial(late_by, by=by) for name, by in delays.items() if by != 0.0}
        )


def delayed(
    values: Array,
    time: Array,
    by: float,
    order: np.ndarray | None = None,
    speed: Array | None = None,
) -> Array:
    """The channel (n,) at `time` (n,) less `by` [s], in the order of measuring; a `speed` (n,) with
    its sign says where it may jump.
    """
    at = np.arange(len(time)) if order is None else order
    t, y = time[at], np.asarray(values, dtype=float)[at]
    v = np.ones(len(t)) if speed is None else speed[at]
    delayed_values = np.empty(len(t))
    for rows in _stretches(t):
        delayed_values[rows] = np.interp(t[rows] - by, *_with_jumps(t[rows], y[rows], v[rows]))
    whole = np.empty(len(t))
    whole[at] = delayed_values
    return whole


def _with_jumps(t: Array, y: Array, v: Array) -> tuple[Array, Array]:
    """A channel (n,) with two more points wherever it jumps as the speed v passes 0 between two
    rows of either sign: what both sides extrapolate to.
    """
    sign = np.sign(v)
    steps = np.abs(np.diff(y))
    k = 1 + np.flatnonzero(
        (sign[:-3] == sign[1:-2])
        & (sign[1:-2] * sign[2:-1] < 0.0)
        & (sign[2:-1] == sign[3:])
        & (steps[1:-1] > JUMP * (steps[:-2] + steps[2:]))
    )
    zero = t[k] + (t[k + 1] - t[k]) * v[k] / (v[k] - v[k + 1])
    ends = [
        y[a] + (y[a] - y[b]) / (t[a] - t[b]) * (zero - t[a])
        for a, b in ((k, k - 1), (k + 1, k + 2))
    ]
    at = np.repeat(k + 1, 2)
    return np.insert(t, at, np.repeat(zero, 2)), np.insert(y, at, np.column_stack(ends).ravel())


def _stretches(time: Array) -> list[slice]:
    """Rows between which the record was not interrupted."""
    steps = np.diff(time)
    ahead = steps[steps > 0.0]
    usual = float(np.median(ahead)) if len(ahead) else inf
    ends = np.flatnonzero((steps <= 0.0) | (steps > BREAK * usual)) + 1
    edges = [0, *ends.tolist(), len(time)]
    return [slice(a, b) for a, b in pairwise(edges)]


def _continuous(values: Array) -> bool:
    """Whether a channel (n,) goes on from row to row, whatever noise it carries.

    White noise is in no correlation of different rows: what neighbours share is the channel's own,
    and of a channel that goes on the next but one shares nearly as much.
    """
    spread = float(np.var(values))
    if spread == 0.0 or len(values) < FEWEST:
        return False
    if float(np.mean(np.diff(values) ** 2)) < ROUGH * 2.0 * spread:
        return True
    error = 1.0 / sqrt(len(values))
    near, next_but_one = (_correlation(values, by) for by in (1, 2))
    by_chance = SIGMAS * error * (1.0 - near)
    return near > PRESENT * error and near - next_but_one < FALLS * near + by_chance


def _correlation(values: Array, by: int) -> float:
    """Of a channel with itself, so many rows apart."""
    y = values - np.mean(values)
    return float(y[by:] @ y[:-by]) / float(y @ y)
