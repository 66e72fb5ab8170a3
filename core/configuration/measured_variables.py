"""`[variables.<name>.measured]`: what measured parts say about a variable."""

from __future__ import annotations

from ..declarations import Kind, Variable
from ..models.capability import PartSample, read_sample
from ..models.inputs.reading import keys
from ..section import Section

BOUNDS = ("value", "low", "high", "limits", "mid")
"""Keys that a variable with a measured standard deviation may not have."""


def read_measured(section: Section, variable: Variable, mid: float | None, t: float | None) -> PartSample | None:
    """The `measured` table of a variable of a half-width or standard deviation; None where there is
    none, or after a fault.

    `mid` is its mid-limit, `t` the half-width where it is fixed. The sample gives
    the distribution of a half-width, or the value of a standard deviation.
    """
    if "measured" not in section or "machine" in section:  # next to machines it is a fault already
        section.accept(("measured",))
        return None
    deviates = variable.kind is Kind.STANDARD_DEVIATION
    if not deviates and not (variable.random and variable.kind is Kind.HALF_WIDTH):
        section.take("measured")
        text = f"{variable.name} ({variable.kind}) takes no measured parts"
        section.fault("measured", f"{text}: half-widths with a distribution and standard deviations do")
        return None
    stated = [key for key in (BOUNDS if deviates else keys()) if key in section]
    for key in stated:
        section.fault(key, "is stated in addition to measured, from which it follows: keep only one of them")
    if mid is None and (single := [key for key in ("lower", "upper") if key in section.section("measured")]):
        text = f"has one limit ({single[0]}), and errors of {variable.name} count as centred between two"
        section.fault("measured.file", f"{text}: state a distribution of them instead")
        section.accept(("measured",))
        return None
    sample = read_sample(section, variable.unit, None, mid or 0.0, t, follows=not deviates)
    if sample is None or stated:
        return None
    if sample.offset and mid is None:
        section.fault(
            "measured.mean",
            f'must be "corrected": errors of {variable.name} have no mid-limit here and count as centred, and the '
            f"sample is {sample.offset:+.4g} {variable.unit} off",
        )
        return None
    return sample
