"""Simulated and measured units compared, and their differences attributed to inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter, itemgetter

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import chdtri, ndtri

from ...models.effects.measurements import labels_of, measurements_of, unit_numbers
from ...models.effects.population import Law, acts_on_scatter
from ...models.measurable import Column, Role, Source
from ...section import Array
from .data import GapData
from .input_changes import KINDS, Change, Tables, UnitLaw
from .library import predictor
from .population import likelier
from .records import Attribution, InputChange, Measurement, PopulationLine, Rival
from .result import Ending
from .scan import generic_residual
from .setup import LEAST_NAMED, residual_of

# Statistics that distinguish batches of units: location, spread, shape, mixture, trend, lots.
#
# Every statistic maps batches (b, n), units in the order of production, to (b,).


Statistic = Callable[[Array], Array]
LEAST_UNITS = 3
"""Number of units of a lot from which its mean is compared with others."""
STEPS = (-3.5, -2.5, -1.8, 1.8, 2.5, 3.5)
SHARES = (0.1, 0.25, 0.5)
"""Offsets, in standard deviations of one supplier, and fractions of second suppliers that are
tried.
"""
LATTICE = np.linspace(-8.0, 8.0, 1025)
NORMAL = Law(-8.0, 1.0 / 64.0, -0.5 * LATTICE**2, 1.0)
"""Up to a constant, which cancels in ratios."""


@dataclass(frozen=True)
class Look:
    """A statistic: its aspect, its name, its unit, and whether it has a sign.

    A `signed` statistic has an interval; others are never negative, and positive by chance alone.
    """

    aspect: str
    name: str
    unit: str
    of: Statistic
    signed: bool = True


def along(order: Array) -> Statistic:
    """Change from the first unit to the last one, by least squares on their `order` (n,)."""
    centred = order - order.mean()
    size = float(centred @ centred)
    weight = centred * (np.ptp(order) / size) if size > 0.0 else centred
    return lambda x: np.asarray(x @ weight)


def shape_distance(quantiles: Array) -> Statistic:
    """Distance from a population with these `quantiles` (n,) once mean and scatter are the same.

    In standard deviations: the 2-Wasserstein distance after standardisation.
    """
    wanted = (quantiles - quantiles.mean()) / quantiles.std()

    def distance(x: Array) -> Array:
        scaled = (x - x.mean(axis=1, keepdims=True)) / x.std(axis=1, keepdims=True)
        return np.asarray(np.sqrt(np.mean((np.sort(scaled, axis=1) - wanted) ** 2, axis=1)))

    return distance


def between_lots(of_lot: NDArray[np.int64]) -> Statistic | None:
    """The F ratio of the means of lots, by the number (n,) of each unit's lot; None without two lots
    of enough units.
    """
    counts = np.bincount(of_lot)
    large_lots = np.flatnonzero(counts >= LEAST_UNITS)
    if len(large_lots) < 2:
        return None
    kept = np.isin(of_lot, large_lots)
    indicator = (of_lot[kept][:, None] == large_lots).astype(float)
    sizes = indicator.sum(axis=0)

    def ratio(x: Array) -> Array:
        part = x[:, kept]
        means = part @ indicator / sizes
        between = (sizes * (means - part.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
        within = ((part - means @ indicator.T) ** 2).sum(axis=1)
        return np.asarray(between / (len(large_lots) - 1) / (within / (sizes.sum() - len(large_lots))))

    return ratio


def two_supplier_ratio(law: Law = NORMAL) -> Statistic:
    """Twice the log likelihood ratio of two suppliers to one, for equal mean and scatter.

    `law` is that of one supplier about its mean. The best of a few fixed mixtures counts: its
    distribution by chance is simulated.
    """
    single, steps = law.standardised(LATTICE), law.std * np.array(STEPS)
    ratios = np.array([law.mixed(by, p).standardised(LATTICE, p * by) - single for by in steps for p in SHARES])

    def gain(x: Array) -> Array:
        about = (x - x.mean(axis=1, keepdims=True)) / x.std(axis=1, keepdims=True)
        return likelier(about, NORMAL.low, NORMAL.step, ratios)

    return gain


def looks_of(
    unit: str,
    order: Array,
    mixture: Statistic | None = None,
    shape: Statistic | None = None,
    lots: Statistic | None = None,
) -> tuple[Look, ...]:
    """All statistics of one output, without those that are None."""
    looks = (
        Look("location", "mean", unit, lambda x: np.asarray(x.mean(axis=1))),
        Look("location", "median", unit, lambda x: np.asarray(np.median(x, axis=1))),
        Look("spread", "standard deviation", unit, lambda x: np.asarray(x.std(axis=1, ddof=1))),
        Look("shape", "skewness", "", lambda x: np.asarray(scipy.stats.skew(x, axis=1))),
        Look("shape", "kurtosis", "", lambda x: np.asarray(scipy.stats.kurtosis(x, axis=1))),
        shape and Look("shape", "distance of shapes", "", shape, signed=False),
        mixture and Look("mixture", "two suppliers", "", mixture, signed=False),
        Look("trend", "first to last unit", unit, along(order)),
        lots and Look("lots", "scatter of lots", "", lots, signed=False),
    )
    return tuple(look for look in looks if look is not None)


# Lines of statistics of measured and simulated batches, and whether these differ.


LEVEL = 0.9
DETECTED = 0.9
"""Probability of detecting a difference of the stated size."""
COMMON = 0.05
DIFFERS, NOT_DETECTED = "differs", "no difference detected; one of {} would have been"
DRAWN = 500_000
"""Approximate number of units of all simulated batches together."""
AGAIN = 200
"""Number of batches drawn from the measured one for the intervals."""


def batches(count: int) -> int:
    """The number of batches of `count` units that are simulated."""
    return int(np.clip(DRAWN // count, 300, 1000))


def rare_value(values: Array, rate: float) -> float:
    """The value that a fraction `rate` of simulated values (b,) exceeds. The tail is extrapolated
    as exponential, as that of a likelihood ratio is; that of a normal falls more steeply.
    """
    common = float(np.quantile(values, 1.0 - COMMON))
    beyond = values[values > common] - common
    more = float(beyond.mean()) if len(beyond) else 0.0
    return common + more * max(float(np.log(COMMON / rate)), 0.0)


@dataclass(frozen=True)
class Compared:
    """Measured units `x` (n,) and batches `drawn` (b, n) of the model, in the same order.

    `offset`, by name of the statistic, is added to both where they are shown.
    """

    looks: tuple[Look, ...]
    x: Array
    drawn: Array
    rate: float
    least: int

    def lines(
        self, model: str, output: str, offset: dict[str, float], rng: np.random.Generator
    ) -> tuple[PopulationLine, ...]:
        """A line for each statistic; a difference exceeds what any line reaches by chance."""
        again = self.x[rng.integers(0, len(self.x), (AGAIN, len(self.x)))]
        return tuple(self._line(look, model, output, offset.get(look.name, 0.0), again) for look in self.looks)

    def _line(self, look: Look, model: str, output: str, offset: float, again: Array) -> PopulationLine:
        drawn, measured = look.of(self.drawn), float(look.of(self.x[None])[0])
        simulated, low, high = float(np.mean(drawn)), float("nan"), float("nan")
        difference, apart = measured - simulated, drawn - simulated
        if look.signed:
            half = float(ndtri(0.5 + 0.5 * LEVEL) * np.std(look.of(again)))
            low, high = difference - half, difference + half
        rate = 1.0 - (1.0 - self.rate) ** (1.0 / len(self.looks))  # of all lines together (Sidak)
        limit = rare_value(np.abs(apart) if look.signed else apart, rate)
        beyond = abs(difference) > limit if look.signed else difference > limit
        shows = limit + float(ndtri(DETECTED) * np.std(drawn))
        text = DIFFERS if beyond else NOT_DETECTED.format(f"{shows:.3g} {look.unit}".rstrip())
        enough = beyond or len(self.x) >= self.least
        text = text if enough else f"cannot tell with n = {len(self.x)}"
        what = (model, output, look.aspect, look.name, look.unit)
        numbers = (simulated + offset, measured + offset, difference, low, high, limit, shows)
        return PopulationLine(*what, *numbers, text, bool(enough))


# Units compared with the model's, before and after correction: a batch with the population, or
# units that are simulated one by one with the values at the same inputs.


EXACT = 1e-9
"""Fraction of the simulated scatter below which measurements are the simulation itself."""
PLAIN = ("mean", "two suppliers", "first to last unit")
SHAPES = ("standard deviation", "skewness", "kurtosis")
"""Statistics of the differences themselves, and those of the units with the differences added."""
NO_DIFFERENCE = "no difference detected: measured is as simulated"


def compared(end: Ending) -> tuple[PopulationLine, ...]:
    """Lines before, and after correction where an effect was identified; empty where rows are no
    units.

    A population has lines of its one output. Before correction the model of single units is
    uncorrected: not even the zero of an angle is subtracted.
    """
    if not (population := end.setup.data.target.population) and not has_units(end):
        return ()
    models = ("before", "after") if end.fit.members or end.analysis.scatter else ("before",)
    if population:
        return tuple(line for k, model in enumerate(models) for line in _batch_lines(end, model, k))
    plain = predictor(end.setup.plan, end.setup.data)({})
    residuals = np.split(residual_of(end.setup, end.fit), len(end.setup.data.outputs))
    lines: tuple[PopulationLine, ...] = ()
    for stream, model in enumerate(models):
        for at, output in enumerate(end.setup.data.outputs):
            corrected = end.setup.data.measured[output.name] - residuals[at]
            simulated = plain[output.name] if model == "before" else corrected
            lines += _pair_lines(end, at, model, stream, simulated)
    return lines


def _batch_lines(end: Ending, model: str, stream: int) -> tuple[PopulationLine, ...]:
    """The lines of the deviations of units from the model's prediction."""
    initial = end.analysis.initial_null_model
    setup, fit = (end.setup, end.fit) if model == "after" else (initial.setup, initial.null_fit)
    output, kept = setup.data.outputs[0], initial.noises[0].counted
    law, middle = initial.setup.laws[output.name], 0.0
    for effect in end.analysis.scatter[:1] if model == "after" else ():
        law, middle = effect.changed(law), effect.moves
    x = residual_of(setup, fit)[kept] + middle
    measurements = setup.data.measurements
    order = unit_numbers(measurements)[kept].astype(float)
    lots = between_lots(labels_of(measurements[Role.LOT])[1][kept]) if Role.LOT in measurements else None
    quantiles = law.histogram.ppf((np.arange(len(x)) + 0.5) / len(x))
    looks = looks_of(output.unit, order, two_supplier_ratio(law), shape_distance(quantiles), lots)
    rng = np.random.default_rng([setup.plan.seed, 14, stream])
    drawn = law.histogram.rvs(size=(batches(len(x)), len(x)), random_state=rng)
    shown = setup.data.measured[output.name][kept] - x
    mean, trend = float(shown.mean()), float(along(order)(shown[None])[0])
    offset = {"mean": mean, "median": mean, "first to last unit": trend}
    whole = Compared(looks, x, drawn, setup.plan.settings.false_rate, LEAST_NAMED)
    return whole.lines(model, output.name, offset, rng)


