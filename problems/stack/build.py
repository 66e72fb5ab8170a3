"""From a requirement and its parts to the mechanism, with everything checked that can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import Fault
from ...models.stack import Mechanism
from .definition import Correlation, Part, Requirement
from .formulas import with_formula

Array = NDArray[np.float64]


def mechanism_of(
    requirement: Requirement,
    parts: Sequence[Part],
    correlations: Sequence[Correlation],
    faults: list[Fault],
) -> Mechanism | None:
    """The mechanism; None and every fault where the parts do not make one."""
    correlation = _matrix(parts, correlations, faults)
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
    found = kind(bare, requirement, parts, faults)
    return None if faults else found


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


def _with_sensitivities(
    bare: Mechanism, requirement: Requirement, parts: Sequence[Part], faults: list[Fault]
) -> Mechanism | None:
    """The mechanism whose parts state their sensitivities."""
    each = np.array([part.sensitivity or 0.0 for part in parts])
    nominal = requirement.nominal
    if nominal is None:
        missing = [part.name for part in parts if part.nominal is None]
        if missing and bare.bounded:
            text = "is missing: lower and upper need it, or the nominal of every part (not given: "
            faults.append(Fault("requirement.nominal", f"{text}{', '.join(missing)})"))
            return None
        nominal = nominal_sum(parts)
    moved = float(sum(s * part.mid * part.count for s, part in zip(each, parts, strict=True)))
    return replace(bare, sensitivities=each[bare.owners], centre=nominal + moved)


def nominal_sum(parts: Sequence[Part]) -> float:
    """The requirement of a loop of dimensions: sum of sensitivity times nominal."""
    return float(sum((p.sensitivity or 0.0) * (p.nominal or 0.0) * p.count for p in parts))
