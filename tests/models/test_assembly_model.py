"""The measurable model `assembly`: rows of a table, what effects change, parameters."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo.errors import InputError
from tolevo.models.assembly.model import Assembly
from tolevo.section import Value

PART_ERRORS = (-1.6, 5.3, 5.8, 3.2)


def table(count: int, precision: float) -> dict[str, NDArray[np.float64]]:
    parts = {f"dtheta_{at}_mrad": np.full(count, e) for at, e in enumerate(PART_ERRORS, 1)}
    return {
        "unit": np.arange(float(count)), "precision_weight": np.full(count, precision)
    } | parts  # fmt: skip


def predicted(
    parameters: dict[str, Value] | None = None,
    rows: dict[str, NDArray[np.float64]] | None = None,
    changes: dict[str, NDArray[np.float64]] | None = None,
) -> NDArray[np.float64]:
    rows = rows or table(1, 5.0)
    found = Assembly(parameters).predict(rows, np.random.default_rng(0), changes or {})
    return np.stack([found[f"delta_{at}_mrad"] for at in range(1, 5)], axis=1)


def changed(name: str, *values: float) -> NDArray[np.float64]:
    """Rows of the document's parts at Q = 5, each with a change of its own."""
    return predicted(rows=table(len(values), 5.0), changes={name: np.array(values)})


def test_rows_of_different_precision_weight() -> None:
    """The final states of document A's four parts, in any order of rows."""
    rows = table(4, 0.0) | {"precision_weight": np.array([10.0, 0.0, 5.0, 10.0])}
    expected = [
        (-0.985, 0.884, 2.486, 4.029), (-1.6, 3.7, 5.8, 9.0), (-1.314, 1.375, 3.314, 4.857),
        (-0.985, 0.884, 2.486, 4.029),
    ]  # fmt: skip
    np.testing.assert_allclose(predicted(rows=rows), expected, atol=6e-4)


@pytest.mark.parametrize("change", [one.name for one in Assembly.changeable])
def test_changes_are_neutral_at_zero_and_act_row_by_row(change: str) -> None:
    plain = predicted(rows=table(3, 5.0))
    np.testing.assert_array_equal(changed(change, 0.0, 0.0, 0.0), plain)
    mixed = changed(change, 0.0, 0.2, 0.4)
    np.testing.assert_array_equal(mixed[0], plain[0])
    once, twice = (np.linalg.norm(mixed[at] - plain[at]) for at in (1, 2))
    assert 0.01 < once < twice


def test_springback_in_full_undoes_every_adjustment() -> None:
    np.testing.assert_allclose(changed("springback", 1.0)[0], (-1.6, 3.7, 5.8, 9.0))


def test_gain_error_of_minus_one_and_a_wide_dead_band_adjust_nothing() -> None:
    np.testing.assert_allclose(changed("adjustment_gain_error", -1.0)[0], (-1.6, 3.7, 5.8, 9.0))
    np.testing.assert_allclose(changed("adjustment_backlash_mrad", 50.0)[0], (-1.6, 3.7, 5.8, 9.0))


def test_dead_band_is_in_milliradians() -> None:
    """After insertion with a huge weight the last crankshaft error is removed but for the band."""
    rows = table(1, 1e9) | {f"dtheta_{at}_mrad": np.zeros(1) for at in (1, 2, 3)}
    found = predicted({"insertion": "after"}, rows, {"adjustment_backlash_mrad": np.array(0.3)})
    np.testing.assert_allclose(found, [[0.0, 0.0, 0.0, 0.3]], atol=1e-6)


def test_measurement_noise_comes_from_the_generator() -> None:
    noisy: dict[str, Value] = {"measurement_std_mrad": 0.5, "insertion": "after"}
    rows = table(2000, 10.0)
    found = predicted(noisy, rows)
    np.testing.assert_array_equal(found, predicted(noisy, rows))
    assert np.all(found.std(axis=0) > 0.05)
    assert np.ptp(predicted({"insertion": "after"}, rows), axis=0) == pytest.approx(np.zeros(4))


def test_another_chain() -> None:
    """Every part on the housing: nothing moves anything else."""
    weights: dict[str, Value] = {"hangs_on": (0.0, 0.0, 0.0, 0.0)}
    np.testing.assert_allclose(predicted(weights, table(1, 0.0))[0], PART_ERRORS)


def test_negative_precision_weight_is_refused_with_its_row() -> None:
    rows = table(3, 5.0) | {"precision_weight": np.array([5.0, -1.0, 0.0])}
    with pytest.raises(InputError, match="precision_weight: must be at least 0, got -1 in row 2"):
        predicted(rows=rows)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("adjustment_weights_1", (5.0, 5.0, 1000.0, 1000.0),
         r"parameters.adjustment_weights_1\[1\]: step 1 adjusts part 2"),
        ("adjustment_weights_4", (10.0, 5.0, -1.0, 5.0),
         r"parameters.adjustment_weights_4\[2\]: must be above 0"),
        ("hangs_on", (0.0, 1.0, 4.0, 3.0), r"parameters.hangs_on\[2\]: crankshaft_2 must hang on"),
        ("hangs_on", (0.0, 0.5, 0.0, 3.0), "parameters.hangs_on: must hold whole numbers"),
    ],
)  # fmt: skip
def test_faulty_parameters(name: str, value: Value, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Assembly({name: value})