def _pair_lines(end: Ending, at: int, model: str, stream: int, simulated: Array) -> tuple[PopulationLine, ...]:
    setup = end.setup
    output, kept = setup.data.outputs[at], end.analysis.initial_null_model.noises[at].counted
    s, measured = simulated[kept], setup.data.measured[output.name][kept]
    r = measured - s
    order = unit_numbers(setup.data.measurements)[kept].astype(float)
    scale = max(float(np.std(s)), float(np.std(measured)), 1e-300)
    looks = _looks(output.unit, s, order)
    if float(np.std(r)) <= EXACT * scale and abs(float(r.mean())) <= EXACT * scale:
        shown = _shown(s, order)
        nothing = (0.0, 0.0, 0.0, 0.0, 0.0, NO_DIFFERENCE)
        values = [shown.get(look.name, 0.0) for look in looks]
        return tuple(
            PopulationLine(model, output.name, look.aspect, look.name, look.unit, value, value, *nothing)
            for look, value in zip(looks, values, strict=True)
        )
    rng, count = np.random.default_rng([setup.plan.seed, 15, stream, at]), batches(len(r))
    drawn = rng.permuted(np.tile(r, (count, 1)), axis=1) * rng.choice([-1.0, 1.0], (count, len(r)))
    # one supplier is drawn as such: permuted measurements would keep a second one
    normal = float(np.std(r)) * rng.standard_normal((count, len(r)))
    looks = tuple(_simulate_look(look, normal) if look.name == "two suppliers" else look for look in looks)
    whole = Compared(looks, r, drawn, setup.plan.settings.false_rate, LEAST_NAMED)
    return whole.lines(model, output.name, _shown(s, order), rng)


