"""Where the residual has structure: regions, shapes without a name, and the spectrum of orders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...models.effects.measurements import unit_numbers
from ...models.effects.unresolved import Form
from ...models.measurable import Role
from ...section import Array, Output
from .data import GapData
from .fit import Fit, Fitter
from .generic import PREDICTED, order_grid, order_of_units
from .linear import basis, products, project_out, ranking
from .noise import Noise
from .records import Region, Shape
from .scan import GenericResidual, Remaining, evidence
from .selection import Search
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


def regions_of_prediction(setup: Setup, fit: Fit, table: pd.DataFrame) -> tuple[Region, ...]:
    """The regions of the prediction in which effects inside the model change it."""
    if not any(member.candidate.is_nonlinear for member in fit.members):
        return ()
    regions = []
    for output in setup.data.outputs:
        after = table[f"{output.name}_corrected"].to_numpy()
        ends = densest_interval(after, after - table[f"{output.name}_predicted"].to_numpy())
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
    coefficients = np.linalg.lstsq(project_out(generic.white.of(at), q), residual, rcond=1e-7)[0]
    curve = setup.generic.of(at % len(setup.forms)) @ coefficients
    zero = setup.data.outputs[int(generic.outputs[at])].name in setup.data.zeros
    return np.asarray(curve - curve.mean() if zero else curve)


def densest_interval(x: Array, curve: Array, part: float = 0.6) -> tuple[float, float]:
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
        low, high = densest_interval(setup.data.values(form.variable), curve)
    torque = _parity(setup, curve) if role in (Role.TORQUE, Role.FORCE) else "none"
    what, *details = form.words
    parts = [f"{what}, amplitude {amplitude:.3g} {output.unit}".rstrip(), *details]
    parts += [f"{torque} in the load"] if torque in ("odd", "even") and form.kind != "power" else []
    parts += [f"form not resolved between {', '.join(near)}"] if near else []
    return Shape(
        output=output.name,
        family="unknown" if role is None else FAMILIES.get(role, "unknown"),
        variable=" x ".join(form.variables),
        amplitude=amplitude,
        unit=output.unit,
        text="; ".join(parts),
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
        _explained_fraction(np.column_stack([s * size**p for p in (0.0, 0.5, 1.0, 2.0)]), curve)
        for s in (np.sign(load), np.ones_like(load))
    )
    return "odd" if odd > even else "even"


def _explained_fraction(columns: Array, curve: Array) -> float:
    coefficients = np.linalg.lstsq(columns, curve, rcond=1e-9)[0]
    return float(1.0 - np.sum((curve - columns @ coefficients) ** 2) / max(np.sum(curve**2), 1e-300))


MAX_REGIONS = 6
LEAKAGE = 0.6
"""Distance of orders that are leakage of a located one: angles seldom cover whole turns."""
AS_MUCH = 0.8
"""Fraction of the gain of a flexible form from which a symmetric one is reported instead."""
WIDTHS = np.geomspace(0.01, 1.0, 24)
"""Half-widths of symmetric intervals, as fractions of the largest magnitude."""
OVER_INPUT = ("interval", "power", "trend")


def regions(setup: Setup, fitter: Fitter, generic: Remaining, fit: Fit, limit: float) -> tuple[Region, ...]:
    """The significant regions, the strongest first.

    A located region is removed with a flexible form of its variable before the next search: two
    variables in which a single cause shows, through chance correlation, are not two regions.
    """
    located: list[Region] = []
    groups, q = generic.white, fitter.q
    residual = project_out(fit.residual, q)
    projected, product = products(groups, q, residual)
    beyond = fit.rss - fitter.space.count
    while len(located) < MAX_REGIONS:
        gains = groups.conditional_gains(projected, product)
        level = evidence(groups, gains)
        at = int(ranking(level)[0])
        if level[at] <= limit:
            break
        parts = [generic.white.of(int(k)) for k in _related_forms(generic, at)]
        taken = basis(project_out(np.hstack(parts), q))
        explained = max(float(np.sum((taken.T @ residual) ** 2)) - taken.shape[1], float(gains[at]))
        beyond = max(beyond, explained)
        low, high = _ends(setup, fitter, generic, at, q, residual, explained)
        located.append(_region(setup, generic, at, low, high, explained / beyond, float(level[at]), limit))
        q, residual = np.hstack([q, taken]), project_out(residual, taken)
        more, product = products(groups, taken, residual)
        projected = np.vstack([projected, more])
    return tuple(located)


def _related_forms(generic: Remaining, at: int) -> NDArray[np.int64]:
    """The forms that are removed with a located one: all of its variable, or of about its order."""
    form = generic.forms[at]

    def same(other: Form) -> bool:
        if (other.variables, other.direction) != (form.variables, form.direction):
            return False
        if form.kind == "order":
            near = other.kind == "order" and abs(other.order - form.order) < LEAKAGE
            return near and (other.by, other.by_power) == (form.by, form.by_power)
        return other.kind in OVER_INPUT and form.kind in OVER_INPUT

    together = [
        same(candidate) and generic.outputs[k] == generic.outputs[at] for k, candidate in enumerate(generic.forms)
    ]
    together[at] = True
    return np.flatnonzero(together)


def _ends(
    setup: Setup, fitter: Fitter, generic: Remaining, at: int, q: Array, residual: Array, explained: float
) -> tuple[float, float]:
    """The interval of its variable in which a form has its gain; nan where it has none."""
    form = generic.forms[at]
    x = along(setup, form.variable) if form.kind in OVER_INPUT else None
    if x is None:
        return np.nan, np.nan
    if (x < 0).any() and (x > 0).any():
        width, gain = _turning(setup, fitter, form, int(generic.outputs[at]), x, q, residual)
        if gain >= AS_MUCH * explained:
            return max(-width, float(x.min())), min(width, float(x.max()))
    return densest_interval(x, curve_of(setup, generic, at, q, residual))


def _turning(
    setup: Setup, fitter: Fitter, form: Form, output: int, x: Array, q: Array, residual: Array
) -> tuple[float, float]:
    """Half-width of the interval about zero in which an odd function of x rises, and its gain.

    The function is clip(x/w, -1, 1), constant beyond w.
    """
    widths = WIDTHS * float(np.abs(x).max())
    columns = np.zeros((len(x) * len(setup.data.outputs), len(widths)))
    odd = np.clip(x[:, None] / widths, -1.0, 1.0)
    if form.direction:
        odd = odd * np.asarray(setup.data.measurements[Role.DIRECTION], dtype=float)[:, None]
    columns[setup.data.rows_of(output)] = odd
    remaining = project_out(fitter.space.whiten(columns), q)
    size = np.einsum("ij,ij->j", remaining, remaining)
    gains = (remaining.T @ residual) ** 2 / np.maximum(size, 1e-9)
    best = int(np.argmax(gains))
    return float(widths[best]), float(gains[best])


def _region(
    setup: Setup, generic: Remaining, at: int, low: float, high: float, fraction: float, level: float, limit: float
) -> Region:
    form, output = generic.forms[at], setup.data.outputs[int(generic.outputs[at])]
    unit = next((c.unit for c in setup.data.inputs if c.name == form.variable), "")
    return Region(
        output=output.name,
        variable=" x ".join(form.variables),
        kind="interval" if form.kind == "power" else form.kind,
        unit=output.unit if form.variable.startswith(PREDICTED) else unit,
        low=low,
        high=high,
        order=form.order if form.kind == "order" else np.nan,
        direction="opposite in the two directions" if form.direction else "",
        share=float(np.clip(fraction, 0.0, 1.0)),
        statistic=level,
        threshold=limit,
    )


COLUMNS = ("output", "order", "before", "after", "threshold")
SPECTRUM_MOST = 20_000
"""Rows of a spectrum."""
VALUES_PER_BATCH = 2_000_000
"""Values of waves that are held at once."""
NODES = 1e-9
"""Fraction of a cosine's squares below which the sine has only rounding errors."""


