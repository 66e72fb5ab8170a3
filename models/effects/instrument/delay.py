"""A recorded channel that comes late."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from math import inf

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import Action, Effect, EffectParameter, Readings, Target, quantity

LONGEST = 20.0
"""Usual steps of the clock that a channel may be late, or early."""
BREAK = 10.0
"""Usual steps after which a record has been interrupted."""
ROUGH = 0.1
"""Squared steps of a channel, as a share of those of rows without an order, above which it is none
that a delay could be seen in."""


class Delay(Effect):
    """What was recorded is the output of a moment before: y(t - T), filters and buses included.

    Only where rows follow each other as a record does: a clock, and a channel whose steps from row
    to row are small. Between rows the channel goes straight; before the beginning of a record, and
    after an interruption of more than 10 usual steps, it stands at its first value. Reference:
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
        numbers = dict(zip((o.name for o in target.outputs), self.own_parameters(target),
                           strict=True))  # fmt: skip
        rough = [name for name in numbers if not _continuous(measured[name])]
        if target.pace <= 0.0 or len(rough) == len(numbers):
            return None
        return {numbers[name].name: 0.0 for name in rough}

    def own_action(self, readings: Readings, values: Mapping[str, float], target: Target) -> Action:
        names = [one.name for one in self.own_parameters(target)]
        late = {o.name: values.get(name, 0.0) for o, name in
                zip(target.outputs, names, strict=True)}  # fmt: skip
        time = np.asarray(readings[Role.TIME], dtype=float)
        return Action(reading={name: partial(delayed, time=time, by=by, order=readings.order)
                               for name, by in late.items() if by != 0.0})  # fmt: skip


def delayed(values: Array, time: Array, by: float, order: np.ndarray | None = None) -> Array:
    """The channel (n,) at `time` (n,) less `by` [s], in the order of measuring."""
    at = np.arange(len(time)) if order is None else order
    t, y = time[at], np.asarray(values, dtype=float)[at]
    found = np.empty(len(t))
    for rows in _stretches(t):
        found[rows] = np.interp(t[rows] - by, t[rows], y[rows])
    whole = np.empty(len(t))
    whole[at] = found
    return whole


def _stretches(time: Array) -> list[slice]:
    """Rows between which the record was not interrupted."""
    steps = np.diff(time)
    ahead = steps[steps > 0.0]
    usual = float(np.median(ahead)) if len(ahead) else inf
    ends = np.flatnonzero((steps <= 0.0) | (steps > BREAK * usual)) + 1
    edges = [0, *ends.tolist(), len(time)]
    return [slice(a, b) for a, b in pairwise(edges)]


def _continuous(values: Array) -> bool:
    """Whether a channel (n,) goes on from row to row."""
    spread = float(np.var(values))
    steps = float(np.mean(np.diff(values) ** 2)) if len(values) > 1 else inf
    return spread > 0.0 and steps < ROUGH * 2.0 * spread
