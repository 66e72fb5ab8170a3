"""Reads a `measured` table: the posterior of a process or a machine from measured parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...likely_units import unit_hint
from ...section import POSITIVE, Range, Section
from ...units import converted, fits
from ..inputs import Normal
from .indices import Index, capability
from .knowledge import Gauge, Knowledge, Prior, knowledge_of
from .stability import Finding, distribution_type, findings

Array = NDArray[np.float64]
MEANS = ("as_found", "corrected")
FIXED = "fixed"
NEAR_NOMINAL = 1e-9
BEYOND = 20.0
"""Deviation, in half-widths that parts were made to, above which the unit is taken to be wrong."""
CAPABLE = 100.0
"""A Cp that no process has: above it parts and half-width are taken to be in different units."""


@dataclass(frozen=True, slots=True, eq=False)
class PartSample:
    """Measured parts of one characteristic: deviations (n,) from the mid-limit, in the part's unit.

    `knowledge` is the posterior of the process, `made_to` the half-width that the parts were made
    to (0 where it is not known), `offset` the deviation of the mean of all later parts.
    """

    deviations: Array
    knowledge: Knowledge
    made_to: float
    offset: float
    findings: tuple[Finding, ...]
    indices: Mapping[str, Index]
    stated: Mapping[str, Any] = field(default_factory=dict)
    assumed: Mapping[str, str] = field(default_factory=dict)

    @property
    def distribution(self) -> Normal:
        """Distribution of deviations over the half-width, with the sample's standard deviation."""
        return Normal(cp=self.made_to / (3.0 * self.knowledge.std))

    @property
    def type(self) -> str:
        """The distribution model of ISO 22514-2."""
        return distribution_type(self.findings)

    def departures(self, owner: str) -> tuple[str, ...]:
        """Departures from one stable normal process; `owner` names what was measured."""
        return tuple(
            f"{owner}, measured: {finding.text} (by chance: {finding.probability:.2g})" for finding in self.findings
        )

    def statement(self, unit: str) -> str:
        """The sample and its capability, in one line."""
        indices = [
            f"{name} {index.value:.2f} ({index.low:.2f} to {index.high:.2f})" for name, index in self.indices.items()
        ]
        return ", ".join(
            [
                f"{len(self.deviations)} parts: mean {self.knowledge.mean:+.4g} {unit} from the "
                f"mid-limit, s = {self.knowledge.std:.4g} {unit}",
                *indices,
                f"distribution {self.type} (ISO 22514-2)",
            ]
        )


def read_sample(
    owner: Section, unit: str, nominal: float | None, mid: float, t: float | None = None, follows: bool = True
) -> PartSample | None:
    """The `measured` table of a part or machine, in its unit; None and faults where it is wrong.

    `t` is the half-width of a part with a fixed one. Where the scatter `follows` the tolerance, the
    half-width that the parts were made to must be known. Without a nominal that of a Q-DAS file is
    used.
    """
    section = owner.section("measured")
    own_unit = _unit(section, unit)
    numbers, lots = section.numbers("values"), section.take("lots") or []
    mean = section.text("mean", MEANS)
    gauge = _gauge(section, own_unit, unit)
    made_to = _made_to(section, own_unit, unit, t, follows)
    of_file = section.number("nominal", own_unit or unit)
    section.accept(("characteristic",))
    prior = _prior(section, made_to or 0.0, unit)
    if "values" not in section:
        section.fault("file", "is missing: name a table or Q-DAS file of measured parts, or give values")
    section.finish()
    if numbers is None or made_to is None or own_unit is None:
        return None
    values = np.asarray(converted(np.array(numbers), own_unit, unit), dtype=float)
    if of_file is not None:
        file_nominal = float(converted(of_file, own_unit, unit))
        nominal = file_nominal if nominal is None else nominal
        if abs(file_nominal - nominal) > NEAR_NOMINAL * max(abs(nominal), 1.0):
            section.fault(
                "file",
                f"is of a nominal of {file_nominal:g} {unit}, the part has {nominal:g} "
                f"{unit}: another revision of the drawing?",
            )
            return None
    deviations = _deviations(values, nominal) - mid
    try:
        knowledge = knowledge_of(deviations, prior, gauge)
    except ValueError as error:
        section.fault("values", str(error))
        return None
    if not _near(section, unit, deviations, made_to):
        return None
    assumed = (
        {}
        if mean
        else {
            "measured.mean": "the mean of later parts is that of the sample; "
            "the configuration does not say that it is corrected"
        }
    )
    return PartSample(
        deviations=deviations,
        knowledge=knowledge,
        made_to=made_to,
        offset=0.0 if mean == "corrected" else knowledge.mean,
        findings=tuple(findings(deviations, [str(lot) for lot in lots])),
        indices=capability(deviations, -made_to, made_to) if made_to else {},
        stated=dict(owner.take("measured")),
        assumed=assumed,
    )