def _looks(unit: str, s: Array, order: Array) -> tuple[Look, ...]:
    """Statistics of differences (b, n) from simulated s (n,): those of s + x minus those of s."""

    def beyond(of: Statistic) -> Statistic:
        return lambda x: of(s + x) - float(of(s[None])[0])

    moved = SHAPES if float(np.std(s)) > 0.0 else ()
    return tuple(
        replace(look, of=beyond(look.of)) if look.name in moved else look
        for look in looks_of(unit, order, two_supplier_ratio())
        if look.name in (*PLAIN, *moved)
    )


def _shown(s: Array, order: Array) -> dict[str, float]:
    """The statistics of simulated values s (n,) that differences are added to."""
    return {look.name: float(look.of(s[None])[0]) for look in looks_of("", order) if look.name in (*PLAIN, *SHAPES)}


def _simulate_look(look: Look, normal: Array) -> Look:
    """The same statistic with normal simulated batches."""
    return replace(look, of=lambda x: look.of(x if len(x) == 1 else normal))


def has_units(end: Ending) -> bool:
    """Whether rows are units that are simulated one by one."""
    data = end.setup.data
    named = any(c.role is Role.UNIT for c in data.target.columns)
    return named and not data.target.population and end.setup.plan.model is not None


# Changes of inputs compared by likelihood on one batch.


