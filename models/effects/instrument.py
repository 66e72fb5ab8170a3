"""Effects of the instrument that measures."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from ...section import Array
from ..measurable import Role
from .effect import Action, Effect, EffectParameter, Measurements, Target, Values, quantity, value_or_zero
from .measurements import usual_step
from .shapes import POSITIONS, OneColumn, Orders, SignedSpeed, Weight, speed_unit


class ClockDrift(OneColumn):
    """A clock that drifts."""

    name = "clock_drift"
    family = "instrument"
    dimensions = POSITIONS
    cause = "The clocks of input and output diverge, and the output is recorded later and later."
    formula = "a t v d"
    needs = (Role.TIME, Role.SPEED, Role.DIRECTION)
    mistaken_for = ("wear", "read_out_lag")
    reference = "IEEE 1588-2019"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, per unit of speed and second", f"({speed_unit(target)} s)", -inf),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.TIME] * measurements[Role.SPEED] * measurements[Role.DIRECTION])


MAX_DELAY_STEPS = 20.0
"""Longest delay or lead of a channel, in usual steps of the clock."""
BREAK = 10.0
"""Usual steps after which a record has been interrupted."""
ROUGH = 0.1
"""Squared steps of a channel, as a fraction of those of rows in random order, above which its noise
is tested: a delay can be detected in a channel that is continuous beneath its noise."""
JUMP = 2.0
"""A step of the channel, over the sum of its two neighbours, that counts as a jump."""
FEWEST = 4
"""Least number of rows."""
PRESENT, FALLS, SIGMAS = 4.0, 0.2, 2.0
"""Standard errors that the correlation of neighbours must exceed; the fraction of it that may be
lost one row further; and standard errors of that loss."""


class Delay(Effect):
    """The recorded output is that of an earlier time: y(t - T), filters and buses included.

    It applies to a record only: a clock, and a channel whose steps from row to row are small. The
    channel is linear between rows, except where the speed changes its sign: a term that follows the
    direction jumps there, and not over a whole step. Before the beginning of a record, and after an
    interruption of more than 10 usual steps, it has its first value. Reference: Franklin, Powell
    and Workman, Digital Control of Dynamic Systems, 1998, section 4.3 (transport lag).
    """

    name = "delay"
    family = "instrument"
    cause = "The channel of the output is recorded later, or sooner, than those of the inputs."
    formula = "y(t) becomes y(t - T)"
    needs = (Role.TIME,)
    of_rows = True
    yields_to = "memory"
    mistaken_for = ("read_out_lag", "viscous_friction", "stribeck")
    reference = "Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998"

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        end = MAX_DELAY_STEPS * target.pace if target.pace > 0.0 else inf
        meaning = "T, delay of the channel (negative: lead)"
        return tuple(
            quantity(f"{target.prefix(output)}delay", "s", meaning, -end, end, linear=False)
            for output in target.outputs
        )

    def shown(self, measured: Mapping[str, Array], target: Target) -> dict[str, float] | None:
        numbers = dict(zip((o.name for o in target.outputs), self.own_parameters(target), strict=True))
        driven = {Role.SPEED, Role.DIRECTION} <= target.roles()  # which tell where the channel may jump
        rough = [
            name
            for name in numbers
            if not _is_continuous(measured[name]) or (not driven and _moves_in_jumps(measured[name]))
        ]
        if target.pace <= 0.0 or len(rough) == len(numbers):
            return None
        return {numbers[name].name: 0.0 for name in rough}

    def kinds_of_rows(self, measurements: Measurements, whole: Array) -> NDArray[np.int64]:
        """Rows in which the channel rises or falls, slowly or fast: a hysteresis has a loop of the same
        width in fast rows as in slow ones, a delay a wider one.
        """
        order = measurements.in_order
        steps = np.gradient(np.asarray(whole, dtype=float)[order])
        kinds = np.empty(len(order), dtype=np.int64)
        kinds[order] = 2 * (np.abs(steps) > np.median(np.abs(steps))) + (steps > 0.0)
        return kinds

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        names = [own_parameter.name for own_parameter in self.own_parameters(target)]
        delays = {o.name: values.get(name, 0.0) for o, name in zip(target.outputs, names, strict=True)}
        time = np.asarray(measurements[Role.TIME], dtype=float)
        signed = Role.SPEED in measurements and Role.DIRECTION in measurements
        speed = np.asarray(measurements[Role.SPEED] * measurements[Role.DIRECTION]) if signed else None
        late_by = partial(delay_channel, time=time, order=measurements.order, speed=speed)
        return Action(reading={name: partial(late_by, by=by) for name, by in delays.items() if by != 0.0})


def delay_channel(
    values: Array, time: Array, by: float, order: np.ndarray | None = None, speed: Array | None = None
) -> Array:
    """The channel (n,) at `time` (n,) less `by` [s], in the order of measurement; a signed `speed`
    (n,) shows where it may jump.
    """
    at = np.arange(len(time)) if order is None else order
    t, y = time[at], np.asarray(values, dtype=float)[at]
    v = np.ones(len(t)) if speed is None else speed[at]
    delayed_values = np.empty(len(t))
    for rows in _stretches(t):
        delayed_values[rows] = np.interp(t[rows] - by, *_insert_jumps(t[rows], y[rows], v[rows]))
    in_table_order = np.empty(len(t))
    in_table_order[at] = delayed_values
    return in_table_order


def _insert_jumps(t: Array, y: Array, v: Array) -> tuple[Array, Array]:
    """A channel (n,) with two more points at each jump where the speed v changes its sign between
    two rows: the values extrapolated from both sides.
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
    ends = [y[a] + (y[a] - y[b]) / (t[a] - t[b]) * (zero - t[a]) for a, b in ((k, k - 1), (k + 1, k + 2))]
    at = np.repeat(k + 1, 2)
    return np.insert(t, at, np.repeat(zero, 2)), np.insert(y, at, np.column_stack(ends).ravel())


