"""Units drawn stage by stage, against convolution, closed forms and numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo.models.inputs import Distribution, Normal, Triangular, Uniform
from tolevo.models.propagation import ClippedSum, Convolution, Term
from tolevo.models.rv_reducer import declared
from tolevo.models.rv_reducer.batch import PART, Batch, Units, batch, drawn, sum_at_probabilities, units
from tolevo.units import ARCMIN

Array = NDArray[np.float64]
EDGES = np.linspace(0.2, 1.6, 51) * ARCMIN


def document(**laws: Distribution) -> ClippedSum:
    model = declared.backlash_model({"reading": "printed"}, None, laws)
    design = {v.name: np.array([float(v.document or 0.0)]) for v in declared.VARIABLES}
    return model.total(declared.allocation(design))


def counted(total: ClippedSum, count: int, seed: int = 1) -> Batch:
    return batch(total, count, ARCMIN, EDGES, np.random.default_rng(seed))


LAWS: list[dict[str, Any]] = [
    {},
    {"pin_hole_radius": Normal(shift=0.2), "pitch": Triangular(0.5), "eccentricity": Normal()},
]


@pytest.mark.parametrize("laws", LAWS)
def test_statistics_are_those_of_convolution(laws: dict[str, Distribution]) -> None:
    """Each within four standard errors of the sample."""
    total, n = document(**laws), 100_000
    found, exact = counted(total, n), Convolution().propagate(total, 0.9973, ARCMIN)
    backlash = found.sums["backlash"]
    for drawn_one, exact_one in ((backlash.mean, exact.mean), (backlash.std, exact.std)):
        assert abs(drawn_one.value - exact_one.value[0]) < 4.0 * drawn_one.error
    for hits, share in ((found.conforming, exact.conforming), (found.interfering, exact.negative)):
        p = float(share.value[0])
        assert abs(hits / n - p) < 4.0 * np.sqrt(p * (1.0 - p) / n)


def test_stages_are_those_of_section_2() -> None:
    """phi_1 uniform between 0.19' and 0.78', phi_3 between 0 and 2 um/a_0."""
    found = counted(document(), 100_000).sums
    for name, low, high in (("phi_1", 0.1925, 0.7758), ("phi_3", 0.0, 0.1910)):
        wanted = {"mean": (low + high) / 2.0, "std": (high - low) / np.sqrt(12.0)}
        for statistic, value in wanted.items():
            one = getattr(found[name], statistic)
            assert one.value / ARCMIN == pytest.approx(value, abs=4.0 * one.error / ARCMIN + 1e-4)
    one = found["phi_2"].mean
    assert one.value / ARCMIN == pytest.approx(0.0142, abs=4.0 * one.error / ARCMIN)


def test_histogram_and_ends_are_those_of_numpy() -> None:
    count = 2 * PART + 77
    total, edges = document(), np.linspace(0.4, 1.0, 31) * ARCMIN
    parts = list(units(total, count, np.random.default_rng(5)))
    values = np.concatenate([one.effective for one in parts])
    found = batch(total, count, ARCMIN, edges, np.random.default_rng(5))
    inside = np.histogram(values, edges)[0]
    inside[0] += np.count_nonzero(values < edges[0])
    inside[-1] += np.count_nonzero(values > edges[-1])
    np.testing.assert_array_equal(found.counts, inside)
    assert found.units == len(values) == count == found.counts.sum()
    assert (found.least, found.most) == (values.min(), values.max())
    assert found.conforming == np.count_nonzero(values <= ARCMIN)


def test_effective_cuts_interference_off() -> None:
    one = Units(np.array([1.0, 1.0]), np.array([-5.0, 2.0]), np.array([0.5, 0.25]))
    np.testing.assert_array_equal(one.effective, [1.5, 3.25])


@pytest.mark.parametrize("law", [Uniform(), Triangular(0.3), Normal()])
def test_sum_is_constant_linear_and_quadratic_part(law: Distribution) -> None:
    one = np.ones(1)
    terms = (Term(Uniform(), 3.0 * one, 2.0 * one), Term(law, one, -1.5 * one, 0.7 * one))
    p = np.random.default_rng(2).random((2, 40))
    first, second = 2.0 * p[0] - 1.0, law.quantile(p[1])
    wanted = 3.0 + 2.0 * first + 1.0 - 1.5 * second + 0.7 * second**2
    np.testing.assert_allclose(sum_at_probabilities(terms, p.copy()), wanted, rtol=1e-12)


def test_batches_longer_than_a_part_are_drawn_whole() -> None:
    terms, count = document().clipped, PART + 3
    found = drawn(terms, count, np.random.default_rng(4))
    rng = np.random.default_rng(4)
    wanted = [sum_at_probabilities(terms, rng.random((len(terms), n))) for n in (PART, 3)]
    np.testing.assert_array_equal(found, np.concatenate(wanted))
