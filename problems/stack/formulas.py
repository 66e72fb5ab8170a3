"""The mechanism of a formula, and what can be wrong with it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from ...errors import Fault, nearest
from ...models.expressions import FUNCTIONS, Formula, FormulaError
from ...models.stack import Mechanism
from ...units import family, to_unit
from .definition import Part, Requirement

Array = NDArray[np.float64]
FORMULA = "requirement.formula"
CORNERS = 12
"""Pieces up to which all corners of the tolerance range are looked at; beyond, as many samples."""
INNER = 4096
"""Points within the tolerance range that are looked at."""
NEGLIGIBLE = 1e-12
"""A part that adds less than this share of the worst case does not matter."""


def with_formula(
    bare: Mechanism, requirement: Requirement, parts: Sequence[Part], faults: list[Fault]
) -> Mechanism | None:
    """The mechanism of the requirement's formula; None and faults where it has none."""
    try:
        formula = Formula(requirement.formula)
    except FormulaError as error:
        faults.append(Fault(FORMULA, str(error)))
        return None
    before = len(faults)
    faults += _name_faults(formula, parts)
    faults += [Fault(f"part[{at}].nominal", f"is missing: the formula needs it (part {part.name})")
               for at, part in enumerate(parts) if part.nominal is None]  # fmt: skip
    if len(faults) > before:
        return None
    gain, scale = _units(requirement, parts)
    nominals = scale * np.array([part.nominal for part in parts], dtype=float)
    mids = nominals + scale * np.array([part.mid for part in parts])
    reach = scale * np.array([part.high for part in parts])
    found = replace(bare, formula=formula, mids=mids[bare.owners], scale=scale[bare.owners],
                    gain=gain)  # fmt: skip
    if why := _undefined(found, nominals[bare.owners], reach[bare.owners]):
        faults.append(Fault(FORMULA, why))
        return None
    found = _linearised(found)
    faults += _slope_faults(found, parts)
    faults += _nominal_faults(requirement, gain * _at(formula, found, nominals[bare.owners]))
    return found


def _at(formula: Formula, mechanism: Mechanism, x: Array) -> float:
    """The formula at one point, pieces (k,)."""
    return float(formula.value(dict(zip(mechanism.names, x, strict=True))))


def _linearised(mechanism: Mechanism) -> Mechanism:
    """The mechanism with its value and sensitivities at the mid-limits."""
    formula, mids, scale = mechanism.formula, mechanism.mids, mechanism.scale
    assert formula is not None and mids is not None and scale is not None
    slopes = formula.gradient(dict(zip(mechanism.names, mids, strict=True)))
    each = np.array([float(slopes[name]) for name in mechanism.names])
    centre = mechanism.gain * _at(formula, mechanism, mids)
    return replace(mechanism, sensitivities=mechanism.gain * each * scale, centre=centre)


def _name_faults(formula: Formula, parts: Sequence[Part]) -> list[Fault]:
    """Names that no part has, and parts that the formula leaves out."""
    pieces = {piece: part for part in parts for piece in part.pieces}
    whole = {part.name: part for part in parts if part.count > 1}
    found = []
    for name, column in formula.names.items():
        if name in whole:
            listed = ", ".join(whole[name].pieces)
            text = f"{name} is built in {whole[name].count} times: write {listed}"
            found.append(Fault(FORMULA, f"column {column}: {text}"))
        elif name not in pieces:
            close = nearest(name, [*pieces, *FUNCTIONS])
            found.append(Fault(FORMULA, f'column {column}: "{name}" is not a part{close}'))
    for at, part in enumerate(parts):
        unused = [piece for piece in part.pieces if piece not in formula.names]
        if unused and part.name not in formula.names:
            text = f"{', '.join(unused)} does not appear in the formula: the requirement does not "
            found.append(Fault(f"part[{at}].name", f"{text}depend on it (part {part.name})"))
    return found


