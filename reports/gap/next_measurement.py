"""The next measurement: its points among those of the record, and the question that they decide."""

from __future__ import annotations

from html import escape

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...gap_next_records import NextMeasurement
from ...gap_records import GapResult
from ..document import bullets
from ..drawing import new_axes, style_axes
from ..tables import listed, table
from .marks import words
from .residuals import thinned

OLD, NEW = "#9a9a9a", "#1f5fa8"
CAPTION = (
    "The next measurement in the two inputs that matter most: its points (diamonds, larger where "
    "several measurements are taken at one) and those of the record (dots)."
)


def next_figure(result: GapResult) -> Figure | None:
    """Old and new points in the inputs that matter most; None where no points are planned."""
    planned, points = result.next_measurement, result.next_points
    if planned is None or points is None:
        return None
    names = [name for name in planned.telling if name in points and name in result.residuals]
    if not names:
        return None
    figure, axes = new_axes(height=3.4)
    _scatter(axes, thinned(result.residuals), points, names)
    units = {axis.name: axis.unit for axis in result.inputs}
    axes.set_xlabel(words(names[0], units.get(names[0], "")))
    axes.set_ylabel(words(names[1], units.get(names[1], "")) if len(names) > 1 else "")
    if len(names) == 1:
        axes.set_yticks([0, 1], ["record", "next"])
        axes.set_ylim(-0.5, 1.5)
    figure.legend(loc="outside lower center", frameon=False, fontsize="small", ncols=2)
    style_axes(axes)
    return figure


def _scatter(axes: Axes, old: pd.DataFrame, new: pd.DataFrame, names: list[str]) -> None:
    at = new.groupby(names).size().reset_index(name="count")
    flat = pd.Series(0.0, index=old.index), pd.Series(1.0, index=at.index)
    heights = (old[names[1]], at[names[1]]) if len(names) > 1 else flat
    axes.plot(old[names[0]], heights[0], ".", markersize=4.0, color=OLD, label="record")
    x, size = at[names[0]], 22.0 * at["count"] ** 0.8
    axes.scatter(x, heights[1], s=size, marker="D", facecolor="none", edgecolor=NEW, linewidth=1.2, label="next")


def next_section(planned: NextMeasurement | None, pictures: str) -> str:
    """The text, the figure and the tables; a hint where no measurement is planned."""
    if planned is None:
        return "<p>No measurement is planned: <code>[next_measurement]</code> with a range plans one.</p>"
    parts = [f"<p>{escape(planned.text)}</p>", pictures]
    if planned.pairs:
        parts.append(_pairs(planned))
    if planned.effects:
        parts.append(_effects(planned))
    return "\n".join([*parts, bullets([*(str(pair) for pair in planned.pairs), *planned.notes])])


def _pairs(planned: NextMeasurement) -> str:
    columns = (
        "names: rival, instead_of: of, now: discrimination now, expected, "
        "chance: probability that the right effect fits better, alike: with as many measurements like the present, "
        "alone: probability that one effect remains, needed: measurements for 0.95"
    )
    rows = listed(planned.pairs, columns)
    rows[["rival", "of"]] = rows[["rival", "of"]].map(" + ".join)
    rows["measurements for 0.95"] = rows["measurements for 0.95"].mask(rows["measurements for 0.95"] == 0)
    return table(rows, caption="Discrimination: squared, in noise units.")


def _effects(planned: NextMeasurement) -> str:
    columns = (
        "name: effect, parameter, unit, amount: size, now: probability now, then: probability then, "
        "alike: with as many measurements like the present, least_now: detected from (now), "
        "least_then: detected from (then)"
    )
    caption = "Probability of detection above the threshold of the whole library."
    return table(listed(planned.effects, columns), caption=caption)
