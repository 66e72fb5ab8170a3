"""Attribution to a wrongly recorded input of single units: biased, mis-scaled, or drifting.

A part error that was recorded b too large causes a residual of -b times the model's sensitivity to
it in every output of every unit; one recorded as (1 + g) times its value causes a proportional one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter

import numpy as np
from scipy.special import chdtri, ndtri

from ....arrays import Array
from ....gap_population_records import Attribution, InputChange
from ....models.effects.measurements import measurements_of
from ....models.measurable import Column, Role
from ..predictor import predictor
from ..result import Ending
from ..scan import generic_residual
from ..setup import LEAST_NAMED
from .attribution import order_of

GAIN_LOW, GAIN_HIGH = -0.5, 1.0
BIAS_AT_MOST = 3.0
"""In root mean squares of the recorded values. Both are assumptions: more would be noticed at
once.
"""
NEWTON = 3
STEP = 1e-4
MEASURED_AGAIN = 3
"""Number of parts whose measurement is to be repeated."""


@dataclass(frozen=True)
class Wrong:
    """An input recorded wrongly (or the zero of an output), and the residual given it.

    `amount` is how much too large it was recorded, `residual_square` the squared whitened residual
    given it, `moved` (N,) the change of the model's prediction, whitened.
    """

    name: str
    kind: str
    unit: str
    amount: float
    error: float
    residual_square: float
    moved: Array
    is_input: bool = True
    objection: str = ""


@dataclass(frozen=True)
class Records:
    """The units of an analysis, and all errors that a recorded input may have."""

    end: Ending

    @cached_property
    def uncorrected_prediction(self) -> Array:
        """The prediction (N,) of the uncorrected model."""
        return self._predicted({})

    @cached_property
    def y(self) -> Array:
        """The whitened residual of that prediction; the zeros of the outputs are not subtracted."""
        data = self.end.setup.data
        return self._white(data.stacked(data.measured) - self.uncorrected_prediction)

    @cached_property
    def order(self) -> Array:
        """The order of the units, from 0 to 1."""
        return order_of(self.end.setup.data)

    @property
    def inputs(self) -> tuple[Column, ...]:
        """Numeric inputs of the model."""
        return tuple(c for c in self.end.setup.data.target.columns if c.role is Role.INPUT and not c.text)

    @cached_property
    def zeros(self) -> tuple[Wrong, ...]:
        """The gauge of each output, biased or drifting."""
        data, gauge_errors = self.end.setup.data, list[Wrong]()
        for kind, shape in (("bias", np.ones(len(data))), ("trend", self.order)):
            for at, output in enumerate(data.outputs):
                column = np.kron(np.eye(len(data.outputs))[at], shape)
                gauge_errors.append(self._of_column(f"gauge of {output.name}", kind, output.unit, column))
        return tuple(gauge_errors)

    @cached_property
    def wrong(self) -> tuple[Wrong, ...]:
        """Every error of every input."""
        return tuple(self._every())

    def _every(self) -> Iterator[Wrong]:
        for column in self.inputs:
            size = float(np.sqrt(np.mean(self.end.setup.data.values(column.name) ** 2)))
            weight = column.unit == ""  # of a cost: no measurement with a step offset
            for kind in ("gain",) if weight else ("bias", "gain", "trend"):
                if size > 0.0:
                    yield self._fitted(column, kind, size)

    def _of_column(self, name: str, kind: str, unit: str, column: Array) -> Wrong:
        white = self._white(column)
        square = max(float(white @ white), 1e-300)
        amount = float(white @ self.y) / square
        rss = float(np.sum((self.y - amount * white) ** 2))
        return Wrong(name, kind, unit, amount, square**-0.5, rss, amount * white, False)

    def _fitted(self, column: Column, kind: str, size: float) -> Wrong:
        """The error with its likeliest admissible amount, by Newton's method."""
        low, high = (GAIN_LOW, GAIN_HIGH) if kind == "gain" else (-BIAS_AT_MOST * size, BIAS_AT_MOST * size)
        step = STEP * (1.0 if kind == "gain" else size)
        amount, wanted, slope = 0.0, 0.0, np.zeros_like(self.y)
        for _ in range(NEWTON):
            here = self._moved(column, kind, amount)
            slope = (self._moved(column, kind, amount + step) - here) / step
            square = float(slope @ slope)
            if square <= 0.0:
                break
            wanted = amount + float(slope @ (self.y - here)) / square
            amount = float(np.clip(wanted, low, high))
        moved = self._moved(column, kind, amount)
        square = float(slope @ slope)
        error = square**-0.5 if square > 0.0 else np.inf
        shown = "" if kind == "gain" else column.unit
        why = f"it would need {wanted:.3g} {shown}".rstrip() if wanted != amount else ""
        rss = float(np.sum((self.y - moved) ** 2))
        return Wrong(column.name, kind, shown, amount, error, rss, moved, True, why)

    def _moved(self, column: Column, kind: str, amount: float) -> Array:
        """The prediction for the right input minus that for the recorded one, whitened."""
        recorded = self.end.setup.data.values(column.name)
        if kind == "gain":
            right = recorded / (1.0 + amount)
        else:
            right = recorded - amount * (self.order if kind == "trend" else 1.0)
        return self._white(self._predicted({column.name: right}) - self.uncorrected_prediction)

    def _predicted(self, changed: dict[str, Array]) -> Array:
        plan, data = self.end.setup.plan, self.end.setup.data
        data = replace(data, measurements=measurements_of(data.target.columns, {**data.measurements.table, **changed}))
        return data.stacked(predictor(plan, data)({}))

    def _white(self, columns: Array) -> Array:
        return self.end.analysis.search.fitter.space.whiten(columns)

    def explains(self, wrong: Wrong) -> bool:
        """Whether the residual given it is only noise, for any zeros."""
        analysis = self.end.analysis
        fitter = analysis.search.fitter.of_record(self.y - wrong.moved)
        remaining = generic_residual(fitter.fit(()), fitter, analysis.null_model.generic)
        return bool(remaining.evidence.max(initial=0.0) <= analysis.search.thresholds.generic)

    @cached_property
    def score_of_identified(self) -> float:
        """The squared residual given the identified effects and all zeros, plus their price."""
        fit, fitter = self.end.fit, self.end.analysis.search.fitter
        count = sum(member.candidate.count for member in fit.members)
        return float(fit.rss + self.price * (count + fitter.q.shape[1]))

    @property
    def price(self) -> float:
        """The price of a fitted parameter."""
        return self.end.analysis.search.fitter.penalty

    @cached_property
    def gauges(self) -> float:
        """The squared residual given only the gauge biases that gain more than their price."""
        whole = float(self.y @ self.y)
        pays = (max(whole - gauge.residual_square - self.price, 0.0) for gauge in self.zeros if gauge.kind == "bias")
        return whole - sum(pays)