def _units(requirement: Requirement, parts: Sequence[Part]) -> tuple[float, Array]:
    """The requirement's unit per unit of the formula, and the formula's units per unit of a part.

    Angles enter in rad, plain numbers as they are, all lengths in the unit of the requirement if it
    is a length, else in that of the first part that is one; other quantities like lengths.
    """
    kind, factor = family(requirement.unit)
    coherent = {"radian": 1.0, "": 1.0}
    base = dict(coherent)
    base.setdefault(kind, factor)
    for part in parts:
        base.setdefault(*family(part.unit))
    scale = [family(part.unit)[1] / base[family(part.unit)[0]] for part in parts]
    return base[kind] / factor, np.array(scale)


def _undefined(mechanism: Mechanism, nominals: Array, reach: Array) -> str:
    """Where the formula has no value: at the nominals, or within the tolerances."""
    formula, mids, names = mechanism.formula, mechanism.mids, mechanism.names
    assert formula is not None and mids is not None
    if why := formula.trouble(dict(zip(names, nominals[:, None], strict=True))):
        return f"at the nominal values, {why}"
    points = mids[:, None] + reach[:, None] * _box(len(names))
    if why := formula.trouble(dict(zip(names, points, strict=True))):
        return f"within the tolerances, {why}; tighten the ranges or correct the formula"
    return ""


def _box(pieces: int) -> Array:
    """Corners of [-1, 1]^k and points between them, shape (k, m); the first is the middle."""
    inner = 2.0 * qmc.Sobol(pieces, scramble=False).random(INNER).T - 1.0
    if pieces <= CORNERS:
        corners = np.array(list(product((-1.0, 1.0), repeat=pieces))).T
    else:
        corners = np.where(inner[:, 1:] > 0.0, 1.0, -1.0)
    return np.hstack([np.zeros((pieces, 1)), corners, inner])


def _slope_faults(mechanism: Mechanism, parts: Sequence[Part]) -> list[Fault]:
    """Pieces that the requirement does not depend on, or depends on without bound."""
    slopes, t = mechanism.sensitivities, np.array([part.high for part in parts])[mechanism.owners]
    effect = np.where(t > 0.0, np.abs(slopes) * t, np.nan)
    found = []
    for i, (name, at) in enumerate(zip(mechanism.names, mechanism.owner, strict=True)):
        if not np.isfinite(slopes[i]):
            text = f"has no finite derivative with respect to {name} at the mid-limits: the linear "
            found.append(Fault(FORMULA, f"{text}model does not exist"))
        elif effect[i] <= NEGLIGIBLE * np.nansum(effect):
            text = f"the sensitivity of the requirement to {name} is 0 at the mid-limits: no "
            text += f"tolerance of it matters (part {parts[at].name})"
            found.append(Fault(f"part[{at}].name", text))
    return found


def _nominal_faults(requirement: Requirement, computed: float) -> list[Fault]:
    """The stated nominal against the formula's, up to the digits it is stated with."""
    if requirement.nominal is None:
        return []
    rounding = _rounding(requirement.stated_nominal, requirement.unit)
    allowed = min(rounding, 1e-3 * abs(computed)) * 1.001 + 1e-12 * abs(computed)
    if abs(requirement.nominal - computed) <= allowed:
        return []
    text = f"is stated as {requirement.nominal:.10g}, but the formula gives {computed:.10g}"
    unit = f" {requirement.unit}".rstrip()
    return [Fault("requirement.nominal", f"{text}{unit} at the nominals; correct one of them")]


def _rounding(stated: object, unit: str) -> float:
    """Half a step of the last digit that a nominal is stated with."""
    match = re.match(r"\s*[+-]?\d*\.?(\d*)(?:[eE]([+-]?\d+))?\s*(.*)", str(stated))
    assert match is not None
    step = 0.5 * 10.0 ** (int(match[2] or 0) - len(match[1]))
    return step * abs(to_unit(f"1 {match[3]}", unit)) if match[3].strip() else step
