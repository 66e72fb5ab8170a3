"""The path of steps: held-out error against the noise floor, and for a batch the gain of a step
against its threshold.
"""

from __future__ import annotations

from math import isfinite, nan
from textwrap import shorten

from matplotlib.figure import Figure

from ...gap_records import GapResult, Step
from ..drawing import new_axes, style_axes
from .marks import AFTER

LONGEST = 52
"""Letters of a label; the table of steps has all of it."""


def path_figure(result: GapResult) -> Figure | None:
    """Each step in the measure that decides on it; accepted ones filled, refused ones hollow.

    Held-out error in noise units; for a batch, which has no rows to leave out, the gain over its
    threshold, on a logarithmic axis. None without steps.
    """
    batch = len(result.units) > 0
    measured = {
        step.number: step.gain / step.threshold if batch else step.held_out
        for step in result.steps
        if not batch or (step.gain > 0.0 and step.threshold > 0.0)
    }
    steps = [step for step in result.steps if isfinite(measured.get(step.number, nan))]
    if not steps:
        return None
    at_step = [measured[step.number] for step in steps]
    figure, axes = new_axes(height=1.6 + 0.32 * len(steps))
    places = range(len(steps))
    kept = [at for at in places if steps[at].accepted]
    x, line = [at_step[at] for at in kept], "o" if batch else "o-"
    axes.plot(x, kept, line, color=AFTER.colour, linewidth=1.4, label="accepted")
    refused = [at for at in places if not steps[at].accepted]
    if refused:
        x = [at_step[at] for at in refused]
        axes.plot(x, refused, "D", color="#555555", markerfacecolor="none", label="not accepted")
    threshold = "least gain of a step" if batch else "noise floor"
    axes.axvline(1.0, color="black", linestyle=":", linewidth=1.4, label=threshold)
    axes.set_yticks(places, [_label(step) for step in steps], fontsize="small")
    axes.invert_yaxis()
    if batch:
        axes.set_xscale("log")
        axes.set_xlabel("gain over the least gain of a step")
    else:
        axes.set_xlim(left=min(0.9, 0.95 * min(at_step)))
        axes.set_xlabel("held-out RMSE over noise")
    style_axes(axes, legend=True)
    return figure


def _label(step: Step) -> str:
    name = step.name.replace("_", " ")
    return shorten(f"{step.number} {step.action} {name}", LONGEST, placeholder=" ...")
