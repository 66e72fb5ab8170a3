"""One repeat: measure a sample of every part, allocate by a promise, and make the parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from tolevo.algorithms.exact.choices import least_cost
from tolevo.models.capability import Knowledge, Norm, Prior, Surplus, knowledge_of, norm_of
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Way

from .cases import OFFSET, SIGMA, Case

Array = NDArray[np.float64]
SHARE, CONFIDENCE = 0.9973, 0.95
LOOSEST, TIGHTEST = 30.0, 1e-3
"""Half-widths that are searched, in those that the parts were made to."""


@dataclass(frozen=True, slots=True)
class Repeat:
    """Costs of the plug-in and the assured allocation, and the share of units that they keep."""

    plug_in: float
    assured: float
    plug_in_yield: float
    assured_yield: float
    gap: float


def repeat(case: Case, seed: int) -> Repeat:
    """A repeat of a case; the sample depends on the case and the seed alone."""
    rng = np.random.default_rng([seed, case.parts, case.n, int(case.uneven), int(case.as_found)])
    offset = OFFSET * SIGMA * rng.standard_normal(case.parts) * case.as_found
    samples = offset + SIGMA * rng.standard_normal((case.n, case.parts))
    prior = Prior(SIGMA, case.prior) if case.prior else None
    known = [knowledge_of(column, prior) for column in samples.T]
    mean = np.array([one.mean for one in known])
    room = float(ndtri(0.5 * (1.0 + SHARE))) * SIGMA * float(np.linalg.norm(case.slopes))
    centre = float(case.slopes @ mean) if case.as_found else 0.0
    left = max(room - abs(centre), 1e-6)
    found = []
    for norm in (plug_in(case, known), assured(case, known)):
        best = least_cost(form_of(case, norm), np.array([[left]]))
        found.append((float(best.cost[0]), float(best.bound[0]), best.t[0]))
    error = offset - mean
    kept = []
    for _, _, t in found:
        std = SIGMA * float(np.linalg.norm(case.slopes * t))
        shift = float(case.slopes @ offset) if case.as_found else float(case.slopes @ (t * error))
        kept.append(float(ndtr((room - shift) / std) - ndtr((-room - shift) / std)))
    gap = 1.0 - found[1][1] / found[1][0]
    return Repeat(found[0][0], found[1][0], kept[0], kept[1], gap)


def plug_in(case: Case, known: list[Knowledge]) -> Norm:
    """The standard deviation by the estimates."""
    square = np.array([case.slopes[at] * one.std for at, one in enumerate(known)]) ** 2
    return Norm(square, np.zeros(case.parts), np.zeros(case.parts))


def assured(case: Case, known: list[Knowledge]) -> Norm:
    """That of an assured promise."""
    square = np.array([case.slopes[at] * one.std for at, one in enumerate(known)]) ** 2
    return norm_of(known, square, square, CONFIDENCE)


def form_of(case: Case, norm: Norm) -> Form:
    """The convex form that a stack has for a norm."""
    quantile = float(ndtri(0.5 * (1.0 + SHARE)))
    spread = quantile * np.sqrt(norm.even)
    features = tuple(
        Feature(f"t_{at}", (Way(Reciprocal(0.0, float(b)), TIGHTEST, LOOSEST, (0.0,),
                                (float(spread[at]),)),))
        for at, b in enumerate(case.prices)
    )  # fmt: skip
    surplus = Surplus(norm.own / norm.even, norm.shared / norm.even)
    doubt = (surplus,) if np.any(norm.own) or np.any(norm.shared) else ()
    return Form(("promise",), features, np.zeros(1), np.zeros(1), "", surpluses=doubt)
