"""From requirements and parts to mechanisms, with everything checked that can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...arrays import Array
from ...errors import Fault
from ...models.stack import Mechanism
from .definition import Correlation, Part, Requirement
from .formulas import with_formula
from .sensitivities import needless


def mechanisms_of(
    requirements: Sequence[Requirement], parts: Sequence[Part], correlations: Sequence[Correlation], faults: list[Fault]
) -> tuple[Mechanism, ...]:
    """The mechanism of each requirement; fewer, and every fault, where the parts make none."""
    correlation = _matrix(parts, correlations, faults)
    candidates = [_mechanism(requirement, parts, correlation, faults) for requirement in requirements]
    mechanisms = tuple(mechanism for mechanism in candidates if mechanism is not None)
    if requirements[0].key and len(mechanisms) == len(requirements):
        used = np.any([mechanism.acting for mechanism in mechanisms], axis=0)
        owners = mechanisms[0].owners
        faults += needless(parts, [bool(np.any(used[owners == at])) for at in range(len(parts))])
    return mechanisms


def _mechanism(
    requirement: Requirement, parts: Sequence[Part], correlation: Array | None, faults: list[Fault]
) -> Mechanism | None:
    """The mechanism of one requirement; None and every fault where the parts do not make one."""
    owner = tuple(at for at, part in enumerate(parts) for _ in part.pieces)
    bare = Mechanism(
        names=tuple(piece for part in parts for piece in part.pieces),
        owner=owner,
        inputs=tuple(part.distribution for part in parts),
        sensitivities=np.zeros(len(owner)),
        centre=0.0,
        lower=-np.inf if requirement.lower is None else requirement.lower,
        upper=np.inf if requirement.upper is None else requirement.upper,
        correlation=correlation,
    )
    kind = with_formula if requirement.formula else _with_sensitivities
    return kind(bare, requirement, parts, faults)


def _matrix(parts: Sequence[Part], correlations: Sequence[Correlation], faults: list[Fault]) -> Array | None:
    """The correlation matrix of the pieces, None where all are independent."""
    if not correlations:
        return None
    at = {piece: i for i, piece in enumerate(p for part in parts for p in part.pieces)}
    matrix = np.eye(len(at))
    for correlation in correlations:
        i, j = (at[piece] for piece in correlation.pieces)
        matrix[i, j] = matrix[j, i] = correlation.coefficient
    least = float(np.linalg.eigvalsh(matrix)[0])
    if least < -1e-10:
        text = f"the matrix is not positive semidefinite (its smallest eigenvalue is {least:.4g}): "
        faults.append(Fault("correlation", f"{text}no parts can vary like this; make the coefficients smaller"))
        return None
    return matrix


def _with_sensitivities(
    bare: Mechanism, requirement: Requirement, parts: Sequence[Part], faults: list[Fault]
) -> Mechanism | None:
    """The mechanism whose parts state their sensitivities."""
    slopes = np.array([part.sensitivities.get(requirement.key, 0.0) for part in parts])
    nominal = requirement.nominal
    if nominal is None:
        missing = [
            part.name for part, slope in zip(parts, slopes, strict=True) if part.nominal is None and slope != 0.0
        ]
        if missing and bare.bounded:
            text = "is missing: lower and upper need it, or the nominal of every part (not given: "
            faults.append(Fault(f"{requirement.place}.nominal", f"{text}{', '.join(missing)})"))
            return None
        nominal = nominal_sum(requirement, parts)
    moved = float(sum(s * part.mean * part.count for s, part in zip(slopes, parts, strict=True)))
    return replace(bare, sensitivities=slopes[bare.owners], centre=nominal + moved)


def nominal_sum(requirement: Requirement, parts: Sequence[Part]) -> float:
    """The requirement of a loop of dimensions: sum of sensitivity times nominal."""
    return float(sum(p.sensitivities.get(requirement.key, 0.0) * (p.nominal or 0.0) * p.count for p in parts))
