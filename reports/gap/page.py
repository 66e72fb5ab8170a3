"""The page of one gap analysis: a single HTML file that needs no network."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from html import escape
from math import isfinite

import pandas as pd
from matplotlib.figure import Figure

from ...gap_records import FoundEffect, GapResult, Rival
from ..document import about, bullets, document, folded, picture, section
from ..summary import summary_table
from ..tables import listed, shown, table
from .distribution import distribution_figure
from .drawing import drawing_section
from .next_measurement import CAPTION, next_figure, next_section
from .path import path_figure
from .populations import attribution_table, population_table
from .residuals import residuals_figure
from .spectrum import spectrum_figure

NONE = table(pd.DataFrame())
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
CONFOUNDED = "Not detectable, because confounded with free parameters"
CAPTIONS = {
    "residuals": "{0}: measured less predicted against every input: before (circles), after "
    "(crosses) and the part that the correction removed (pluses), all on one scale. The black line is the mean "
    "of neighbouring measurements, dotted lines are at twice the noise, and the gap is located in hatched "
    "regions. At most 600 measurements are drawn.",
    "spectrum": "{0}: amplitude of every order of the residual, before in the upper and after in the lower panel. "
    "The dotted line is the largest amplitude of noise alone; peaks above it are labelled with their order. "
    "The gap is located at hatched orders, including waves that grow with the torque, which hardly show here.",
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


def drawings(result: GapResult) -> tuple[Drawn, ...]:
    """Name, figure and caption of every figure that this result has."""
    return tuple(_drawn(result))


def gap_page(result: GapResult, drawn: Sequence[Drawn] | None = None) -> str:
    """The whole page, with the figures that are `drawn` already; every text that comes from
    outside is escaped.
    """
    all_drawn = drawings(result) if drawn is None else drawn
    pictures = {name: picture(name, figure, caption) for name, figure, caption in all_drawn}
    sections = {
        "The gap before and after": _of_kind(pictures, "distribution")
        + _of_kind(pictures, "residuals")
        + _gaps(result)
        + population_table(result),
        "What was simulated": drawing_section(result.drawing),
        "Verdict": _verdict(result),
        "Where": _regions_section(result),
        "Orders": _of_kind(pictures, "spectrum"),
        "Steps": _of_kind(pictures, "path") + _steps(result),
        "Effects": "\n".join(map(_effect, result.effects)),
        "Unexplained residual": _remainder(result) if result.remainder else "",
        "Rivals and the measurement that separates them": "\n".join(map(_rival, result.rivals)),
        "Inputs that may cause it": attribution_table(result),
        "The next measurement": _next(result, _of_kind(pictures, "next_measurement")),
        "Shapes without an identified effect": bullets([str(shape) for shape in result.shapes])
        if result.shapes
        else "",
        "Recalibrated parameters": _recalibrated(result),
        "Detection limits": _detectable(result),
        "Notes": bullets(result.notes) if result.notes else "",
        "Summary": summary_table(result.summary),
        "Configuration": f"<pre>{escape(result.configuration)}</pre>",
        "Corrected configuration": f"<pre>{escape(result.corrected)}</pre>",
    }
    parts = [
        section(title, folded("Show", body) if title in FOLDED else body)
        for title, body in sections.items()
        if body.replace(NONE, "").strip()
    ]
    return document(result.title, parts, head=_head(result))


def _head(result: GapResult) -> str:
    """The answer in sentences: the verdict, the effects, and the gap before and after."""
    lines = [VERDICTS.get(result.verdict, result.verdict)]
    lines += [f"{effect.name.replace('_', ' ')}: {effect.cause}" for effect in result.effects]
    lines += [line for line in map(partial(_before_after, result), result.gap_before) if line]
    rest = "".join(f"<li>{escape(line)}</li>" for line in lines[1:])
    return f'{about(result.summary)}<p class="asked">{escape(lines[0])}</p>\n<ul class="answers">{rest}</ul>'


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


def _drawn(result: GapResult) -> Iterator[Drawn]:
    kinds = (("residuals", residuals_figure), ("spectrum", spectrum_figure), ("distribution", distribution_figure))
    for output in result.outputs:
        for kind, draw in kinds:
            figure = draw(result, output)
            if figure is not None:
                yield (f"{kind}_{_file_part(output.name)}", figure, CAPTIONS[kind].format(output.name))
    points = next_figure(result)
    if points is not None:
        yield "next_measurement", points, CAPTION
    path = path_figure(result)
    if path is not None:
        yield "path", path, CAPTIONS["path of a batch" if len(result.units) else "path"]


def _file_part(name: str) -> str:
    """A user's column as a part of a file name."""
    return re.sub(r"\W+", "_", name)


def _of_kind(pictures: Mapping[str, str], kind: str) -> str:
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
    return table(rows.assign(variables=rows["variables"].map(", ".join))) + bullets(terms)


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


def _recalibrated(result: GapResult) -> str:
    columns = "name: parameter, before, after, unit, tolerance, at_bound: at its end"
    return table(listed(result.gate.recalibrated, columns))


def _detectable(result: GapResult) -> str:
    rows = listed(result.gate.detectable, "name: effect, family, rms: smallest rms, unit, parameter, value")
    confounded = ", ".join(result.gate.unseen)
    return table(rows) + (f"<p>{CONFOUNDED}: {escape(confounded)}.</p>" if confounded else "")
