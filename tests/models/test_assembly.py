"""The assembly process of document A against dense least squares, scipy and printed figures."""

import numpy as np
import pytest
import scipy.linalg
from numpy.typing import NDArray

from tolevo.errors import InputError
from tolevo.models.assembly.assemble import Departures, assemble, response
from tolevo.models.assembly.process import (
    AdjustmentWeights,
    DatumFlowChain,
    Process,
    gains,
    kalman,
    plane_process,
    space_process,
    terminal_weight,
)

Array = NDArray[np.float64]
PRINTED_F = np.array([[1.0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]])
PRINTED_R = np.array([[5.0, 1000, 1000, 1000], [10, 5, 1000, 1000], [10, 5, 5, 1000], [10, 5, 10, 5]])
PART_ERRORS = np.array([-1.6, 5.3, 5.8, 3.2])


def final(
    precision: float, reading: str = "printed", insertion: str = "before", process: Process | None = None
) -> Array:
    """Final state of the document's four parts."""
    process = process or plane_process()
    found = gains(process, terminal_weight(process, precision, reading))
    return assemble(process, found, PART_ERRORS, insertion).state


def general_process(rng: np.random.Generator, steps: int = 5, n: int = 3, m: int = 2) -> Process:
    """A process without any structure."""
    root = rng.normal(size=(steps, m, m))
    return Process(
        transition=rng.normal(size=(steps, n, n)),
        control=rng.normal(size=(steps, n, m)),
        error=rng.normal(size=(steps, n, n)),
        arriving=np.tile(np.arange(steps)[:, None] % n == np.arange(n), 1),
        weight=root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(m),
        observation=np.eye(n)[:2],
        coupling=np.zeros((n, n)),
    )


def least_squares(process: Process, terminal: Array, start: Array, first: int = 0) -> Array:
    """All adjustments (N - first, m) that minimise x(N)'P x(N) + sum u'Ru without further errors,
    as one dense least-squares problem with the states eliminated."""
    n, m = process.control.shape[1:]
    reach, carried = np.zeros((n, 0)), np.eye(n)
    for step in range(first, process.steps):
        a = process.transition[step]
        reach, carried = np.hstack([a @ reach, process.control[step]]), a @ carried
    halves = [np.linalg.cholesky(process.weight[k]).T for k in range(first, process.steps)]
    root = np.linalg.cholesky(terminal).T
    rows = np.vstack([root @ reach, scipy.linalg.block_diag(*halves)])
    target = np.concatenate([-root @ carried @ start, np.zeros(m * len(halves))])
    found = np.linalg.lstsq(rows, target)[0].reshape(-1, m)
    return np.asarray(found, dtype=float)


# ---------------------------------------------------------------- the document's tables


def test_chain_gives_the_printed_matrices() -> None:
    chain = DatumFlowChain()
    np.testing.assert_array_equal(chain.error_matrix(), PRINTED_F)
    np.testing.assert_array_equal(chain.weights(), PRINTED_R)
    np.testing.assert_array_equal(chain.observation(), [[1, 0, 1, 0], [0, 1, 0, 1]])
    np.testing.assert_array_equal(chain.adjustable(), PRINTED_R < 1000)


def test_another_chain_and_rule() -> None:
    """One stack of three: each carries the next, nothing is free once something hangs on it."""
    chain = DatumFlowChain((0, 1, 2), ("base", "arm", "tool"))
    np.testing.assert_array_equal(chain.error_matrix(), np.tri(3))
    np.testing.assert_array_equal(chain.observation(), np.eye(3))
    weights = chain.weights(AdjustmentWeights(1.0, 2.0, 9.0))
    np.testing.assert_array_equal(weights, [[1, 9, 9], [2, 1, 9], [2, 2, 1]])


