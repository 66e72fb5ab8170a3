"""Cost curves from and to the tables of a configuration."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

from ...section import Section
from . import CURVES, CostCurve


def read_curve(section: Section, default: CostCurve | None = None) -> CostCurve | None:
    """The curve that a table states; without `model` it changes coefficients of the default."""
    name = section.text("model", CURVES)
    base: dict[str, Any] = {}
    if "model" not in section and default is not None:
        name, base = name_of(default), asdict(default)  # type: ignore[call-overload]
    if name is None:
        if "model" not in section:
            section.fault("model", f"is missing; one of {', '.join(CURVES)}")
        return None
    kind = CURVES[name]
    keys = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    values = {key: section.numbers(key) if name == "table" else section.number(key) for key in keys}
    for key in keys:
        if key not in section and key not in base:
            section.fault(key, f"is missing: the cost model {name} needs {', '.join(keys)}")
    section.finish()
    stated = base | {key: value for key, value in values.items() if value is not None}
    if len(stated) < len(keys):
        return None
    curve = kind(**stated)
    faults = curve.faults()
    for key, message in faults:
        section.fault(key, message)
    return None if faults else curve


def name_of(curve: CostCurve) -> str:
    """The configuration name of a curve."""
    return CURVES.name_of(type(curve))


def curve_table(curve: CostCurve) -> dict[str, Any]:
    """The table that states a curve."""
    coefficients: dict[str, Any] = asdict(curve)  # type: ignore[call-overload]
    return {"model": name_of(curve)} | {
        key: list(value) if isinstance(value, tuple) else value for key, value in coefficients.items()
    }
