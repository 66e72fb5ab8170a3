"""`python -m benchmarks.promise.machines`: promises kept where machines are chosen by samples.

Nine parts, each on one of three machines, all machines sampled: 19 683 choices. The level of the
norm is found by self-calibration. Of the promises made the lower 95 % limit of the share kept must
be 91 % at least; the share of samples without an assured choice is stated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from tolevo.algorithms.exact.choices import least_cost
from tolevo.models.capability import Aim, Norm, Processes, Surplus, Ways, calibrated, norm_of
from tolevo.models.capability.knowledge import Knowledge, knowledge_of
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Way

from .cases import SIZES
from .repeated import Repeated, lowest, parser
from .repeats import CONFIDENCE, SHARE

Array = NDArray[np.float64]
PARTS, LEAST = 9, 91.0
SCATTER, PRICE = np.array([1.0, 0.7, 0.5]), np.array([1.0, 1.6, 2.6])
UNEVEN = 0.15, 0.25
"""Standard deviations of the logarithms of scatter and price about those of the kinds."""


@dataclass(frozen=True, slots=True)
class Machines:
    """Nine parts on three sampled machines each, `n` parts of each; `room` on both sides."""

    name: str
    room: float
    n: int

    @property
    def key(self) -> str:
        """By which its results are kept."""
        return f"{self.name}, n = {self.n}"

    @property
    def known(self) -> tuple[Array, Array]:
        """True scatter and price (parts, machines), the same in all cases."""
        rng, shape = np.random.default_rng(5), (PARTS, len(SCATTER))
        return (SCATTER * np.exp(UNEVEN[0] * rng.standard_normal(shape)),
                PRICE * np.exp(UNEVEN[1] * rng.standard_normal(shape)))  # fmt: skip


def cases() -> list[Machines]:
    """Every case of the table: with room to spare, and nearly without."""
    return [Machines(name, room, n) for name, room in (("9 x 3 machines", 7.0),
            ("9 x 3 machines, little room", 6.4)) for n in SIZES]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Choice:
    """Cost and true yield of the choices by estimates and assured, NaN where there is none."""

    plug_in: float
    plug_in_yield: float
    assured: float
    assured_yield: float
    level: float


def repeat(case: Machines, seed: int) -> Choice:
    """Sample every machine, calibrate, choose, and make the parts."""
    rng = np.random.default_rng([37, round(1e3 * case.room), case.n, seed])
    scatter, price = case.known
    samples = scatter * rng.standard_normal((case.n, *scatter.shape))
    known = [[knowledge_of(samples[:, at, way]) for way in range(len(SCATTER))]
             for at in range(PARTS)]  # fmt: skip
    level = calibrated(ways_of(known, price), Processes(np.full(scatter.size, case.n - 1.0),
                       np.full(scatter.size, float(case.n))), aim_of(case), rng)  # fmt: skip
    error = np.array([[-one.mean for one in own] for own in known])
    found: list[tuple[float, float]] = []
    for confidence in (None, level.confidence):
        form = form_of(known, price, confidence)
        best = least_cost(form, np.array([[case.room]]))
        kept = float("nan")
        if np.isfinite(best.cost[0]):
            at = np.arange(PARTS), best.chosen[0]
            std, mean = float(np.linalg.norm(scatter[at])), float(error[at].sum())
            kept = float(ndtr((case.room - mean) / std) - ndtr((-case.room - mean) / std))
        found.append((float(best.cost[0]), kept))
    return Choice(*found[0], *found[1], level.confidence)


def aim_of(case: Machines) -> Aim:
    """99.73 % between both ends, with 95 % confidence."""
    quantile = np.array([float(ndtri(0.5 * (1.0 + SHARE)))])
    return Aim(SHARE, CONFIDENCE, np.array([[-case.room, case.room]]), quantile)


def ways_of(known: list[list[Knowledge]], price: Array) -> list[Ways]:
    """The machines of each part, each of a process of its own."""
    count, one = len(SCATTER), np.zeros((1, len(SCATTER)))
    return [
        Ways(price[at], count * at + np.arange(count), np.array([[k.std for k in own]]), one,
             np.ones(1))
        for at, own in enumerate(known)
    ]  # fmt: skip


def form_of(known: list[list[Knowledge]], price: Array, level: float | None) -> Form:
    """The form that a stack of such machines has; by the estimates alone without a level."""
    quantile = float(ndtri(0.5 * (1.0 + SHARE)))
    norms = [_norm(own, level) for own in known]
    features = tuple(
        Feature(f"t_{at}", tuple(
            Way(Reciprocal(float(cost), 0.0), 1.0, 1.0, (0.0,), (quantile * float(spread),),
                choice=float(way))
            for way, (cost, spread) in enumerate(zip(price[at], np.sqrt(norms[at].even),
                                                     strict=True))), f"process_{at}")
        for at in range(len(known))
    )  # fmt: skip
    ratio = np.array([float(norm.own[0] / norm.even[0]) for norm in norms])
    doubt = (Surplus(ratio, np.zeros(len(known))),) if np.any(ratio) else ()
    return Form(("promise",), features, np.zeros(1), np.zeros(1), "", surpluses=doubt)


def _norm(own: list[Knowledge], level: float | None) -> Norm:
    """Squares of the machines of one part, each as if it were a part of its own."""
    square = np.array([one.std**2 for one in own])
    if level is None:
        return Norm(square, np.zeros(len(own)), np.zeros(len(own)))
    return norm_of(own, square, square, CONFIDENCE, level)


def main(arguments: Sequence[str] | None = None) -> None:
    """Repeat every case, and print the table."""
    given = parser(__doc__, "machines").parse_args(arguments)
    repeats = Repeated(given.kept, repeat, Choice)
    print("| machines | plug-in kept | assured kept | lower 95 % limit | cost | level (median) "
          "| no assured choice | promise broken |\n"
          "|---|---:|---:|---:|---:|---:|---:|---:|")  # fmt: skip
    for case in (one for one in cases() if one.n in given.n):
        own = repeats.each(case, range(given.seed, given.seed + given.count))
        print(row(case, own), flush=True)


def figures(own: Sequence[Choice]) -> tuple[float, float, float, float, float]:
    """Shares [percent]: kept by the estimates, of assured promises kept with the lower limit,
    without an assured choice, and of all samples those whose promise is broken.
    """
    plain = [one.plug_in_yield >= SHARE for one in own if np.isfinite(one.plug_in_yield)]
    made = [one.assured_yield >= SHARE for one in own if np.isfinite(one.assured_yield)]
    kept = sum(made)
    return (100.0 * float(np.mean(plain)), 100.0 * kept / max(len(made), 1),
            lowest(kept, len(made)), 100.0 * (1.0 - len(made) / len(own)),
            100.0 * (len(made) - kept) / len(own))  # fmt: skip


def row(case: Machines, own: Sequence[Choice]) -> str:
    """The line of one case; the cost relative to the plug-in's where there is an assured one."""
    plain, kept, low, without, broken = figures(own)
    cost = np.mean([one.assured / one.plug_in for one in own if np.isfinite(one.assured)])
    level = 100.0 * float(np.median([one.level for one in own]))
    return (f"| {case.key} | {plain:.1f} % | {kept:.1f} % | {low:.1f} % | {cost:.3f} "
            f"| {level:.1f} % | {without:.1f} % | {broken:.1f} % |")  # fmt: skip


if __name__ == "__main__":
    main()