@pytest.mark.parametrize(
    ("precision", "state"),
    [
        (0.0, (-1.6, 3.7, 5.8, 9.0)),
        (5.0, (-1.314, 1.375, 3.314, 4.857)),
        (10.0, (-0.985, 0.884, 2.486, 4.029)),
        (1e9, (0.0, 0.0, 0.0, 3.2)),
    ],
)
def test_final_states_of_the_printed_reading(precision: float, state: tuple[float, ...]) -> None:
    np.testing.assert_allclose(final(precision), state, atol=6e-4)


@pytest.mark.parametrize(
    ("reading", "insertion", "combined", "drops"),
    [
        ("printed", "before", False, (46.0, 57.0)),
        ("printed", "after", False, (74.0, 84.0)),
        ("consistent", "after", True, (84.0, 91.0)),
    ],
)
def test_fall_of_the_final_error(reading: str, insertion: str, combined: bool, drops: tuple[float, float]) -> None:
    seen = plane_process().observation if combined else np.eye(4)
    norms = [np.linalg.norm(seen @ final(q, reading, insertion)) for q in (0.0, 5.0, 10.0)]
    falls = [100.0 * (1.0 - one / norms[0]) for one in norms[1:]]
    np.testing.assert_allclose(falls, drops, atol=0.5)
    assert falls[1] - falls[0] < falls[0], "diminishing returns from 5 to 10"


def test_error_free_row_needs_adjustment_after_insertion() -> None:
    """The document's last row: only y of the consistent reading after insertion goes to zero, and
    of the printed one the whole state; before insertion the last part is never adjusted."""
    observation = plane_process().observation
    np.testing.assert_allclose(observation @ final(1e9, "consistent", "after"), 0.0, atol=1e-6)
    np.testing.assert_allclose(final(1e9, "printed", "after"), 0.0, atol=1e-6)
    for reading in ("printed", "consistent"):
        assert np.linalg.norm(observation @ final(1e9, reading, "before")) > 3.0


# ---------------------------------------------------------------- the recursion


@pytest.mark.parametrize("seed", range(3))
def test_recursion_equals_dense_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    process, start = general_process(rng), rng.normal(size=3)
    terminal = terminal_weight(process, 7.0)
    found, x = gains(process, terminal), start
    dense = least_squares(process, terminal, start)
    for step in range(process.steps):
        u = -found[step] @ x
        np.testing.assert_allclose(u, dense[step], rtol=1e-10, atol=1e-10)
        x = process.transition[step] @ x + process.control[step] @ u


@pytest.mark.parametrize("insertion", ["before", "after"])
def test_every_step_solves_what_is_left(insertion: str) -> None:
    """Each printed adjustment is the first of the least-squares plan from the state it sees."""
    process = plane_process()
    terminal = terminal_weight(process, 5.0)
    found = assemble(process, gains(process, terminal), PART_ERRORS, insertion)
    x = np.zeros(4)
    for step in range(4):
        arriving = PRINTED_F[:, step] * PART_ERRORS[step]
        x = x + arriving * (insertion == "after")
        plan = least_squares(process, terminal, x, step)
        np.testing.assert_allclose(found.adjustments[step], plan[0], rtol=1e-10, atol=1e-10)
        x = x + PRINTED_F @ plan[0] + arriving * (insertion == "before")
    np.testing.assert_allclose(found.state, x, rtol=1e-12, atol=1e-12)


def test_recursion_equals_the_printed_form() -> None:
    process = plane_process()
    p, found = 5.0 * np.eye(4), gains(process, terminal_weight(process, 5.0))
    for step in reversed(range(4)):
        r = process.weight[step]
        gain = np.linalg.inv(r + PRINTED_F.T @ p @ PRINTED_F) @ PRINTED_F.T @ p
        np.testing.assert_allclose(found[step], gain, rtol=1e-11, atol=1e-14)
        p = p @ np.linalg.inv(np.eye(4) + PRINTED_F @ np.linalg.inv(r) @ PRINTED_F.T @ p)


