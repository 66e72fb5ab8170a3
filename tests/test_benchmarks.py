"""The exact fronts that the comparison measures against, and how it measures."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from scipy.optimize import NonlinearConstraint, minimize

pytest.importorskip("benchmarks.task", reason="the benchmarks are not shipped")
pytestmark = pytest.mark.source_tree

from benchmarks.task import Array, OutOfTime, Recorder, Task  # noqa: E402
from benchmarks.tasks.cost_rss import B, S, cost_rss  # noqa: E402
from benchmarks.tasks.mixed_process import PART, PROCESSES, mixed_process  # noqa: E402
from benchmarks.tasks.mixed_process import A as PROCESS_A  # noqa: E402
from benchmarks.tasks.mixed_process import B as PROCESS_B  # noqa: E402
from benchmarks.tasks.mixed_process import S as PART_S  # noqa: E402


def least(b: Array, s: Array, variation: float) -> float:
    """Least sum b/t at a variation, by SLSQP in log t."""

    def cost(u: Array) -> float:
        return float((b / np.exp(u)).sum())

    def slope(u: Array) -> Array:
        return -b / np.exp(u)

    found = minimize(
        cost,
        np.full(len(b), np.log(variation / np.sqrt((s**2).sum()))),
        jac=slope,
        constraints=NonlinearConstraint(
            lambda u: ((s * np.exp(u) / variation) ** 2).sum(), -np.inf, 1.0
        ),
        bounds=[(math.log(0.005), math.log(0.1))] * len(b),
        method="SLSQP",
        tol=1e-12,
    )
    return float(found.fun)


@pytest.mark.parametrize("variables", [9, 12])
@pytest.mark.parametrize("at", [0.1, 0.5, 0.9])
def test_front_of_cost_rss_is_that_of_slsqp(variables: int, at: float) -> None:
    task = cost_rss(variables)
    fixed = task.evaluate(np.full((1, variables), 1e12))[0, 0]
    cost, variation = task.front[int(at * len(task.front))]
    assert cost - fixed == pytest.approx(least(B[:variables], S[:variables], variation), rel=1e-6)


@pytest.mark.parametrize("at", [0.05, 0.3, 0.7, 0.97])
def test_front_of_mixed_process_is_the_best_of_36(at: float) -> None:
    front = mixed_process().front
    cost, variation = front[np.argsort(front[:, 1])][int(at * len(front))]
    sets = list(product(*(range(n) for n in PROCESSES)))
    best = min(
        PROCESS_A[PART, one].sum() + least(PROCESS_B[PART, one], PART_S, variation) for one in sets
    )
    assert len(sets) == 36
    assert cost == pytest.approx(best, rel=1e-6)


def square(x: Array) -> Array:
    return np.stack([x[:, 0], 1.0 - x[:, 0]], axis=1)


def test_recorder_finds_the_evaluation_that_reached_the_level() -> None:
    """Areas up to (1.1, 1.1), by hand; the front of (0, 1), (0.5, 0.5), (1, 0) has 0.46."""
    front = square(np.array([[0.0], [0.5], [1.0]]))
    task = Task("line", np.zeros(1), np.ones(1), square, front, "")
    recorder = Recorder(task, np.inf)
    for x in ([0.0], [2.0]), ([3.0],), ([0.5], [0.25], [1.0]):
        recorder.batch(np.array(x))
    areas = [0.11, 0.11, 0.11, 0.41, 0.4725, 0.5225]
    shares = np.array(areas) / 0.46
    for level in (0.2, 0.8, 0.9, 1.1):
        count, seconds = recorder.reached(level)
        assert count == 1 + int(np.argmax(shares >= level))
        assert seconds == recorder.times[0 if count < 3 else 2]
    assert recorder.reached(1.2) == (np.inf, np.inf)


def test_recorder_ends_a_run_that_is_out_of_time() -> None:
    task = Task("line", np.zeros(1), np.ones(1), square, square(np.zeros((1, 1))), "")
    with pytest.raises(OutOfTime):
        Recorder(task, 0.0).one(np.zeros(1))
