"""The exact fronts that the comparison measures against, and how it measures."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import NonlinearConstraint, minimize

pytest.importorskip("benchmarks.task", reason="the benchmarks are not shipped")
pytestmark = pytest.mark.source_tree

from benchmarks import compare, dynamics, promised, proven  # noqa: E402
from benchmarks.parts import beyond  # noqa: E402
from benchmarks.peers import tolevo_exact, tolevo_nsga2  # noqa: E402
from benchmarks.task import Array, OutOfTime, Recorder, Task  # noqa: E402
from benchmarks.tasks.cost_rss import B, S, cost_rss  # noqa: E402
from benchmarks.tasks.mixed_process import PART, PARTS, PROCESSES, mixed_process  # noqa: E402
from benchmarks.tasks.mixed_process import A as PROCESS_A  # noqa: E402
from benchmarks.tasks.mixed_process import B as PROCESS_B  # noqa: E402
from benchmarks.tasks.mixed_process import S as PART_S  # noqa: E402
from benchmarks.tasks.rv_backlash import rv_backlash, stored  # noqa: E402
from tolevo.models.rv_reducer.dynamics import tabulate_mesh  # noqa: E402
from tolevo.models.rv_reducer.lost_motion import unit_under_load as loaded_unit  # noqa: E402


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
        constraints=NonlinearConstraint(lambda u: ((s * np.exp(u) / variation) ** 2).sum(), -np.inf, 1.0),
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
    best = min(PROCESS_A[PART, one].sum() + least(PROCESS_B[PART, one], PART_S, variation) for one in sets)
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


@pytest.mark.parametrize("task", [cost_rss(9), mixed_process()], ids=lambda task: str(task.name))
def test_form_and_problem_are_those_of_the_task(task: Task) -> None:
    """Values, slopes and the exact points against the function that all contenders are given."""
    assert task.parts is not None
    assert task.problem is not None
    noted: list[Array] = []
    problem = task.problem().watched(noted.append)
    rng = np.random.default_rng(1)
    x = task.low + (task.high - task.low) * rng.random((20, len(task.low)))
    found = problem.evaluate(x, return_values_of=["F"])
    np.testing.assert_allclose(found, task.evaluate(x), rtol=1e-14)
    np.testing.assert_array_equal(np.vstack(noted), found)
    step, count = 1e-7, len(task.parts.s)
    slopes = problem.gradient(problem.complete(x))
    for at in range(count):
        moved = np.zeros_like(x)
        moved[:, at] = step
        rise = (task.evaluate(x + moved) - task.evaluate(x - moved)) / (2.0 * step)
        for column, name in enumerate(problem.objectives):
            np.testing.assert_allclose(slopes[name][:, at], rise[:, column], rtol=1e-5)


@pytest.mark.parametrize("task", [cost_rss(9), mixed_process()], ids=lambda task: str(task.name))
def test_exact_contender_returns_the_front(task: Task) -> None:
    recorder = Recorder(task, np.inf)
    returned = tolevo_exact.run(recorder, 0, 0)
    ideal, nadir = task.front.min(axis=0), task.front.max(axis=0)
    stored = task.front[np.argsort(task.front[:, 1])]
    cost = np.interp(returned[:, 1], stored[:, 1], stored[:, 0])
    np.testing.assert_allclose(returned[:, 0], cost, atol=1e-4 * (nadir - ideal)[0])
    assert task.share(returned) > 0.9995
    assert recorder.count == len(returned)


def test_designs_that_break_a_limit_lie_beyond_all_others() -> None:
    """In order of their violation; beyond the dearest and the coarsest design as well."""
    f, edge = np.array([[1.0, 2.0], [0.5, 0.5], [0.1, 0.1]]), np.array([10.0, 20.0])
    g = np.array([[-1.0, 0.0], [0.1, -1.0], [0.1, 0.2]])
    np.testing.assert_allclose(beyond(f, g, edge), [[1.0, 2.0], [11.0, 22.0], [13.0, 26.0]])
    task = rv_backlash()
    x = np.random.default_rng(0).uniform(task.low, task.high, (200, len(task.low)))
    values = task.evaluate(np.vstack([task.low, task.high, x]))
    edge = 10.0 * task.front.max(axis=0)
    outside = np.all(values > edge, axis=1)
    assert 0 < outside.sum() < len(values)
    assert np.all(values[~outside] < edge)
    assert task.problem is not None
    noted: list[Array] = []
    task.problem().watched(noted.append).evaluate(x)
    np.testing.assert_array_equal(noted[0], values[2:])


def test_front_of_rv_backlash_is_proven() -> None:
    cost, backlash, bound = stored().T
    assert np.all(np.diff(backlash) > 0.0) and np.all(np.diff(cost) < 0.0)
    gap = cost / bound - 1.0
    assert gap.min() >= 0.0
    assert np.median(gap) < 0.005


def test_true_share_counts_the_area_under_the_chords() -> None:
    """Front y = 1 - x of three points: the triangle has 0.5, with the reference's rim 0.71."""
    front = square(np.array([[0.0], [0.5], [1.0]]))
    task = Task("line", np.zeros(1), np.ones(1), square, front, "")
    assert promised.area(front) == pytest.approx(0.46)
    assert promised.true_share(task, front) == pytest.approx(0.46 / 0.71)