OUT_OF_QUESTION = 10.0
"""Tolerances from which the amount that an excluded input would need is no size of a part, and not told."""
UNLIKELY = 0.005
"""Level of each test of whether the best change explains the batch."""
DETECTION_FACTOR = float((ndtri(0.95) + ndtri(0.9)) ** 2)
"""Squared size, in standard errors, of an effect that is detected nine times out of ten."""


@dataclass(frozen=True)
class Weighed:
    """All changes of inputs on one batch, and those that the batch does not exclude.

    `rival` is the identified effect that is no change of an input, `likely` its log likelihood
    minus the price of its additional parameter.
    """

    tables: Tables
    distance: float
    level: float
    rival: str = ""
    likely: float = -np.inf

    @cached_property
    def _free(self) -> float:
        """The highest log likelihood of any amount, admissible or not."""
        return max(change.free[1] for change in self.tables.changes)

    @property
    def top(self) -> float:
        """The highest log likelihood of all, the rival among them."""
        return max(self._free, self.likely)

    @property
    def gain(self) -> float:
        """Twice the log likelihood ratio of the best change."""
        return 2.0 * (self._free - self.tables.none)

    @property
    def mixed(self) -> bool:
        """Whether the rival explains the batch as well."""
        return 2.0 * (self.top - self.likely) <= self.distance

    def behind(self, change: Change) -> float:
        """Twice the log likelihood by which the best admissible amount is behind the best of all."""
        return 2.0 * (self.top - change.best[1])

    @cached_property
    def standing(self) -> tuple[Change, ...]:
        """The changes that explain the batch as well as any, the best first."""
        changes = [change for change in self.tables.changes if self.behind(change) <= self.distance]
        return tuple(sorted(changes, key=self.behind))

    @cached_property
    def explained(self) -> bool:
        """Whether the residuals of the best of them are only noise."""
        best = self.standing[0]
        below = np.clip(self.tables.shares_below(best, best.best[0]), 1e-9, 1.0 - 1e-9)
        shape = scipy.stats.cramervonmises(below, "uniform").pvalue
        order = scipy.stats.linregress(self.tables.u, ndtri(below)).pvalue
        return bool(min(shape, order) > UNLIKELY)

    def record(self, change: Change, unit: str) -> InputChange:
        """A change as a record, amounts in the input's unit."""
        standing = change in self.standing
        amount = change.best[0] if standing else change.free[0]
        ends = change.interval(float(chdtri(1, 1.0 - self.level)), standing)
        low, high = sorted(change.shown(end) for end in ends)
        shown, share = change.shown(amount), change.share(amount)
        if not standing and abs(share) > OUT_OF_QUESTION:
            shown = low = high = share = np.nan
        return InputChange(
            change.name,
            shown,
            low,
            high,
            change.unit if change.source else unit,
            share,
            self.behind(change),
            "" if standing else self._reason_for_exclusion(change),
            parts_of(change, amount) if standing else 0,
            self._units_to_separate(change) if standing else 0,
        )

    def _reason_for_exclusion(self, change: Change) -> str:
        """Why a change is excluded."""
        amount, log = change.free
        if 2.0 * (self.top - log) > self.distance:
            return "the shape of the batch differs"
        if change.kind != "widening" and abs(change.share(amount)) > OUT_OF_QUESTION:
            return f"all of its tolerance explains {100.0 / abs(change.share(amount)):.2g} % of it"
        if change.kind != "widening":
            return f"it would need {abs(change.share(amount)):.3g} of its tolerance; its parts are inspected"
        if amount < change.low:
            return f"it would need {amount:.3g} of its tolerance, and parts are made over its whole width"
        return f"it would need {amount:.3g} times its tolerance"

    def _units_to_separate(self, change: Change) -> int:
        """The number of units that separate it from the best, by the divergence of their laws."""
        best = self.standing[0]
        if "trend" in (change.kind, best.kind) or change is best:
            return 0
        change_density, best_density = (self.tables.density(o, o.best[0]) for o in (change, best))
        probability = np.exp(best_density) * self.tables.law.step
        apart = float(probability @ (best_density - change_density))
        # below a distance of 0.01 in 10,000 units the laws are practically the same
        return int(np.ceil(self.distance / (2.0 * apart))) if apart > 5e-7 else 0


