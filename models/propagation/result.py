"""Results of a propagation: estimates, each with the error that its method states."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ...arrays import Array


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value per design and its stated numerical (or standard) error, both of shape (n,)."""

    value: Array
    error: Array


@dataclass(frozen=True, slots=True)
class Propagated:
    """Statistics of a `ClippedSum` over the units built to each of n designs.

    `geometric_mean`, `geometric_std` are exact in every method. `mean`, `std` and `quantile` (at
    the one-sided coverage) are those of the effective value, `conforming` is the probability that
    it does not exceed the limit, `negative` the probability that the clipped part is below zero.
    """

    geometric_mean: Array
    geometric_std: Array
    mean: Estimate
    std: Estimate
    quantile: Estimate
    conforming: Estimate
    negative: Estimate


def joined(parts: list[Propagated]) -> Propagated:
    """The results of consecutive blocks of designs, joined."""
    return Propagated(*(_joined([getattr(part, field.name) for part in parts]) for field in fields(Propagated)))


def _joined(pieces: list[Any]) -> Any:
    if not isinstance(pieces[0], Estimate):
        return np.concatenate(pieces)
    value, error = (np.concatenate(arrays) for arrays in zip(*((p.value, p.error) for p in pieces), strict=True))
    return Estimate(value, error)
