"""Interpretations of claims (`[[claim.reading]]`) by models and problems."""

from __future__ import annotations

from .. import registry
from ..counts import SAMPLES
from ..problems.interfaces import Documented
from ..section import Range, Section
from ..workflows.reproduce.recipes import STATISTICS, ByModel, ByProblem, Recipe, Statistic
from .claim_parts import configured, names_of
from .plugins import ModelClass
from .simulated import arguments_of

LEVEL = Range(0.0, 1.0, open_low=True, open_high=True)
MODEL_KEYS = ("model", "parameters", "variables", "effect")
PROBLEM_KEYS = ("problem", "parameters", "variables", "costs", "propagation", "limits", "grouping", "effect")


def by_model(section: Section, count: int) -> Recipe | None:
    """A statistic of a model's outputs; None where the model cannot be set up."""
    configuration = configured(section, MODEL_KEYS)
    section.accept(["at", "output", "statistic", "level", "threshold", "units", "derivative"])
    if configuration is None:
        return None
    kind = registry.load("models", configuration.model_name)
    at = _points(section.section("at"), kind)
    drawn = section.integer("units", Range(low=2), SAMPLES) or 0
    statistic = _statistic(section, drawn, max((len(points) for points in at.values()), default=1))
    if kind.population and not drawn:
        section.fault("units", f"is missing: {configuration.model_name} draws units; state their number")
    names = names_of(section, "output", count, {output.name: output.unit for output in kind.outputs})
    recipe = ByModel(
        configuration.model_name,
        kind,
        **arguments_of(configuration),
        effects=configuration.settings.effects,
        at=at,
        outputs=names,
        statistic=statistic,
        drawn=drawn,
    )
    section.attempt(recipe.model)  # reports faults that only show when the model is built
    return recipe


def _points(section: Section, kind: ModelClass) -> dict[str, tuple[float, ...]]:
    """The operating points: one value for all, or lists of one length."""
    points = {}
    for column in kind.columns:
        if column.text:
            continue
        if isinstance(section.take(column.name), list):
            values = section.numbers(column.name)
        else:
            value = section.quantity(column.name, column.unit)
            values = None if value is None else (value,)
        if values:
            points[column.name] = values
        elif column.needed and column.name not in section:
            section.fault(column.name, f"is missing: {column.meaning}")
    section.finish()
    lengths = {len(values) for values in points.values()} - {1}
    if len(lengths) > 1:
        section.fault("", f"has lists of different lengths: {sorted(lengths)}")
    return points


def _statistic(section: Section, drawn: int, rows: int) -> Statistic:
    name = section.text("statistic", STATISTICS) or "value"
    level = section.number("level", within=LEVEL)
    threshold = section.number("threshold")
    if name == "quantile" and "level" not in section:
        section.fault("level", "is missing: the fraction of rows below the quantile")
    if name.startswith("fraction") and "threshold" not in section:
        section.fault("threshold", "is missing: the value, in the unit of the output")
    if name == "value" and (drawn or rows > 1):
        section.fault(
            "statistic", f"is missing: there are {drawn or rows} rows; choose one of {', '.join(STATISTICS[1:])}"
        )
    return Statistic(name, (level if name == "quantile" else threshold) or 0.0)


def by_problem(section: Section, count: int) -> Recipe | None:
    """Outputs of a problem at a design; None where problem or design are faulty."""
    configuration = configured(section, PROBLEM_KEYS)
    section.accept(["reference", "design", "output", "derivative"])
    if configuration is None or configuration.problem is None:
        return None
    problem = configuration.problem
    names = names_of(section, "output", count, {output.name: output.unit for output in problem.outputs})
    printed = Documented.of(problem).references()
    label = section.text("reference", printed)
    values = {v.name: v.document for v in problem.variables if v.document is not None} | problem.fixed
    if label is not None and label in printed:
        values |= dict(zip(problem.names, printed[label].tolist(), strict=True))
    design = section.section("design")
    for variable in problem.variables:
        value = design.number(variable.name, variable.unit, Range(variable.valid_low, variable.valid_high))
        if value is not None:
            values[variable.name] = value
        elif variable.name not in values and variable.name not in design:
            design.fault(variable.name, "is missing: no document prints it")
    design.finish()
    if len(values) < len(problem.variables):
        return None
    return ByProblem(configuration.problem_name, problem, tuple(float(values[name]) for name in problem.names), names)