def parts_of(change: Change, amount: float) -> int:
    """The number of parts whose measurement would show the change of an input."""
    if change.source is None:
        return 0
    fraction = change.share(amount)
    scatter, peaked = _scatter(change.source)
    if change.kind == "widening":
        size = np.log(fraction) ** 2 if fraction > 1.0 else 0.0
        variance = 0.25 * (peaked - 1.0)
    else:
        size = fraction**2 * (1.0 if change.kind == "shift" else 1.0 / 12.0)
        variance = scatter
    return int(max(np.ceil(DETECTION_FACTOR * variance / size), 3)) if size > 0.0 else 0


def _scatter(source: Source) -> tuple[float, float]:
    """Variance of an input in squared tolerances, and its kurtosis."""
    raw = source.law.raw_moments(4)
    mean, second = raw[1], raw[2] - raw[1] ** 2
    fourth = raw[4] - 4.0 * mean * raw[3] + 6.0 * mean**2 * raw[2] - 3.0 * mean**4
    return float(second), float(fourth / second**2)


# Attribution of a batch's difference to an input: by likelihood, and by the inputs' limits.


def attribute_batch(end: Ending) -> tuple[Attribution, ...]:
    """The inputs that may cause the gap of a batch; empty where there is no gap."""
    analysis, data = end.analysis, end.setup.data
    sources = None if end.setup.plan.model is None else end.setup.plan.model.sources()
    if not analysis.significant or sources is None or not data.target.population:
        return ()
    names, output = _names(end), data.outputs[0]
    if why := _refusal_reason(end):
        return (Attribution(names, output.name, "", (), "cannot tell", (), why),)
    y, u = _units(end)
    settings = end.setup.plan.settings
    tables = Tables(UnitLaw(sources), y, u, settings.parts_out_of_limits)
    weighed = Weighed(tables, settings.set_distance, settings.interval, *_rival(end, tables))
    if weighed.gain <= tables.chance(settings.false_rate, end.setup.plan.seed):
        given = _subtracted_effects(end)
        text = given or f"no change of an input is significant: cannot tell with n = {len(y)}"
        return (Attribution(names, output.name, "", (), "none" if given else "cannot tell", (), text),)
    attributions = decide_changes(weighed, names, output.name, output.unit)
    basis = f" ({sources.basis})" if sources.basis else ""
    return tuple(replace(attribution, text=f"{attribution.text}{basis}") for attribution in attributions)


