"""The convex form at a fixed precision weight: cost against transmission error, from below.

The amplitude is A_0 plus the quantile of the radius R of a Gaussian vector in the plane. For a
coverage p, R_p^2 is at least c_p times the trace of its covariance, with c_p the least of that
ratio over all shapes of the ellipse (of a circle, at high coverage); the trace is a sum of squares
of the tolerances. The bound is exact where the optimum is round. A wave m that all units share only
widens |c . x + m| (Anderson's inequality), so that the bound holds with it too. The standard
deviations of the final angles are roots of sums of squares as they stand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...models.assembly.assemble import radius_quantile
from ...models.assembly.process import DatumFlowChain
from ...section import Array
from ...units import ARCSEC, MRAD
from ..forms import Feature, Form, Way
from ..limits import narrow_range
from .declared import AXES, DOCUMENT_MRAD, PARTS, PRECISION, SIZE

if TYPE_CHECKING:
    from .problem import RvTransmissionError

SHAPES = 257
"""Ellipses, from flat to round, among which the least ratio is sought."""
SAFETY = 1e-6
"""Relative lowering of c_p, more than the numerical error of the quantiles."""
TE = "te_amplitude_arcsec"
COMPOSITE_STD = ("kc_sum_std_mrad", "kc_rss_std_mrad")
STD = (*(f"kc_{at}_{axis}_std_mrad" for at in range(1, 5) for axis in AXES), *COMPOSITE_STD)


def variances(spread: Array) -> Array:
    """Contributions of each source (..., s) to the variances of the outputs `STD`, (..., STD, s).

    `spread` (..., 12, s) are the final angles per standardised source.
    """
    *designs, _, sources = spread.shape
    combined = spread.reshape(*designs, len(PARTS), len(AXES), sources).sum(axis=-3)
    composite = [np.sum(angles**2, axis=-2, keepdims=True) for angles in (combined, spread)]
    return np.concatenate([spread**2, *composite], axis=-2)


def least_ratio(coverage: float) -> float:
    """c_p: the least R_p^2 over the trace of the covariance, of any Gaussian in the plane."""
    flat = np.linspace(0.0, 1.0, SHAPES)
    covariance = np.zeros((SHAPES, 2, 2))
    covariance[:, 0, 0], covariance[:, 1, 1] = 1.0, flat
    ratios = radius_quantile(covariance, coverage) ** 2 / (1.0 + flat)
    return float(ratios.min() * (1.0 - SAFETY))


def form_of(problem: RvTransmissionError) -> Form | None:
    """The form, None where the precision weight is searched."""
    if PRECISION not in problem.fixed:
        return None
    unit = np.ones((1, len(problem.names)))
    unit[:, problem.names.index(PRECISION)] = problem.fixed[PRECISION]
    spread = problem.residual(unit).spread[0]
    plane = problem.influence.order_40 @ spread / ARCSEC
    factor = least_ratio(problem.settings.propagation.coverage)
    squares = np.vstack([factor * np.sum(plane**2, axis=0), variances(spread / MRAD)])
    base = problem.influence.base_amplitude / ARCSEC
    features = []
    for at, name in enumerate(DOCUMENT_MRAD):
        ends = narrow_range(problem.limits, name, *problem.interval(name))
        spreads = tuple(np.sqrt(squares[:, at]).tolist())
        features.append(Feature(name, (Way(problem.settings.costs[name], *ends, (0.0,) * len(squares), spreads),)))
    relaxed = _relaxed_limits(problem)
    left_out = f"; limits left out: {', '.join(relaxed)}" if relaxed else ""
    return Form(
        (TE, *STD),
        tuple(features),
        np.array([base, *(0.0 for _ in STD)]),
        squares[:, SIZE:].sum(axis=1),
        f"influence coefficients, precision weight {problem.fixed[PRECISION]:g}{left_out}",
        exact=False,
        settled={PRECISION: problem.fixed[PRECISION]},
        relaxed=relaxed,
    )


def _relaxed_limits(problem: RvTransmissionError) -> tuple[str, ...]:
    """Limits that the form leaves out."""
    known = {*problem.cost_names, TE, *STD}
    return tuple(
        limit.name
        for limit in problem.limits
        if limit.name not in {*known, *DOCUMENT_MRAD} or (limit.name in known and np.isfinite(limit.low))
    )


# The relative costs that document A's allocation implies.
#
# Least cost sum a_i / v_i^b with a root sum of squares sum J_i^2 v_i^2 = P^2 has, by Lagrange,
# a_i b / v_i^(b + 1) proportional to J_i^2 v_i: v_i proportional to (a_i / J_i^2)^(1/(b + 2)), and
# read backwards a_i proportional to J_i^2 v_i^(b + 2) / b.


COMPOSITES = ("sum", "rss")


def sensitivities(composite: str = "sum", chain: DatumFlowChain | None = None) -> Array:
    """J, shape (12,), of the composite final error: per part, alike about its three axes.

    `sum`: the composite is the sum of the four final angles; `rss`: their root sum of squares.
    """
    flow = (chain or DatumFlowChain()).error_matrix()
    composite_error = flow.sum(axis=0) if composite == "sum" else np.linalg.norm(flow, axis=0)
    return np.repeat(composite_error, len(AXES))


def implied_costs(tolerances: Array, influence: Array, exponent: float = 1.0) -> Array:
    """Relative costs a (n,), mean 1, under which the allocation `tolerances` (n,) is the optimum.

    `influence` is J (n,), `exponent` b > 0.
    """
    costs = influence**2 * tolerances ** (exponent + 2.0) / exponent
    return np.asarray(costs / costs.mean())


def optimal_allocation(costs: Array, influence: Array, limit: float, exponent: float = 1.0) -> Array:
    """Tolerances v (n,) of least cost sum a/v^b with sqrt(sum J^2 v^2) = `limit`."""
    shape = (costs / influence**2) ** (1.0 / (exponent + 2.0))
    return np.asarray(limit * shape / np.linalg.norm(influence * shape))
