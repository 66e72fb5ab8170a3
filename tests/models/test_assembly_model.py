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


# ---------------------------------------------------------------- A(k), F and the diagonal of Q


B = np.array([[1.0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]])
C = np.array([[1.0, 0, 1, 0], [0, 1, 0, 1]])
R = np.array([[5.0, 1000, 1000, 1000], [10, 5, 1000, 1000], [10, 5, 5, 1000], [10, 5, 10, 5]])


def by_hand(a: NDArray[np.float64], f: NDArray[np.float64], p: NDArray[np.float64], after: bool) -> NDArray[np.float64]:
    """Final angles of the document's parts, K(k) and P(k) as printed, with the inverse of R."""
    gains: list[NDArray[np.float64]] = []
    for k in (3, 2, 1, 0):
        r = np.diag(R[k])
        gains.insert(0, np.linalg.inv(r + B.T @ p @ B) @ B.T @ p @ a[k])
        p = a[k].T @ p @ np.linalg.inv(np.eye(4) + B @ np.linalg.inv(r) @ B.T @ p) @ a[k]
    x = np.zeros(4)
    for k in range(4):
        w = f @ np.where(np.arange(4) == k, PART_ERRORS, 0.0)
        x = x + w * after
        x = a[k] @ x - B @ gains[k] @ x + w * (not after)
    return x


@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("reading", ["printed", "consistent"])
def test_any_transition_part_flow_and_diagonal_weight(reading: str, after: bool) -> None:
    rng = np.random.default_rng(3)
    a, f = np.eye(4) + 0.3 * rng.normal(size=(4, 4, 4)), rng.normal(size=(4, 4))
    q = np.array([2.0, 0.0, 0.5, 7.0] if reading == "printed" else [2.0, 0.5])
    given: dict[str, Value] = {f"transition_{k}": tuple(a[k - 1].ravel()) for k in (1, 2, 4)}
    a[2] = np.eye(4)  # as a step that states no matrix
    given |= {"error_flow": tuple(f.ravel()), "final_weights": tuple(q), "reading": reading}
    given["insertion"] = "after" if after else "before"
    terminal = np.diag(q) if reading == "printed" else C.T @ np.diag(q) @ C
    np.testing.assert_allclose(predicted(given)[0], by_hand(a, f, 5.0 * terminal, after), rtol=1e-9)


def test_diagonal_scales_the_precision_weight_of_the_printed_states() -> None:
    """Q = 10 is a precision weight of 2 times a diagonal of 5, and identities change no bit."""
    fives = predicted({"final_weights": (5.0, 5.0, 5.0, 5.0)}, table(1, 2.0))
    np.testing.assert_allclose(fives, [(-0.985, 0.884, 2.486, 4.029)], atol=6e-4)
    same: dict[str, Value] = {f"transition_{k}": tuple(np.eye(4).ravel()) for k in range(1, 5)}
    same |= {"error_flow": tuple(B.ravel()), "final_weights": (1.0, 1.0, 1.0, 1.0)}
    np.testing.assert_array_equal(predicted(same), predicted())


def test_every_fault_of_matrices_and_weights_is_told_at_once() -> None:
    wrong: dict[str, Value] = {
        "transition_2": (1.0,) * 15,
        "error_flow": (np.inf,) * 16,
        "final_weights": (1.0, -1.0),
        "reading": "consistent",
        "adjustment_weights_4": (10.0, 5.0, -1.0, 5.0),
    }
    with pytest.raises(InputError) as caught:
        Assembly(wrong)
    assert [fault.place for fault in caught.value.faults] == [
        "parameters.error_flow", "parameters.transition_2", "parameters.final_weights",
        "parameters.adjustment_weights_4[2]",
    ]  # fmt: skip
    for count, reading in ((2, "printed"), (4, "consistent")):
        with pytest.raises(InputError, match=f"a weight for each of the {6 - count} "):
            Assembly({"final_weights": (1.0,) * count, "reading": reading})
    with pytest.raises(InputError, match="one above 0"):
        Assembly({"final_weights": (0.0,) * 4})


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