def _near(section: Section, unit: str, deviations: Array, made_to: float) -> bool:
    """Whether deviations have the size of a tolerance; a fault is reported where they do not."""
    far = float(np.max(np.abs(deviations)))
    width = made_to or 3.0 * float(np.std(deviations, ddof=1))
    if made_to and made_to > CAPABLE * 3.0 * (std := float(np.std(deviations, ddof=1))):
        hint = unit_hint(std, unit, made_to / 30.0, made_to)
        section.fault(
            "values",
            f"scatter by {std:.4g} {unit} (Cp = {made_to / (3.0 * std):.4g}), "
            f"but were made to {made_to:g} {unit}{hint}: check their unit and "
            "made_to",
        )
        return False
    if far <= BEYOND * width:
        return True
    hint = unit_hint(far, unit, 0.0, width)
    comparison = (
        f"but were made to {width:g} {unit}{hint}: check their unit and made_to"
        if made_to
        else f"but three times their scatter is {width:.4g} {unit}{hint}: state measured.nominal, or check their unit"
    )
    section.fault("values", f"lie up to {far:.4g} {unit} off the mid-limit, {comparison}")
    return False


def _deviations(values: Array, nominal: float | None) -> Array:
    """Deviations from the nominal; `values` are sizes, or deviations already."""
    middle = float(np.median(values)) if len(values) else 0.0
    if nominal is None or abs(middle) < abs(middle - nominal):
        return values
    return values - nominal


def _unit(section: Section, unit: str) -> str | None:
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


def _made_to(section: Section, own_unit: str | None, unit: str, t: float | None, follows: bool) -> float | None:
    """Half-width that the measured parts were made to, in the unit of the part; 0: not known."""
    if section.take("made_to") == FIXED:
        if t is None and follows:
            section.fault(
                "made_to",
                "cannot be fixed where the tolerance is searched, as tighter "
                "limits would change nothing: state a machine",
            )
        return t if follows else 0.0
    half_width = section.number("made_to", own_unit or unit, POSITIVE)
    if half_width is not None:
        return float(converted(half_width, own_unit or unit, unit))
    if "made_to" in section:
        return None
    if t is None and follows:
        section.fault(
            "made_to",
            "is missing: the half-width that the measured parts were made to, "
            "so that their scatter can follow the tolerance",
        )
    return t if follows else 0.0


def _gauge(section: Section, own_unit: str | None, unit: str) -> Gauge | None:
    if "gauge" not in section:
        return None
    table = section.section("gauge")
    sigma = table.number("sigma", own_unit or unit, POSITIVE)
    df = table.number("df", within=Range(low=1.0))
    if "sigma" not in table:
        table.fault("sigma", "is missing: the standard deviation of repeated readings of one part")
    table.finish()
    if sigma is None:
        return None
    return Gauge(float(converted(sigma, own_unit or unit, unit)), np.inf if df is None else df)


def _prior(section: Section, made_to: float, unit: str) -> Prior | None:
    """`prior = { cp, parts }`, or sigma in place of cp."""
    if "prior" not in section:
        return None
    table = section.section("prior")
    cp, sigma = table.number("cp", within=POSITIVE), table.number("sigma", unit, POSITIVE)
    parts = table.number("parts", within=POSITIVE)
    if "cp" in table and "sigma" in table:
        table.fault("sigma", "is stated in addition to cp: keep one")
    elif "cp" not in table and "sigma" not in table:
        table.fault("cp", "is missing: the capability that is believed, or sigma")
    elif cp is not None and not made_to:
        table.fault("cp", "needs made_to, the half-width that it is of: state sigma")
    if "parts" not in table:
        table.fault("parts", "is missing: how many measured parts the belief is worth")
    table.finish()
    believed = sigma if cp is None else made_to / (3.0 * cp)
    return None if not believed or parts is None else Prior(believed, parts)
