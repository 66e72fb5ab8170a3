"""The analysis of a stack at given tolerances: the ends, the spread and the yield of every requirement.

Nothing is searched. A requirement that its slopes describe (a linear formula, or sensitivities) has
its spread in closed form; of any other formula it is that of the sample of units.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from ...models.stack import AsMade, Mechanism, Tolerances, extremes_of, limit_of
from ...models.stack.mechanism import SIGMAS
from ...section import Array, Integers
from ..limits import keeps
from .definition import Part
from .formulas import nominal_sum
from .problem import Stack
from .promises import Measured

BINS = 40
"""Bars of a histogram of units."""
PER_MILLION = 1e4
"""Units in a million of one per cent."""
REQUIREMENT_COLUMNS = (
    "requirement",
    "unit",
    "nominal",
    "mean",
    "std",
    "worst_case_least",
    "worst_case_greatest",
    "worst_case_kind",
    "rss_least",
    "rss_greatest",
    "lower",
    "upper",
    "cp",
    "cpk",
    "yield_percent",
    "ppm",
    "ppm_error",
    "kept_worst_case",
    "kept_statistical",
)
CONTRIBUTION_COLUMNS = ("requirement", "part", "sensitivity", "variance_percent", "worst_case_percent")
HISTOGRAM_COLUMNS = ("requirement", "from", "to", "units_percent")


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """The tables of an analysis, in the units of the requirements.

    `requirements` has a row for each requirement, `contributions` one for each part that it depends
    on, `histograms` one for each bar. `joint_yield_percent` are the units that keep the limits of all
    requirements, NaN where there is but one, `shifted` the half-widths of the root sum square with
    all mean shifts in the worst direction, by requirement; NaN where a formula has no slope.
    `notes` say how a figure was found where it is not the plain way.
    """

    requirements: pd.DataFrame
    contributions: pd.DataFrame
    histograms: pd.DataFrame
    joint_yield_percent: float
    shifted: dict[str, float]
    notes: tuple[str, ...]


def analyse(stack: Stack, design: Array) -> Analysis:
    """Every requirement of a stack at one full design (all variables,)."""
    made = stack.parts_as_made(design[None, :])
    yields = stack.yields.percentages(made)
    rows, contributions, histograms, notes, shifted = [], [], [], list[str](), dict[str, float]()
    for measured in stack.measured:
        sample = _sampled_values(stack, measured, made)
        percent = tuple(float(yields[measured.name(name)][0]) for name in ("yield_percent", "yield_percent_error"))
        row = _requirement_row(measured, made, sample, percent)
        rows.append(row)
        contributions.append(_contributions(measured, made))
        histograms.append(_histogram(label_of(measured), sample, row))
        notes += _notes(measured, row, sample)
        shift = np.nan if measured.rough else float(measured.linear.shifted_rss(made)[0])
        shifted[label_of(measured)] = shift
    joint = float(yields["yield_percent"][0]) if len(stack.measured) > 1 else np.nan
    return Analysis(
        pd.DataFrame(rows, columns=list(REQUIREMENT_COLUMNS)),
        pd.concat(contributions, ignore_index=True),
        pd.concat(histograms, ignore_index=True),
        joint,
        shifted,
        tuple(notes),
    )


def label_of(measured: Measured) -> str:
    """The name of a requirement in tables: its key, or the name of the only one."""
    return measured.requirement.key or measured.requirement.name or "requirement"


def _requirement_row(
    measured: Measured, made: Tolerances, sample: Array, percent: tuple[float, ...]
) -> dict[str, object]:
    mechanism, requirement = measured.mechanism, measured.requirement
    mean, std = _mean_and_deviation(measured, made, sample)
    least, greatest, kind = extremes_of(_about_the_zones(measured), limit_of(made)[0])
    rss = (mean - SIGMAS * std, mean + SIGMAS * std)
    lower, upper = mechanism.lower, mechanism.upper
    above, below = ((end / (SIGMAS * std) if std > 0.0 else np.inf) for end in (upper - mean, mean - lower))
    capable = mechanism.bounded and np.isfinite(std)
    two_sided = bool(np.isfinite(lower) and np.isfinite(upper))
    outside = PER_MILLION * (100.0 - percent[0])
    return {
        "requirement": label_of(measured),
        "unit": requirement.unit,
        "nominal": _nominal(measured),
        "mean": mean,
        "std": std,
        "worst_case_least": least,
        "worst_case_greatest": greatest,
        "worst_case_kind": kind,
        "rss_least": rss[0],
        "rss_greatest": rss[1],
        "lower": lower if np.isfinite(lower) else np.nan,
        "upper": upper if np.isfinite(upper) else np.nan,
        "cp": 0.5 * (above + below) if capable and two_sided else np.nan,
        "cpk": min(above, below) if capable else np.nan,
        "yield_percent": percent[0],
        "ppm": outside,
        "ppm_error": PER_MILLION * percent[1],
        "kept_worst_case": _kept(mechanism, least, greatest),
        "kept_statistical": _kept(mechanism, *rss),
    }


def _kept(mechanism: Mechanism, least: float, greatest: float) -> bool:
    """Whether a range lies within the limits, to the rounding with which all limits are kept."""
    upper = bool(keeps(greatest, mechanism.upper)) if np.isfinite(mechanism.upper) else True
    lower = bool(keeps(-least, -mechanism.lower)) if np.isfinite(mechanism.lower) else True
    return upper and lower


def _nominal(measured: Measured) -> float:
    """The requirement at the nominal values of the parts; NaN where neither it nor they are stated."""
    requirement, parts, mechanism = measured.requirement, measured.parts, measured.mechanism
    if mechanism.formula is not None and mechanism.mids is not None and mechanism.scale is not None:
        means = np.array([part.mean for part in parts])[mechanism.owners]
        return _value_at(mechanism, mechanism.mids - mechanism.scale * means)
    if requirement.nominal is not None:
        return requirement.nominal
    sized = all(part.nominal is not None or part.feature is not None for part in parts)
    return nominal_sum(requirement, parts) if sized else np.nan


def _about_the_zones(measured: Measured) -> Mechanism:
    """The mechanism about the middles of the zones of the drawing: a mean that was measured moves
    the units, and no limit of a part.
    """
    mechanism = measured.mechanism
    offsets = np.array([part.mean - part.mid for part in measured.parts])[mechanism.owners]
    if not np.any(offsets):
        return mechanism
    if mechanism.formula is None or mechanism.mids is None or mechanism.scale is None:
        return replace(mechanism, centre=mechanism.centre - float(mechanism.sensitivities @ offsets))
    mids = mechanism.mids - mechanism.scale * offsets
    return replace(mechanism, mids=mids, centre=_value_at(mechanism, mids))


def _value_at(mechanism: Mechanism, x: Array) -> float:
    """The requirement at one point, pieces (k,) in the units of the formula."""
    assert mechanism.formula is not None
    return mechanism.gain * float(mechanism.formula.value(dict(zip(mechanism.names, x, strict=True))))


def described_by_slopes(mechanism: Mechanism) -> bool:
    """Whether the sensitivities describe the requirement everywhere, not at the mid-limits alone."""
    return mechanism.formula is None or mechanism.formula.linear


def _mean_and_deviation(measured: Measured, made: Tolerances, sample: Array) -> tuple[float, float]:
    """Mean and standard deviation of the units: in closed form, or those of the sample."""
    if described_by_slopes(measured.mechanism):
        mean = measured.mechanism.centre + float(measured.linear.mean_shift(made)[0])
        return mean, float(np.sqrt(max(measured.linear.variance(made)[0], 0.0)))
    known = sample[np.isfinite(sample)]
    return (float(known.mean()), float(known.std())) if known.size else (np.nan, np.nan)


def _sampled_values(stack: Stack, measured: Measured, made: Tolerances) -> Array:
    """The requirement of every unit of the sample, in any order; NaN where it has no value."""
    blocks = stack.yields.reported.blocks(measured.mechanism, made)
    return np.concatenate([y.ravel() for _, y in blocks])


def _contributions(measured: Measured, made: Tolerances) -> pd.DataFrame:
    """Sensitivity and shares of every part on which a requirement depends."""
    linear, names = measured.linear, [part.name for part in measured.parts]
    variance, worst = linear.variance_shares(made)[0], linear.worst_shares(made)[0]
    slope = linear.slope.copy()
    if measured.rough:
        slope[_rough_parts(measured)] = np.nan
        variance, worst = _shares_by_part(measured, made)
    rows = [
        (label_of(measured), names[at], float(slope[at]), 100.0 * float(variance[at]), 100.0 * float(worst[at]))
        for at in measured.shown
    ]
    return pd.DataFrame(rows, columns=list(CONTRIBUTION_COLUMNS))


def _rough_parts(measured: Measured) -> list[int]:
    mechanism = measured.mechanism
    return sorted(
        {owner for name, owner in zip(mechanism.names, mechanism.owner, strict=True) if name in mechanism.rough}
    )


LEVELS, WITHIN_LEVEL = 64, 256
"""Values of a part, and units at each, of the variance that a part alone explains."""


def _shares_by_part(measured: Measured, made: Tolerances) -> tuple[Array, Array]:
    """Fractions of the variance, and of the worst case, of each part (p,) of a formula without slopes.

    Of the variance: that of the mean of the requirement over the values of one part (first-order index
    of Sobol); what parts do together is in none of them. Of the worst case: the range over one
    part alone, the others at the middles of their zones, as a fraction of the sum of these ranges.
    """
    mechanism, parts = measured.mechanism, len(measured.parts)
    rng = np.random.default_rng(0)
    pieces = len(mechanism.owner)
    uniform = rng.random((pieces, LEVELS * WITHIN_LEVEL))
    fractions = (np.arange(LEVELS) + 0.5) / LEVELS
    variance, worst = np.zeros(parts), np.zeros(parts)
    total = 0.0
    limits = limit_of(made)[0]
    zones = _about_the_zones(measured)
    for at in measured.shown:
        own = np.flatnonzero(mechanism.owners == at)
        index = np.zeros(1)
        for piece in own:
            u = uniform.copy()
            u[piece] = np.repeat(fractions, WITHIN_LEVEL)
            z = np.stack([mechanism.inputs[owner].quantile(u[i]) for i, owner in enumerate(mechanism.owner)])
            y = mechanism.values(made, z)[0]
            total = max(total, float(np.nanvar(y)))
            means = np.nanmean(y.reshape(LEVELS, WITHIN_LEVEL), axis=1)
            within = np.nanvar(y.reshape(LEVELS, WITHIN_LEVEL), axis=1).mean() / WITHIN_LEVEL
            index += max(float(np.var(means)) - within, 0.0)
        variance[at] = index[0]
        alone = np.where(np.arange(parts) == at, limits, 0.0)
        least, greatest, _ = extremes_of(zones, alone)
        worst[at] = greatest - least
    variance = variance / total if total > 0.0 else variance
    return variance, worst / worst.sum() if worst.sum() > 0.0 else worst


def _histogram(label: str, sample: Array, row: dict[str, object]) -> pd.DataFrame:
    """Per cent of the units in bars of equal width between the least and the greatest unit."""
    known = sample[np.isfinite(sample)]
    if not known.size or float(np.ptp(known)) == 0.0:
        return pd.DataFrame(columns=list(HISTOGRAM_COLUMNS))
    counts, edges = np.histogram(known, bins=BINS)
    percent = 100.0 * counts / sample.size
    return pd.DataFrame(
        {"requirement": label, "from": edges[:-1], "to": edges[1:], "units_percent": percent},
        columns=list(HISTOGRAM_COLUMNS),
    )


def _notes(measured: Measured, row: dict[str, object], sample: Array) -> list[str]:
    """How figures were found where that is not the plain way."""
    mechanism, label = measured.mechanism, label_of(measured)
    notes = []
    if not described_by_slopes(mechanism):
        how = {"bound": "an outer bound by intervals", "sample": "those of a sample of the corners"}.get(
            str(row["worst_case_kind"]), "those of the corners of the tolerances"
        )
        notes.append(
            f"{label} is not linear: mean and standard deviation are those of {sample.size} units, the worst-case "
            f"ends are {how}"
        )
    if measured.rough:
        notes.append(
            f"{label} has no slope at the mid-limits by {', '.join(mechanism.rough)}: contributions are those of each "
            "part alone, and what parts do together is in none of them"
        )
    if lost := int(np.sum(~np.isfinite(sample))):
        notes.append(f"{label} has no value for {100.0 * lost / sample.size:.3g} % of the units: they do not conform")
    return notes


def analysed_design(stack: Stack) -> tuple[Array, tuple[str, ...]]:
    """The design (all variables,) that an analysis is of, and the parts whose tolerance it assumes.

    Fixed tolerances are as stated; a part that is to be searched has the one that its drawing has now,
    else the loosest one that it may have.
    """
    design, assumed = stack.corner(tight=False), []
    for part in stack.definition.parts:
        if part.present is not None:
            design[stack.names.index(f"{part.name}_t")] = part.present
        elif _is_open(stack, part):
            assumed.append(part.name)
    return design, tuple(assumed)


def _is_open(stack: Stack, part: Part) -> bool:
    return f"{part.name}_t" not in stack.fixed or (part.alternatives and f"{part.name}_process" not in stack.fixed)


# The model of second order that a page calculates with: what if a tolerance, a nominal, a Cp changes.


def quick_model(stack: Stack, design: Array) -> dict[str, Any]:
    """The requirements to second order in the deviations of the parts, as plain numbers for a page.

    `parts`: half-width t, standard deviation and mean of a part per t. A requirement: its value at the
    mid-limits, per piece its part, slope, and second derivatives, and the yield that the full model has
    at this design. Requirements that slopes do not describe, and stacks with correlated parts or
    machines, have none.
    """
    made = stack.parts_as_made(design[None, :])
    if isinstance(made, AsMade):
        return {}
    t = limit_of(made)[0]
    moments = [part.distribution.raw_moments(2) for part in stack.definition.parts]
    parts = [
        {"name": part.name, "unit": part.unit, "t": float(t[at]), "mean": float(m[1]), "offset": part.mean - part.mid}
        | {"std": float(np.sqrt(max(m[2] - m[1] ** 2, 0.0)))}
        for at, (part, m) in enumerate(zip(stack.definition.parts, moments, strict=True))
    ]
    requirements = []
    for measured in stack.measured:
        mechanism = measured.mechanism
        if measured.rough or mechanism.correlation is not None:
            continue
        acting = np.flatnonzero(mechanism.acting)
        curvature = _second_derivatives(mechanism, acting)
        requirements.append(
            {
                "name": label_of(measured),
                "unit": measured.requirement.unit,
                "centre": mechanism.centre,
                "lower": None if np.isinf(mechanism.lower) else mechanism.lower,
                "upper": None if np.isinf(mechanism.upper) else mechanism.upper,
                "owner": mechanism.owners[acting].tolist(),
                "slope": mechanism.sensitivities[acting].tolist(),
                "curvature": curvature.tolist() if np.any(curvature) else [],
            }
        )
    return {"parts": parts, "requirements": requirements} if requirements else {}


STEP = 1e-4
"""Step of a difference of two gradients, relative to the size of the quantity or its spread."""


def _second_derivatives(mechanism: Mechanism, acting: Integers) -> Array:
    """Second derivatives (k, k) of a requirement by its acting pieces at the mid-limits."""
    none = np.zeros((len(acting), len(acting)))
    if described_by_slopes(mechanism) or mechanism.mids is None or mechanism.scale is None:
        return none
    assert mechanism.formula is not None
    size = np.maximum(np.abs(mechanism.mids), 1.0) * STEP
    moves = np.zeros((len(mechanism.mids), 2, len(acting)))
    for column, piece in enumerate(acting):
        moves[piece, :, column] = size[piece], -size[piece]
    x = {name: mechanism.mids[i] + moves[i] for i, name in enumerate(mechanism.names)}
    gradient = mechanism.formula.gradient(x)
    for row, piece in enumerate(acting):
        if (slope := gradient.get(mechanism.names[piece])) is not None:
            rise = np.subtract(*np.broadcast_to(slope, (2, len(acting)))) / (2.0 * size[acting])
            none[row] = mechanism.gain * mechanism.scale[piece] * mechanism.scale[acting] * rise
    return 0.5 * (none + none.T)