def of_recorded(end: Ending) -> tuple[Attribution, ...]:
    """The recorded inputs that alone may cause the units' deviations, empty where these are noise."""
    if len(end.setup.data) < LEAST_NAMED:
        return ()
    records = Records(end)
    every = (*records.wrong, *records.zeros)
    rate = end.setup.plan.settings.false_rate / max(len(every), 1)
    least = float(chdtri(1, rate))
    best = min(records.wrong, key=lambda wrong: wrong.residual_square, default=None)
    if best is None or float(records.y @ records.y) - best.residual_square <= least:
        return ()
    top = min(*(wrong.residual_square + records.price for wrong in every), records.score_of_identified, records.gauges)
    max_distance = end.setup.plan.settings.set_distance
    standing = [
        wrong
        for wrong in every
        if not wrong.objection
        and wrong.residual_square + records.price - top <= max_distance
        and records.explains(wrong)
    ]
    if not any(wrong.is_input for wrong in standing):
        return () if end.fit.members or not end.analysis.significant else (_none(end, best),)
    standing.sort(key=attrgetter("residual_square"))
    return _records_of(end, records, standing, top, max_distance)


def _none(end: Ending, best: Wrong) -> Attribution:
    text = f"no input recorded wrongly explains these units alone; nearest is a {best.kind} of {best.name}"
    return Attribution("", _outputs(end), best.kind, (), "none", (), text)


def _records_of(
    end: Ending, records: Records, standing: list[Wrong], top: float, max_distance: float
) -> tuple[Attribution, ...]:
    """One record per remaining kind."""
    effect = ", ".join(end.fit.names)
    alone = len(standing) == 1 and not (effect and records.score_of_identified - top <= max_distance)
    verdict = "attributed" if alone else "cannot tell"
    text = _text(end, records, standing, alone)
    attributions = []
    for kind in dict.fromkeys(wrong.kind for wrong in standing):
        errors = [wrong for wrong in (*records.wrong, *records.zeros) if wrong.kind == kind]
        errors.sort(key=attrgetter("residual_square"))
        records_of_kind = tuple(
            _record(end, wrong, wrong in standing, wrong.residual_square + records.price - top) for wrong in errors
        )
        names = tuple(wrong.name for wrong in standing if wrong.kind == kind)
        attributions.append(Attribution(effect, _outputs(end), kind, names, verdict, records_of_kind, text))
    return tuple(attributions)


def _record(end: Ending, wrong: Wrong, stands: bool, distance: float) -> InputChange:
    half = float(ndtri(0.5 + 0.5 * end.setup.plan.settings.interval)) * wrong.error
    why = "" if stands else wrong.objection or "it does not explain the residual"
    return InputChange(
        wrong.name,
        wrong.amount,
        wrong.amount - half,
        wrong.amount + half,
        wrong.unit,
        float("nan"),
        max(distance, 0.0),
        why,
        MEASURED_AGAIN if stands and wrong.is_input else 0,
    )


def _text(end: Ending, records: Records, standing: list[Wrong], alone: bool) -> str:
    first = next(wrong for wrong in standing if wrong.is_input)
    if alone:
        size = f"{first.amount:.3g} {first.unit}".rstrip()
        return f"{first.kind} of {first.name} as it was recorded ({size}) explains these units"
    names = [*(f"{wrong.kind} of {wrong.name}" for wrong in standing), *end.fit.names]
    return f"cannot tell between {', '.join(names)}; measure {first.name} of {MEASURED_AGAIN} parts again"


def _outputs(end: Ending) -> str:
    return ", ".join(o.name for o in end.setup.data.outputs)
