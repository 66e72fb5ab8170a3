"""The region where effects inside a model act, and the shape of the unidentified residual."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ...arrays import Array
from ...declarations import Output
from ...gap_records import Region, Shape
from ...models.effects.measurements import unit_numbers
from ...models.measurable import Role
from .fit import Fit
from .generic import PREDICTED, Form, order_of_units
from .linear import projected_out
from .scan import GenericResidual, Remaining
from .select import Search
from .setup import Setup

FAMILIES = {
    Role.TORQUE: "load",
    Role.FORCE: "load",
    Role.ANGLE: "geometry by angle",
    Role.SPEED: "speed",
    Role.TEMPERATURE: "temperature, time",
    Role.TIME: "temperature, time",
    Role.UNIT: "population",
    Role.LOT: "population",
    Role.PAYLOAD: "load",
    Role.POSITION: "position",
    Role.DIRECTION: "load",
}


def of_inside(setup: Setup, fit: Fit, table: pd.DataFrame) -> tuple[Region, ...]:
    """The regions of the prediction in which effects inside the model change it."""
    if not any(member.candidate.is_nonlinear for member in fit.members):
        return ()
    regions = []
    for output in setup.data.outputs:
        after = table[f"{output.name}_corrected"].to_numpy()
        ends = densest(after, after - table[f"{output.name}_predicted"].to_numpy())
        squares, remaining = (float(np.mean(table[f"{output.name}_{side}"] ** 2)) for side in ("before", "after"))
        fraction = 1.0 - remaining / max(squares, 1e-300)
        variable = f"{PREDICTED}{output.name}"
        regions.append(Region(output.name, variable, "interval", output.unit, *ends, share=fraction))
    return tuple(regions)


def along(setup: Setup, variable: str) -> Array | None:
    """Values (n,) of an input, or of a predicted output; None where there is no such variable."""
    if variable.startswith(PREDICTED):
        return setup.predicted[variable.removeprefix(PREDICTED)]
    if variable == order_of_units(setup.data):
        return np.asarray(unit_numbers(setup.data.measurements), dtype=float)
    if variable not in {c.name for c in setup.data.inputs}:
        return None
    return setup.data.values(variable)


def curve_of(setup: Setup, generic: Remaining, at: int, q: Array, residual: Array) -> Array:
    """The fit of a form to a residual (N,) given a basis (N, r), in the unit of its output."""
    coefficients = np.linalg.lstsq(projected_out(generic.white.of(at), q), residual, rcond=1e-7)[0]
    curve = setup.generic.of(at % len(setup.forms)) @ coefficients
    zero = setup.data.outputs[int(generic.outputs[at])].name in setup.data.zeros
    return np.asarray(curve - curve.mean() if zero else curve)


def densest(x: Array, curve: Array, part: float = 0.6) -> tuple[float, float]:
    """The shortest interval of x that holds `part` of the curve's squares."""
    order = np.argsort(x, kind="stable")
    total = np.concatenate([[0.0], np.cumsum(curve[order] ** 2)])
    if total[-1] <= 0.0:
        return float(x.min()), float(x.max())
    wanted = total + part * total[-1]
    ends = np.searchsorted(total, wanted[wanted <= total[-1]])
    ends = np.minimum(ends, len(x)) - 1
    starts = np.arange(len(ends))
    widths = x[order][ends] - x[order][starts]
    best = int(np.argmin(np.where(ends >= starts, widths, np.inf)))
    return float(x[order][best]), float(x[order][ends[best]])


def shapes(
    setup: Setup, search: Search, generic: Remaining, remaining: GenericResidual, fit: Fit, near: tuple[str, ...]
) -> tuple[Shape, ...]:
    """The strongest unidentified forms given the fit of the identified effects, at most 3."""
    records: dict[tuple[int, str], Shape] = {}
    for at in remaining.best:
        if remaining.evidence[at] <= search.thresholds.generic or len(records) >= 3:
            break
        form, output = generic.forms[at], int(generic.outputs[at])
        key = (output, form.variable)
        if key not in records and not (records and form.kind == "distribution"):
            curve = curve_of(setup, generic, int(at), search.fitter.q, fit.residual)
            role = generic.roles.get(form.variable)
            records[key] = _shape(setup, form, setup.data.outputs[output], role, curve, near)
    return tuple(records.values())


def _shape(setup: Setup, form: Form, output: Output, role: Role | None, curve: Array, near: tuple[str, ...]) -> Shape:
    amplitude = float(np.abs(curve).max() if form.kind == "distribution" else 0.5 * np.ptp(curve))
    low = high = np.nan
    if form.variable in {c.name for c in setup.data.inputs} and form.kind != "order":
        low, high = densest(setup.data.values(form.variable), curve)
    torque = _parity(setup, curve) if role in (Role.TORQUE, Role.FORCE) else "none"
    return Shape(
        output=output.name,
        family="unknown" if role is None else FAMILIES.get(role, "unknown"),
        variable=" x ".join(form.variables),
        amplitude=amplitude,
        unit=output.unit,
        text=_text(form, amplitude, output.unit, torque, near),
        low=low,
        high=high,
        order=form.order if form.kind == "order" else np.nan,
        torque=torque,
        direction="odd" if form.direction else "even",
        between=near,
        by=form.by,
    )


def _parity(setup: Setup, curve: Array) -> str:
    """Whether a curve changes its sign with the load."""
    role = Role.TORQUE if Role.TORQUE in setup.data.measurements else Role.FORCE
    load = np.asarray(setup.data.measurements[role], dtype=float)
    if not ((load < 0).any() and (load > 0).any()):
        return "unknown"
    size = np.abs(load) / np.abs(load).max()
    odd, even = (
        _explained(np.column_stack([s * size**p for p in (0.0, 0.5, 1.0, 2.0)]), curve)
        for s in (np.sign(load), np.ones_like(load))
    )
    return "odd" if odd > even else "even"


def _explained(columns: Array, curve: Array) -> float:
    coefficients = np.linalg.lstsq(columns, curve, rcond=1e-9)[0]
    return float(1.0 - np.sum((curve - columns @ coefficients) ** 2) / max(np.sum(curve**2), 1e-300))


def _text(form: Form, amplitude: float, unit: str, torque: str, near: tuple[str, ...]) -> str:
    """A sentence about a form."""
    where = {
        "order": f"a wave of order {form.order:g}",
        "distribution": "an offset of all units",
        "direction": "an offset that changes sign with the direction",
        "product": f"a product of {form.variable} and {', '.join(form.further_variables)}",
        "trend": f"a change along {form.variable}",
    }.get(form.kind, f"a dependence on {form.variable}")
    parts = [f"{where}, amplitude {amplitude:.3g} {unit}".rstrip()]
    if form.kind == "power":
        parts.append(f"about its power {form.order:.3g}")
    if form.detail and form.kind != "power":
        parts.append(form.detail)
    if torque in ("odd", "even"):
        parts.append(f"{torque} in the load")
    if form.direction:
        parts.append("opposite in the two directions")
    if near:
        parts.append(f"form not resolved between {', '.join(near)}")
    return "; ".join(parts)