def decide_changes(weighed: Weighed, effect: str, output: str, unit: str) -> tuple[Attribution, ...]:
    """A record for each remaining kind of change, or a single record with why none remains."""

    def of(kind: str, verdict: str, text: str, names: tuple[str, ...] = ()) -> Attribution:
        records = [weighed.record(change, unit) for change in weighed.tables.changes if change.kind == kind]
        records.sort(key=lambda record: (bool(record.excluded_because), record.distance))
        return Attribution(effect, output, kind, names, verdict, tuple(records), text)

    if not weighed.standing or not weighed.explained:
        if weighed.mixed:
            text = f"{weighed.rival} explain the batch; no change of one input alone does"
            return (of("", "none", text),)
        best = max(weighed.tables.changes, key=lambda change: change.best[1])
        text = f"no admissible change of one input alone explains the batch; nearest is a {best.kind} of {best.name}"
        return (of(best.kind, "none", text),)
    text = explanation(weighed, unit)
    if all(change.source is None for change in weighed.standing):
        text = f"no input alone explains it within its limits; {text}"
        return (of(weighed.standing[0].kind, "none", text),)
    alone = len(weighed.standing) == 1 and not weighed.mixed
    names = {kind: tuple(change.name for change in weighed.standing if change.kind == kind) for kind in KINDS}
    verdict = "attributed" if alone else "cannot tell"
    return tuple(of(kind, verdict, text, kind_names) for kind, kind_names in names.items() if kind_names)


def explanation(weighed: Weighed, unit: str) -> str:
    """A sentence on the remaining changes, and the measurement that would decide between them."""
    names = [_describe_change(change) for change in weighed.standing]
    names += [weighed.rival] if weighed.mixed else []
    if len(names) == 1:
        change = weighed.standing[0]
        times = change.kind == "widening" and change.source is not None
        what = "times" if times else change.unit or unit
        sentence = f"{names[0]} ({change.shown(change.best[0]):.3g} {what}) alone would explain the batch"
        return f"{sentence}; several inputs together may do so as well"
    listed = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
    text = f"cannot tell with n = {len(weighed.tables.y)} between {listed}"
    parts = {change.source: parts_of(change, change.best[0]) for change in weighed.standing if change.source}
    source, count = min(((s, k) for s, k in parts.items() if k), key=itemgetter(1), default=(None, 0))
    return text if source is None else f"{text}; measure the {source.part} of {count} parts"


def _describe_change(change: Change) -> str:
    """The change of an input, or of the gauge, in words."""
    kind = "noise" if change.source is None and change.kind == "widening" else change.kind
    return f"{kind} of {change.name}"


def _names(end: Ending) -> str:
    return ", ".join([*end.fit.names, *(effect.candidate.name for effect in end.analysis.scatter[:1])])


def _refusal_reason(end: Ending) -> str:
    """Why no attribution to inputs is made; empty where it is."""
    count = len(end.setup.data)
    if not end.setup.plan.settings.effects_at_most or count < LEAST_NAMED:
        return f"cannot tell with n = {count} which input it is due to"
    setup = end.analysis.initial_null_model.setup
    measurements, target = setup.data.measurements, setup.data.target
    if any(acts_on_scatter(active.effect, active.values, measurements, target) for active in setup.plan.active):
        return "cannot tell which input it is due to: the model contains an effect on the scatter already"
    return ""


def _rival(end: Ending, tables: Tables) -> tuple[str, float]:
    """The identified effect on the scatter that no input explains, and its log likelihood."""
    best = end.analysis.scatter[0] if end.analysis.scatter else None
    if best is None or not best.apart_from_inputs:
        return "", -np.inf
    return best.apart_from_inputs, tables.under(best.changed) - 0.5 * float(np.log(len(tables.y)))


def trends(end: Ending) -> tuple[str, ...]:
    """Effects along the order of the units: they act as an input that drifts."""
    return tuple(member.name for member in end.fit.members if member.candidate.effect.along_units)


def _subtracted_effects(end: Ending) -> str:
    """The sentence on effects that are subtracted before attribution, empty without any."""
    attributable = (*trends(end), *end.analysis.initial_null_model.batch.levels)
    subtracted = [name for name in end.fit.names if name not in attributable]
    return f"given {', '.join(subtracted)}, nothing remains to attribute to an input" if subtracted else ""


def _units(end: Ending) -> tuple[Array, Array]:
    """Units (n,) that count, given the effects on single units, and their order (n,)."""
    initial = end.analysis.initial_null_model
    units = initial.batch.units(end.fit, trends(end))
    return units.x + units.law.mean, order_of(initial.setup.data)[initial.noises[0].counted]


