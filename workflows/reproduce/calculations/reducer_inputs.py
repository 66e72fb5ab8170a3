"""What calculations on the backlash of a reducer are given, and the sum that they make of it."""

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

PLAIN = ("uniform", "triangular", "trapezoid", "normal", "truncated_normal", "rayleigh")
"""Distributions whose parameters all have defaults."""
COMMON = "distribution"
SAME = "as the others"
RANDOM = tuple(v for v in declared.VARIABLES if v.random)


def _of_variable(one: Variable) -> Parameter:
    assumed, low = bool(one.assumed), one.valid_low
    kind = "" if one.kind is Kind.NOMINAL else f" ({one.kind.value.split(' of ')[0]})"
    default = float(one.document or 0.0)
    source = one.assumed or "document B"
    return Parameter(
        one.name,
        default,
        one.unit,
        one.meaning + kind,
        source,
        assumed,
        low=low,
        high=one.valid_high,
    )


def _of_law(one: Variable) -> Parameter:
    name = f"{stem(one.name)}_distribution"
    return Parameter(
        name,
        SAME,
        "",
        f"distribution over units of {one.meaning}",
        "assumed",
        assumed=True,
        choices=(SAME, *PLAIN),
    )


def stem(name: str) -> str:
    """The name of an error, of the variable that states its tolerance."""
    return name.removesuffix("_um")


PARAMETERS: tuple[Parameter, ...] = (
    *(replace(one, default=PRINTED) if one.name == READING else one for one in declared.PARAMETERS),
    *(_of_variable(one) for one in declared.VARIABLES),
    Parameter(
        COMMON,
        "uniform",
        "",
        "distribution of every error over units, where it has none of its own",
        "assumed: document B names none",
        assumed=True,
        choices=PLAIN,
    ),
    Parameter(
        "cp",
        1.0,
        "",
        "process capability of the distributions that have one (normal, "
        "truncated normal, Rayleigh)",
        "assumed",
        assumed=True,
        low=0.0,
        open_low=True,
    ),
    *(_of_law(one) for one in RANDOM),
)


def model_of(values: Mapping[str, Value]) -> BacklashModel:
    """The model of completed values. Raises InputError where the teeth would be undercut."""
    laws = {stem(one.name): _law(values, stem(one.name)) for one in RANDOM}
    found = declared.backlash_model(values, None, laws)
    if not found.geometry.k1 < 1.0:
        text = f"e z_p/r_p must be below 1 (no undercut), got {found.geometry.k1:.4g}; lower it"
        raise refuse("parameters.eccentricity_mm", text)
    return found


def total_of(model: BacklashModel, values: Mapping[str, Value], **swept: Any) -> ClippedSum:
    """The sum over units; `swept` replaces designs by name with arrays (n,), in their unit."""
    count = max((np.size(one) for one in swept.values()), default=1)
    design = {v.name: swept.get(v.name, number(values[v.name])) for v in declared.VARIABLES}
    arrays = {name: np.broadcast_to(np.asarray(one, float), count) for name, one in design.items()}
    return model.total(declared.allocation(arrays))


def _law(values: Mapping[str, Value], name: str) -> Distribution:
    own = str(values[f"{name}_distribution"])
    kind = DISTRIBUTIONS[str(values[COMMON]) if own == SAME else own]
    known = {one.name for one in fields(kind)}  # type: ignore[arg-type]
    stated = {"cp": number(values["cp"])} if "cp" in known else {}
    return kind(**stated)