@pytest.mark.parametrize("limit", proven.LIMITS)
def test_branch_and_bound_finds_the_best_of_all_sets(limit: float) -> None:
    assert proven.proven(limit)[0] == pytest.approx(proven.of_all_sets(PARTS, limit), rel=1e-12)


def test_a_written_limit_is_the_same_problem() -> None:
    """The stack of the configuration and the function of the task agree on cost and variation."""
    problem = proven.limited(0.06)
    x = np.array([[0.01, 0.02, 0.03, 0.04, 2.0, 1.0, 0.0, 1.0]])
    order = [0, 4, 1, 5, 2, 6, 3, 7]
    names = [variable.name for variable in problem.free]
    assert names == [f"part_{part}_{kind}" for part in range(4) for kind in ("t", "process")]
    found = problem.outputs_of(problem.complete(x[:, order]))
    expected = mixed_process().evaluate(x)[0]
    assert found["cost"][0] == pytest.approx(expected[0])
    assert found["variation"][0] == pytest.approx(expected[1])


def test_a_seed_counts_where_cost_and_processes_are_those_of_the_optimum() -> None:
    case = proven.Case("written", proven.limited, (0.06,), 1e-9, True)
    assert proven.run(case, 0.06, 1).optimal
    assert not proven.run(replace(case, near=0.0), 0.06, 1).optimal


def test_figures_say_whether_they_are_met() -> None:
    task = cost_rss(9)
    slow, fast, faster = (
        compare.Measured(((1000.0, cpu), (np.inf, np.inf)), 0.99, cpu / 1e4) for cpu in (1.0, 0.05, 0.002)
    )
    runs = {"pymoo_nsga2": slow, "tolevo_nsga2": fast, "tolevo_exact": fast}
    results = {(task.name, name): [run] for name, run in runs.items()}
    share, ratio = promised.exact(results, task)
    assert share.met
    assert not ratio.met
    assert ratio.value == "20"
    results[task.name, "tolevo_exact"] = [faster]
    assert [figure.met for figure in promised.exact(results, task)] == [True, True]
    each, returned = promised.engines(results, [task])
    assert each.met
    assert each.value == "20.0"
    assert returned.met is None  # one seed has no range


def test_equal_cpu_time_is_that_of_every_contender_and_goes_on_from_a_file(tmp_path: Path) -> None:
    task, path = cost_rss(9), tmp_path / "runs.jsonl"
    found = {"tolevo_exact": tolevo_exact, "tolevo_nsga2": tolevo_nsga2}
    effort = compare.Effort(seeds=2, evaluations=compare.ENOUGH, equal={task.name: 0.05})
    assert {effort.limit(module, task) for module in found.values()} == {0.05}  # `exact` is not left uncut
    first = list(compare.rounds(found, [task], effort, path))
    assert [name for _, name, _ in first] == 2 * ["tolevo_exact", "tolevo_nsga2"]
    stopped = replace(effort, minutes=-1.0)  # nothing is begun
    again = list(compare.rounds(found, [task], stopped, path))
    assert [run.seen for _, _, run in again] == [run.seen for _, _, run in first]
    assert not list(compare.rounds(found, [task], replace(stopped, equal={task.name: 0.1}), path))
    results = {(task.name, name): [run for _, of, run in first if of == name] for name in found}
    lines = compare.equal_table([task], results, dict(zip(found, "ab", strict=True)), effort.equal)
    head, _, best, second = lines.split("\n")
    assert head == f"| | {task.name}, 2 seeds of 0.05 s: hypervolume, %; CPU s to 99 % |"
    assert best.startswith("| a | 99.9")
    assert second.startswith("| b | ")


def test_right_hand_sides_of_the_dynamics_are_the_mesh() -> None:
    mesh = tabulate_mesh(loaded_unit(dynamics.UNIT).mesh(400), 500.0, nodes=41)
    found = dynamics.numpy_motion(mesh, 3.0, 80.0, 2.0)
    compiled = dynamics.compiled_motion(mesh, 3.0, 80.0, 2.0)
    rng = np.random.default_rng(0)
    for t, twist, rate in rng.uniform([-5.0, -1e-3, -0.1], [5.0, 1e-3, 0.1], (20, 3)):
        both = [one(t, np.array([twist, rate])) for one in (found, compiled)]
        np.testing.assert_allclose(both[0], both[1], rtol=1e-9)
    at = 2.0 * np.pi / 2.0 * 37 / 400  # the time of sample 37
    torque = mesh.torque(np.full((1, 400), 8e-4))[0][0, 37]
    expected = (dynamics.TORQUE - torque - 80.0 * 0.01) / 3.0
    assert found(at, np.array([8e-4, 0.01]))[1] == pytest.approx(expected, rel=1e-9)