def test_stationary_gain_is_scipys() -> None:
    rng = np.random.default_rng(4)
    one = general_process(rng, steps=1)
    a, b, r = 0.4 * one.transition[0], one.control[0], one.weight[0]
    long = Process(
        transition=np.broadcast_to(a, (200, 3, 3)),
        control=np.broadcast_to(b, (200, 3, 2)),
        error=np.broadcast_to(np.eye(3), (200, 3, 3)),
        arriving=np.zeros((200, 3), dtype=bool),
        weight=np.broadcast_to(r, (200, 2, 2)),
        observation=np.eye(3),
        coupling=np.zeros((3, 3)),
    )
    stage = np.diag([1.0, 2.0, 0.5])
    p = scipy.linalg.solve_discrete_are(a, b, stage, r)
    expected = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
    found = gains(long, np.zeros((3, 3)), running=stage)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)


def test_effort_rises_and_error_falls_with_the_precision_weight() -> None:
    process = plane_process()
    terminal = terminal_weight(process, np.array([0.0, 1.0, 5.0, 10.0, 100.0]))
    found = assemble(process, gains(process, terminal), PART_ERRORS)
    assert found.effort(process)[0] == 0.0
    assert np.all(np.diff(found.effort(process)) > 0.0)
    assert np.all(np.diff(np.linalg.norm(found.state, axis=-1)) < 0.0)
    by_hand = [sum(u @ r @ u for u, r in zip(one, process.weight, strict=True))
               for one in found.adjustments]  # fmt: skip
    np.testing.assert_allclose(found.effort(process), by_hand)


# ---------------------------------------------------------------- batches and space


