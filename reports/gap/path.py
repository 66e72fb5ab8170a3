"""The path of steps: held-out error against the noise floor."""

from __future__ import annotations

from math import isfinite
from textwrap import shorten

from matplotlib.figure import Figure

from ...gap_records import GapResult, Step
from ..drawing import new_figure, plain
from .marks import AFTER

LONGEST = 52
"""Letters of a label; the table of steps has all of it."""


def path_figure(result: GapResult) -> Figure | None:
    """Held-out error of each step in noise units; accepted ones joined, refused ones hollow.

    None for a batch: what decides there is its distance from the population.
    """
    steps = [one for one in result.steps if isfinite(one.held_out)]
    if not steps or len(result.units):
        return None
    figure = new_figure(height=1.6 + 0.32 * len(steps))
    axes = figure.add_subplot()
    places = range(len(steps))
    kept = [at for at in places if steps[at].accepted]
    axes.plot([steps[at].held_out for at in kept], kept, color=AFTER.colour, marker="o",
              linewidth=1.4, label="accepted")  # fmt: skip
    refused = [at for at in places if not steps[at].accepted]
    if refused:
        axes.plot([steps[at].held_out for at in refused], refused, linestyle="none", marker="D",
                  color="#555555", markerfacecolor="none", label="not accepted")  # fmt: skip
    axes.axvline(1.0, color="black", linestyle=":", linewidth=1.4, label="noise floor")
    axes.set_yticks(places, [_label(one) for one in steps], fontsize="small")
    axes.invert_yaxis()
    axes.set_xlim(left=min(0.9, 0.95 * min(one.held_out for one in steps)))
    axes.set_xlabel("held-out RMSE over noise")
    axes.legend(frameon=False, fontsize="small")
    plain(axes)
    return figure


def _label(step: Step) -> str:
    name = step.name.replace("_", " ")
    return shorten(f"{step.number} {step.action} {name}", LONGEST, placeholder=" ...")