def spectrum(data: GapData, residuals: pd.DataFrame, noises: Sequence[Noise], limit: float) -> pd.DataFrame:
    """Amplitude of each order in the residuals of every output, and the threshold by its noise.

    `limit` is a threshold on minus the logarithm of a probability. Empty without an angle that turns far enough.
    """
    turns = Role.ANGLE in data.measurements and np.ptp(data.measurements[Role.ANGLE]) >= 0.1
    orders = order_grid(data) if turns else np.empty(0)
    if not len(orders):  # or none of which the record holds half a wave
        return pd.DataFrame({name: [] for name in COLUMNS})
    rows = np.linspace(0, len(data) - 1, min(len(data), SPECTRUM_MOST)).astype(int)
    angle = np.asarray(data.measurements[Role.ANGLE], dtype=float)[rows]
    parts = []
    for output, noise in zip(data.outputs, noises, strict=True):
        before, after = (residuals[f"{output.name}_{side}"].to_numpy()[rows] for side in ("before", "after"))
        columns = {
            "output": output.name,
            "order": orders,
            "before": amplitudes(angle, orders, before),
            "after": amplitudes(angle, orders, after),
            "threshold": noise.level * np.sqrt(4.0 * limit / len(rows)),
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def amplitudes(angle: Array, orders: Array, residual: Array) -> Array:
    """Amplitude (m,) of the wave of each order that fits residuals (n,) best.

    Least squares at each order (Lomb, Astrophys. Space Sci. 39, 1976): angles need not be even.
    """
    centred = residual - residual.mean()
    parts = np.array_split(orders, -(-len(orders) * len(angle) // VALUES_PER_BATCH))
    return np.concatenate([_amplitudes(angle, part, centred) for part in parts])


def _amplitudes(angle: Array, orders: Array, residual: Array) -> Array:
    """The amplitudes of a few orders: normal equations of cosine and sine from sums of waves and of
    their squares.

    Where all angles lie on the nodes of a wave, the solution of least norm is taken.
    """
    wave = np.exp(1j * np.outer(orders, angle))
    squares, sums = np.sum(wave**2, axis=1), wave @ residual
    cross, real = squares.imag, squares.real
    equations = np.array([[len(angle) + real, cross], [cross, len(angle) - real]]) / 2.0
    inverse = np.linalg.pinv(equations.transpose(2, 0, 1), rcond=NODES, hermitian=True)
    both = inverse @ np.stack([sums.real, sums.imag], axis=1)[:, :, None]
    return np.asarray(np.hypot(both[:, 0, 0], both[:, 1, 0]))
