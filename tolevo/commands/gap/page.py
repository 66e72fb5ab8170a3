"""The page and figures of a gap analysis, from its result record."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from math import isfinite, nan
from textwrap import shorten

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ...page import drawing
from ...page.document import (
    about,
    bullets,
    declared_tables,
    document,
    folded_section,
    listed,
    picture,
    section,
    shown,
    table,
)
from ...page.drawing import flags, label_with_unit, new_axes, new_figure, style_axes
from ...page.page import summary_table
from ...records import Axis
from ...units import split_unit
from .records import Attribution, Drawing, FoundEffect, GapResult, NextMeasurement, Region, Remainder, Rival, Step

__all__ = ["drawings", "figures", "gap_page"]

# The marks of the states before and after in all figures of a gap: their shapes differ too.


REGION = "#f3d9a4"


@dataclass(frozen=True, slots=True)
class Mark:
    """The look of one state of the model."""

    word: str
    colour: str
    marker: str
    line: str
    face: str


BEFORE = Mark("before", "#c4501b", "o", "--", "none")
AFTER = Mark("after", "#1f5fa8", "x", "-", "#1f5fa8")
TAKEN = Mark("taken away", "#2b7a3d", "+", "-.", "#2b7a3d")
"""What the correction does: before less after."""
REMAINDER = Mark("remainder", "#7a3e9d", ".", "-", "#7a3e9d")
"""What the named effects leave; the curves without a name take it away."""


def words(name: str, unit: str) -> str:
    """`torque_Nm` as "torque [Nm]", with the unit of the name where no other is given."""
    return drawing.label_with_unit(drawing.words(name), unit or split_unit(name)[1])


def shade(axes: Axes, low: float, high: float, label: str = "located here") -> None:
    """Mark the part of an axis where the gap was located: coloured and hatched."""
    axes.axvspan(
        low, high, facecolor=REGION, edgecolor="#8a6d00", hatch="//", alpha=0.45, linewidth=0.0, zorder=0, label=label
    )


def legend(figure: Figure, panels: Iterable[Axes]) -> None:
    """One legend below all panels, before and after first."""
    handles: dict[str, Artist] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    states = [mark.word for mark in (BEFORE, AFTER, TAKEN)]
    labels = sorted(handles, key=lambda label: (label not in states, states.index(label) if label in states else 0))
    figure.legend(
        [handles[label] for label in labels],
        labels,
        loc="outside lower center",
        frameon=False,
        fontsize="small",
        ncols=min(len(handles), 3),
    )


# Populations: the measured units, the model's and the corrected model's, as distributions.


LINES = (
    ("measured", "measured", "black", "-", 2.2),
    ("before", "model before", BEFORE.colour, BEFORE.line, 1.5),
    ("after", "model after", AFTER.colour, "-.", 1.5),
)


def distribution_figure(result: GapResult, output: Axis) -> Figure | None:
    """Fractions of units below a value; None where the model describes no population."""
    if output.name not in set(result.units.get("output", ())):
        return None
    rows = result.units[result.units["output"] == output.name].sort_values("share")
    figure = new_figure(height=3.6)
    grid = figure.add_gridspec(1, 2, width_ratios=(3.0, 1.4))
    axes, distance_axes = (figure.add_subplot(grid[0, at]) for at in range(2))
    for name, label, colour, style, width in LINES:
        axes.step(rows[name], rows["share"], where="mid", color=colour, linestyle=style, linewidth=width, label=label)
    axes.set_xlabel(words(output.name, output.unit))
    axes.set_ylabel("fraction of units below")
    style_axes(axes, legend=True)
    _distances(distance_axes, result, output)
    return figure


def _distances(axes: Axes, result: GapResult, output: Axis) -> None:
    """The distance of the units from the model before and after, and the distance that chance causes."""
    distances = (result.gap_before[output.name], result.gap_after[output.name])
    axes.bar(["before", "after"], distances, width=0.5, color=[BEFORE.colour, AFTER.colour])
    axes.axhline(result.noise_floor[output.name], color="black", linestyle=":", linewidth=1.4, label="chance")
    axes.set_ylabel(words("distance from the population", output.unit))
    style_axes(axes, legend=True)


# The drawing that the units are simulated by: the first section of the page of a batch.


def drawing_section(drawing: Drawing | None) -> str:
    """Source, geometry and zones; empty where the units follow no drawing."""
    if drawing is None:
        return ""
    sentences = [drawing.assumed] if drawing.assumed else []
    sentences.append(
        f"Model {drawing.model}; geometry from {drawing.geometry_from}; allocation from {drawing.allocation_from}."
    )
    if drawing.effects:
        sentences.append(f"Effects in the simulated units: {', '.join(drawing.effects)}.")
    geometry = listed(drawing.geometry, "name: geometry, value, unit, meaning")
    geometry["value"] = [f"{v:g}" if isinstance(v, int | float) else str(v) for v in geometry["value"]]
    zones = listed(drawing.zones, "variable, value, unit, kind: means, low: zone from, high: to, distribution")
    return "\n".join([bullets(sentences), table(geometry), table(zones) if len(zones) else ""])


# The residual before and after, against every input, with the place where it was located.


DRAWN = 600
"""Measurements drawn per panel: every k-th, so that a page of a million rows stays small."""
ROW, MARGIN = 1.75, 0.9
"""Height [inch] of a row of panels, and of what is above and below them."""
MEANS, LEAST = 16, 4
"""Intervals of an input whose means are drawn, and measurements in each of them at least."""
MARKS = (BEFORE, AFTER, TAKEN)
"""The columns of panels."""
MAX_LINE_LEVELS = 3
"""Values up to which an input is drawn as labels."""
TICKS = 4
"""Intervals between ticks at most: panels are small, and ticks take most of their time."""
MEAN = "mean of neighbours"
GOLDEN = 0.618033988749895


def residuals_figure(result: GapResult, output: Axis) -> Figure | None:
    """One row per input: before, after, and what the correction removed, on the same scale.

    None where rows have no residuals (a population).
    """
    inputs = [axis for axis in result.inputs if axis.name in result.residuals]
    if f"{output.name}_before" not in result.residuals or not inputs:
        return None
    frame = thin_rows(result.residuals)
    ends = (f"{output.name}_{mark.word}" for mark in (BEFORE, AFTER))
    before, after = (frame[name] for name in ends)
    frame = frame.assign(**{f"{output.name}_{TAKEN.word}": before - after})
    figure = new_figure(height=MARGIN + ROW * len(inputs))
    panels = figure.subplots(len(inputs), len(MARKS), sharey=True, sharex="row", squeeze=False)
    for row, axis in zip(panels, inputs, strict=True):
        here = (region for region in result.where if (region.output, region.variable) == (output.name, axis.name))
        regions = [region for region in here if region.ends]
        for axes, mark in zip(row, MARKS, strict=True):
            _panel(axes, frame, axis, output, mark, regions)
        row[0].set_ylabel(label_with_unit("residual", output.unit))
    limit = _limit(frame, output)
    panels[0][0].set_ylim(-limit, limit)
    _titles(panels[0], result, output)
    legend(figure, panels.ravel())
    for axes in panels.ravel():
        style_axes(axes)
    return figure


def remainder_figure(result: GapResult, output: Axis) -> Figure | None:
    """What the named effects leave, against the two inputs that show most of it; None where nothing is."""
    best = next((part.against for part in result.remainder if part.output == output.name), ())
    inputs = [axis for name in best for axis in result.inputs if axis.name == name]
    if not inputs or f"{output.name}_{REMAINDER.word}" not in result.residuals:
        return None
    frame, figure = thin_rows(result.residuals), new_figure(height=3.0)
    panels = figure.subplots(1, len(inputs), sharey=True, squeeze=False)[0]
    for axes, axis in zip(panels, inputs, strict=True):
        _panel(axes, frame, axis, output, REMAINDER, [])
        style_axes(axes)
    panels[0].set_ylabel(label_with_unit(REMAINDER.word, output.unit))
    legend(figure, panels)
    return figure


def thin_rows(frame: pd.DataFrame) -> pd.DataFrame:
    """Every k-th row, at most DRAWN of them."""
    return frame.iloc[:: max(1, -(-len(frame) // DRAWN))]


def _panel(axes: Axes, frame: pd.DataFrame, axis: Axis, output: Axis, mark: Mark, regions: list[Region]) -> None:
    for region in regions:
        shade(axes, region.low, region.high)
    places, ticks = _places(frame[axis.name])
    outlier = _outliers(frame, output)
    rest = frame[f"{output.name}_{mark.word}"].to_numpy(dtype=float)
    limit = _limit(frame, output, MARKS if mark in MARKS else (mark,))
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.plot(
        places[~outlier],
        rest[~outlier],
        mark.marker,
        markersize=3.0,
        color=mark.colour,
        markerfacecolor=mark.face,
        markeredgewidth=0.7,
        label=mark.word,
    )
    if outlier.any():
        at_most, label = np.clip(rest[outlier], -limit, limit), "outlier (at the edge: beyond it)"
        axes.plot(places[outlier], at_most, "+", markersize=7.0, color="black", label=label)
    if ticks:
        _means_of_labels(axes, np.rint(places[~outlier]), rest[~outlier])
    else:
        _means(axes, places[~outlier], rest[~outlier])
    _noise(axes, frame, output)
    axes.yaxis.set_major_locator(MaxNLocator(TICKS, symmetric=True))
    if ticks:
        axes.set_xticks(range(len(ticks)), ticks, fontsize="small")
        axes.set_xlim(-0.5, len(ticks) - 0.5)
    else:
        axes.xaxis.set_major_locator(MaxNLocator(TICKS))
    axes.set_xlabel(words(axis.name, axis.unit))


def _outliers(frame: pd.DataFrame, output: Axis) -> NDArray[np.bool_]:
    return np.array(flags(frame, f"{output.name}_outlier"), dtype=bool)


def _limit(frame: pd.DataFrame, output: Axis, marks: Sequence[Mark] = MARKS) -> float:
    """Half the height of the panels, in which all measurements but the outliers lie."""
    good = frame[~_outliers(frame, output)]
    both = good[[f"{output.name}_{mark.word}" for mark in marks]].to_numpy(dtype=float)
    return 1.1 * float(np.nanmax(np.abs(both), initial=0.0)) or 1.0


def _means(axes: Axes, places: NDArray[np.float64], rest: NDArray[np.float64]) -> None:
    """Means of neighbouring measurements, in which a systematic residual shows first."""
    order = np.argsort(places, kind="stable")
    groups = [group for group in np.array_split(order, MEANS) if len(group) >= LEAST]
    if len(groups) == MEANS and len(np.unique(places)) > MEANS:
        axes.plot(
            [places[group].mean() for group in groups],
            [rest[group].mean() for group in groups],
            color="black",
            linewidth=1.6,
            label=MEAN,
        )


def _means_of_labels(axes: Axes, codes: NDArray[np.float64], rest: NDArray[np.float64]) -> None:
    """The mean of the measurements of each label."""
    levels = np.unique(codes)
    means = [float(rest[codes == level].mean()) for level in levels]
    axes.hlines(means, levels - 0.3, levels + 0.3, color="black", linewidth=1.6, label=MEAN)


def _noise(axes: Axes, frame: pd.DataFrame, output: Axis) -> None:
    """Twice the noise on either side."""
    column = f"{output.name}_noise"
    level = float(np.nanmedian(frame[column])) if column in frame else np.nan
    for sign, label in ((1.0, "twice the noise"), (-1.0, None)) if isfinite(level) else ():
        axes.axhline(2.0 * sign * level, color="#555555", linestyle=":", linewidth=1.1, label=label)


def _places(column: pd.Series) -> tuple[NDArray[np.float64], list[str]]:
    """Places of measurements along an input; labels side by side in the order of appearance."""
    if pd.api.types.is_numeric_dtype(column):
        values = column.to_numpy(dtype=float)
        levels = np.unique(values)
        if len(levels) > MAX_LINE_LEVELS:
            return values, []
        return _spread_sideways(np.searchsorted(levels, values)), [f"{level:g}" for level in levels]
    codes, labels = pd.factorize(column.astype(str))
    shown = [str(label) for label in labels] if len(labels) <= 12 else []
    return _spread_sideways(codes) if shown else codes.astype(float), shown


def _spread_sideways(codes: NDArray[np.intp]) -> NDArray[np.float64]:
    """Places that spread the measurements of one label sideways instead of on one line."""
    shift = (np.arange(len(codes)) * GOLDEN) % 1.0
    return np.asarray(codes + 0.6 * (shift - 0.5))


def _titles(row: Sequence[Axes], result: GapResult, output: Axis) -> None:
    """The held-out RMSE of each column; none for a population, which has its distributions."""
    errors = [None if len(result.units) else gap.get(output.name) for gap in (result.gap_before, result.gap_after)]
    for axes, mark, error in zip(row, MARKS, (*errors, None), strict=True):
        text = "" if error is None else f": held-out {error:.3g} {output.unit}"
        axes.set_title(f"{mark.word}{text}", fontsize="small")


# The next measurement: its points among those of the record, and the question that they decide.


OLD, NEW = "#9a9a9a", "#1f5fa8"
NEXT_MEASUREMENT_CAPTION = (
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
    _scatter(axes, thin_rows(result.residuals), points, names)
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


# The path of steps: held-out error against the noise floor, and for a batch the gain of a step
# against its threshold.


MAX_LABEL_CHARACTERS = 52
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
    return shorten(f"{step.number} {step.action} {name}", MAX_LABEL_CHARACTERS, placeholder=" ...")


# Simulated and measured units line by line, and the inputs that may cause a difference.


CAPTION = "Simulated and measured units, with the model before correction and with the effects in it."


def population_table(result: GapResult) -> str:
    """Location, spread, shape, mixture and trend of the units; empty where rows are no units."""
    if not result.population:
        return ""
    columns = (
        "model, output, aspect, statistic, unit, simulated, measured, difference, low: 90 % from, high: to, "
        "chance: size by chance, verdict"
    )
    return table(listed(result.population, columns), [line.differs for line in result.population], CAPTION)


def attribution_table(result: GapResult) -> str:
    """The change of every input that alone would cause the difference, and why it is excluded."""
    return "\n".join(map(_attribution, result.attribution))


def _attribution(attribution: Attribution) -> str:
    rows = listed(
        attribution.candidates,
        "input, amount, low: 90 % from, high: to, unit, share_of_tolerance: in tolerances, "
        "distance: explains worse by, excluded_because: excluded because, parts: parts to measure, "
        "readings: units needed",
    )
    counts = ["parts to measure", "units needed"]
    rows[counts] = rows[counts].mask(rows[counts] == 0)
    marks = [not c.excluded_because for c in attribution.candidates]
    head = f"{attribution.kind}: {attribution.verdict}" if attribution.kind else attribution.verdict
    below = table(rows, marks) if len(rows) else ""
    return f"<h3>{escape(head)}</h3>\n<p>{escape(attribution.text)}</p>\n{below}"


# Orders in the residual before and after: waves per turn of the output.


HIGHEST = 5
"""Peaks that are labelled with their order."""
ORDER_HALF_WIDTH = 0.75
"""Half-width of the mark at an order that was located."""


def spectrum_figure(result: GapResult, output: Axis) -> Figure | None:
    """Amplitude over order, before above and after below; None where there is no angle."""
    if result.spectrum.empty or "order" not in result.spectrum:
        return None
    rows = result.spectrum[result.spectrum["output"] == output.name].sort_values("order")
    if rows.empty:
        return None
    figure = new_figure(height=4.4)
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    located = [region.order for region in result.where if region.output == output.name and isfinite(region.order)]
    for axes, mark in zip(panels, (BEFORE, AFTER), strict=True):
        for order in located:
            shade(axes, order - ORDER_HALF_WIDTH, order + ORDER_HALF_WIDTH)
        axes.vlines(rows["order"], 0.0, rows[mark.word], color=mark.colour, linewidth=1.0)
        if rows["threshold"].notna().any():
            label = "largest amplitude of noise alone"
            axes.plot(rows["order"], rows["threshold"], ":", color="black", linewidth=1.2, label=label)
        _label_peaks(axes, rows["order"].tolist(), rows[mark.word].tolist(), rows["threshold"].tolist())
        axes.set_ylabel(label_with_unit(mark.word, output.unit))
    panels[1].set_xlabel("order [waves per turn]")
    legend(figure, panels)
    for axes in panels:
        style_axes(axes)
    return figure


def _label_peaks(axes: Axes, orders: list[float], sizes: list[float], limits: list[float]) -> None:
    """The highest local peaks above the threshold."""
    inner = range(len(sizes))
    peaks = [at for at in inner if sizes[at] > limits[at] and sizes[at] == max(sizes[max(0, at - 4) : at + 5])]
    for at in sorted(peaks, key=lambda peak: -sizes[peak])[:HIGHEST]:
        axes.annotate(
            f"{orders[at]:g}",
            (orders[at], sizes[at]),
            fontsize="small",
            ha="center",
            va="bottom",
            xytext=(0, 1),
            textcoords="offset points",
        )


# The page of one gap analysis: a single HTML file that needs no network.


EMPTY_TABLE = table(pd.DataFrame())
"""A section that has nothing else is omitted."""
FOLDED = frozenset({"Summary", "Configuration", "Corrected configuration", "Detection limits", "What was simulated"})
"""Sections that are folded until a reader opens them."""
VERDICTS = {
    "no_gap": "No gap: the residual between model and measurement is noise.",
    "named": "Named: the effect below closes the gap, and no other effect fits these data as well.",
    "ambiguous": "Ambiguous: the effect below closes the gap, but in these data it is "
    "indistinguishable from its rivals.",
    "partial": "Partial: the effects below close part of the gap. The remaining residual exceeds "
    "the noise and no effect is identified for it; it stays in the corrected model as unresolved "
    "terms, so that its omission biases no other number.",
    "unnamed": "Unnamed: model and measurement disagree, and no effect of the library explains it.",
}
RMSE = "RMSE on held-out rows"
FORMULA = (
    "To have it fitted as an effect with a name, add this to the configuration, and give it the name of its cause:"
)
PLUGIN = "Or as a plugin, with the form that was found, in a package with an entry point in tolevo.effects:"
CONFOUNDED = "Not detectable, because confounded with free parameters"
CAPTIONS = {
    "residuals": "{0}: measured less predicted against every input: before (circles), after "
    "(crosses) and the part that the correction removed (pluses), all on one scale. The black line is the mean "
    "of neighbouring measurements, dotted lines are at twice the noise, and the gap is located in hatched "
    "regions. At most 600 measurements are drawn.",
    "spectrum": "{0}: amplitude of every order of the residual, before in the upper and after in the lower panel. "
    "The dotted line is the largest amplitude of noise alone; peaks above it are labelled with their order. "
    "The gap is located at hatched orders, including waves that grow with the torque, which hardly show here.",
    "remainder": "{0}: what the named effects leave, before any term without a name, against the two inputs that show "
    "most of it. The black line is the mean of neighbouring measurements.",
    "distribution": "{0}. Left: fraction of units below a value; measured (solid), model before "
    "(dashed) and after (dash-dotted). Right: the distance of the measured units from both "
    "populations; 95 % of batches of that size, drawn from the corrected model, stay below the dotted line.",
    "path": "Held-out error of every step over the noise: 1 is the noise floor (dotted). Accepted "
    "steps are filled and joined, refused ones hollow.",
    "path of a batch": "The gain of every step over the least gain for its acceptance (dotted), in the measure of "
    "the batch, which has no held-out rows. Accepted steps are filled, refused ones hollow.",
}
Drawn = tuple[str, Figure, str]


def figures(result: GapResult) -> dict[str, Figure]:
    """Every figure of the result by the name of its file."""
    return {name: figure for name, figure, _ in drawings(result)}


def gap_page(result: GapResult, drawn: Sequence[Drawn] | None = None) -> str:
    """The whole page, with the figures that are `drawn` already; every text that comes from
    outside is escaped.
    """
    pictures = {part[0]: picture(*part) for part in (drawings(result) if drawn is None else drawn)}
    sections = {
        "The gap before and after": _pictures_of_kind(pictures, "distribution")
        + _pictures_of_kind(pictures, "residuals")
        + _gaps(result)
        + population_table(result),
        "What was simulated": drawing_section(result.drawing),
        "Verdict": _verdict(result),
        "Where": _regions_section(result),
        "Orders": _pictures_of_kind(pictures, "spectrum"),
        "Steps": _pictures_of_kind(pictures, "path") + _steps(result),
        "Effects": "\n".join(map(_effect, result.effects)),
        "Unexplained residual": _pictures_of_kind(pictures, "remainder") + _remainder(result)
        if result.remainder
        else "",
        "Rivals and the measurement that separates them": "\n".join(map(_rival, result.rivals)),
        "Inputs that may cause it": attribution_table(result),
        "The next measurement": _next(result, _pictures_of_kind(pictures, "next_measurement")),
        "Shapes without an identified effect": bullets([str(shape) for shape in result.shapes])
        if result.shapes
        else "",
        "Recalibrated parameters": _recalibrated_table(result),
        "Detection limits": _detectable_table(result),
        **declared_tables(result),
        "Notes": bullets(result.notes) if result.notes else "",
        "Summary": summary_table(result.summary),
        "Configuration": f"<pre>{escape(result.configuration)}</pre>",
        "Corrected configuration": f"<pre>{escape(result.corrected)}</pre>",
    }
    parts = [
        section(title, folded_section("Show", body) if title in FOLDED else body)
        for title, body in sections.items()
        if body.replace(EMPTY_TABLE, "").strip()
    ]
    return document(result.title, parts, head=_head(result))


def _head(result: GapResult) -> str:
    """The answer in sentences: the verdict, the effects, and the gap before and after."""
    lines = [VERDICTS.get(result.verdict, result.verdict)]
    lines += [_answer(effect) for effect in result.effects]
    lines += [line for line in map(partial(_before_after, result), result.gap_before) if line]
    rest = "".join(f"<li>{escape(line)}</li>" for line in lines[1:])
    return f'{about(result.summary)}<p class="asked">{escape(lines[0])}</p>\n<ul class="answers">{rest}</ul>'


def _answer(effect: FoundEffect) -> str:
    """An effect in a sentence or two."""
    explained = f" It {effect.explained}." if effect.explained else ""
    return f"{effect.name.replace('_', ' ')}: {effect.cause}{explained}"


def _before_after(result: GapResult, name: str) -> str:
    before, after = result.gap_before.get(name), result.gap_after.get(name)
    if before is None or after is None or not isfinite(before + after) or before <= 0.0:
        return ""
    unit = next((axis.unit for axis in result.outputs if axis.name == name), "noise units")
    floor = result.noise_floor.get(name)
    cause = "chance" if len(result.units) else "noise"
    noise = f"; {cause} alone causes {shown(floor)}" if floor is not None else ""
    measure, _, _ = str(result.summary.get("gap_is", RMSE)).partition(";")
    return f"{name.replace('_', ' ')}: {shown(before)} before, {shown(after)} after [{unit}] ({measure}{noise})."


def drawings(result: GapResult) -> Iterator[Drawn]:
    """Name, figure and caption of every figure that this result has."""
    kinds = (
        ("residuals", residuals_figure),
        ("spectrum", spectrum_figure),
        ("distribution", distribution_figure),
        ("remainder", remainder_figure),
    )
    for output in result.outputs:
        for kind, draw in kinds:
            figure = draw(result, output)
            if figure is not None:
                part = re.sub(r"\W+", "_", output.name)  # a user's column as a part of a file name
                yield f"{kind}_{part}", figure, CAPTIONS[kind].format(output.name)
    points = next_figure(result)
    if points is not None:
        yield "next_measurement", points, NEXT_MEASUREMENT_CAPTION
    path = path_figure(result)
    if path is not None:
        yield "path", path, CAPTIONS["path of a batch" if len(result.units) else "path"]


def _pictures_of_kind(pictures: Mapping[str, str], kind: str) -> str:
    return "\n".join(text for name, text in pictures.items() if name.startswith(kind))


def _verdict(result: GapResult) -> str:
    lines = [VERDICTS.get(result.verdict, result.verdict)]
    lines += [f"{effect.name}: {effect.cause}" for effect in result.effects]
    lines += [
        f"{effect.name}: {parameter} is at its physical bound"
        for effect in result.effects
        for parameter in effect.at_bound
    ]
    lines += [f"unexplained: {remainder}" for remainder in result.remainder]
    lines += [str(output) for output in result.gate.outputs]
    return bullets(lines)


def _gaps(result: GapResult) -> str:
    units = {axis.name: axis.unit for axis in result.outputs} | {"total": "noise units"}
    rows = [
        {
            "output": name,
            "unit": units.get(name, ""),
            "before": before,
            "after": result.gap_after.get(name),
            "noise floor": result.noise_floor.get(name),
        }
        for name, before in result.gap_before.items()
    ]
    return table(pd.DataFrame(rows), caption=f"{result.summary.get('gap_is', RMSE)}.")


def _regions_section(result: GapResult) -> str:
    columns = (
        "output, variable, kind, low: from, high: to, unit, order, direction, share: fraction of the gap, "
        "statistic: evidence, threshold: threshold of noise"
    )
    return table(listed(result.where, columns))


def _steps(result: GapResult) -> str:
    columns = (
        "number: step, action, name, accepted, held_out: held-out RMSE over noise, held_out_gain: held-out gain, "
        "held_out_error: its standard error, gain, threshold, reason"
    )
    frame = listed(result.steps, columns).dropna(axis="columns", how="all")
    return table(frame, [step.accepted for step in result.steps])


def _effect(effect: FoundEffect) -> str:
    rows = listed(effect.parameters, "name: parameter, value, low: 90 % from, high: to, unit, meaning")
    evidence = [
        f"explains {shown(effect.gain)} where the threshold of noise is {shown(effect.threshold)}",
        f"held-out squared error falls by {shown(effect.held_out_gain)} "
        f"(standard error {shown(effect.held_out_error)})",
    ]
    if effect.frequency == effect.frequency:
        evidence.append(f"identified in {100 * effect.frequency:.0f} % of the bootstrap replicates")
    evidence += [f"{name} is at its physical bound" for name in effect.at_bound]
    if effect.counterpart:
        evidence.append(f"in the problem of the allocation: {effect.counterpart}")
    return (
        f"<h3>{escape(effect.name)} ({escape(effect.family)})</h3>\n<p>{escape(effect.cause)}</p>\n"
        f"{table(rows)}\n{bullets(evidence)}"
    )


def _remainder(result: GapResult) -> str:
    columns = "output, variables, shape, rms, unit, ratio: over the noise, share: fraction of the gap"
    rows = listed(result.remainder, columns)
    terms = [f"unexplained term of the corrected model: {term}" for term in result.unresolved]
    offers = "\n".join(_offer(part) for part in result.remainder if part.plugin)
    return table(rows.assign(variables=rows["variables"].map(", ".join))) + bullets(terms) + offers


def _offer(part: Remainder) -> str:
    """An effect of one's own with the form of a remainder, by a formula and by a plugin."""
    formula = f"<p>{FORMULA}</p>\n<pre>{escape(part.formula)}</pre>" if part.formula else ""
    body = f"{formula}\n<p>{PLUGIN}</p>\n<pre>{escape(part.plugin)}</pre>"
    return folded_section(f"An effect of your own: {part.output} by {' and '.join(part.variables)}", body)


