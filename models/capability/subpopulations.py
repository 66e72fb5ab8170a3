"""Sub-populations of measured parts: cavities, machines, operators, lots that differ in their mean.

With n values in k groups of n_i about their means, MSW = sum (x - mean_i)^2/(n - k) is the variance
within the groups and MSB = sum n_i (mean_i - mean)^2/(k - 1) that of n_0 parts between them,
n_0 = (n - sum n_i^2/n)/(k - 1). Cavities, machines and operators make later parts as well (fixed
groups); later lots are others (random groups), so that their scatter is known from k of them alone.

Reference: Searle, Casella & McCulloch (1992), Variance Components, sections 3.6 and 4.4;
Satterthwaite (1946), Biometrics Bulletin 2(6), 110-114.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ...section import Array, Integers

RANDOM = ("lot", "order")
"""Groups of which later parts have others; all other groups make later parts too."""
LEAST_DF = 4.0
"""Degrees of freedom of few lots at least, as of five of them: the posterior mean of a variance needs them."""
DIFFERENCE, SURE = 2.0, 0.95
"""Standard deviations within a group by which one is off that a sample should show, and how surely."""
PLURALS = {"cavity": "cavities", "lot": "lots"}


@dataclass(frozen=True, slots=True)
class Scatter:
    """A variance of parts, its degrees of freedom, and the number of parts that the mean is known by."""

    variance: float
    df: float
    n: float


@dataclass(frozen=True, slots=True, eq=False)
class Subpopulations:
    """Groups of measured parts: names (k,), numbers of parts and means (k,), and mean squares within
    and between them; `group` (n,) is the place of each value's group.
    """

    kind: str
    names: tuple[str, ...]
    group: Integers
    counts: Array
    means: Array
    within: float
    between: float
    probability: float

    @classmethod
    def of(cls, kind: str, labels: Sequence[str], values: Array) -> Subpopulations | None:
        """The groups that `labels` (n,) name; None where there is one, or no group of two parts."""
        names, group = np.unique(np.asarray(labels, dtype=str), return_inverse=True)
        n, k = len(values), len(names)
        if not 1 < k < n:
            return None
        counts = np.bincount(group).astype(float)
        means = np.bincount(group, values) / counts
        within = float(np.sum((values - means[group]) ** 2)) / (n - k)
        between = float(np.sum(counts * (means - np.mean(values)) ** 2)) / (k - 1)
        if within <= 0.0:
            return None
        p = float(scipy.stats.f.sf(between / within, k - 1, n - k))
        return cls(kind, tuple(map(str, names)), group, counts, means, within, between, p)

    @property
    def df(self) -> tuple[int, int]:
        """Degrees of freedom between the groups, and within them."""
        return len(self.names) - 1, len(self.group) - len(self.names)

    @property
    def plural(self) -> str:
        """What several of them are called."""
        return PLURALS.get(self.kind, f"{self.kind}s")

    @property
    def parts_between(self) -> float:
        """n_0, the number of parts of a group in the mean square between the groups."""
        n = len(self.group)
        return (n - float(np.sum(self.counts**2)) / n) / self.df[0]

    @property
    def between_variance(self) -> float:
        """Variance of the means of the groups, without the share of the scatter within them."""
        return max(self.between - self.within, 0.0) / self.parts_between

    def as_found(self) -> Scatter:
        """The scatter of later parts from the same cavities, or from other lots."""
        n, (of_groups, of_parts) = len(self.group), self.df
        if self.kind in RANDOM:
            n_0, total = self.parts_between, self.between_variance + self.within
            error = (self.between / n_0) ** 2 / of_groups + ((1.0 - 1.0 / n_0) * self.within) ** 2 / of_parts
            df = min(max(total**2 / error, LEAST_DF), n - 1.0)
            return Scatter(total, df, n * min(total / self.between, 1.0))
        total = (of_groups * self.between + of_parts * self.within) / (n - 1)
        surplus = max(of_groups * (self.between / self.within - 1.0), 0.0)  # noncentrality of the sum of squares
        return Scatter(total, (n - 1 + surplus) ** 2 / (n - 1 + 2.0 * surplus), n * total / self.within)

    def corrected(self) -> Scatter:
        """The scatter of later parts where every group is set to the same mean."""
        return Scatter(self.within, float(self.df[1]), float(len(self.group)))

    def centred(self, values: Array) -> Array:
        """The values (n,) with the mean of every group moved to that of all."""
        return np.asarray(values - self.means[self.group] + np.mean(values))

    def furthest(self) -> tuple[int, float]:
        """The group that is furthest from the others, and how far its mean is above theirs."""
        total = float(np.sum(self.counts * self.means))
        others = (total - self.counts * self.means) / (len(self.group) - self.counts)
        at = int(np.argmax(np.abs(self.means - others)))
        return at, float(self.means[at] - others[at])

    def stands_out(self, level: float) -> bool:
        """Whether the furthest of three groups or more is what differs: the others do not beyond `level`."""
        far = self.furthest()[0]
        counts, means = np.delete(self.counts, far), np.delete(self.means, far)
        df = len(counts) - 1, self.df[1]
        if not df[0]:
            return False
        square = float(np.sum(counts * (means - counts @ means / counts.sum()) ** 2)) / df[0]
        return float(scipy.stats.f.sf(square / self.within, *df)) >= level

    def furthest_moved(self, values: Array) -> Array:
        """The values (n,) with the furthest group moved to the mean of the others."""
        at, off = self.furthest()
        return np.asarray(values - off * (self.group == at))

    def mixture(self) -> tuple[tuple[float, ...], tuple[float, ...], float]:
        """Fractions and centres of the groups about the mean of all, and the scatter within them."""
        shares = self.counts / len(self.group)
        return tuple(shares.tolist()), tuple((self.means - shares @ self.means).tolist()), float(np.sqrt(self.within))

    def power(self, level: float) -> float:
        """The probability that a test at `level` detects that the smallest group is off by `DIFFERENCE`.

        The F test of a noncentrality n_i (1 - n_i/n) DIFFERENCE^2 (Searle, Casella & McCulloch 1992).
        """
        fewest = float(np.min(self.counts))
        excess = fewest * (1.0 - fewest / len(self.group)) * DIFFERENCE**2
        return float(scipy.stats.ncf.sf(scipy.stats.f.isf(level, *self.df), *self.df, excess))

    def blind_text(self, level: float) -> str:
        """That the parts are too few to show a difference, empty where they are not."""
        if (power := self.power(level)) >= SURE:
            return ""
        of = "to".join(f" {int(end)} " for end in sorted({np.min(self.counts), np.max(self.counts)})).strip()
        return (
            f"of {len(self.names)} {self.plural} of {of} parts one that is off by {DIFFERENCE:g} standard deviations "
            f"would be detected in {100.0 * power:.0f} of 100 samples: that none is does not show that all are alike"
        )

    def text(self) -> str:
        """How the groups differ."""
        at, off = self.furthest()
        scatter = f"s = {np.sqrt(self.within):.3g} within and {np.sqrt(self.between_variance):.3g} between them"
        return (
            f"has {self.plural} whose means differ by up to {np.ptp(self.means):.3g} ({self.kind} {self.names[at]} is "
            f"{abs(off):.3g} {'above' if off > 0.0 else 'below'} the others; {scatter}, {self.df[1]} and {self.df[0]} "
            "degrees of freedom)"
        )


def subpopulations(values: Array, groups: Mapping[str, Sequence[str]]) -> list[Subpopulations]:
    """Every grouping of values (n,) that has several groups."""
    found = [Subpopulations.of(kind, labels, values) for kind, labels in groups.items()]
    return [one for one in found if one is not None]