def _stretches(time: Array) -> list[slice]:
    """Rows of each stretch without an interruption of the record."""
    steps = np.diff(time)
    ends = np.flatnonzero((steps <= 0.0) | (steps > BREAK * usual_step(time, inf))) + 1
    edges = [0, *ends.tolist(), len(time)]
    return [slice(a, b) for a, b in pairwise(edges)]


STANDS_ALONE = 3.0
"""A step of a channel that is so many times each of its neighbours happens within a row."""


def _moves_in_jumps(values: Array) -> bool:
    """Whether most of the squared movement of a channel (n,) is in steps within a row: what follows a jump a part of a
    row late is a delay as well as a fast memory.
    """
    steps = np.abs(np.diff(values, prepend=values[0], append=values[-1]))
    jumps = steps[1:-1] > STANDS_ALONE * np.maximum(steps[:-2], steps[2:])
    return float((steps[1:-1][jumps] ** 2).sum()) > 0.5 * float((steps**2).sum())


def _is_continuous(values: Array) -> bool:
    """Whether a channel (n,) is continuous from row to row beneath its noise.

    White noise does not contribute to correlations of different rows: the correlation of neighbours
    is that of the channel, and in a continuous channel the next row but one has nearly the same.
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
    """Autocorrelation of a channel at a lag of so many rows."""
    y = values - np.mean(values)
    return float(y[by:] @ y[:-by]) / float(y @ y)


class EncoderHarmonics(Orders):
    """Orders 1, 2 and 4: errors of the encoder or resolver."""

    name = "encoder_harmonics"
    family = "instrument"
    dimensions = POSITIONS
    cause = "The scale is eccentric and oval, and the signals of its reading heads differ."
    formula = "orders 1, 2 and 4, as above; without 2 and 4 it is output_eccentricity"
    mistaken_for = ("output_eccentricity",)
    reference = "Sanchez-Brea and Morlanes, Meas. Sci. Technol. 19, 2008"
    orders = (1, 2, 4)


class GaugeBias(OneColumn):
    """A constant that the instrument adds."""

    name = "gauge_bias"
    family = "instrument"
    cause = "The zero of the instrument deviates."
    formula = "c"
    mistaken_for = ("process_mean_shift", "lot_offset")
    reference = "AIAG, Measurement Systems Analysis, 2010"
    weight = Weight("offset", "c, constant that the instrument adds", low=-inf)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.ones(len(measurements))


FINEST = 1e-6
"""Least step, as a fraction of the range of the measurements, that is searched for."""
OFF = 0.06
"""Rms deviation from the multiples, in steps, that is allowed: for random values it is 0.29."""
MIN_DISTINCT_LEVELS = 5
"""Distinct values below which any numbers may be multiples of a step, unless they recur."""


def step_of(values: Array) -> float | None:
    """The step q of measurements (n,) that are all whole multiples of q, None where they are not.

    The smallest difference of two values is about a step; the sum of all the differences, counted
    in steps, gives it exactly.
    """
    levels = np.unique(values)
    if len(levels) < 3 or (len(levels) < MIN_DISTINCT_LEVELS and len(values) < 4 * len(levels)):
        return None
    gaps = np.diff(levels)
    gaps = gaps[gaps > FINEST * np.ptp(levels)]
    counts = np.round(gaps / float(np.min(gaps)))
    step = float(gaps.sum() / counts.sum())
    counts = np.round(levels / step)
    step = float(levels @ counts) / max(float(counts @ counts), 1.0)
    off = levels / step - np.round(levels / step)
    return step if float(np.sqrt(np.mean(off**2))) < OFF else None


class Quantisation(Effect):
    """Measurements are multiples of the instrument's resolution."""

    name = "quantisation"
    family = "instrument"
    cause = "The instrument resolves whole steps only."
    formula = "y becomes q round(y/q)"
    mistaken_for = ()
    reference = "Widrow and Kollar, Quantization Noise, 2008"

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        meaning = "q, the step; 0 is no quantisation"
        return tuple(
            quantity(f"{target.prefix(output)}step", output.unit, meaning, linear=False) for output in target.outputs
        )

    def shown(self, measured: Mapping[str, Array], target: Target) -> dict[str, float] | None:
        numbers = zip(target.outputs, self.own_parameters(target), strict=True)
        steps = {number.name: step_of(measured[output.name]) for output, number in numbers}
        if not any(steps.values()):
            return None
        return {name: step or 0.0 for name, step in steps.items()}

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        numbers = zip(target.outputs, self.own_parameters(target), strict=True)
        steps = {output.name: value_or_zero(values, number.name) for output, number in numbers}
        return Action(reading={name: partial(round_to_step, step=q) for name, q in steps.items() if q > 0.0})


def round_to_step(values: Array, step: float) -> Array:
    """Values (n,) in whole steps."""
    return np.asarray(step * np.round(values / step))


class ReadOutLag(SignedSpeed):
    """The output is recorded late, or its input is.

    An output that grows with the motion lags by v times the delay (a < 0); in a difference
    in/i - out, such as the transmission error, a late output has the opposite sign (a > 0).
    """

    name = "read_out_lag"
    family = "instrument"
    dimensions = POSITIONS
    cause = "The output is recorded some time after the input."
    formula = "a v d"
    mistaken_for = ("viscous_friction", "windage")
    reference = "Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, per unit of speed", speed_unit(target), -inf),)