def order_of(data: GapData) -> Array:
    """The order (n,) of the units, from 0 to 1."""
    numbers = unit_numbers(data.measurements).astype(float)
    return np.asarray(numbers / max(numbers.max(), 1.0))


# Attribution to a wrongly recorded input of single units: biased, mis-scaled, or drifting.
#
# A part error that was recorded b too large causes a residual of -b times the model's sensitivity to
# it in every output of every unit; one recorded as (1 + g) times its value causes a proportional one.


GAIN_LOW, GAIN_HIGH = -0.5, 1.0
MAX_BIAS_RATIO = 3.0
"""In root mean squares of the recorded values. Both are assumptions: more would be noticed at
once.
"""
NEWTON = 3
STEP = 1e-4
REMEASURED_PARTS = 3
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
        low, high = (GAIN_LOW, GAIN_HIGH) if kind == "gain" else (-MAX_BIAS_RATIO * size, MAX_BIAS_RATIO * size)
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


def attribute_to_records(end: Ending) -> tuple[Attribution, ...]:
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
        text = f"no input recorded wrongly explains these units alone; nearest is a {best.kind} of {best.name}"
        none = Attribution("", _outputs(end), best.kind, (), "none", (), text)
        return () if end.fit.members or not end.analysis.significant else (none,)
    standing.sort(key=attrgetter("residual_square"))
    return _records_of(end, records, standing, top, max_distance)


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
        REMEASURED_PARTS if stands and wrong.is_input else 0,
    )


def _text(end: Ending, records: Records, standing: list[Wrong], alone: bool) -> str:
    first = next(wrong for wrong in standing if wrong.is_input)
    if alone:
        size = f"{first.amount:.3g} {first.unit}".rstrip()
        return f"{first.kind} of {first.name} as it was recorded ({size}) explains these units"
    names = [*(f"{wrong.kind} of {wrong.name}" for wrong in standing), *end.fit.names]
    return f"cannot tell between {', '.join(names)}; measure {first.name} of {REMEASURED_PARTS} parts again"


def _outputs(end: Ending) -> str:
    return ", ".join(o.name for o in end.setup.data.outputs)


# The results of an analysis on units as a population: a table, and an attribution.


SHOWN = 3


def attribution_of(end: Ending) -> tuple[Attribution, ...]:
    """The inputs that may cause a difference; empty where rows are no units."""
    if end.setup.data.target.population:
        return attribute_batch(end)
    return attribute_to_records(end) if has_units(end) else ()


def inputs_instead(end: Ending, attributions: Sequence[Attribution]) -> tuple[Rival, ...]:
    """A rival: a shift of the process mean, where a shifted input makes units look like a mixture.

    Clipped interference changes the shape of the distribution as a second supplier does.
    """
    levels = end.analysis.initial_null_model.batch.levels if end.setup.data.target.population else ()
    apart = [effect.candidate for effect in end.analysis.scatter[:1] if effect.apart_from_inputs]
    shifts = [
        attribution
        for attribution in attributions
        if attribution.kind == "shift" and attribution.inputs and attribution.verdict != "none"
    ]
    if not apart or not levels or not shifts or end.verdict not in ("named", "ambiguous"):
        return ()
    nearest = min((change.distance for change in shifts[0].candidates if not change.excluded_because), default=0.0)
    return (Rival(levels[:1], (apart[0].name,), nearest, Measurement(shifts[0].text)),)


def summary_messages(lines: Sequence[PopulationLine], attribution: Sequence[Attribution]) -> list[str]:
    """The summary: the differences before correction, and the inputs that may cause them."""
    before = [line for line in lines if line.model == "before"]
    differ = [
        f"{line.output} {line.statistic} ({line.simulated:.4g}, measured {line.measured:.4g} {line.unit}".rstrip() + ")"
        for line in before
        if line.differs
    ]
    sentences = []
    if differ:
        more = f" and {len(differ) - SHOWN} more" if len(differ) > SHOWN else ""
        sentences.append(f"units differ from the simulated ones in {', '.join(differ[:SHOWN])}{more}")
    elif any(not line.enough for line in before):
        sentences.append(f"units compared with the simulated ones: {before[0].verdict}")
    elif before:
        sentences.append(f"units as simulated: no difference detected in {len(before)} statistics")
    return sentences + [f"input: {text}" for text in dict.fromkeys(record.text for record in attribution)]
