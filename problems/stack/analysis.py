"""The analysis of a stack at given tolerances: the ends, the spread and the yield of every requirement.

Nothing is searched. A requirement that its slopes describe (a linear formula, or sensitivities) has
its spread in closed form; of any other formula it is that of the sample of units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from ...models.stack.extremes import extremes
from ...models.stack.mechanism import SIGMAS, AsMade, Mechanism, Tolerances, limit_of, moments_of
from ...section import Array, Integers
from ..limits import keeps
from .definition import Part
from .formulas import nominal_sum, value_at
from .problem import Stack
from .promises import WINDOW, Measured

ROUNDED = 1e-12
"""Ends of the worst case, mean and nominal that are so much smaller than the larger end are 0, as they are rounded."""
ROUNDED_STD = 1e-7
"""Fraction of the worst case up to which a standard deviation is 0, as the root of rounded squares that cancel."""
BINS = 40
"""Bars of a histogram of units."""
PER_MILLION = 1e4
"""Units in a million of one per cent."""
HOW = {
    "corners": "reached by units, and no corner of the tolerances lies beyond",
    "bound": "bounds that no unit exceeds",
    "sample": "the outermost of the units that were tried, and others may lie beyond",
}
"""How the ends of a requirement that is not linear were found."""
METHODS = ("rss", "worst_case")
"""Of which contributions are given: shares in the variance and in the worst case."""
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
    """Every requirement of a stack at one full design (all variables,), with the units of a sample."""
    made = stack.parts_as_made(design[None, :])
    samples = [_sampled_values(stack, measured, made) for measured in stack.measured]
    requirements, joint = _requirements(stack, made, samples)
    rows = zip(stack.measured, requirements["worst_case_kind"], samples, strict=True)
    return Analysis(
        requirements,
        pd.concat([_contributions(stack, measured, made) for measured in stack.measured], ignore_index=True),
        pd.concat(
            [_histogram(measured.label, y) for measured, y in zip(stack.measured, samples, strict=True)],
            ignore_index=True,
        ),
        joint,
        {m.label: np.nan if m.rough else float(m.shifted_rss(made)[0]) for m in stack.measured},
        tuple(note for measured, kind, sample in rows for note in _notes(measured, kind, sample)),
    )


def requirements_table(stack: Stack, design: Array) -> pd.DataFrame:
    """The `requirements` of an analysis alone: units are drawn where a figure takes a sample."""
    made = stack.parts_as_made(design[None, :])
    none = np.empty(0)
    samples = [
        _sampled_values(stack, measured, made) if _takes_sample(measured) else none for measured in stack.measured
    ]
    return _requirements(stack, made, samples)[0]


def _requirements(stack: Stack, made: Tolerances, samples: Sequence[Array]) -> tuple[pd.DataFrame, float]:
    """A row for each requirement, and the units that keep all of them [percent]."""
    yields = stack.yields.percentages(made)
    rows = []
    for measured, sample in zip(stack.measured, samples, strict=True):
        percent = tuple(float(yields[measured.name(name)][0]) for name in ("yield_percent", "yield_percent_error"))
        rows.append(_requirement_row(measured, made, sample, percent))
    joint = float(yields["yield_percent"][0]) if len(rows) > 1 else np.nan
    return pd.DataFrame(rows), joint


def _requirement_row(
    measured: Measured, made: Tolerances, sample: Array, percent: tuple[float, ...]
) -> dict[str, object]:
    mechanism, requirement = measured.mechanism, measured.requirement
    mean, std = _mean_and_deviation(measured, made, sample)
    least, greatest, kind = _worst_ends(measured, made)
    small, nominal = ROUNDED * max(abs(least), abs(greatest)), _nominal(measured)
    least, greatest, mean, nominal = (0.0 if abs(end) <= small else end for end in (least, greatest, mean, nominal))
    std = 0.0 if std <= max(small, ROUNDED_STD * (greatest - least)) else std
    rss = (mean - SIGMAS * std, mean + SIGMAS * std)
    lower, upper = mechanism.lower, mechanism.upper
    above, below = (end / (SIGMAS * std) if std > 0.0 else np.nan for end in (upper - mean, mean - lower))
    capable = mechanism.bounded and np.isfinite(std)  # without scatter there is no Cp and no Cpk
    two_sided = bool(np.isfinite(lower) and np.isfinite(upper))
    outside = PER_MILLION * (100.0 - percent[0])
    return {
        "requirement": measured.label,
        "unit": requirement.unit,
        "nominal": nominal,
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


def _worst_ends(measured: Measured, made: Tolerances) -> tuple[float, float, str]:
    """Least and greatest value of parts within their zones, and how they were found."""
    one_sided = bool(_one_sided(measured))
    if not measured.straight:
        least, greatest, kind = extremes(measured.drawn, limit_of(made)[0])
        return least, greatest, "bound" if one_sided and kind == "corners" else kind
    ends = measured.variations(made) | measured.window(made, asked=True)
    least, greatest = (float(ends[measured.name(name)][0]) for name in WINDOW)
    return least, greatest, "bound" if one_sided else "corners"


def _one_sided(measured: Measured) -> list[str]:
    """Names of the parts whose deviations have one side of their zone alone, of which the worst case counts both."""
    return [part.name for part in measured.parts if part.distribution.one_sided]


def _kept(mechanism: Mechanism, least: float, greatest: float) -> bool:
    """Whether a range lies within the limits, to the rounding with which all limits are kept."""
    upper = bool(keeps(greatest, mechanism.upper)) if np.isfinite(mechanism.upper) else True
    lower = bool(keeps(-least, -mechanism.lower)) if np.isfinite(mechanism.lower) else True
    return upper and lower


def _nominal(measured: Measured) -> float:
    """The requirement at the nominal values of the parts; NaN where neither it nor they are stated."""
    requirement, parts, mechanism = measured.requirement, measured.parts, measured.mechanism
    if mechanism.formula is not None:
        _, mids, scale = mechanism.stated
        return value_at(mechanism, mids - scale * np.array([part.mean for part in parts])[mechanism.owners])
    if requirement.nominal is not None:
        return requirement.nominal
    sized = all(part.nominal is not None or part.feature is not None for part in parts)
    return nominal_sum(requirement, parts) if sized else np.nan


def _mean_and_deviation(measured: Measured, made: Tolerances, sample: Array) -> tuple[float, float]:
    """Mean and standard deviation of the units: in closed form, or those of the sample."""
    if not _takes_sample(measured):
        mean = measured.mechanism.centre + float(measured.linear.mean_shift(made)[0])
        return mean, float(np.sqrt(max(measured.linear.variance(made)[0], 0.0)))
    mean_of_units, deviation = moments_of(sample[None])
    return float(mean_of_units[0]), float(deviation[0])


def _takes_sample(measured: Measured) -> bool:
    """Whether mean and standard deviation are those of units: of a formula that is not linear, or of matched parts."""
    return not measured.straight or measured.mechanism.matches


def _sampled_values(stack: Stack, measured: Measured, made: Tolerances) -> Array:
    """The requirement of every unit of the sample, in any order; NaN where it has no value."""
    blocks = stack.yields.reported.blocks(measured.mechanism, made)
    return np.concatenate([y.ravel() for _, y in blocks])


def _contributions(stack: Stack, measured: Measured, made: Tolerances) -> pd.DataFrame:
    """Sensitivity and shares of every part on which a requirement depends."""
    mechanism, names = measured.mechanism, [part.name for part in measured.parts]
    rough = [owner for name, owner in zip(mechanism.names, mechanism.owner, strict=True) if name in mechanism.rough]
    slope = measured.linear.slope.copy()
    slope[rough] = np.nan
    by_method = {
        method: replace(measured, requirement=replace(measured.requirement, method=method)) for method in METHODS
    }
    shares = {method: stack.yields.shares(own, made) for method, own in by_method.items()}
    rows = [
        (
            measured.label,
            names[at],
            float(slope[at]),
            *(float(shares[method][measured.contribution(at)][0]) for method in METHODS),
        )
        for at in measured.shown
    ]
    return pd.DataFrame(rows, columns=list(CONTRIBUTION_COLUMNS))


def _histogram(label: str, sample: Array) -> pd.DataFrame:
    """Per cent of the units in bars of equal width between the least and the greatest unit."""
    known = sample[np.isfinite(sample)]
    if not known.size or float(np.ptp(known)) <= ROUNDED * float(np.abs(known).max()):
        return pd.DataFrame(columns=list(HISTOGRAM_COLUMNS))
    counts, edges = np.histogram(known, bins=BINS)
    percent = 100.0 * counts / sample.size
    return pd.DataFrame(
        {"requirement": label, "from": edges[:-1], "to": edges[1:], "units_percent": percent},
        columns=list(HISTOGRAM_COLUMNS),
    )


def _notes(measured: Measured, kind: str, sample: Array) -> list[str]:
    """How figures were found where that is not the plain way."""
    mechanism, label = measured.mechanism, measured.label
    notes = []
    if not measured.straight:
        how = HOW[kind]
        notes.append(
            f"{label} is not linear: mean and standard deviation are those of {sample.size} units, the worst-case "
            f"ends are {how}"
        )
    if names := _one_sided(measured):
        notes.append(
            f"the worst case of {label} is a bound: it counts both sides of the zone of {', '.join(names)}, whose "
            "deviations are never below the mid-limit"
        )
    if measured.rough:
        why = (
            f"has no slope at the mid-limits by {', '.join(mechanism.rough)}"
            if mechanism.rough
            else "has matched parts"
        )
        notes.append(
            f"{label} {why}: contributions to the "
            "variance are those in the growth of the standard deviation with each tolerance"
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
        slopes = mechanism.directed if measured.straight else mechanism.sensitivities
        requirements.append(
            {
                "name": measured.label,
                "unit": measured.requirement.unit,
                "centre": mechanism.centre,
                "lower": None if np.isinf(mechanism.lower) else mechanism.lower,
                "upper": None if np.isinf(mechanism.upper) else mechanism.upper,
                "owner": mechanism.owners[acting].tolist(),
                "slope": slopes[acting].tolist(),
                "curvature": curvature.tolist() if np.any(curvature) else [],
            }
        )
    return {"parts": parts, "requirements": requirements} if requirements else {}


STEP = 1e-4
"""Step of a difference of two gradients, relative to the size of the quantity or its spread."""


def _second_derivatives(mechanism: Mechanism, acting: Integers) -> Array:
    """Second derivatives (k, k) of a requirement by its acting pieces at the mid-limits."""
    none = np.zeros((len(acting), len(acting)))
    if mechanism.formula is None or mechanism.formula.linear:
        return none
    formula, mids, scale = mechanism.stated
    size = np.maximum(np.abs(mids), 1.0) * STEP
    moves = np.zeros((len(mids), 2, len(acting)))
    for column, piece in enumerate(acting):
        moves[piece, :, column] = size[piece], -size[piece]
    gradient = formula.gradient({name: mids[i] + moves[i] for i, name in enumerate(mechanism.names)})
    for row, piece in enumerate(acting):
        if (slope := gradient.get(mechanism.names[piece])) is not None:
            rise = np.subtract(*np.broadcast_to(slope, (2, len(acting)))) / (2.0 * size[acting])
            none[row] = mechanism.gain * scale[piece] * scale[acting] * rise
    return 0.5 * (none + none.T)
