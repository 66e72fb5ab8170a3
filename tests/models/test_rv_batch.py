"""A drawn batch against the convolution of the same errors."""

from collections.abc import Mapping

import numpy as np
import pytest

from tolevo.errors import InputError
from tolevo.models.inputs import Normal
from tolevo.models.propagation import Convolution, Propagated
from tolevo.models.rv_reducer import declared
from tolevo.models.rv_reducer.backlash import BacklashModel
from tolevo.models.rv_reducer.batch import RvBatch, drawn
from tolevo.section import Value
from tolevo.units import ARCMIN

DOCUMENT: dict[str, Value] = {"model": "document"}
"""Units by document B's closed form."""
UNITS = 200_000
LIMIT = 5.0
"""Standard errors allowed: one seed in about two million is further off."""


CONSISTENT: Mapping[str, Value] = {}
PRINTED: dict[str, Value] = {"reading": "printed"}


def expected(
    designs: dict[str, float], inputs: dict[str, Normal], parameters: Mapping[str, Value] = CONSISTENT
) -> Propagated:
    at = {v.name: float(v.document or 0.0) for v in declared.VARIABLES} | designs
    model = declared.backlash_model(parameters, None, inputs)
    one = {name: np.array([value]) for name, value in at.items()}
    return Convolution().propagate(model.total(declared.allocation(one)), 0.9973, ARCMIN)


@pytest.mark.parametrize(
    ("designs", "inputs"),
    [
        ({}, {}),
        ({"stagger_arcmin": 0.2, "eccentricity_um": 8.0}, {}),
        ({"crank_bearing_um": 20.0}, {"pin_hole_radius": Normal(1.0, 0.3)}),
        ({}, {"involute_grade": Normal()}),
    ],
)
def test_sample_agrees_with_convolution(designs: dict[str, float], inputs: dict[str, Normal]) -> None:
    model = RvBatch(DOCUMENT, designs, inputs={f"{name}_um": law for name, law in inputs.items()})
    table = {"unit": np.arange(UNITS)}
    sample = model.predict(table, np.random.default_rng(3))["backlash_arcmin"]
    exact = expected(designs, inputs)
    std = exact.std.value[0] / ARCMIN
    assert abs(sample.mean() - exact.mean.value[0] / ARCMIN) < LIMIT * std / np.sqrt(UNITS)
    assert sample.std() == pytest.approx(std, rel=LIMIT / np.sqrt(UNITS))
    within = exact.conforming.value[0]
    error = np.sqrt(within * (1.0 - within) / UNITS)
    assert abs(np.mean(sample <= 1.0) - within) < LIMIT * error


def test_share_of_interfering_units() -> None:
    """Document B's zones: phi_2 below zero in 48 % of units (issue 2)."""
    cycloid = drawn(RvBatch(DOCUMENT | PRINTED).total.clipped, UNITS, np.random.default_rng(0))
    error = np.sqrt(0.48 * 0.52 / UNITS)
    exact = expected({}, {}, PRINTED).negative.value[0]
    assert exact == pytest.approx(0.48, abs=0.005)
    assert abs(np.mean(cycloid < 0.0) - exact) < LIMIT * error


def test_same_seed_same_batch() -> None:
    table = {"unit": np.arange(10)}
    one, two = (RvBatch(DOCUMENT).predict(table, np.random.default_rng(0)) for _ in range(2))
    np.testing.assert_array_equal(one["backlash_arcmin"], two["backlash_arcmin"])


def test_repeated_readings_of_a_unit_agree() -> None:
    table = {
        "unit": np.array(["a", "b", "a", "a"], dtype=object),
        "lot": np.array(["1", "1", "1", "2"], dtype=object),
        "repeat": np.array([1.0, 1.0, 2.0, 1.0]),
    }
    found = RvBatch(DOCUMENT).predict(table, np.random.default_rng(0))["backlash_arcmin"]
    assert found[0] == found[2]
    assert len(set(found.tolist())) == 3


def test_declared_defaults_are_those_of_the_records() -> None:
    model, record = declared.backlash_model({}, None, {}), BacklashModel()
    for part in ("geometry", "stage", "eccentricity"):
        ours, theirs = getattr(model, part), getattr(record, part)
        for name in type(ours).__slots__:
            assert getattr(ours, name) == pytest.approx(getattr(theirs, name), rel=1e-14), name
    for name in ("tighter", "sun_held", "stagger_gain", "position_mids_count"):
        assert getattr(model, name) == getattr(record, name), name


def test_undercut_profile_is_refused() -> None:
    with pytest.raises(InputError, match=r"parameters\.eccentricity_mm.*1\.25"):
        RvBatch({"eccentricity_mm": 2.0})
