"""Measured parts of a characteristic: indices of capability, tests for departures from one stable normal
process, and the `measured` table of a part or machine, which states them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy

from ...section import ANY, POSITIVE, Array, Range, Section
from ...units import converted, fits, unit_hint
from ..inputs import Distribution, Mixture, Normal
from .knowledge import MIN_SAMPLE_PARTS, Gauge, Knowledge, Prior, knowledge_of
from .subpopulations import RANDOM, Scatter, Subpopulations, subpopulations

# Capability and performance indices of a characteristic, with confidence limits.


CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Index:
    """An index and its two-sided confidence limits."""

    value: float
    low: float
    high: float


def capability(values: Array, lower: float | None, upper: float | None) -> dict[str, Index]:
    """Cp and Cpk (those that the limits allow) of normal values (n,), n >= 2."""
    return indices_of(len(values), float(np.mean(values)), float(np.std(values, ddof=1)), lower, upper)


def indices_of(n: int, mean: float, std: float, lower: float | None, upper: float | None) -> dict[str, Index]:
    """Cp and Cpk (those that the limits allow) of n >= 2 normal values of a mean and standard deviation.

    Limits of Cp are exact (chi-square); those of Cpk are approximate.

    Reference: ISO 22514-2:2017, clause 6; Bissell (1990), How reliable is your capability index?,
    Applied Statistics 39(3), 331-340.
    """
    if std <= 0.0:
        return {}
    indices: dict[str, Index] = {}
    if lower is not None and upper is not None:
        cp = (upper - lower) / (6.0 * std)
        levels = [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2]
        ends = np.sqrt(scipy.stats.chi2.ppf(levels, n - 1) / (n - 1))
        indices["Cp"] = Index(cp, cp * float(ends[0]), cp * float(ends[1]))
    distances = ([] if upper is None else [upper - mean]) + ([] if lower is None else [mean - lower])
    if distances:
        cpk = min(distances) / (3.0 * std)
        error = float(scipy.stats.norm.ppf(0.5 + CONFIDENCE / 2)) * np.sqrt(1.0 / (9.0 * n) + cpk**2 / (2.0 * (n - 1)))
        indices["Cpk"] = Index(cpk, cpk - error, cpk + error)
    return indices


# Tests for departures from a single stable normal process: drift, lots, outliers, shape.


LEVEL = 0.01
"""Probability of a false finding in a sample of a stable normal process: that named groups differ in
their means, and all other tests together.
"""
MIN_TESTED_PARTS = 8
"""Number of values from which the shape of a distribution can be tested."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A departure: its kind (`drift`, `lots`, `scatter`, `outlier`, `shape`), a description, and
    the probability of a departure as large by chance; `groups` are those whose means differ.
    """

    kind: str
    text: str
    probability: float
    groups: Subpopulations | None = None


def findings(values: Array, groups: Mapping[str, Sequence[str]] = MappingProxyType({})) -> list[Finding]:
    """Departures of `values` (n,), in the order of production, beyond chance (Holm's procedure).

    `groups` name the lot, cavity, machine or operator of each value, each (n,); without them lots
    are detected by consecutive values that are more alike than by chance (von Neumann's ratio).

    Reference: Holm (1979), Scandinavian J. Statistics 6(2), 65-70; Grubbs (1969), Technometrics
    11(1), 1-21; Shapiro and Wilk (1965), Biometrika 52(3-4), 591-611; Brown and Forsythe (1974),
    J. American Statistical Association 69(346), 364-367; von Neumann (1941), Annals of Mathematical
    Statistics 12(4), 367-395.
    """
    tests = [_drift(values), _outlier(values), *_groups(values, groups)]
    if len(values) >= MIN_TESTED_PARTS:
        tests.append(_shape(values))
    named = [test for test in tests if groups and test.kind == "lots"]
    significant = [*_beyond_chance(named), *_beyond_chance([test for test in tests if test not in named])]
    significant.sort(key=lambda finding: finding.probability)
    if any(test.kind == "outlier" for test in significant):  # the shape is tested without it
        remaining = np.delete(values, np.argmax(np.abs(values - values.mean())))
        if len(remaining) >= MIN_TESTED_PARTS and _shape(remaining).probability > LEVEL:
            significant = [test for test in significant if test.kind != "shape"]
    differing = [test.groups for test in tests if test.groups is not None and test in significant]
    flat = bool(differing) and float(scipy.stats.kurtosis(values)) < 0.0  # quantiles of a normal law are further out
    tested = differing and flat and len(values) >= MIN_TESTED_PARTS
    if tested and _shape(differing[0].centred(values)).probability > LEVEL:
        significant = [test for test in significant if test.kind != "shape"]  # each group is normal
    return significant


def _beyond_chance(tests: list[Finding]) -> list[Finding]:
    """The findings that are no chance, by Holm's procedure."""
    ordered = sorted(tests, key=lambda finding: finding.probability)
    chances = (finding.probability > LEVEL / (len(tests) - at) for at, finding in enumerate(ordered))
    return ordered[: next((at for at, chance in enumerate(chances) if chance), len(ordered))]


def distribution_type(departures: Sequence[Finding]) -> str:
    """The distribution model of ISO 22514-2: A1, A2 (stable), B (scatter moves), C1, C3 (the mean
    moves, by lots or along a trend) or D (both), as far as the tests show.

    Reference: ISO 22514-2:2017, clause 5, table 1.
    """
    kinds = {finding.kind for finding in departures}
    if "scatter" in kinds:
        return "D" if kinds & {"drift", "lots"} else "B"
    if "drift" in kinds:
        return "C3"
    if "lots" in kinds:
        return "C1"
    return "A2" if "shape" in kinds else "A1"


def _drift(values: Array) -> Finding:
    trend = scipy.stats.linregress(np.arange(len(values), dtype=float), values)
    total = float(trend.slope) * (len(values) - 1)
    return Finding("drift", f"drifts by {total:.3g} from the first part to the last", float(trend.pvalue))


def _groups(values: Array, groups: Mapping[str, Sequence[str]]) -> list[Finding]:
    """Means and scatter of lots, cavities, machines; without any, the succession of the values."""
    tests = []
    for one in subpopulations(values, groups):
        tests.append(Finding("lots", one.text(), one.probability, one))
        several = [values[one.group == at] for at in np.flatnonzero(one.counts > 1.0)]
        if len(several) > 1:
            p = float(scipy.stats.levene(*several, center="median").pvalue)
            tests.append(Finding("scatter", f"has {one.plural} that scatter differently", p))
    return tests or ([_succession(values)] if len(values) >= MIN_TESTED_PARTS else [])


def _succession(values: Array) -> Finding:
    """Mean square of the steps from part to part over the variance, about a straight line: 2 where
    parts do not depend on those before (a little more, for the line is fitted).
    """
    n, at = len(values), np.arange(len(values), dtype=float)
    residual = values - np.polyval(np.polyfit(at, values, 1), at)
    total = float(np.sum(residual**2))
    ratio = float(np.sum(np.diff(residual) ** 2)) / total if total > 0.0 else 2.0
    z = (0.5 * ratio - 1.0) * np.sqrt((n**2 - 1.0) / (n - 2.0))
    text = (
        f"has parts that depend on the parts before them (steps of {ratio:.2g} variances in the mean "
        "square, 2 by chance): lots or settings that are not named"
    )
    return Finding("lots", text, float(scipy.special.ndtr(z)))


def _outlier(values: Array) -> Finding:
    """Grubbs' test of the value furthest from the mean."""
    n, far = len(values), int(np.argmax(np.abs(values - values.mean())))
    g = float(abs(values[far] - values.mean()) / values.std(ddof=1))
    denominator = (n - 1) ** 2 - n * g**2
    t = np.inf if denominator <= 0.0 else np.sqrt(n * (n - 2) * g**2 / denominator)
    p = min(1.0, 2.0 * n * float(scipy.stats.t.sf(t, n - 2)))
    text = f"has an outlier: {values[far]:.6g} (part {far + 1}), {g:.1f} standard deviations off"
    return Finding("outlier", text, p)


def _shape(values: Array) -> Finding:
    skew, excess = float(scipy.stats.skew(values)), float(scipy.stats.kurtosis(values))
    words = "heavy tails, " if excess > abs(skew) else "skew, " if abs(skew) > 0.5 else ""
    text = f"is not normal ({words}skewness {skew:.2f}, excess kurtosis {excess:.2f})"
    return Finding("shape", text, float(scipy.stats.shapiro(values).pvalue))


MEANS = ("as_found", "corrected")
SAME_MEAN = "the mean of later parts is that of the sample; the configuration does not state that it is corrected"
"""The assumption where a table is silent about the mean."""
AS_FOUND = "the mean of later parts is that of the sample"
CORRECTED = 'must be "as_found": a characteristic with one limit has no mid-limit that a mean is corrected to'
FIXED = "fixed"
NOT_FIXED = "cannot be fixed where the tolerance is searched, as tighter limits would change nothing: state a machine"
NOT_STATED = "is missing: the half-width that the measured parts were made to, as their scatter is proportional to it"
OTHER_MID = (
    "move its nominal (and measured.nominal) to their middle, or state measured.made_to if the drawing has changed"
)
NEAR_NOMINAL = 1e-9
MAX_DEVIATION_WIDTHS = 20.0
"""Deviation, in half-widths that parts were made to, above which the unit is taken to be wrong."""
CAPABLE = 100.0
"""A Cp that no process has: above it parts and half-width are taken to be in different units."""


@dataclass(frozen=True, slots=True, eq=False)
class PartSample:
    """Measured parts of a characteristic: deviations (n,) from the mid-limit, in the part's unit.

    `knowledge` is the posterior of the process, `made_to` the half-width that the parts were made
    to (0 where it is not known), `offset` the deviation of the mean of all later parts. `limits`
    are deviations as well, None where there is none or a natural one: a coaxiality ends at 0.
    `subpopulations` are the groups that differ, where the allocation is for parts of all of them, `blind`
    says of which others the parts are too few to show a difference.
    Where a supplier states number, mean and standard deviation alone there are no deviations: n is 0.
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
    subpopulations: Subpopulations | None = None
    unit: str = ""
    blind: tuple[str, ...] = ()

    @property
    def parts(self) -> int:
        """Number of measured parts."""
        return len(self.deviations) or int(self.knowledge.n)

    @property
    def one_sided(self) -> bool:
        """Whether it has a single limit: its zone has no middle."""
        return (self.limits[0] is None) != (self.limits[1] is None)

    @property
    def mean(self) -> float:
        """Deviation of the mean from the mid-limit; from the nominal where there is no mid-limit."""
        return self.knowledge.mean + (self.mid if self.one_sided else 0.0)

    @property
    def distribution(self) -> Distribution:
        """Distribution of deviations over the half-width, with the sample's standard deviation: normal,
        or a mixture of the cavities, machines or operators that differ.
        """
        groups = self.subpopulations
        if groups is None or groups.kind in RANDOM or not self.made_to:
            return Normal(cp=self.made_to / (3.0 * self.knowledge.std))
        shares, centres, within = groups.mixture()
        size = float(np.hypot(within, np.sqrt(np.dot(shares, np.square(centres)))))
        scale = self.knowledge.std / size / self.made_to
        return Mixture(tuple(scale * centre for centre in centres), (scale * within,) * len(shares), shares)

    @property
    def type(self) -> str:
        """The distribution model of ISO 22514-2; empty where no values are known."""
        return distribution_type(self.findings) if len(self.deviations) else ""

    def departures(self, owner: str) -> tuple[str, ...]:
        """Departures from a single stable normal process, and those that the parts are too few to show; `owner`
        names what was measured.
        """
        notes = tuple(f"{owner}, measured: {f.text} (by chance: {f.probability:.2g})" for f in self.findings)
        notes += tuple(f"{owner}, measured: {text}" for text in self.blind)
        return notes + ((f"{owner}, measured: {text}",) if (text := self.correction_text()) else ())

    def correction_text(self) -> str:
        """What Cpk comes to where the group that is furthest off is corrected, and where all are."""
        groups = self.subpopulations
        if groups is None or "Cpk" not in self.indices:
            return ""
        now, then, every = (
            capability(values, *self.limits)["Cpk"].value
            for values in (self.deviations, groups.furthest_moved(self.deviations), groups.centred(self.deviations))
        )
        text = f"{self.furthest_text()}: correcting it gives"
        more = f" (all {groups.plural}: {every:.2f})" if every > then else ""
        return f"{text} Cpk {then:.2f}{more} instead of {now:.2f}"

    def furthest_text(self) -> str:
        """The group that is furthest off, and by how much."""
        assert self.subpopulations is not None
        groups, (at, off) = self.subpopulations, self.subpopulations.furthest()
        return f"{groups.kind} {groups.names[at]} is {abs(off):.3g} {self.unit} {'high' if off > 0.0 else 'low'}"

    @property
    def stands_out(self) -> bool:
        """Whether one group is off, and the others do not differ beyond chance."""
        return self.subpopulations is not None and self.subpopulations.stands_out(LEVEL)

    def corrected(self, one: bool = False) -> PartSample:
        """The sample with all groups set to one mean, or with the `one` that stands out set to that of the
        others; as it is where none differ.
        """
        groups, known = self.subpopulations, self.knowledge
        if groups is None:
            return self
        scatter, deviations, mean = groups.corrected(), groups.centred(self.deviations), known.mean
        if one:
            deviations = groups.furthest_moved(self.deviations)
            n, mean = len(deviations), float(np.mean(deviations))
            scatter = Scatter(float(np.var(deviations, ddof=2)), n - 2.0, float(n))
        gauge = 0.0 if known.difference is None else known.difference.gauge
        std = float(np.sqrt(max(scatter.variance - gauge, 1e-3 * scatter.variance)))
        process = Knowledge(mean, std, scatter.n, scatter.df + known.prior_parts, known.prior_parts)
        return replace(self, knowledge=process, subpopulations=None, deviations=deviations)

    def statement(self, unit: str) -> str:
        """The sample and its capability, in one line."""
        mean, std = f"{self.mean:+.4g} {unit}", f"{self.knowledge.std:.4g} {unit}"
        indices = [f"{name} {i.value:.2f} ({i.low:.2f} to {i.high:.2f})" for name, i in self.indices.items()]
        origin = "nominal" if self.one_sided else "mid-limit"
        first = f"{self.parts} parts: mean {mean} from the {origin}, s = {std}"
        shape = f"distribution {self.type} (ISO 22514-2)" if len(self.deviations) else "normal, as no values are stated"
        return ", ".join([first, *indices, shape])


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
    if any(key in section for key in SUMMARY) and not {"values", "file"} & set(section.all_keys()):
        return _read_summary(owner, unit, nominal, mid, t, follows, natural)
    known_unit = _unit(section, unit)
    stated_unit = known_unit or unit
    numbers, subgroups = section.numbers("values"), section.take("subgroups")
    named = {"lot": section.take("lots") or []} | dict(section.take("groups") or {})
    groups = {kind: [str(label) for label in labels] for kind, labels in named.items() if labels}
    mean = section.text("mean", MEANS)
    gauge, of_gauge = _gauge(section, stated_unit, unit)
    made_to = _read_production_tolerance(section, stated_unit, unit, t, follows)
    of_file, mid_made_to = (_number_in(section, key, stated_unit, unit) for key in ("nominal", "mid"))
    single = _single_limit(section, stated_unit, unit)
    section.accept(("characteristic",))
    prior = _prior(section, made_to or 0.0, unit)
    if "values" not in section:
        section.fault("file", "is missing: name a table or Q-DAS file of measured parts, or give values")
    section.finish()
    if numbers is None or made_to is None or known_unit is None:
        return None
    values = np.asarray(converted(np.array(numbers), stated_unit, unit), dtype=float)
    nominal = of_file if nominal is None else nominal
    if of_file is not None and nominal is not None and abs(of_file - nominal) > NEAR_NOMINAL * max(abs(nominal), 1.0):
        other = f"is of a nominal of {of_file:g} {unit}, the part has {nominal:g} {unit}"
        section.fault("file", f"{other}: another revision of the drawing?")
        return None
    zero = _origin(np.array([mid if mid_made_to is None else mid_made_to]), nominal)
    if mid_made_to is not None and abs(mid_made_to - zero - mid) > 1e-3 * made_to + NEAR_NOMINAL * max(abs(zero), 1.0):
        middles = f"is {mid_made_to:.9g} {unit}, the middle of the limits of these parts, and {zero + mid:.9g}"
        text = f"{middles} for the part"
        section.fault("mid", f"{text}: {OTHER_MID}")
        return None
    origin = _origin(values, nominal) + mid
    limits = _limits(single, origin, made_to, natural)
    one_sided = (limits[0] is None) != (limits[1] is None)
    if one_sided and mean == "corrected":
        section.fault("mean", CORRECTED)
        return None
    if (selected := _subgroups(section, subgroups, groups, values - origin)) is None:
        return None
    deviations, departures = selected
    detected = {finding.groups.kind for finding in departures if finding.groups is not None}
    others = (one for one in subpopulations(values, groups) if one.kind not in detected)
    blind = () if isinstance(subgroups, dict) else tuple(text for one in others if (text := one.blind_text(LEVEL)))
    differing = next((f.groups for f in departures if f.groups is not None and not isinstance(subgroups, dict)), None)
    scatter = None if differing is None else differing.as_found()
    if subgroups == "corrected" and differing is not None:
        scatter, deviations, differing = differing.corrected(), differing.centred(deviations), None
        departures = findings(deviations)
    try:
        knowledge = knowledge_of(deviations, prior, gauge, scatter)
    except ValueError as error:
        section.fault("values", str(error))
        return None
    if not _are_plausible_deviations(section, unit, deviations, made_to):
        return None
    return PartSample(
        deviations=deviations,
        knowledge=knowledge,
        made_to=made_to,
        offset=0.0 if mean == "corrected" else knowledge.mean,
        findings=tuple(departures),
        indices=capability(deviations, *limits),
        stated=dict(owner.take("measured")),
        assumed=({} if mean else {"measured.mean": AS_FOUND if one_sided else SAME_MEAN}) | of_gauge,
        limits=limits,
        mid=mid,
        subpopulations=differing,
        unit=unit,
        blind=blind,
    )


SUMMARY = ("n", "s", "cp", "cpk")
"""What a supplier states in the place of values, with `mean`."""
CENTRED = "no mean is stated: that of the parts is taken to be at the mid-limit"


def _read_summary(
    owner: Section, unit: str, nominal: float | None, mid: float, t: float | None, follows: bool, natural: int
) -> PartSample | None:
    """`measured = { n = 50, mean = 25.003, s = 0.004 }`, or `cpk` (with `cp` or `mean`) in the place of s.

    By Cpk = (made_to - |mean|)/(3 s); where only cp and cpk are stated, the mean is towards the upper limit.
    """
    section = owner.section("measured")
    stated_unit = _unit(section, unit) or unit
    n = section.integer("n", Range(low=MIN_SAMPLE_PARTS))
    s = _number_in(section, "s", stated_unit, unit, POSITIVE)
    cp, cpk = (section.number(key, within=POSITIVE) for key in ("cp", "cpk"))
    corrected = section.take("mean") == "corrected"
    mean = None if corrected else _number_in(section, "mean", stated_unit, unit)
    made_to = _read_production_tolerance(section, stated_unit, unit, t, follows)
    section.finish()
    has = set(section.all_keys())
    wrong = {
        "n": "n" not in has and "is missing: the number of parts that were measured",
        "s": ("s" in has) == ("cpk" in has) and "give either s, the standard deviation, or cpk",
        "cp": "cp" in has and has & {"s", "mean"} and "is stated in addition to s or mean: keep only one of the two",
        "cpk": (cp and cpk and cpk > cp and f"must not be above cp ({cp:g}), got {cpk:g}")
        or ("cpk" in has and made_to == 0.0 and "needs made_to, the half-width that it refers to: state it, or s"),
        "mean": natural and mean is None and "is missing: with one limit alone there is no mid-limit, and no cp",
    }
    for key, text in wrong.items():
        if text:
            section.fault(key, str(text))
    if any(wrong.values()) or n is None or made_to is None or (s is None and cpk is None):
        return None
    off = 0.0 if mean is None else mean - _origin(np.array([mean]), nominal) - mid
    std = s
    if std is None:
        assert cpk is not None
        off = off if cp is None else made_to * (1.0 - cpk / cp)
        std = (made_to + natural * off if natural else made_to - abs(off)) / (3.0 * cpk)
        if std <= 0.0:
            section.fault("cpk", f"contradicts mean: it is {abs(off):.4g} {unit} off, made_to is {made_to:g} {unit}")
            return None
    if not _are_plausible_deviations(section, unit, np.array([off - std, off, off + std]), made_to):
        return None
    limits = _limits(None, 0.0, made_to, natural)
    return PartSample(
        deviations=np.empty(0),
        knowledge=Knowledge(off, std, float(n), n - 1.0),
        made_to=made_to,
        offset=0.0 if corrected else off,
        findings=(),
        indices=indices_of(n, off, std, *limits),
        stated=dict(owner.take("measured")),
        assumed={} if corrected or mean is not None or cp is not None else {"measured.mean": CENTRED},
        limits=limits,
        mid=mid,
        unit=unit,
    )


SUBGROUPS = ("as_found", "corrected")
"""What later parts are: of all groups as they are, or of groups that are set to one mean."""


def _subgroups(
    section: Section, wanted: Any, groups: dict[str, list[str]], values: Array
) -> tuple[Array, list[Finding]] | None:
    """The values that later parts are like, and their departures from one stable process; None after
    a fault.

    `wanted` is one of `SUBGROUPS`, or one group alone, { cavity = "3" }.
    """
    if any(len(labels) != len(values) for labels in groups.values()):
        section.fault("groups", f"must name a group of each of the {len(values)} values")
        return None
    if isinstance(wanted, dict) and len(wanted) == 1:
        ((kind, name),) = wanted.items()
        names = list(dict.fromkeys(groups.get(kind, ())))
        if str(name) not in names:
            known = f"{kind} {', '.join(names[:20])}" if names else ", ".join(groups) or "no groups"
            section.fault("subgroups", f"names {kind} {name}, and the measured parts have {known}")
            return None
        kept = np.array([label == str(name) for label in groups[kind]])
        values = values[kept]
        groups = {k: [n for n, here in zip(v, kept, strict=True) if here] for k, v in groups.items()}
    elif wanted not in (None, *SUBGROUPS):
        section.fault("subgroups", f'must be "as_found", "corrected" or one group, {{ cavity = "3" }}, got {wanted}')
        return None
    departures = findings(values, groups) if len(values) >= MIN_SAMPLE_PARTS and np.ptp(values) > 0.0 else []
    if wanted == "corrected" and not any(finding.groups is not None for finding in departures):
        section.fault("subgroups", "must be as_found: the measured parts name no groups that differ beyond chance")
        return None
    return values, departures


def _are_plausible_deviations(section: Section, unit: str, deviations: Array, made_to: float) -> bool:
    """Whether deviations have the size of a tolerance; a fault is reported where they do not."""
    far, std = float(np.max(np.abs(deviations))), float(np.std(deviations, ddof=1))
    width = made_to or 3.0 * std
    if made_to > CAPABLE * 3.0 * std:
        hint = unit_hint(std, unit, made_to / 30.0, made_to)
        problem = f"scatter by {std:.4g} {unit} (Cp = {made_to / (3.0 * std):.4g})"
    elif far > MAX_DEVIATION_WIDTHS * width:
        hint = unit_hint(far, unit, 0.0, width)
        problem = f"lie up to {far:.4g} {unit} off the mid-limit"
    else:
        return True
    else_stated = f"three times their scatter is {width:.4g} {unit}{hint}: state measured.nominal, or check their unit"
    comparison = f"were made to {made_to:g} {unit}{hint}: check their unit and made_to" if made_to else else_stated
    section.fault("values", f"{problem}, but {comparison}")
    return False


def _origin(values: Array, nominal: float | None) -> float:
    """What deviations from the nominal count from; `values` are sizes, or deviations already."""
    middle = float(np.median(values)) if len(values) else 0.0
    return 0.0 if nominal is None or abs(middle) < abs(middle - nominal) else nominal


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
    limits = {key: _number_in(section, key, stated_unit, unit) for key in ("lower", "upper")}
    if "lower" in section and "upper" in section:
        section.fault("upper", "is stated in addition to lower: of two limits state made_to, half their distance")
        return None
    return next(((key, limit) for key, limit in limits.items() if limit is not None), None)


def _number_in(section: Section, key: str, stated_unit: str, unit: str, within: Range = ANY) -> float | None:
    """A number in the unit of the part, None where there is none."""
    number = section.number(key, stated_unit, within)
    return None if number is None else float(converted(number, stated_unit, unit))


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


def _read_production_tolerance(
    section: Section, stated_unit: str, unit: str, t: float | None, follows: bool
) -> float | None:
    """Half-width that the measured parts were made to, in the unit of the part; 0: not known."""
    fixed = section.take("made_to") == FIXED
    if "made_to" in section and not fixed:
        return _number_in(section, "made_to", stated_unit, unit, POSITIVE)
    unread = "values" in section and section.take("values") is None  # its own fault is reported already
    if t is None and follows and not unread:
        section.fault("made_to", NOT_FIXED if fixed else NOT_STATED)
    return t if follows else 0.0


def _gauge(section: Section, stated_unit: str, unit: str) -> tuple[Gauge | None, dict[str, str]]:
    """The gauge, and what a study of it says, by the key of the assumption."""
    if "gauge" not in section:
        return None, {}
    table = section.section("gauge")
    if "values" in table:
        return _studied_gauge(table, stated_unit, unit)
    sigma, df = _number_in(table, "sigma", stated_unit, unit, POSITIVE), table.number("df", within=Range(low=1.0))
    if "sigma" not in table:
        table.fault("sigma", "is missing: the standard deviation of repeated measurements of a part")
    table.finish()
    return None if sigma is None else Gauge(sigma, np.inf if df is None else df), {}


def _studied_gauge(table: Section, stated_unit: str, unit: str) -> tuple[Gauge | None, dict[str, str]]:
    """The gauge by repeated measurements of parts."""
    of_study = _unit(table, stated_unit) or unit
    values, reference = table.numbers("values"), _number_in(table, "reference", of_study, unit)
    parts, operators = ([str(label) for label in table.take(key) or ()] for key in ("parts", "operators"))
    table.accept(("characteristic",))
    for key in ("sigma", "df"):
        if key in table:
            table.fault(key, "is stated in addition to a gauge study: keep only one of them")
    table.finish()
    if values is None:
        return None, {}
    from .gauge_studies import gauge_study  # only few configurations have one

    measured = np.asarray(converted(np.array(values), of_study, unit), dtype=float)
    try:
        study = gauge_study(measured, parts, operators, reference)
    except ValueError as error:
        table.fault("values", str(error))
        return None, {}
    return Gauge(study.sigma, study.df), {"measured.gauge": study.statement(unit)}


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
