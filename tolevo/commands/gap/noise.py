"""The noise of the data, and the whitening that makes it independent with variance 1."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter

import numpy as np
import scipy
from numpy.typing import NDArray

from ...section import Array
from .linear import basis, project_out, whitening

GRID = np.arange(0.0, 0.91, 0.05)
"""Autocorrelations that are tried."""
OUTLYING = 4.5
"""Robust standard deviations beyond which a measurement is an outlier."""
NORMAL = float(scipy.special.ndtri(0.75))
"""Median magnitude of normal noise, in its standard deviation."""


@dataclass(frozen=True)
class Noise:
    """Noise of one output: standard deviation (n,) of each measurement, and its autocorrelation.

    `good` (n,) is false for outliers, which do not count. `source` says where the noise level comes
    from, `varies_with` is the input that it follows.
    """

    sigma: Array
    source: str
    rho: float = 0.0
    good: NDArray[np.bool_] | None = None
    varies_with: str = ""

    def whiten(self, columns: Array) -> Array:
        """Columns (n, ...) or (n,), such that the noise in them is independent with variance 1."""
        scale = self._scale if columns.ndim == 1 else self._scale[:, None]
        scaled = columns * scale
        if self.rho == 0.0:
            return scaled
        white = np.empty_like(scaled)
        white[0] = scaled[0]
        np.multiply(scaled[:-1], -self.rho, out=white[1:])
        white[1:] += scaled[1:]
        white[1:] /= np.sqrt(1.0 - self.rho**2)
        return white

    @cached_property
    def _scale(self) -> Array:
        """Weight (n,) of each measurement."""
        return 1.0 / self.sigma if self.good is None else np.where(self.good, 1.0 / self.sigma, 0.0)

    @property
    def is_plain(self) -> bool:
        """Whether all measurements that count have the same weight."""
        return self.rho == 0.0 and float(np.ptp(self.sigma)) == 0.0

    def independent(self) -> Noise:
        """Independent noise of the same level for every measurement."""
        return replace(self, sigma=np.full(len(self.sigma), self.level), rho=0.0)

    def coloured(self, columns: Array) -> Array:
        """L' x of columns x (n, m), where L L' is the covariance of the noise: x' L L' x is the
        covariance of the products of the columns with the noise.
        """
        scaled = columns * self.sigma[:, None]
        bands = np.array([np.full(len(scaled), -self.rho), np.ones(len(scaled))])
        summed = scipy.linalg.solve_banded((0, 1), bands, scaled)
        summed[1:] *= np.sqrt(1.0 - self.rho**2)
        return np.asarray(summed)

    @property
    def level(self) -> float:
        """Root of the mean variance."""
        return float(np.sqrt(np.mean(self.sigma**2)))

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Which measurements (n,) count."""
        return np.ones(len(self.sigma), dtype=bool) if self.good is None else self.good

    @property
    def outliers(self) -> int:
        """The number of measurements that do not count."""
        return 0 if self.good is None else int((~self.good).sum())


def robust_scale(residual: Array) -> float:
    """Standard deviation from the median of the magnitudes."""
    return float(np.median(np.abs(residual - np.median(residual))) / NORMAL)


def outliers(residual: Array, sigma: Array, least: float = 1e-12) -> NDArray[np.bool_]:
    """False (n,) where a measurement is an outlier; the robust scale is at least `least` sigma."""
    scaled = residual / sigma
    return np.abs(scaled - np.median(scaled)) < OUTLYING * max(robust_scale(scaled), least)


def autocorrelation(residual: Array, columns: Array, noise: Noise) -> float:
    """The autocorrelation of maximum restricted likelihood, for a residual (n,) given columns (n, k).

    The fitted columns do not bias it. Reference: Harville, J. Am. Stat. Assoc. 72, 1977.
    """
    log_likelihood = _restricted_likelihood(residual, columns, noise)
    best = int(np.argmax(log_likelihood))
    if best in (0, len(GRID) - 1):
        return float(GRID[best])
    below, at, above = log_likelihood[best - 1 : best + 2]
    bend = below - 2 * at + above
    step = 0.5 * (below - above) / bend if bend < 0 else 0.0
    width = GRID[best + 1] - GRID[best] if step > 0 else GRID[best] - GRID[best - 1]
    return float(GRID[best] + np.clip(step, -1, 1) * width)