def _next(result: GapResult, pictures: str) -> str:
    """The planned measurement, or how to plan one where a question is open."""
    open_question = result.next_measurement is not None or bool(result.rivals or result.shapes)
    return next_section(result.next_measurement, pictures) if open_question else ""


def _rival(rival: Rival) -> str:
    names, instead_of = " + ".join(rival.names), " + ".join(rival.instead_of)
    lines = [f"fits worse by {shown(rival.distance)} (likelihood, and ln n per further parameter)"]
    if rival.correlation == rival.correlation:
        lines.append(
            f"their contributions on these rows, given all other fitted terms, correlate by {rival.correlation:.3f}"
        )
    lines.append(f"next measurement: {rival.measurement}")
    lines += [
        f"vary {name} from {shown(low)} to {shown(high)}" for name, (low, high) in rival.measurement.inputs.items()
    ]
    if rival.measurement.readings:
        lines.append(f"measurements that separate them: {rival.measurement.readings}")
    return f"<h3>{escape(names)} instead of {escape(instead_of)}</h3>\n{bullets(lines)}"


def _recalibrated_table(result: GapResult) -> str:
    columns = "name: parameter, before, after, unit, tolerance, at_bound: at its end"
    return table(listed(result.gate.recalibrated, columns))


def _detectable_table(result: GapResult) -> str:
    rows = listed(result.gate.detectable, "name: effect, family, rms: smallest rms, unit, parameter, value")
    confounded = ", ".join(result.gate.unseen)
    return table(rows) + (f"<p>{CONFOUNDED}: {escape(confounded)}.</p>" if confounded else "")
