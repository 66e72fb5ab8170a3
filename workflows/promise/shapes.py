"""Whether measured parts are normal enough for a promise to be called assured."""

from __future__ import annotations

import numpy as np
from scipy import stats

from ...arrays import Array
from ...models.capability import PartSample, cumulants_drawn, fraction_within_limits
from ...problems.interfaces import Checks
from ...problems.stack import Stack
from ...problems.tolerance_problem import ToleranceProblem

FEW = 20
"""Parts below which a skewed sample does not carry an assurance."""
NOT_NORMAL = ("shape", "outlier")
"""Findings that no normal process has: an outlier is a tail whose cause is not known."""
DRAWS = 4000
"""Draws of the Bayesian bootstrap."""


def withheld(problem: ToleranceProblem) -> list[str]:
    """Why the word "assured" is withheld, a phrase for each part; none where it is not."""
    return [f"{name} {why}" for name, _, sample in Checks.of(problem).samples() if (why := doubt(sample))]


def any_not_normal(stack: Stack) -> bool:
    """Whether a measured part is not normal, as far as the tests show."""
    return any(part.sample is not None and _not_normal(part.sample) for part in stack.definition.parts)


def bootstrapped(stack: Stack, design: Array) -> float:
    """Assurance [percent] of a full design (all variables,) by the Bayesian bootstrap: the least of
    all requirements; parts without a sample are normal as stated.
    """
    t = stack.tolerances(design[None, :])[0]
    fraction = stack.definition.promise.fraction if stack.definition.promise else 0.0
    drawn = [_cumulants(stack, at) for at in range(len(stack.definition.parts))]
    assurances = []
    for requirement in stack.measured:
        mechanism = requirement.mechanism
        if not mechanism.bounded:
            continue
        cumulants = []
        for at, part_cumulants in enumerate(drawn):
            slopes = mechanism.sensitivities[mechanism.owners == at] * t[at]
            powers = np.array([np.sum(slopes**k) for k in (1, 2, 3, 4)])
            cumulants.append(part_cumulants * powers)
        ends = (mechanism.lower - mechanism.centre, mechanism.upper - mechanism.centre)
        assurances.append(fraction_within_limits(cumulants, ends, fraction))
    return 100.0 * min(assurances, default=float("nan"))


def _cumulants(stack: Stack, at: int) -> Array:
    """Drawn cumulants (draws, 4) of a part at t = 1, without what the gauge adds."""
    part = stack.definition.parts[at]
    if part.sample is None:
        m1, m2 = part.distribution.raw_moments(2)[1:]
        return np.tile([m1, m2 - m1**2, 0.0, 0.0], (DRAWS, 1))
    rng = np.random.default_rng([stack.settings.seed, at])
    sample = part.sample
    scale = sample.knowledge.std / float(np.std(sample.deviations, ddof=1)) / sample.made_to
    return cumulants_drawn(sample.deviations * scale, DRAWS, rng)


def _not_normal(sample: PartSample) -> bool:
    return any(finding.kind in NOT_NORMAL for finding in sample.findings)


def doubt(sample: PartSample) -> str:
    """Why a sample does not carry an assurance, empty where it does."""
    if not _not_normal(sample):
        return ""
    if any(finding.kind == "outlier" for finding in sample.findings):
        return "has an outlier"
    values = sample.deviations
    skew, excess = float(stats.skew(values)), float(stats.kurtosis(values))
    if excess > abs(skew):
        return f"has heavy tails (excess kurtosis {excess:.2g})"
    if len(values) < FEW:
        return f"is skewed ({skew:.2g}) and has {len(values)} parts only; {FEW} are enough"
    return ""
