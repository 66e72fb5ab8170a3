"""Result records of `tolevo gap`: of each step of its loop, and the whole.

Every record prints as a plain sentence. Amounts are in the unit of their output, unless they are
stated in noise units (divided by the standard deviation of the noise).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, isnan, nan
from typing import Any

from ...records import Axis, GapTables
from ...section import Value


@dataclass(frozen=True, slots=True)
class Dimension:
    """A nominal dimension, or another number of the geometry."""

    name: str
    value: Value
    unit: str
    meaning: str

    def __str__(self) -> str:
        shown = f"{self.value:g}" if isinstance(self.value, int | float) else str(self.value)
        return f"{self.name} {shown}"


@dataclass(frozen=True, slots=True)
class DrawnZone:
    """A variable of the allocation that the units were built to.

    `value` is what `kind` says; `low` and `high` are the limits of the zone, None where it has
    none. `distribution` is empty where the variable does not scatter.
    """

    variable: str
    unit: str
    kind: str
    value: float
    low: float | None
    high: float | None
    distribution: str

    def __str__(self) -> str:
        if self.low is None or self.high is None:
            return f"{self.variable} {self.value:.6g}"
        return f"{self.variable} {self.low:.6g}..{self.high:.6g}"


@dataclass(frozen=True, slots=True)
class Drawing:
    """Geometry, zones, distributions and effects of the simulated units, each with its source.

    `assumed` says what is the model's default because the configuration does not name it, and how
    to name it; empty where everything is named.
    """

    model: str
    geometry_from: str
    allocation_from: str
    geometry: tuple[Dimension, ...]
    zones: tuple[DrawnZone, ...]
    effects: tuple[str, ...] = ()
    assumed: str = ""

    def lines(self) -> tuple[str, ...]:
        """The same for the terminal, what is assumed first."""
        texts = [self.assumed] if self.assumed else []
        geometry = ", ".join(map(str, self.geometry))
        texts.append(f"simulated: {self.model}, {geometry}; from {self.geometry_from}")
        zones, laws = ", ".join(map(str, self.zones)), ", ".join(self.distributions())
        if zones:
            text = f"built to: {zones}; from {self.allocation_from}"
            texts.append(f"{text}; distribution: {laws}" if laws else text)
        if self.effects:
            texts.append(f"effects in the simulated units: {', '.join(self.effects)}")
        return tuple(texts)

    def distributions(self) -> tuple[str, ...]:
        """The distribution of every input; a single entry where it is the same for all."""
        laws = {zone.variable: zone.distribution for zone in self.zones if zone.distribution}
        if len(set(laws.values())) == 1:
            return (next(iter(laws.values())),)
        return tuple(f"{name} {law}" for name, law in laws.items())


@dataclass(frozen=True, slots=True)
class Separation:
    """How well the next measurement, together with the present data, separates `names` from
    `instead_of`.

    `now` and `expected` are the discrimination without and with it: the squared norm, in noise
    units, of the part of one prediction that a refit of the other cannot follow. `chance` is the
    probability that the right one then fits better, `alike` the same with as many measurements
    like the present ones, `alone` that only the right one stays within the distance of a set;
    `needed` measurements like the planned ones raise the chance to 0.95 (0 where none do). `text`
    says so. `possible` is false where no design in the range separates them.
    """

    names: tuple[str, ...]
    instead_of: tuple[str, ...]
    now: float
    expected: float
    chance: float
    alike: float
    alone: float
    needed: int
    text: str
    possible: bool = True

    def __str__(self) -> str:
        names, rivals = " + ".join(self.names), " + ".join(self.instead_of)
        return f"{names} instead of {rivals}: {self.text}"


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """How sensitive the next measurement is to an effect that is barely detectable.

    `amount` is the value of `parameter` that is looked for; `now`, `then` and `alike` the chances
    that an effect of that size passes the threshold of the whole library in the present data, with
    the planned measurements, and with as many like the present ones; `least_now` and `least_then`
    the smallest values that are detected nine times out of ten.
    """

    name: str
    parameter: str
    unit: str
    amount: float
    now: float
    then: float
    alike: float
    least_now: float
    least_then: float

    def __str__(self) -> str:
        return (
            f"{self.name} of {self.parameter} = {self.amount:.3g} {self.unit}: detected with probability "
            f"{self.then:.2f} (now {self.now:.2f}, with as many measurements like these {self.alike:.2f}); detected "
            f"from {self.least_then:.3g} instead of {self.least_now:.3g}"
        )


@dataclass(frozen=True, slots=True)
class NextMeasurement:
    """The points of the next measurement, in `file` (empty where there are none), and what they
    are expected to show of every pair of effects, or of effects that are barely detectable.

    `telling` are the inputs whose values matter most for the separation.
    """

    text: str
    readings: int = 0
    pairs: tuple[Separation, ...] = ()
    effects: tuple[Sensitivity, ...] = ()
    notes: tuple[str, ...] = ()
    telling: tuple[str, ...] = ()
    file: str = ""

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class PopulationLine:
    """One line of the comparison of simulated and measured units.

    `model` is "before" or "after" (with the effects in it), `aspect` "location", "spread", "shape",
    "mixture", "trend" or "lots", `statistic` what of it. `low` and `high` are the 90 % interval of
    `difference` (nan where the statistic is never negative), `chance` the size that it reaches by
    chance in any of the lines, `would_show` the size that is detected nine times out of ten;
    `enough` is false where the units are too few to conclude that nothing differs.
    """

    model: str
    output: str
    aspect: str
    statistic: str
    unit: str
    simulated: float
    measured: float
    difference: float
    low: float
    high: float
    chance: float
    would_show: float
    verdict: str
    enough: bool = True

    @property
    def differs(self) -> bool:
        """Whether measured and simulated units differ in it."""
        return self.verdict == "differs"

    def __str__(self) -> str:
        return (
            f"{self.statistic} {self.simulated:.4g} simulated, {self.measured:.4g} measured {self.unit}".rstrip()
            + f": {self.verdict}"
        )


@dataclass(frozen=True, slots=True)
class InputChange:
    """The change of one input that would alone explain a difference.

    `amount` is in `unit`, a factor for a widening without a unit; `share_of_tolerance` is the
    fraction of the half-width of its zone; all are nan where an excluded input would need more than 10
    of them. `distance` is twice the log likelihood by which it
    explains the data worse than the best. `parts` is how many measured parts would show it,
    `readings` how many units like these would distinguish it from the best (0: none would, or not
    known).
    """

    input: str
    amount: float
    low: float
    high: float
    unit: str
    share_of_tolerance: float
    distance: float
    excluded_because: str = ""
    parts: int = 0
    readings: int = 0


@dataclass(frozen=True, slots=True)
class Attribution:
    """Which inputs may be behind a difference; `effect` names those that it would stand for.

    `kind` is "shift", "widening", "trend", "bias" or "gain", `verdict` "attributed" (to the one
    input), "cannot tell" (between the inputs) or "none".
    """

    effect: str
    output: str
    kind: str
    inputs: tuple[str, ...]
    verdict: str
    candidates: tuple[InputChange, ...]
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class OutputGate:
    """Whether an output disagrees with the model, after recalibration.

    `rmse` is that of the recalibrated model, `noise` the standard deviation of the noise and
    `noise_source` where it comes from: "configuration", "column", "repeats", or the smallest of
    "estimated" (with the generic forms), "residual" (of the answer) and "neighbouring rows".
    `uncertainty` is the half-width of the error that noise alone causes (ASME V&V 20), `whiteness`
    the p-value that noise is as autocorrelated as the final residual (Ljung-Box).
    """

    output: str
    unit: str
    noise: float
    noise_source: str
    rmse: float
    statistic: float
    threshold: float
    significant: bool
    autocorrelation: float = 0.0
    heteroscedastic: str = ""
    outliers: int = 0
    uncertainty: float = nan
    whiteness: float = nan

    def __str__(self) -> str:
        verdict = "disagrees with" if self.significant else "agrees with"
        return (
            f"{self.output}: data {verdict} the model: rmse {self.rmse:.4g} {self.unit}, noise "
            f"{self.noise:.4g} {self.unit} ({self.noise_source})"
        )


@dataclass(frozen=True, slots=True)
class Recalibrated:
    """A free parameter of the model: its value before and after recalibration, its tolerance."""

    name: str
    unit: str
    before: float
    after: float
    tolerance: float
    at_bound: bool = False

    def __str__(self) -> str:
        edge = ", at the end of its tolerance" if self.at_bound else ""
        return f"{self.name}: {self.before:.6g} -> {self.after:.6g} {self.unit}{edge}"


@dataclass(frozen=True, slots=True)
class Detectable:
    """The smallest effect of a kind that would have been detected: its rms on these rows."""

    name: str
    family: str
    rms: float
    unit: str
    parameter: str = ""
    value: float = nan

    def __str__(self) -> str:
        return f"{self.name}: {self.rms:.3g} {self.unit} rms"


@dataclass(frozen=True, slots=True)
class Gate:
    """The test for a gap; `unseen` are effects that the free parameters can imitate."""

    outputs: tuple[OutputGate, ...]
    recalibrated: tuple[Recalibrated, ...] = ()
    detectable: tuple[Detectable, ...] = ()
    unseen: tuple[str, ...] = ()

    @property
    def significant(self) -> bool:
        """Whether any output disagrees."""
        return any(output.significant for output in self.outputs)

    def __str__(self) -> str:
        return "; ".join(str(output) for output in self.outputs)


@dataclass(frozen=True, slots=True)
class Region:
    """A region in which the residual has structure.

    `kind` is "interval" (of `variable`, from `low` to `high`), "order", "direction", "trend",
    "product" (of two variables) or "distribution". `share` is the fraction of the squared gap
    beyond the noise that lies there, `statistic` the evidence and `threshold` the value that noise
    alone reaches.
    """

    output: str
    variable: str
    kind: str
    unit: str = ""
    low: float = nan
    high: float = nan
    order: float = nan
    direction: str = ""
    share: float = nan
    statistic: float = nan
    threshold: float = nan

    @property
    def ends(self) -> tuple[float, float] | None:
        """The ends of its interval, where it is one."""
        return (self.low, self.high) if isfinite(self.low + self.high) else None

    def __str__(self) -> str:
        if self.kind == "order":
            where = f"order {self.order:g}"
        elif self.kind in ("interval", "trend"):
            where = f"{self.variable} {self.low:.4g} to {self.high:.4g} {self.unit}".rstrip()
        else:
            where = self.variable
        side = f", {self.direction}" if self.direction else ""
        return f"{self.output}: {where}{side} ({100 * self.share:.0f} % of the gap)"


@dataclass(frozen=True, slots=True)
class Score:
    """What an effect explains alone, in addition to the model's parameters.

    `gain` is the decrease of the squared residual in noise units; `threshold` that which the best
    of the whole library reaches under noise.
    """

    name: str
    family: str
    gain: float
    threshold: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    note: str = ""

    @property
    def significant(self) -> bool:
        """Whether noise alone would rarely reach this gain."""
        return self.gain > self.threshold

    def __str__(self) -> str:
        return f"{self.name}: gain {self.gain:.1f} (threshold {self.threshold:.1f})"


@dataclass(frozen=True, slots=True)
class Step:
    """A step on the path of the selection, accepted or not, and why.

    `action` is "start", "add", "drop", "swap", "keep" or "reject"; `names` the effects that are in the
    model after it. Errors are the RMSE of held-out rows, all outputs together, in noise units;
    `held_out_gain` and `held_out_error` are the improvement of the squared error and its standard
    error.
    """

    number: int
    action: str
    name: str
    names: tuple[str, ...]
    accepted: bool
    reason: str
    gain: float = nan
    threshold: float = nan
    held_out: float = nan
    held_out_gain: float = nan
    held_out_error: float = nan

    def __str__(self) -> str:
        return f"{self.number} {self.action} {self.name}: {self.reason}"


@dataclass(frozen=True, slots=True)
class FoundParameter:
    """A parameter of an effect with its interval (90 % unless stated)."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    meaning: str = ""

    def __str__(self) -> str:
        whole = (
            f" (reversal error {2.0 * self.value:.4g} {self.unit})" if "half of the reversal" in self.meaning else ""
        )
        return f"{self.name} = {self.value:.4g} [{self.low:.4g}, {self.high:.4g}] {self.unit}{whole}"


