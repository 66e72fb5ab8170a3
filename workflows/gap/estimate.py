"""Estimates the noise of each output beside the model, what is named, and any smooth remainder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.inputs.distribution import Array
from .generic import Form
from .linear import Groups, basis, beside, products
from .noise import Noise, autocorrelation, outliers, robust_scale, scale_left, size_follows
from .scan import evidence

CERTAIN = 14.0
"""Evidence from which a generic form is taken out before the noise is estimated."""
FEW = 0.03
"""Share of the units of a batch up to which those far out are outliers."""
MANY = 0.06
"""Share of the readings up to which those far out are outliers: more are a part that is missing."""
PASSES = 2


@dataclass(frozen=True)
class Remainder:
    """One output: its residual (n,), the columns (n, k) that may explain it and are kept, generic
    forms, the inputs by name, labels of repeats, and the noise where it is known. `law` is the
    standard deviation that the units of a population have in the model, 0 for readings;
    `resolution` what steps of the readings alone scatter by, 0 without steps.
    """

    residual: Array
    kept: Array
    forms: tuple[Form, ...]
    generic: Groups
    inputs: Mapping[str, Array]
    slow: tuple[bool, ...]
    repeats: NDArray[np.int64] | None = None
    known: Array | None = None
    source: str = "estimated"
    law: float = 0.0
    resolution: float = 0.0

    def least(self, sigma: Array) -> float:
        """What noise of these sizes (n,) is at least, as a share of them."""
        return max(max(self.law, self.resolution) / float(np.median(sigma)), 1e-12)

    def good(self, left: Array, sigma: Array) -> NDArray[np.bool_]:
        """False (n,) where a reading is an outlier; many units far out are a group of their own."""
        found = outliers(left, sigma, self.least(sigma))
        return np.ones_like(found) if np.mean(~found) > (FEW if self.law else MANY) else found


def estimated(of: Remainder) -> Noise:
    """The noise of one output."""
    n = len(of.residual)
    kept = np.column_stack([of.kept, _slow(n)])
    sigma = np.ones(n) if of.known is None else of.known
    noise = Noise(sigma * _first_scale(of, kept, sigma), of.source)
    chosen = kept
    for _ in range(PASSES):
        noise, chosen = _improved(of, kept, noise)
    return _scaled(of, chosen, noise)


def _slow(n: int) -> Array:
    """A slow curve along the order of measuring."""
    x = np.linspace(-1.0, 1.0, n)
    return np.column_stack([np.ones(n), x, x * x, x**3])


def _first_scale(of: Remainder, kept: Array, sigma: Array) -> float:
    q = basis(kept / sigma[:, None])
    return max(robust_scale(beside(of.residual / sigma, q)), of.law, of.resolution, 1e-300)


def _improved(of: Remainder, kept: Array, noise: Noise) -> tuple[Noise, Array]:
    """One pass: forms taken out, then outliers, size and autocorrelation of what is left."""
    start = _start(of, kept, noise)
    every = np.ones(len(of.slow), dtype=bool)
    whole, trend = _with_forms(of, start, every)
    tried = [(_one(of, whole, noise), whole)]
    if trend:  # a trend, or noise that wanders: what is likelier
        plain, _ = _with_forms(of, start, ~np.array(of.slow))
        tried.append((_one(of, plain, noise), plain))
    scores = [_likelihood(of.residual, chosen, one) for one, chosen in tried]
    return tried[int(np.argmax(scores))]


def _one(of: Remainder, chosen: Array, noise: Noise) -> Noise:
    white = replace(noise, rho=0.0, good=None)
    left = of.residual - _fitted(of, chosen, white)
    good = of.good(left, noise.sigma)
    found = replace(white, good=None if good.all() else good)
    if of.known is None:
        follows = size_follows(left, of.inputs, good)
        if follows is not None:
            found = replace(found, varies_with=follows[0], sigma=follows[1])
        count = max(int(good.sum()) - basis(white.whiten(chosen)).shape[1], 1)
        size = np.sqrt(np.sum((left[good] / found.sigma[good]) ** 2) / count)
        found = replace(found, sigma=found.sigma * size)
    return replace(found, rho=autocorrelation(of.residual, chosen, found))


def _fitted(of: Remainder, chosen: Array, noise: Noise) -> Array:
    """A fit that outliers do not pull: they are clipped, and it is fitted again."""
    x = noise.whiten(chosen)
    y = whole = noise.whiten(of.residual)
    q = basis(x)
    for _ in range(4):
        fit = q @ (q.T @ y)
        limit = 2.5 * max(robust_scale(whole - fit), of.least(noise.sigma))
        y = fit + np.clip(whole - fit, -limit, limit)
    return np.asarray(q @ (q.T @ y) * noise.sigma)


@dataclass(frozen=True)
class Start:
    """What forms are taken out of: columns that are kept (n, k), their whitened basis q (n, r), the
    whitened residual (n,) beside it, and the whitened forms with their products with both. In noise
    that is the same in each reading the forms are as they are: no gain depends on their lengths.
    """

    kept: Array
    q: Array
    left: Array
    white: Groups
    projected: Array
    product: Array


def _start(of: Remainder, kept: Array, noise: Noise) -> Start:
    groups = of.generic
    if not noise.is_plain or noise.good is not None:
        groups = Groups(noise.whiten(groups.columns), groups.starts, groups.one_sided)
    q = basis(noise.whiten(kept))
    left = beside(noise.whiten(of.residual), q)
    return Start(kept, q, left, groups, *products(groups, q, left))


def _with_forms(of: Remainder, start: Start, allowed: NDArray[np.bool_]) -> tuple[Array, bool]:
    """The columns kept, and those of `allowed` forms (g,) that are certainly there, one after
    another; also whether a trend is among them.
    """
    if not allowed.any():
        return start.kept, False
    chosen, q, left, white = start.kept, start.q, start.left, start.white
    projected, product, trend = start.projected, start.product, False
    while chosen.shape[1] < max(len(left) // 5, start.kept.shape[1] + 2):
        scale = left @ left / (len(left) - q.shape[1])
        level = evidence(white, white.gains_beside(projected, product) / scale)
        best = int(np.argmax(np.where(allowed, level, -np.inf)))
        if level[best] < CERTAIN:
            break
        chosen = np.column_stack([chosen, of.generic.of(best)])
        new = basis(beside(beside(white.of(best), q), q))
        left, q = beside(left, new), np.hstack([q, new])
        more, product = products(white, new, left)
        projected = np.vstack([projected, more])
        trend |= of.slow[best]
    return chosen, trend


def _likelihood(residual: Array, chosen: Array, noise: Noise) -> float:
    """Log likelihood less half ln n per column, but for a constant."""
    q = basis(noise.whiten(chosen))
    left = beside(noise.whiten(residual), q)
    n = len(residual)
    spread = -0.5 * (n - 1) * np.log(1.0 - noise.rho**2) - float(np.sum(np.log(noise.sigma)))
    return float(spread - 0.5 * n * np.log(left @ left / n) - 0.5 * np.log(n) * q.shape[1])


def _scaled(of: Remainder, chosen: Array, noise: Noise) -> Noise:
    """The noise at its final size; repeats say it best."""
    if of.known is not None:
        return replace(noise, sigma=of.known)
    pure = _pure(of)
    if pure is not None:
        level = np.sqrt(np.mean(noise.sigma**2))
        return replace(noise, sigma=noise.sigma * pure / level, source="repeats")
    q = basis(noise.whiten(chosen))
    left = beside(noise.whiten(of.residual), q)
    scale = max(scale_left(left, q.shape[1]), of.resolution / noise.level)
    return replace(noise, sigma=noise.sigma * scale)


def _pure(of: Remainder) -> float | None:
    """Standard deviation between repeats of the same inputs, where there are ten or more."""
    if of.repeats is None:
        return None
    _, number, count = np.unique(of.repeats, return_inverse=True, return_counts=True)
    freedom = int(np.sum(count - 1))
    if freedom < 10:
        return None
    means = np.bincount(number, of.residual) / count
    return float(np.sqrt(np.sum((of.residual - means[number]) ** 2) / freedom))


def remainders(
    residuals: Sequence[Array],
    kept: Sequence[Array],
    forms: tuple[Form, ...],
    generic: Groups,
    inputs: Mapping[str, Array],
    trends: Sequence[str],
    repeats: NDArray[np.int64] | None,
    known: Sequence[tuple[Array, str] | None],
    laws: Sequence[float],
    resolutions: Sequence[float],
) -> list[Remainder]:
    """One record per output."""
    slow = tuple(form.variable in trends for form in forms)
    return [
        Remainder(
            residual,
            columns,
            forms,
            generic,
            inputs,
            slow,
            repeats,
            None if given is None else given[0],
            "estimated" if given is None else given[1],
            law,
            least,
        )
        for residual, columns, given, law, least in zip(
            residuals, kept, known, laws, resolutions, strict=True
        )
    ]
