"""Linear against nonlinear spread: whether the root sum square is exceeded as rarely as stated."""

from __future__ import annotations

from dataclasses import replace

from scipy.special import ndtr

from ...models.stack import Linear, Mechanism, Sample, Tolerances, yield_percent
from ...models.stack.linear import SIGMAS

LEAST = 0.01
"""Percentage points below which a difference does not matter."""
RELATIVE = 0.2
"""Fraction of the promise below which a difference does not matter."""
ERRORS = 3.0
"""Standard errors of the sample below which a difference is not detected."""


def linearity_warnings(
    mechanism: Mechanism, linear: Linear, design: Tolerances, where: str, unit: str, sample: Sample
) -> tuple[str, ...]:
    """The errors of the linear model, in a sentence, at one design (1, p).

    The limits are those of the requirement, where there are some, and the linear mean +- the root
    sum square, beyond which 0.27 % are promised.
    """
    mean = mechanism.centre + float(linear.mean_shift(design)[0])
    rss = float(linear.rss(design)[0])
    if rss == 0.0:
        return ()
    limits = {f"{mean:.4g} +- {rss:.4g}{unit} (root sum square)": (mean - rss, mean + rss)}
    if mechanism.bounded:
        limits["the limits of the requirement"] = (mechanism.lower, mechanism.upper)
    sentences = []
    for name, (lower, upper) in limits.items():
        low, high = ((bound - mean) / (rss / SIGMAS) for bound in (lower, upper))
        promised = 100.0 * float(ndtr(low) + ndtr(-high))
        within, error = yield_percent(replace(mechanism, lower=lower, upper=upper), design, sample)
        actual, doubt = 100.0 - float(within[0]), float(error[0])
        if abs(actual - promised) > max(LEAST, ERRORS * doubt, RELATIVE * promised):
            sentences.append(
                f"outside {name} it promises {promised:.2g} %, but the formula itself gives {actual:.3g} % (standard "
                f"error {doubt:.1g} %)"
            )
    return (f"the linear model misleads {where}: {'; '.join(sentences)}",) if sentences else ()