@dataclass(frozen=True, slots=True)
class FoundEffect:
    """An effect that is in the corrected model, with its evidence.

    `frequency` is the fraction of bootstrap replicates that identify it (nan without bootstrap);
    `at_bound` lists parameters at a physical bound. `in_problem` is whether the problem whose
    allocation is to be repeated has a counterpart of it (None: no allocation was given), and
    `counterpart` what that does, or why there is none. `explains_percent` is the part of the squared
    gap that it explains before any generic term, after the effects that explain more; `form_error` is
    the rms of what remains in its variables, in `form_unit`, and `form` the shape of that.
    """

    name: str
    family: str
    cause: str
    parameters: tuple[FoundParameter, ...]
    gain: float
    threshold: float
    held_out_gain: float
    held_out_error: float
    share: float = nan
    frequency: float = nan
    at_bound: tuple[str, ...] = ()
    in_problem: bool | None = None
    counterpart: str = ""
    explains_percent: float = nan
    form_error: float = nan
    form_unit: str = ""
    form: str = ""

    @property
    def explained(self) -> str:
        """How much of the gap it explains, and how far its form is off; empty where that is not known."""
        if isnan(self.explains_percent):
            return ""
        text = f"explains {self.explains_percent:.3g} % of the gap"
        return (
            f"{text}; its form errs by {self.form_error:.2g} {self.form_unit} rms, {self.form}" if self.form else text
        )

    def __str__(self) -> str:
        numbers = ", ".join(str(parameter) for parameter in self.parameters)
        return f"{self.name} ({self.family}): {numbers}" + (f"; {self.explained}" if self.explained else "")