def test_batch_equals_one_by_one() -> None:
    rng = np.random.default_rng(2)
    process, errors = plane_process(), rng.normal(size=(7, 4))
    each = gains(process, terminal_weight(process, np.arange(7.0)))
    departures = Departures(np.arange(7) / 10.0, 0.05, 0.2, np.linspace(0.0, 0.3, 7))
    whole = assemble(process, each, errors, "after", departures)
    for at in range(7):
        own = Departures(0.1 * at, 0.05, 0.2, 0.05 * at)
        one = assemble(process, each[at], errors[at], "after", own)
        np.testing.assert_allclose(one.state, whole.state[at], rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(one.adjustments, whole.adjustments[at], rtol=1e-13, atol=1e-14)


def test_space_is_three_planes_with_parallel_axes() -> None:
    rng = np.random.default_rng(3)
    plane, space, errors = plane_process(), space_process(), rng.normal(size=(4, 3))
    assert space.transition.shape == (4, 12, 12)
    found = assemble(space, gains(space, terminal_weight(space, 5.0)), errors.ravel(), "after").state.reshape(4, 3)
    single = gains(plane, terminal_weight(plane, 5.0))
    np.testing.assert_allclose(found.T, assemble(plane, single, errors.T, "after").state, rtol=1e-12)


def test_turned_parts_move_the_housing_axes() -> None:
    """A crankshaft put in upside down (turned by 180 deg about x): its z error counts negative."""
    frames = np.stack([np.diag([1.0, -1.0, -1.0]), np.eye(3), np.eye(3), np.eye(3)])
    space = space_process(frames=frames)
    errors = np.zeros(12)
    errors[:3] = (1.0, 2.0, 3.0)
    state = assemble(space, np.zeros((4, 12, 12)), errors).state.reshape(4, 3)
    np.testing.assert_array_equal(state, [[1, -2, -3], [1, -2, -3], [0, 0, 0], [0, 0, 0]])


def test_response_propagates_variances() -> None:
    """Standard deviation and mean effort against 200,000 drawn assemblies, 5 standard errors."""
    rng, count = np.random.default_rng(5), 200_000
    process, sigma = plane_process(), np.array([0.5, 1.0, 0.7, 0.2])
    found = gains(process, terminal_weight(process, 5.0, "consistent"))
    linear = response(process, found, "after")
    drawn = assemble(process, found, sigma * rng.standard_normal((count, 4)), "after")
    rtol = 5.0 / np.sqrt(2.0 * count)
    np.testing.assert_allclose(drawn.state.std(axis=0), linear.std(sigma), rtol=rtol)
    effort = drawn.effort(process)
    error = 5.0 * effort.std() / np.sqrt(count)
    assert effort.mean() == pytest.approx(float(linear.effort(process, sigma)), abs=error)


# ---------------------------------------------------------------- departures


def test_departures_by_hand() -> None:
    """Only the last step adjusts: u = (1, -0.2, 0, 0), by a gain made for it."""
    process = plane_process()
    k = np.zeros((4, 4, 4))
    k[3, 0, 0], k[3, 1, 0] = 0.5, -0.1  # delta_1 is -2 before the last step
    errors = np.array([-2.0, 0.0, 0.0, 0.0])
    plain = assemble(process, k, errors).state
    np.testing.assert_allclose(plain, [-1.0, -1.2, 0.0, 0.0])
    gained = assemble(process, k, errors, departures=Departures(gain_error=-0.1)).state
    np.testing.assert_allclose(gained, [-1.1, -1.28, 0.0, 0.0])
    dead = assemble(process, k, errors, departures=Departures(dead_band=0.3)).state
    np.testing.assert_allclose(dead, [-1.3, -1.3, 0.0, 0.0])
    back = assemble(process, k, errors, departures=Departures(springback=0.25)).state
    np.testing.assert_allclose(back, [-1.25, -1.4, 0.0, 0.0])


def test_chain_coupling_by_hand() -> None:
    """Without adjustment chain 1 takes a share of what chain 2's parts bring."""
    process = plane_process()
    state = assemble(process, np.zeros((4, 4, 4)), PART_ERRORS, departures=Departures(coupling=0.1)).state
    np.testing.assert_allclose(state, [-1.6 + 0.58, 3.7 + 0.58 + 0.32, 5.8, 9.0])


# ---------------------------------------------------------------- estimate


@pytest.mark.parametrize("insertion", ["before", "after"])
@pytest.mark.parametrize("combined", [False, True])
def test_estimate_equals_weighted_least_squares(insertion: str, combined: bool) -> None:
    """Part errors from all readings so far and their prior at once, as one dense problem."""
    rng = np.random.default_rng(6)
    process, sigma = plane_process(), np.array([1.0, 2.0, 1.5, 0.5])
    measured = process.observation if combined else np.eye(4)
    noise_std = np.linspace(0.3, 0.6, len(measured))
    filtered = kalman(process, sigma, noise_std, insertion, measured)
    control = gains(process, terminal_weight(process, 5.0))
    errors = sigma * rng.standard_normal(4)
    noise = noise_std * rng.standard_normal((4, len(measured)))
    found = assemble(process, control, errors, insertion, estimator=filtered, noise=noise)

    x, moved, rows, targets = np.zeros(4), np.zeros(4), [np.diag(1.0 / sigma)], [np.zeros(4)]
    for step in range(4):
        there = np.arange(4) < step + (insertion == "after")
        if insertion == "after":
            x = x + PRINTED_F[:, step] * errors[step]
        looked = measured * there
        reading = looked @ x + noise[step]
        rows.append(looked @ (PRINTED_F * there) / noise_std[:, None])
        targets.append((reading - looked @ moved) / noise_std)
        parts = np.linalg.lstsq(np.vstack(rows), np.concatenate(targets))[0]
        u = -control[step] @ (moved + PRINTED_F @ (parts * there))
        np.testing.assert_allclose(found.adjustments[step], u, rtol=1e-10, atol=1e-12)
        x, moved = x + PRINTED_F @ u, moved + PRINTED_F @ u
        if insertion == "before":
            x = x + PRINTED_F[:, step] * errors[step]
    np.testing.assert_allclose(found.state, x, rtol=1e-10, atol=1e-12)


def test_exact_readings_give_the_known_state() -> None:
    process = plane_process()
    control = gains(process, terminal_weight(process, 5.0))
    exact = kalman(process, np.ones(4), 0.0, "after")
    known = assemble(process, control, PART_ERRORS, "after")
    seen = assemble(process, control, PART_ERRORS, "after", estimator=exact)
    np.testing.assert_allclose(seen.state, known.state, rtol=1e-12)


def test_noise_makes_the_result_worse() -> None:
    """Against the known state; and drawn noise spreads as the response says."""
    process, sigma, noise_std = plane_process(), np.ones(4), 0.5
    control = gains(process, terminal_weight(process, 10.0))
    filtered = kalman(process, sigma, noise_std, "after")
    sources = np.concatenate([sigma, np.full(16, noise_std)])
    spread = response(process, control, "after", filtered).std(sources)
    assert np.all(spread > response(process, control, "after").std(sigma))
    rng, count = np.random.default_rng(7), 100_000
    drawn = assemble(
        process, control, rng.standard_normal((count, 4)), "after",
        estimator=filtered, noise=noise_std * rng.standard_normal((count, 4, 4)),
    )  # fmt: skip
    np.testing.assert_allclose(drawn.state.std(axis=0), spread, rtol=5.0 / np.sqrt(2.0 * count))


# ---------------------------------------------------------------- bad input


@pytest.mark.parametrize("precision", [-1.0, np.nan, np.array([1.0, -2.0])])
def test_negative_precision_weight(precision: float | Array) -> None:
    with pytest.raises(InputError, match=r"precision_weight: must be finite and at least 0"):
        terminal_weight(plane_process(), precision)


def test_precision_matrix_must_fit_the_reading() -> None:
    process = plane_process()
    assert terminal_weight(process, np.diag([1.0, 2.0]), "consistent").shape == (4, 4)
    with pytest.raises(InputError, match=r"\(Q\): must have shape \(4, 4\), got \(2, 2\)"):
        terminal_weight(process, np.diag([1.0, 2.0]))
    with pytest.raises(InputError, match="without negative eigenvalues"):
        terminal_weight(process, np.diag([1.0, 2.0, -1.0, 1.0]))


def test_every_fault_of_the_weights_is_named() -> None:
    weights = PRINTED_R.copy()
    weights[0, 2], weights[2, 0], weights[1, 3] = 5.0, 0.0, 7.0
    with pytest.raises(InputError) as caught:
        plane_process(weights=weights)
    text = str(caught.value)
    assert "adjustment_weights_1[2]: step 1 adjusts part 3, which is installed at step 3" in text
    assert "adjustment_weights_2[3]: step 2 adjusts part 4, which is installed at step 4" in text
    assert "adjustment_weights_3[0]: must be above 0" in text


def test_matrices_that_do_not_fit() -> None:
    good = plane_process()
    fields = {name: getattr(good, name) for name in Process.__slots__}
    skew, negative = good.weight.copy(), good.weight.copy()
    skew[1, 0, 1], negative[2, 3, 3] = 1.0, -1.0
    cases = {
        r"observation \(C\): must have shape": {"observation": np.ones((2, 3))},
        r"weight \(R\): must have shape \(4, 4, 4\), got \(3, 4, 4\)": {"weight": good.weight[:3]},
        r"weight \(R\)\[1\]: .* asymmetric": {"weight": skew},
        r"weight \(R\)\[2\]: .* least eigenvalue -1": {"weight": negative},
        r"transition \(A\): must be finite": {"transition": np.nan * good.transition},
    }
    for message, wrong in cases.items():
        with pytest.raises(InputError, match=message):
            Process(**(fields | wrong))


def test_a_part_cannot_hang_on_a_later_one() -> None:
    with pytest.raises(InputError, match=r"hangs_on\[1\]: gear_1 must hang on the housing"):
        DatumFlowChain((0, 3, 0, 3))


def test_frames_must_be_rotations() -> None:
    with pytest.raises(InputError, match=r"frames\[2\]: must be a rotation"):
        space_process(frames=np.stack([np.eye(3), np.eye(3), -np.eye(3), np.eye(3)]))
    with pytest.raises(InputError, match="frames: must have shape"):
        space_process(frames=np.eye(3))
