"""Reads a `measured` table: the posterior of a process or a machine from measured parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...arrays import Array
from ...likely_units import unit_hint
from ...section import POSITIVE, Range, Section
from ...units import converted, fits
from ..inputs import Normal
from .indices import Index, capability
from .knowledge import Gauge, Knowledge, Prior, knowledge_of
from .stability import Finding, distribution_type, findings

MEANS = ("as_found", "corrected")
SAME_MEAN = "the mean of later parts is that of the sample; the configuration does not state that it is corrected"
"""The assumption where a table is silent about the mean."""
AS_FOUND = "the mean of later parts is that of the sample"
CORRECTED = 'must be "as_found": a characteristic with one limit has no mid-limit that a mean is corrected to'
FIXED = "fixed"
NOT_FIXED = "cannot be fixed where the tolerance is searched, as tighter limits would change nothing: state a machine"
NOT_STATED = "is missing: the half-width that the measured parts were made to, as their scatter is proportional to it"
NEAR_NOMINAL = 1e-9
BEYOND = 20.0
"""Deviation, in half-widths that parts were made to, above which the unit is taken to be wrong."""
CAPABLE = 100.0
"""A Cp that no process has: above it parts and half-width are taken to be in different units."""


@dataclass(frozen=True, slots=True, eq=False)
class PartSample:
    """Measured parts of a characteristic: deviations (n,) from the mid-limit, in the part's unit.

    `knowledge` is the posterior of the process, `made_to` the half-width that the parts were made
    to (0 where it is not known), `offset` the deviation of the mean of all later parts. `limits`
    are deviations as well, None where there is none or a natural one: a coaxiality ends at 0.
    """

    deviations: Array
    knowledge: Knowledge
    made_to: float
    offset: float
    findings: tuple[Finding, ...]
    indices: Mapping[str, Index]
    stated: Mapping[str, Any] = field(default_factory=dict)
    assumed: Mapping[str, str] = field(default_factory=dict)
    limits: tuple[float | None, float | None] = (None, None)
    mid: float = 0.0

    @property
    def one_sided(self) -> bool:
        """Whether it has a single limit: its zone has no middle."""
        return (self.limits[0] is None) != (self.limits[1] is None)

    @property
    def mean(self) -> float:
        """Deviation of the mean from the mid-limit; from the nominal where there is no mid-limit."""
        return self.knowledge.mean + (self.mid if self.one_sided else 0.0)

    @property
    def distribution(self) -> Normal:
        """Distribution of deviations over the half-width, with the sample's standard deviation."""
        return Normal(cp=self.made_to / (3.0 * self.knowledge.std))

    @property
    def type(self) -> str:
        """The distribution model of ISO 22514-2."""
        return distribution_type(self.findings)

    def departures(self, owner: str) -> tuple[str, ...]:
        """Departures from a single stable normal process; `owner` names what was measured."""
        return tuple(f"{owner}, measured: {f.text} (by chance: {f.probability:.2g})" for f in self.findings)

    def statement(self, unit: str) -> str:
        """The sample and its capability, in one line."""
        mean, std = f"{self.mean:+.4g} {unit}", f"{self.knowledge.std:.4g} {unit}"
        indices = [f"{name} {i.value:.2f} ({i.low:.2f} to {i.high:.2f})" for name, i in self.indices.items()]
        origin = "nominal" if self.one_sided else "mid-limit"
        first = f"{len(self.deviations)} parts: mean {mean} from the {origin}, s = {std}"
        return ", ".join([first, *indices, f"distribution {self.type} (ISO 22514-2)"])


def read_sample(
    owner: Section,
    unit: str,
    nominal: float | None,
    mid: float,
    t: float | None = None,
    follows: bool = True,
    natural: int = 0,
) -> PartSample | None:
    """The `measured` table of a part or machine, in its unit; None and faults where it is wrong.

    `t` is the half-width of a part with a fixed one. Where the scatter `follows` the tolerance, the
    half-width that the parts were made to must be known. Without a nominal that of a Q-DAS file is
    used. `natural` is -1 where the lower limit of its zone is a natural one, 1 where the upper is.
    """
    section = owner.section("measured")
    stated_unit = _unit(section, unit)
    numbers, lots = section.numbers("values"), section.take("lots") or []
    mean = section.text("mean", MEANS)
    gauge = _gauge(section, stated_unit or unit, unit)
    made_to = _made_to(section, stated_unit or unit, unit, t, follows)
    of_file = section.number("nominal", stated_unit or unit)
    single = _single_limit(section, stated_unit or unit, unit)
    section.accept(("characteristic",))
    prior = _prior(section, made_to or 0.0, unit)
    if "values" not in section:
        section.fault("file", "is missing: name a table or Q-DAS file of measured parts, or give values")
    section.finish()
    if numbers is None or made_to is None or stated_unit is None:
        return None
    values = np.asarray(converted(np.array(numbers), stated_unit, unit), dtype=float)
    if of_file is not None:
        file_nominal = float(converted(of_file, stated_unit, unit))
        nominal = file_nominal if nominal is None else nominal
        if not _is_nominal(section, unit, file_nominal, nominal):
            return None
    origin = _origin(values, nominal) + mid
    deviations = values - origin
    limits = _limits(single, origin, made_to, natural)
    one_sided = (limits[0] is None) != (limits[1] is None)
    if one_sided and mean == "corrected":
        section.fault("mean", CORRECTED)
        return None
    try:
        knowledge = knowledge_of(deviations, prior, gauge)
    except ValueError as error:
        section.fault("values", str(error))
        return None
    if not _near(section, unit, deviations, made_to):
        return None
    return PartSample(
        deviations=deviations,
        knowledge=knowledge,
        made_to=made_to,
        offset=0.0 if mean == "corrected" else knowledge.mean,
        findings=tuple(findings(deviations, [str(lot) for lot in lots])),
        indices=capability(deviations, *limits),
        stated=dict(owner.take("measured")),
        assumed={} if mean else {"measured.mean": AS_FOUND if one_sided else SAME_MEAN},
        limits=limits,
        mid=mid,
    )