@dataclass(frozen=True, slots=True)
class Measurement:
    """The next measurement: what to vary, in which ranges, and by how much the rivals then differ.

    `difference` is the rms difference of the rivals' predictions per measurement in noise units,
    and `readings` the number of such measurements that separate them (0 where none does).
    """

    text: str
    inputs: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    difference: float = nan
    readings: int = 0

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Rival:
    """Effects that are indistinguishable from `instead_of` in these data.

    `distance` is how much worse they fit: likelihood, and the penalty of further parameters.
    `correlation` is that of both on these rows, given everything else that is fitted.
    """

    names: tuple[str, ...]
    instead_of: tuple[str, ...]
    distance: float
    measurement: Measurement
    correlation: float = nan

    def __str__(self) -> str:
        names, replaced = " + ".join(self.names), " + ".join(self.instead_of)
        alike = "" if isnan(self.correlation) else f" (correlation {self.correlation:.3f})"
        return f"{names} instead of {replaced}{alike}: {self.measurement}"


@dataclass(frozen=True, slots=True)
class Shape:
    """The form of a residual that no effect explains.

    `torque` and `direction` are "odd", "even", "none" or "unknown"; `between` are the effects that
    come closest, none of which fits; `empirical` is a formula that beats a spline on held-out rows;
    `by` is what a wave grows with.
    """

    output: str
    family: str
    variable: str
    amplitude: float
    unit: str
    text: str
    low: float = nan
    high: float = nan
    order: float = nan
    torque: str = "unknown"
    direction: str = "unknown"
    between: tuple[str, ...] = ()
    empirical: str = ""
    by: str = ""

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Remainder:
    """A significant residual given the identified effects: its variables, form and size.

    `rms` is what the form explains, in the unit of the output, measured without it; `ratio` the
    same over the noise floor, `share` its fraction of the squared gap beyond the noise. It `turns` where
    it is opposite in the two directions. `against` are the two inputs that it shows best against.
    `formula` and `plugin` are the texts of an `[[effect]]` table and of a plugin with the form, for an
    effect of one's own, empty where there is none.
    """

    output: str
    variables: tuple[str, ...]
    shape: str
    rms: float
    unit: str
    ratio: float
    share: float
    turns: bool = False
    against: tuple[str, ...] = ()
    formula: str = ""
    plugin: str = ""

    def __str__(self) -> str:
        fraction = f"{100 * self.share:.1f} %" if self.share >= 1e-3 else "under 0.1 %"
        return (
            f"{self.output}: {self.shape}; rms {self.rms:.3g} {self.unit}, {self.ratio:.2g} times "
            f"the noise, {fraction} of the gap"
        )


