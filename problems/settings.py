"""The settings of a problem: plain frozen records, made by the configuration or by hand."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from math import ceil, inf, log
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtr, ndtri

from ..errors import Fault
from ..models.capability import PartSample
from ..models.costs import CostCurve, Table
from ..models.effects.measurements import Active
from ..models.gear import Gear
from ..models.inputs import Distribution
from ..models.machine_offers import PLUG_IN as ESTIMATED
from ..models.machine_offers import Offer
from ..section import Array, Assumption, Output, Range, Section, Value, Variable
from ..units import unit_hint

if TYPE_CHECKING:
    from ..tables import ColumnUse
    from .conditions import OperatingConditions
    from .cost_columns import CostColumn, Robust
    from .tolerance_problem import ToleranceProblem

# `[promise]`: what is promised of the yield, and how it is meant.


PLUG_IN, PREDICTIVE, ASSURED = "plug_in", "predictive", "assured"
STATEMENTS = (PLUG_IN, PREDICTIVE, ASSURED)
YIELDS = Range(50.0, 100.0, open_high=True)
CONFIDENCES = Range(80.0, 100.0, open_high=True)
"""Below 80 % upper limits of variances are no limits above their posterior means."""
YIELD, PROMISED, ASSURANCE = "yield_percent", "promised_yield_percent", "assurance_percent"
"""Outputs: what estimates say, what the statement promises, how surely the promise is kept."""
DRAWS = 20_000
"""Draws of the posterior that a stated assurance is of."""
VALUES_PER_BLOCK = 2_000_000
"""Yields that are computed at once."""


def normal_yield(z: Array, two_sided: bool) -> Array:
    """Yield [percent] (n,) of a normal output whose limits are z (n,) deviations from the mean."""
    return np.asarray(100.0 * (2.0 * ndtr(z) - 1.0 if two_sided else ndtr(z)))


def assured_percent(kept: Array, draws: int = DRAWS) -> tuple[Array, Array]:
    """An assurance [percent] (n,) by the fractions of draws that keep a promise, and its error."""
    error = np.sqrt(np.maximum(kept * (1.0 - kept), 1.0 / draws) / draws)
    return 100.0 * kept, 100.0 * error


@dataclass(frozen=True, slots=True)
class Promise:
    """A fraction of conforming units, by one of `STATEMENTS`, with a confidence.

    `plug_in`: the yield by the estimates. `predictive`: the expected yield, over the uncertainty
    of the processes. `assured`: a yield that is kept with the confidence. `level_percent` is
    the level of its norm where processes are chosen by samples; None: it is self-calibrated.
    `of` is the output that holds the yield by the estimates.
    """

    yield_percent: float
    statement: str = ASSURED
    confidence_percent: float = 95.0
    level_percent: float | None = None
    of: str = YIELD

    @property
    def fraction(self) -> float:
        """The promised fraction of conforming units."""
        return 0.01 * self.yield_percent

    @property
    def confidence(self) -> float:
        """The confidence as a probability."""
        return 0.01 * self.confidence_percent

    def quantile(self, two_sided: bool) -> float:
        """Standard deviations that must fit between the mean and each limit, of two or of one."""
        return float(ndtri(0.5 * (1.0 + self.fraction) if two_sided else self.fraction))

    @property
    def output(self) -> str:
        """The output that keeps the promise."""
        return self.of if self.statement == PLUG_IN else PROMISED

    def table(self) -> dict[str, Any]:
        """The table that states it."""
        level = {} if self.level_percent is None else {"level_percent": self.level_percent}
        table = {"yield_percent": self.yield_percent, "statement": self.statement}
        return {**table, "confidence_percent": self.confidence_percent, **level}

    def words(self) -> str:
        """The promise in one phrase."""
        return {
            PLUG_IN: f"{self.yield_percent:g} % of the units conform if the estimates are true",
            PREDICTIVE: f"{self.yield_percent:g} % of the units are expected to conform",
            ASSURED: f"at least {self.yield_percent:g} % of the units conform, "
            f"with {self.confidence_percent:g} % confidence",
        }[self.statement]


def read_promise(top: Section, of: str = YIELD) -> Promise | None:
    """The `[promise]` table of a yield; None where there is none, or it is faulty."""
    if "promise" not in top:
        return None
    section = top.section("promise")
    percent = section.number("yield_percent", within=YIELDS)
    statement = section.text("statement", STATEMENTS)
    confidence = section.number("confidence_percent", within=CONFIDENCES)
    level = section.number("level_percent", within=CONFIDENCES)
    if "yield_percent" not in section:
        section.fault("yield_percent", "is missing: state the percentage of units that must conform")
    if "statement" not in section:
        section.fault("statement", f"is missing: state one of {', '.join(STATEMENTS)}")
    section.finish()
    given = {"confidence_percent": confidence, "level_percent": level}
    wrong = any(key in section and value is None for key, value in given.items())
    if percent is None or statement is None or wrong:
        return None
    return Promise(percent, statement, 95.0 if confidence is None else confidence, level, of)


METHODS = ("moments", "convolution", "monte_carlo")


@dataclass(frozen=True, slots=True)
class VariableSetting:
    """A variable fixed at `value`, or searched in [low, high]; None means the problem's default.

    `mid` is that of the zone on the drawing; `sample` is what measured parts say about the process.
    """

    value: float | None = None
    low: float | None = None
    high: float | None = None
    distribution: Distribution | None = None
    mid: float | None = None
    sample: PartSample | None = field(default=None, compare=False)

    @property
    def centre(self) -> float | None:
        """Mean of a centred distribution over parts: the mid-limit, and how far it is missed."""
        if self.mid is None or self.sample is None:
            return self.mid
        return self.mid + self.sample.offset


@dataclass(frozen=True, slots=True)
class Bound:
    """A limit on an output: low <= output <= high."""

    low: float = -inf
    high: float = inf


@dataclass(frozen=True, slots=True)
class PropagationSetting:
    """How spread is propagated: one of `METHODS`, one-sided coverage, sample size."""

    method: str = "convolution"
    coverage: float = 0.9973
    samples: int = 65_536


@dataclass(frozen=True, slots=True)
class Labels:
    """What readers know a mechanism by: its name, a description, the number of its drawing."""

    name: str = ""
    description: str = ""
    drawing: str = ""

    def stated(self) -> dict[str, str]:
        """Those that are stated, by key."""
        return {key: value for key, value in asdict(self).items() if value}


@dataclass(frozen=True, slots=True)
class Money:
    """Currency of the costs, empty where they are relative; names of curves that are assumptions,
    and the assumed price of one unit of theirs.
    """

    currency: str = ""
    assumed: tuple[str, ...] = ()
    scale: float | None = None


@dataclass(frozen=True, slots=True)
class Settings:
    """Everything that distinguishes one instance of a problem from its defaults.

    Names that a mapping leaves out keep the problem's default; `objectives` empty means the
    problem's own. `definition` is what a problem that is written in the configuration (`stack`)
    was read from; `effects` are active in the model; `zero` is what an instrument adds to outputs
    of the model, `sense` is -1 of those with the opposite sign; `gear` is that of a table,
    `columns` says what the columns of a file are, `labels` what readers know the mechanism by;
    `money` is what the costs are in, `notes` say how the configuration was understood, `machines`
    make tolerances of a problem that is not a stack, `promise` is what such a problem promises;
    `operating` are the conditions in which its units are evaluated; `record` are the ranges of the inputs
    in the measurements that a correction was found in, `terms` what of it acts on measurements alone;
    `cost_columns` are its further costs, `robust` says how well its cost curves are known.
    """

    parameters: Mapping[str, Value] = field(default_factory=dict)
    variables: Mapping[str, VariableSetting] = field(default_factory=dict)
    costs: Mapping[str, CostCurve] = field(default_factory=dict)
    propagation: PropagationSetting = PropagationSetting()
    objectives: tuple[str, ...] = ()
    limits: Mapping[str, Bound] = field(default_factory=dict)
    seed: int = 0
    definition: Any = None
    effects: tuple[Active, ...] = ()
    zero: Mapping[str, float] = field(default_factory=dict)
    sense: Mapping[str, int] = field(default_factory=dict)
    gear: Gear | None = None
    columns: Mapping[str, ColumnUse] = field(default_factory=dict)
    labels: Labels = Labels()
    money: Money = Money()
    notes: tuple[str, ...] = ()
    machines: Mapping[str, tuple[Offer, ...]] = field(default_factory=dict)
    promise: Promise | None = None
    operating: OperatingConditions | None = None
    record: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    terms: tuple[Active, ...] = ()
    cost_columns: tuple[CostColumn, ...] = ()
    robust: Robust | None = None


# Assumptions: values in use that no document prints.


PRINTED = "printed"
"""The interpretation in which a parameter has the value that a document prints."""
NOT_PRINTED = object()
SAMPLED = (
    "later parts are normal and come from the process that made the sample; the promise includes the "
    "uncertainty of its mean and scatter"
)


def process_assumption(promise: Promise | None) -> str:
    """The assumption about a measured process."""
    return ESTIMATED if promise is None or promise.statement == PLUG_IN else SAMPLED


def assumptions_of(problem: ToleranceProblem) -> tuple[Assumption, ...]:
    """Assumed parameters, ranges and cost curves, each with its value and who set it."""
    return (*_parameters(problem), *_variables(problem), *_costs(problem))


def _value_origin(name: str, given: object) -> str:
    return "configuration" if name in given else "default"  # type: ignore[operator]


def _parameters(problem: ToleranceProblem) -> list[Assumption]:
    settings, given = problem.settings, problem.given
    return [
        Assumption(
            f"parameters.{p.name}",
            settings.parameters[p.name],
            p.unit,
            p.meaning,
            _value_origin(p.name, given.parameters),
        )
        for p in problem.declaration.parameters
        if p.assumed and settings.parameters[p.name] != p.readings.get(PRINTED, NOT_PRINTED)
    ]


def _variables(problem: ToleranceProblem) -> list[Assumption]:
    assumptions = []
    for v in problem.variables:
        setting = problem.settings.variables[v.name]
        set_by = _value_origin(v.name, problem.given.variables)
        if v.assumed and v.document is not None:
            place = f"references.{v.name}"
            assumptions.append(Assumption(place, v.document, v.unit, v.assumed))
        if setting.value is None:
            text = f"{setting.low:g} .. {setting.high:g}"
            reason = "search range; no document prints one"
            assumptions.append(Assumption(f"variables.{v.name}", text, v.unit, reason, set_by))
        if setting.sample is not None:
            assumptions += _sample_statement(v, setting.sample, problem.settings.promise)
        elif v.random:
            kind = type(setting.distribution).__name__ if setting.distribution else "Uniform"
            reason = "distribution over units; the documents name none"
            place = f"variables.{v.name}.distribution"
            assumptions.append(Assumption(place, kind, "", reason, set_by))
    return assumptions


def _sample_statement(variable: Variable, sample: PartSample, promise: Promise | None) -> list[Assumption]:
    """The statement of measured parts about a variable, and the assumptions that it needs."""
    place = f"variables.{variable.name}"
    known = sample.statement(variable.unit)
    return [
        Assumption(f"{place}.measured", known, "", process_assumption(promise), "configuration"),
        *(Assumption(f"{place}.{key}", "", "", why) for key, why in sample.assumed.items()),
    ]


def _costs(problem: ToleranceProblem) -> list[Assumption]:
    reason, money = "relative cost; the documents print no cost data", problem.settings.money
    if money.currency:
        price = f"; one assumed unit costs {money.scale:g} {money.currency}" if money.scale else ""
        return [
            Assumption(
                f"costs.{name}",
                repr(problem.settings.costs[name]),
                money.currency,
                f"assumed curve; the documents print no cost data{price}",
            )
            for name in money.assumed
        ]
    return [
        Assumption(f"costs.{name}", repr(curve), "", reason, _value_origin(name, problem.given.costs))
        for name, curve in problem.settings.costs.items()
    ]


# Samples that are too small for what is said of them.


SURE = 0.95
"""Probability of a unit beyond a quantile below which a sample is called too small for it."""


def few_units_note(place: str, units: int, coverage: float) -> str:
    """That a sample is too small for a quantile at the coverage, empty where it is not.

    All n units lie below the quantile with a probability of coverage^n, whatever their law is (Wilks 1941, Annals of
    Mathematical Statistics 12, 91-96).
    """
    missed = 100.0 * coverage**units
    if missed <= 100.0 * (1.0 - SURE) or not 0.0 < coverage < 1.0:
        return ""
    enough, digits = ceil(log(1.0 - SURE) / log(coverage)), 2 if missed < 99.0 else 4
    return (
        f"{place} = {units}: with a probability of {missed:.{digits}g} % none of them lies beyond the "
        f"quantile at {100.0 * coverage:g} %: so few hardly determine it (from {enough:,} on the probability is "
        f"at most {100.0 * (1.0 - SURE):.2g} %)"
    )


# Numbers of a configuration that look as if they were stated in another unit.


UNIT_SLIP_RATIO = 20.0
"""Ratio of a number to the usual one, or its inverse, above which it is suspicious."""
USUAL_RANGE_RATIO = 3.0
"""Largest ratio to the usual number in the unit that was probably meant."""


def unit_slips(problem: ToleranceProblem) -> list[Fault]:
    """Parameters and tolerances far from the usual ones that another unit would explain.

    What is usual is the default of a parameter and the default range of a variable.
    """
    return [Fault(place, text) for place, text in (*_parameter_slips(problem), *_variable_slips(problem))]


def unit_slip(value: float, unit: str, low: float, high: float) -> str:
    """Why a number is suspicious where `low` to `high` is usual, empty where it is not."""
    if low / UNIT_SLIP_RATIO <= value <= high * UNIT_SLIP_RATIO or low <= 0.0 or value <= 0.0:
        return ""
    hint = unit_hint(value, unit, low / USUAL_RANGE_RATIO, high * USUAL_RANGE_RATIO)
    usual = f"{low:g} {unit}" if low == high else f"{low:g} to {high:g} {unit}"
    return f"{value:g} {unit} is far from what is usual ({usual}){hint}" if hint else ""


def _parameter_slips(problem: ToleranceProblem) -> Iterator[tuple[str, str]]:
    for parameter in problem.declaration.parameters:
        value, default = problem.settings.parameters.get(parameter.name), parameter.default
        if not (isinstance(value, int | float) and isinstance(default, int | float) and parameter.unit):
            continue
        if text := unit_slip(abs(value), parameter.unit, abs(default), abs(default)):
            yield f"parameters.{parameter.name}", text


def _variable_slips(problem: ToleranceProblem) -> Iterator[tuple[str, str]]:
    usual = {variable.name: variable for variable in type(problem).declaration.variables}
    for name, setting in problem.settings.variables.items():
        variable = usual.get(name)
        if variable is None or not variable.tolerance:
            continue
        for key in ("value", "low", "high"):
            value = getattr(setting, key)
            if value is not None and (text := unit_slip(value, variable.unit, variable.low, variable.high)):
                yield f"variables.{name}.{key}", text


# Costs with their currency, and the assumed curves among them.


def unit_of_cost(money: Money) -> str:
    """The unit of a cost: "EUR", or "EUR, partly assumed"."""
    return f"{money.currency}, partly assumed" if money.assumed else money.currency


def add_currency(outputs: Iterable[Output], money: Money) -> tuple[Output, ...]:
    """The outputs with the unit of the cost, and which curves behind it are assumed."""
    unit = unit_of_cost(money)
    more = f"; assumed: {', '.join(money.assumed)}" if money.assumed else ""
    return tuple(
        replace(output, unit=unit, meaning=output.meaning.replace("relative ", "").removesuffix(more) + more)
        if output.name == "cost"
        else output
        for output in outputs
    )


def rising_price_note(name: str, curve: CostCurve | None) -> str:
    """A note that prices of a table rise with the tolerance, empty where none does."""
    if not isinstance(curve, Table) or not curve.rising:
        return ""
    where = ", ".join(f"{t:g}" for t in curve.rising)
    return (
        f"the prices of {name} do not fall with the tolerance (at t = {where}): the lower price of a tighter "
        "tolerance counts there"
    )