def _near(section: Section, unit: str, deviations: Array, made_to: float) -> bool:
    """Whether deviations have the size of a tolerance; a fault is reported where they do not."""
    far, std = float(np.max(np.abs(deviations))), float(np.std(deviations, ddof=1))
    width = made_to or 3.0 * std
    if made_to > CAPABLE * 3.0 * std:
        hint = unit_hint(std, unit, made_to / 30.0, made_to)
        problem = f"scatter by {std:.4g} {unit} (Cp = {made_to / (3.0 * std):.4g})"
    elif far > BEYOND * width:
        hint = unit_hint(far, unit, 0.0, width)
        problem = f"lie up to {far:.4g} {unit} off the mid-limit"
    else:
        return True
    comparison = (
        f"but were made to {made_to:g} {unit}{hint}: check their unit and made_to"
        if made_to
        else f"but three times their scatter is {width:.4g} {unit}{hint}: state measured.nominal, or check their unit"
    )
    section.fault("values", f"{problem}, {comparison}")
    return False


def _origin(values: Array, nominal: float | None) -> float:
    """What deviations from the nominal count from; `values` are sizes, or deviations already."""
    middle = float(np.median(values)) if len(values) else 0.0
    return 0.0 if nominal is None or abs(middle) < abs(middle - nominal) else nominal


def _is_nominal(section: Section, unit: str, of_file: float, nominal: float) -> bool:
    """Whether a file is of the nominal of the part; a fault is reported where it is not."""
    same = abs(of_file - nominal) <= NEAR_NOMINAL * max(abs(nominal), 1.0)
    if not same:
        other = f"is of a nominal of {of_file:g} {unit}, the part has {nominal:g} {unit}"
        section.fault("file", f"{other}: another revision of the drawing?")
    return same


def _limits(
    single: tuple[str, float] | None, origin: float, made_to: float, natural: int
) -> tuple[float | None, float | None]:
    """The limits of deviations from `origin`; None where there is none, or a natural one."""
    if single is not None:
        return (single[1] - origin, None) if single[0] == "lower" else (None, single[1] - origin)
    if not made_to:
        return None, None
    return None if natural < 0 else -made_to, None if natural > 0 else made_to


def _single_limit(section: Section, stated_unit: str, unit: str) -> tuple[str, float] | None:
    """`lower` or `upper`, the limit of a characteristic that has one alone, in the unit of the part."""
    limits = {key: section.number(key, stated_unit) for key in ("lower", "upper")}
    if "lower" in section and "upper" in section:
        section.fault("upper", "is stated in addition to lower: of two limits state made_to, half their distance")
        return None
    single = next(((key, limit) for key, limit in limits.items() if limit is not None), None)
    return None if single is None else (single[0], float(converted(single[1], stated_unit, unit)))


def _unit(section: Section, unit: str) -> str | None:
    """The unit of the values, that of the part where none is stated; None after a fault."""
    stated = section.text("unit")
    if not stated:
        return unit
    try:
        if fits(stated, unit):
            return stated
        section.fault("unit", f'"{stated}" cannot be stated in {unit}, the unit of the part')
    except ValueError as error:
        section.fault("unit", str(error))
    return None


def _made_to(section: Section, stated_unit: str, unit: str, t: float | None, follows: bool) -> float | None:
    """Half-width that the measured parts were made to, in the unit of the part; 0: not known."""
    fixed = section.take("made_to") == FIXED
    if "made_to" in section and not fixed:
        half_width = section.number("made_to", stated_unit, POSITIVE)
        return None if half_width is None else float(converted(half_width, stated_unit, unit))
    unread = "values" in section and section.take("values") is None  # its own fault is reported already
    if t is None and follows and not unread:
        section.fault("made_to", NOT_FIXED if fixed else NOT_STATED)
    return t if follows else 0.0


def _gauge(section: Section, stated_unit: str, unit: str) -> Gauge | None:
    if "gauge" not in section:
        return None
    table = section.section("gauge")
    sigma = table.number("sigma", stated_unit, POSITIVE)
    df = table.number("df", within=Range(low=1.0))
    if "sigma" not in table:
        table.fault("sigma", "is missing: the standard deviation of repeated measurements of a part")
    table.finish()
    if sigma is None:
        return None
    return Gauge(float(converted(sigma, stated_unit, unit)), np.inf if df is None else df)


def _prior(section: Section, made_to: float, unit: str) -> Prior | None:
    """`prior = { cp, parts }`, or sigma in place of cp."""
    if "prior" not in section:
        return None
    table = section.section("prior")
    cp, sigma = table.number("cp", within=POSITIVE), table.number("sigma", unit, POSITIVE)
    parts = table.number("parts", within=POSITIVE)
    if "cp" in table and "sigma" in table:
        table.fault("sigma", "is stated in addition to cp: remove one of them")
    elif "cp" not in table and "sigma" not in table:
        table.fault("cp", "is missing: the expected capability, or sigma")
    elif cp is not None and not made_to:
        table.fault("cp", "needs made_to, the half-width that it refers to: state made_to, or sigma instead of cp")
    if "parts" not in table:
        table.fault("parts", "is missing: the number of measured parts whose weight the prior has")
    table.finish()
    expected = sigma if cp is None else made_to / (3.0 * cp)
    return None if not expected or parts is None else Prior(expected, parts)
