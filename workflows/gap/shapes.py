"""The unidentified forms as records, and a formula where one was requested."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...gap_records import Shape
from ...models.measurable import Role
from .fit import Fit
from .population import Misfit
from .regions import along, shapes
from .remainder import removed_from
from .result import Ending
from .scan import generic_residual
from .setup import residual_of


def shape_records(end: Ending) -> tuple[Shape, ...]:
    """The forms that are significant given the final fit, as records."""
    analysis, search = end.analysis, end.analysis.search
    generic = analysis.null_model.generic
    misfit_shapes = () if analysis.misfit is None else (_of_misfit(end, analysis.misfit),)
    settled = not analysis.identified.withdrawn and not end.remains and not analysis.identified.significant
    if not analysis.significant or (end.identified and settled):
        return misfit_shapes
    fit = search.fitter.fit(end.fit.effects)
    remaining = generic_residual(fit, search.fitter, generic)
    records = shapes(end.setup, search, generic, remaining, fit, removed_from(analysis))
    if end.verdict == "unnamed" and end.setup.plan.settings.empirical:
        records = tuple(_with_formula(end, shape, fit) for shape in records)
    return (*misfit_shapes, *records)


def _with_formula(end: Ending, shape: Shape, fit: Fit) -> Shape:
    text = _formula(end, shape, fit)
    return replace(shape, empirical=text, text=f"{shape.text}; empirical: {text}") if text else shape


def _formula(end: Ending, shape: Shape, fit: Fit) -> str:
    """A formula over the shape's variable; empty where a spline fits as well."""
    from .empirical import Curve, empirical  # scikit-learn takes a second to import

    setup = end.setup
    x, name, period = along(setup, shape.variable), shape.variable, 0.0
    if x is None or shape.by:
        return ""
    if np.isfinite(shape.order):
        x = np.mod(shape.order * setup.data.measurements[Role.ANGLE], 2.0 * np.pi)
        name, period = f"({shape.order:g} {name})", 2.0 * np.pi
    at = [o.name for o in setup.data.outputs].index(shape.output)
    rows, noise = setup.data.rows_of(at), end.analysis.null_model.noises[at]
    good, y = noise.counted, residual_of(setup, fit)[rows]
    if shape.direction == "odd":
        y = y * np.asarray(setup.data.measurements[Role.DIRECTION], dtype=float)
    curve = Curve(x[good], y[good], noise.sigma[good], end.analysis.search.labels[rows][good], period)
    text = empirical(curve, name)
    return f"direction ({text})" if text and shape.direction == "odd" else text


def _of_misfit(end: Ending, misfit: Misfit) -> Shape:
    """Units that scatter unlike the model's, as a record."""
    output = end.setup.data.outputs[0]
    width = ", stretched to its width," if misfit.stretched else ""
    text = (
        f"the units scatter unlike the population: {misfit.distance:.3g} {output.unit} from it "
        f"about their mean{width} where chance reaches {misfit.limit:.3g}; their standard "
        f"deviation is {misfit.ratio:.2f} times as large"
    )
    where = (output.name, "population", "scatter of the units")
    return Shape(*where, misfit.distance, output.unit, text, torque="none", direction="none")
