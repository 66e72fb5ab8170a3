"""A Monte Carlo too large for one process, in blocks that run where the runs of a study do."""

from __future__ import annotations

import hashlib
import pickle
from dataclasses import dataclass, fields

import numpy as np

from ...errors import RunError
from ...models.propagation import ClippedSum, Estimate, MonteCarlo, Propagated
from ..execution import Executor, Lost, pinned

SIZE = 2**20
"""Samples of a block: 65,536 in each of its scrambles."""


@dataclass(frozen=True, slots=True)
class Block:
    """A block: an independent sample, from a seed by its number, for all designs of `total`."""

    key: str
    number: int
    seed: np.random.SeedSequence
    samples: int
    total: ClippedSum
    coverage: float
    limit: float


def monte_carlo(
    total: ClippedSum, coverage: float, limit: float, samples: int, seed: int, executor: Executor, size: int = SIZE
) -> Propagated:
    """Statistics of `total` from at least `samples` units per design, as `Propagation.propagate`.

    Blocks of `size` units are seeded by their number, so that neither the executor nor the order in
    which they end changes a bit. The standard errors come from the scatter of the blocks; that of
    the quantile holds the bias of one block as well, which more blocks do not lessen.
    Raises RunError where a block is lost for good, ValueError for fewer than two blocks.
    """
    count = -(-samples // size)
    if count < 2:
        raise ValueError(f"samples must be more than one block of {size}, got {samples}")
    name = hashlib.sha256(pickle.dumps((total, coverage, limit, samples, seed, size))).hexdigest()
    blocks = (
        Block(f"{name[:24]}-{at}", at, part, size, total, coverage, limit)
        for at, part in enumerate(np.random.SeedSequence(seed).spawn(count))
    )
    by_number: dict[int, Propagated] = {}
    with executor:
        for block, result in executor.completed(propagated, lambda: next(blocks, None)):
            if isinstance(result, Lost):
                raise RunError(f"block {block.number} of the Monte Carlo: {result.reason}")
            by_number[block.number] = result
    return _combined([by_number[at] for at in range(count)])


def propagated(block: Block) -> Propagated:
    """The statistics of one block."""
    dimensions = len(block.total.clipped) + len(block.total.free)
    with pinned():
        sample = MonteCarlo.draw(block.samples, dimensions, np.random.default_rng(block.seed))
        return sample.propagate(block.total, block.coverage, block.limit)


def _combined(parts: list[Propagated]) -> Propagated:
    """Means over equal blocks."""
    estimates = {}
    for field in fields(Propagated):
        pieces = [getattr(part, field.name) for part in parts]
        if isinstance(pieces[0], Estimate):
            values = np.array([piece.value for piece in pieces])
            error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
            if field.name == "quantile":
                error = error + 0.5 * np.mean([piece.error for piece in pieces], axis=0)
            estimates[field.name] = Estimate(values.mean(axis=0), error)
    first = parts[0]  # what is exact is the same in all
    return Propagated(first.geometric_mean, first.geometric_std, **estimates)