def _restricted_likelihood(residual: Array, columns: Array, noise: Noise) -> Array:
    """Restricted log likelihood (g,) at each autocorrelation of GRID, up to a constant.

    Whitened products are quadratic in it, so one pass over the measurements suffices.
    """
    plain = replace(noise, rho=0.0)
    x = plain.whiten(columns)
    z = np.column_stack([x, project_out(plain.whiten(residual), basis(x))])
    size = np.maximum(np.linalg.norm(z, axis=0), 1e-300)
    z = z / size
    now, before = z[1:], z[:-1]
    across = now.T @ before
    rho = GRID[:, None, None]
    inside = now.T @ now - rho * (across + across.T) + rho**2 * (before.T @ before)
    gram = np.outer(z[0], z[0]) + inside / (1.0 - rho**2)
    x, xy, yy = gram[:, :-1, :-1], gram[:, :-1, -1], gram[:, -1, -1]
    scale = np.sqrt(np.maximum(np.diagonal(x, axis1=1, axis2=2), 1e-300))
    turned = whitening(x / scale[:, :, None] / scale[:, None, :])
    residual_squares = yy - np.sum(np.einsum("gjk,gk->gj", turned, xy / scale) ** 2, axis=1)
    whole = x * np.outer(size[:-1], size[:-1])
    ridge = 1e-9 * np.trace(whole, axis1=1, axis2=2)[:, None, None] * np.eye(x.shape[1])
    _, spread = np.linalg.slogdet(whole + ridge)
    count = len(z) - turned.any(axis=2).sum(axis=1)
    rss = np.log(np.maximum(residual_squares, 1e-14) * size[-1] ** 2)
    jacobian = -0.5 * (len(z) - 1) * np.log(1.0 - rho[:, 0, 0] ** 2)
    return np.asarray(jacobian - 0.5 * spread - 0.5 * count * rss)


def residual_scale(white: Array, used: int) -> float:
    """Standard deviation of whitened residuals (N,) after `used` numbers were fitted."""
    count = int(np.count_nonzero(white))
    return float(np.sqrt(white @ white / max(count - used, 1)))


def whiteness(white: Array) -> float:
    """P-value of the test of Ljung and Box for autocorrelation of a whitened residual (n,)."""
    n, centred = len(white), white - white.mean()
    lags = np.arange(1, min(10, n // 5) + 1)
    correlations = np.array([centred[k:] @ centred[:-k] for k in lags]) / (centred @ centred)
    return float(scipy.special.chdtrc(len(lags), n * (n + 2) * np.sum(correlations**2 / (n - lags))))


def size_follows(residual: Array, inputs: Mapping[str, Array], good: NDArray[np.bool_]) -> tuple[str, Array] | None:
    """The input that the size of the noise follows, and its relative size (n,); else None.

    An F test on log squares (Glejser, Breusch and Pagan), which heavy tails do not mislead.
    """
    target = np.log(np.maximum(residual**2, 1e-8 * float(np.mean(residual[good] ** 2)) + 1e-300))
    fits = [(*_explain_by_columns(target, _parabola(values), good), name) for name, values in inputs.items()]
    fitted, p, name = min(fits, key=itemgetter(1), default=(target, 1.0, ""))
    if not name or p > 1e-3 / len(inputs):
        return None
    size = np.exp(0.5 * np.clip(fitted - np.median(fitted), -4.0, 4.0))
    return name, np.asarray(size / np.sqrt(np.mean(size**2)))


def _explain_by_columns(target: Array, x: Array, good: NDArray[np.bool_]) -> tuple[Array, float]:
    """The least-squares fit (n,) of columns (n, k) to good rows, and the p-value of the F test."""
    numbers, _, rank, _ = np.linalg.lstsq(x[good], target[good])
    fitted = x @ numbers
    rss = float(np.sum((target - fitted)[good] ** 2))
    total = float(np.sum((target[good] - target[good].mean()) ** 2))
    if rank < 2 or total == 0.0:
        return fitted, 1.0
    freedom = int(good.sum()) - rank
    return fitted, float(scipy.special.betainc(0.5 * freedom, 0.5 * (rank - 1), min(rss / total, 1.0)))


def _parabola(values: Array) -> Array:
    """The columns of a parabola in values (n,), or of a line for only two distinct ones."""
    x = (values - values.mean()) / max(float(values.std()), 1e-300)
    return np.column_stack([x**k for k in range(3 if len(np.unique(values)) > 2 else 2)])
