"""Statistics over rigid units of their backlash over a turn, with derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from ....section import Array, Single
from ...inputs import Uniform
from .contact import Slopes, Turn
from .units import Involute, Statistic, deviation, mean, ordered_quantile, quantile, share_below, share_within

Spread = Callable[[Array], Array]
INTERFERENCE = ("turn_mean", "share_of_turn", "overlap", "preload")


@dataclass(frozen=True, slots=True)
class Conditions:
    """Options of the statistics: one-sided `coverage`, the `limit` [arcmin] of the yield, and
    what counts as interference (`turn_mean`: y < 0 in the mean of the turn; `share_of_turn`: at any
    position, as a fraction of all; `overlap`: y < -`overlap` [arcmin] anywhere).
    """

    coverage: float = 0.9973
    limit: float = 1.0
    interference: str = "turn_mean"
    overlap: float = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Measure:
    """A statistic and how a weight of each unit (n,) spreads over its positions."""

    statistic: Statistic
    spread: Spread
    of: Turn | None = None
    """The turn that it is a statistic of, where it is another than that of the `Measures`."""

    def slopes(self, turn: Turn, errors: Slopes | None = None) -> Array:
        """Derivatives by `gradient.NAMES`, none by the size of phi_1; `errors` as in a turn."""
        return (self.of or turn).slopes(self.spread(self.statistic.weight), errors)


class Measures:
    """Statistics of a turn by name, each computed at its first use; where its `play` has been
    stretched by a factor, `widening` is that factor.
    """

    def __init__(self, turn: Turn, involute: Involute, conditions: Conditions, widening: float = 1.0) -> None:
        self.turn, self.involute, self.conditions, self.widening = turn, involute, conditions, widening
        self._cached: dict[str, Measure] = {}

    def __getitem__(self, name: str) -> Measure:
        if name not in self._cached:
            self._cached[name] = self._computed(name)
        return self._cached[name]

    def _computed(self, name: str) -> Measure:
        kind, _, subject = name.partition(" ")
        if (held := self.turn.held) is not None and kind in ("interference", "overlap"):
            return replace(Measures(held, self.involute, self.conditions, self.widening)[name], of=held)
        if kind == "yield":
            of = self._largest
            return Measure(share_within(of[0], self.involute, self.conditions.limit), of[1])
        if kind == "interference":
            return self._interference(subject or self.conditions.interference)
        if kind == "overlap":
            return self._overlap()
        if kind == "rms":
            return self._rms()
        values, spread = self._largest if subject == "max" else self._average
        if kind == "quantile":
            return Measure(quantile(values, self.involute, self.conditions.coverage), spread)
        return Measure((mean if kind == "mean" else deviation)(values, self.involute), spread)

    # ---------------------------------------------------------------- values of units

    @property
    def largest(self) -> Array:
        """Largest backlash (n,) [arcmin] of the cycloid stage over the turn."""
        return self._largest[0]

    @cached_property
    def _positive(self) -> NDArray[np.float32]:
        return np.maximum(self.turn.play, 0.0)

    @cached_property
    def _largest(self) -> tuple[Array, Spread]:
        """Largest backlash of the cycloid stage over the turn."""
        play = self.turn.play
        values = np.maximum(play.max(axis=0).astype(np.float64), 0.0)
        return values, partial(_weights_at_largest, play, values)

    @cached_property
    def _average(self) -> tuple[Array, Spread]:
        """Mean backlash of the cycloid stage over the turn."""
        values = self._positive.mean(axis=0, dtype=np.float64)
        return values, partial(_even_weights, self.turn.play)

    def _rms(self) -> Measure:
        """Root mean square of the backlash over units and positions."""
        play, involute = self._positive.astype(np.float64), self.involute
        first, square = involute.mean, involute.variance + involute.mean**2
        level = float(play.mean())
        by_unit = np.mean(play**2, axis=0) + 2.0 * first * play.mean(axis=0) + square
        value = float(np.sqrt(by_unit.mean()))
        error = float(np.std(by_unit)) / np.sqrt(len(by_unit)) / (2.0 * value)
        count, signed = len(by_unit), self.turn.play
        weights = np.full(count, 1.0 / (value * count))

        def spread(weight: Array) -> Array:
            return np.asarray(_even_weights(signed, weight) * (play + first))

        return Measure(Statistic(value, weights, (level * first + square) / value, error), spread)

    # ---------------------------------------------------------------- interference

    def _below(self, values: Array, limit: float, slope: Array | Single) -> Statistic:
        """P(values < limit), each integrated over the pin-circle radius, by which it grows with `slope`
        [arcmin/um]; both of shape (..., n). Units with fitted pins are integrated over the place of their need within a
        class, but for those that need more than the outermost class.
        """
        sample, fitted = self.turn.population.sample, self.turn.fitted
        growth = self.widening * self.turn.design.width("pin_circle_radius") * slope.astype(np.float64)
        radius = np.broadcast_to(sample.z["pin_circle_radius"], values.shape)
        law = sample.hierarchy.of("pin_circle_radius")
        if fitted is None:
            return share_below(values.ravel(), limit, growth.ravel(), radius.ravel(), law)
        of_class, z = (
            np.broadcast_to(of_unit, values.shape).ravel() for of_unit in (self.widening * fitted.growth, fitted.z)
        )
        follows = np.broadcast_to(fitted.follows, values.shape).ravel()
        flat, weight, parts = values.ravel(), np.zeros(values.size), []
        for rows, by, place, over in (
            (follows, of_class, z, Uniform()),
            (~follows, growth.ravel(), radius.ravel(), law),
        ):
            share = float(np.mean(rows))
            if share > 0.0:
                part = share_below(flat[rows], limit, by[rows], place[rows], over)
                weight[rows] = share * part.weight
                zone = 0.0 if over is not law else share * part.by_zone
                parts.append((share * part.value, share * part.error, zone))
        value, error, by_zone = np.array(parts).sum(axis=0).tolist()
        return Statistic(value, weight, 0.0, error, by_zone)

    def _interference(self, kind: str) -> Measure:
        play, slope = self.turn.play, self.turn.by_circle
        if kind == "share_of_turn":
            return self._fraction_of_turn()
        if kind == "overlap":
            at = play.argmin(axis=0)
            least, slope_there = (np.take_along_axis(by_place, at[None, :], axis=0)[0] for by_place in (play, slope))
            below = self._below(least.astype(np.float64), -self.conditions.overlap, slope_there)
            return Measure(below, partial(_weights_at_positions, play.shape, at, True))
        values, slope_of_unit = play.mean(axis=0, dtype=np.float64), slope.mean(axis=0, dtype=np.float64)
        return Measure(self._below(values, 0.0, slope_of_unit), partial(_weights_at_all_positions, play.shape))

    def _overlap(self) -> Measure:
        """Largest overlap over the turn that 95 % of the units stay below [arcmin]."""
        play = self.turn.play
        values = np.maximum(-play.min(axis=0).astype(np.float64), 0.0)
        spread = partial(_weights_at_positions, play.shape, play.argmin(axis=0), values > 0.0)
        return Measure(ordered_quantile(values, 0.95), lambda weight: spread(-weight))

    def _fraction_of_turn(self) -> Measure:
        play = self.turn.play.astype(np.float64)
        below = self._below(play, 0.0, self.turn.by_circle)
        by_place = below.weight.reshape(play.shape)
        error = float(np.std(np.mean(play < 0.0, axis=0))) / np.sqrt(play.shape[1])
        statistic = Statistic(below.value, np.ones(play.shape[1]), 0.0, error, below.by_zone)
        return Measure(statistic, lambda weight: by_place * weight)


# These are not methods: a measure that refers to the `Measures` that cache it would be a cycle, and
# the arrays of every design would stay in memory until Python searches for cycles.


def _weights_at_positions(
    shape: tuple[int, int], at: NDArray[np.intp], counted: NDArray[np.bool_] | bool, weight: Array
) -> Array:
    """Weights of the units that are counted, each at its position `at` (n,)."""
    weights = np.zeros(shape)
    weights[at, np.arange(shape[1])] = np.where(counted, weight, 0.0)
    return weights


def _weights_at_largest(play: NDArray[np.float32], values: Array, weight: Array) -> Array:
    """Weights of the units whose largest backlash, `values` (n,), is above zero, where it is reached."""
    return _weights_at_positions(play.shape, play.argmax(axis=0), values > 0.0, weight)


def _even_weights(play: NDArray[np.float32], weight: Array) -> Array:
    return (play > 0.0) * (weight / len(play))


def _weights_at_all_positions(shape: tuple[int, int], weight: Array) -> Array:
    return np.broadcast_to(weight / shape[0], shape)
