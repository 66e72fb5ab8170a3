"""From a requirement and its parts to the mechanism, with everything checked that can be."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from ...errors import Fault, nearest
from ...models.expressions import FUNCTIONS, Formula, FormulaError
from ...models.stack import Mechanism
from ...units import family, to_unit
from .definition import Correlation, Part, Requirement

Array = NDArray[np.float64]
FORMULA = "requirement.formula"
CORNERS = 12
"""Pieces up to which all corners of the tolerance range are looked at; beyond, as many samples."""
INNER = 4096
"""Points within the tolerance range that are looked at."""
NEGLIGIBLE = 1e-12
"""A part that adds less than this share of the worst case does not matter."""


def mechanism_of(
    requirement: Requirement,
    parts: Sequence[Part],
    correlations: Sequence[Correlation],
    faults: list[Fault],
) -> Mechanism | None:
    """The mechanism; None and every fault where the parts do not make one."""
    found = _linear(requirement, parts, faults) if not requirement.formula else _formula(
        requirement, parts, faults
    )  # fmt: skip
    correlation = _matrix(parts, correlations, faults)
    if found is None or faults:
        return None
    lower = -np.inf if requirement.lower is None else requirement.lower
    upper = np.inf if requirement.upper is None else requirement.upper
    common = {
        "names": tuple(piece for part in parts for piece in part.pieces),
        "owner": tuple(owners(parts)),
        "inputs": tuple(part.distribution for part in parts),
        "lower": lower,
        "upper": upper,
        "correlation": correlation,
    }
    return Mechanism(**(common | found))


def owners(parts: Sequence[Part]) -> list[int]:
    """Part of every piece."""
    return [at for at, part in enumerate(parts) for _ in part.pieces]


def _matrix(
    parts: Sequence[Part], correlations: Sequence[Correlation], faults: list[Fault]
) -> Array | None:
    """The correlation matrix of the pieces, None where all are independent."""
    if not correlations:
        return None
    at = {piece: i for i, piece in enumerate(p for part in parts for p in part.pieces)}
    found = np.eye(len(at))
    for one in correlations:
        i, j = (at[piece] for piece in one.pieces)
        found[i, j] = found[j, i] = one.coefficient
    least = float(np.linalg.eigvalsh(found)[0])
    if least < -1e-10:
        faults.append(Fault("correlation", "the matrix is not positive semidefinite (its smallest "
                            f"eigenvalue is {least:.4g}): no parts can vary like this; make the "
                            "coefficients smaller"))  # fmt: skip
        return None
    return found


# ---------------------------------------------------------------- sensitivities


def _linear(
    requirement: Requirement, parts: Sequence[Part], faults: list[Fault]
) -> dict[str, object] | None:
    """What the mechanism of given sensitivities has of its own."""
    each = [0.0 if part.sensitivity is None else part.sensitivity for part in parts]
    nominal = requirement.nominal
    if nominal is None:
        missing = [part.name for part in parts if part.nominal is None]
        if missing and (requirement.lower is not None or requirement.upper is not None):
            faults.append(Fault("requirement.nominal", "is missing: lower and upper need it, or the "
                                f"nominal of every part (not given: {', '.join(missing)})"))  # fmt: skip
            return None
        nominal = nominal_sum(parts)
    moved = sum(s * part.mid * part.count for s, part in zip(each, parts, strict=True))
    return {
        "sensitivities": np.array([each[at] for at in owners(parts)]),
        "centre": nominal + moved,
    }


def nominal_sum(parts: Sequence[Part]) -> float:
    """The requirement of a loop of dimensions: sum of sensitivity times nominal."""
    return float(sum((p.sensitivity or 0.0) * (p.nominal or 0.0) * p.count for p in parts))


# ---------------------------------------------------------------- formula


def _formula(
    requirement: Requirement, parts: Sequence[Part], faults: list[Fault]
) -> dict[str, object] | None:
    """What the mechanism of a formula has of its own."""
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
    owner = np.array(owners(parts))
    nominals = np.array([part.nominal for part in parts], dtype=float)[owner] * scale[owner]
    mids = nominals + np.array([part.mid for part in parts])[owner] * scale[owner]
    reach = np.array([part.high for part in parts])[owner] * scale[owner]
    names = [piece for part in parts for piece in part.pieces]
    if why := _undefined(formula, names, nominals, mids, reach):
        faults.append(Fault(FORMULA, why))
        return None
    at_mids = dict(zip(names, mids, strict=True))
    slopes = formula.gradient(at_mids)
    found = gain * np.array([float(slopes[name]) for name in names]) * scale[owner]
    effect = np.where(reach > 0.0, np.abs(found) * reach / scale[owner], np.nan)
    faults += _slope_faults(found, effect, names, parts, owner)
    stated = gain * float(formula.value(dict(zip(names, nominals, strict=True))))
    faults += _nominal_faults(requirement, stated)
    return {
        "formula": formula,
        "mids": mids,
        "scale": scale[owner],
        "gain": gain,
        "sensitivities": found,
        "centre": gain * float(formula.value(at_mids)),
    }


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


def _undefined(
    formula: Formula, names: Sequence[str], nominals: Array, mids: Array, reach: Array
) -> str:
    """Where the formula has no value: at the nominals, or within the tolerances."""
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


def _slope_faults(
    slopes: Array, effect: Array, names: Sequence[str], parts: Sequence[Part], owner: Array
) -> list[Fault]:
    """Pieces that the requirement does not depend on, or depends on without bound."""
    found = []
    for at, part in enumerate(parts):
        for i in np.flatnonzero(owner == at):
            if not np.isfinite(slopes[i]):
                found.append(Fault(FORMULA, f"has no finite derivative with respect to {names[i]} at "
                                   "the mid-limits: the linear model does not exist"))  # fmt: skip
            elif effect[i] <= NEGLIGIBLE * np.nansum(effect):
                found.append(Fault(f"part[{at}].name", "the sensitivity of the requirement to "
                                   f"{names[i]} is 0 at the mid-limits: no tolerance of it matters "
                                   f"(part {part.name})"))  # fmt: skip
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