@dataclass(frozen=True, slots=True)
class UnresolvedTerm:
    """A term of the corrected model that no effect explains: its variables and shape, by how much
    it lowers the squared error in noise units (`gain`), and its `[[unresolved]]` table.
    """

    output: str
    variables: tuple[str, ...]
    shape: str
    gain: float
    table: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.output}: {self.shape}"


@dataclass(frozen=True, slots=True)
class GapResult(GapTables):
    """The result of `tolevo gap`.

    `verdict` is "no_gap", "named", "ambiguous", "partial" or "unnamed". `population` compares the `units` of
    a batch line by line, and `attribution` states which inputs may cause a difference.
    `gap_before`, `gap_after` and `noise_floor` hold a number per output, and `total` in noise
    units. `drawing` is the drawing that the simulated units are made to. `elsewhere` is the error of rows held
    out by the coarsest `split` of the record, as `gap_after`.
    """

    title: str
    verdict: str
    outputs: tuple[Axis, ...]
    inputs: tuple[Axis, ...]
    gate: Gate
    where: tuple[Region, ...]
    scores: tuple[Score, ...]
    steps: tuple[Step, ...]
    effects: tuple[FoundEffect, ...]
    rivals: tuple[Rival, ...]
    shapes: tuple[Shape, ...]
    noise_floor: Mapping[str, float]
    gap_before: Mapping[str, float]
    gap_after: Mapping[str, float]
    summary: Mapping[str, Any]
    notes: tuple[str, ...] = ()
    population: tuple[PopulationLine, ...] = ()
    attribution: tuple[Attribution, ...] = ()
    configuration: str = field(default="", repr=False)
    corrected: str = field(default="", repr=False)
    remainder: tuple[Remainder, ...] = ()
    unresolved: tuple[UnresolvedTerm, ...] = ()
    next_measurement: NextMeasurement | None = None
    drawing: Drawing | None = None
    elsewhere: Mapping[str, float] = field(default_factory=dict)
    split: Mapping[str, Any] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that are in the corrected model."""
        return tuple(effect.name for effect in self.effects)
