"""The inputs of calculations on the backlash of a reducer, and the sum that they form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ....declarations import READING, Kind, Parameter, Value, Variable, number
from ....errors import refuse
from ....models.inputs import DISTRIBUTIONS, Distribution
from ....models.propagation import ClippedSum
from ....models.rv_reducer import declared
from ....models.rv_reducer.backlash import BacklashModel
from ....models.rv_reducer.reading import PRINTED
from .results import assumed

PLAIN = ("uniform", "triangular", "trapezoid", "normal", "truncated_normal", "rayleigh")
"""Distributions whose parameters all have defaults."""
COMMON = "distribution"
SAME = "as the others"
RANDOM = tuple(v for v in declared.VARIABLES if v.random)


def _of_variable(variable: Variable) -> Parameter:
    kind = "" if variable.kind is Kind.NOMINAL else f" ({variable.kind.value.split(' of ')[0]})"
    return Parameter(
        variable.name,
        float(variable.document or 0.0),
        variable.unit,
        variable.meaning + kind,
        variable.assumed or "document B",
        bool(variable.assumed),
        variable.valid_low,
        variable.valid_high,
    )


def _of_law(variable: Variable) -> Parameter:
    name = f"{stem(variable.name)}_distribution"
    return assumed(name, SAME, f"distribution over units of {variable.meaning}", choices=(SAME, *PLAIN))


def stem(name: str) -> str:
    """The name of an error, of the variable that states its tolerance."""
    return name.removesuffix("_um")


PARAMETERS: tuple[Parameter, ...] = (
    *(
        replace(parameter, default=PRINTED) if parameter.name == READING else parameter
        for parameter in declared.PARAMETERS
    ),
    *(_of_variable(variable) for variable in declared.VARIABLES),
    assumed(
        COMMON,
        "uniform",
        "distribution of every error over units, where it has none of its own",
        "assumed: document B names none",
        choices=PLAIN,
    ),
    assumed(
        "cp",
        1.0,
        "process capability of the distributions that have one (normal, truncated normal, Rayleigh)",
        low=0.0,
        open_low=True,
    ),
    *(_of_law(variable) for variable in RANDOM),
)


def model_of(values: Mapping[str, Value]) -> BacklashModel:
    """The model of completed values. Raises InputError where the teeth would be undercut."""
    laws = {stem(variable.name): _law(values, stem(variable.name)) for variable in RANDOM}
    model = declared.backlash_model(values, None, laws)
    if not model.geometry.k1 < 1.0:
        text = f"e z_p/r_p must be below 1 (no undercut), got {model.geometry.k1:.4g}; lower it"
        raise refuse("parameters.eccentricity_mm", text)
    return model


def total_of(model: BacklashModel, values: Mapping[str, Value], **swept: Any) -> ClippedSum:
    """The sum over units; `swept` replaces designs by name with arrays (n,), in their unit."""
    count = max((np.size(column) for column in swept.values()), default=1)
    design = {v.name: swept.get(v.name, number(values[v.name])) for v in declared.VARIABLES}
    arrays = {name: np.broadcast_to(np.asarray(column, float), count) for name, column in design.items()}
    return model.total(declared.allocation(arrays))


def _law(values: Mapping[str, Value], name: str) -> Distribution:
    law = str(values[f"{name}_distribution"])
    kind = DISTRIBUTIONS[str(values[COMMON]) if law == SAME else law]
    known = {field.name for field in fields(kind)}  # type: ignore[arg-type]
    stated = {"cp": number(values["cp"])} if "cp" in known else {}
    return kind(**stated)
