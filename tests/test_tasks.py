"""The tasks that agents and tools are scored on: their right answers, the scorer, and a part of the run."""

from __future__ import annotations

import copy

import numpy as np
import pytest

pytest.importorskip("benchmarks.task", reason="the benchmarks are not shipped")
pytestmark = pytest.mark.source_tree

from benchmarks.tasks.answers import _bound, _tolerances, allocation, graded, part  # noqa: E402
from benchmarks.tasks.rivals import by_grades, by_slsqp, by_tolevo  # noqa: E402
from benchmarks.tasks.score import Raw, conforms, cost_of, score, tasks, verdict  # noqa: E402

TASKS = tasks()
ALLOCATIONS = [task for task in TASKS if "model" in task]


def test_right_answers_score_and_damaged_ones_do_not() -> None:
    assert len(TASKS) == 60
    right = {task["id"]: task["answer"] for task in TASKS}
    assert score(right) == {"right": 60, "wrong": 0, "refused": 0, "not as claimed": 0}
    assert score({}) == {"right": 5, "wrong": 0, "refused": 55, "not as claimed": 0}  # five have no allocation
    for task in TASKS:
        answer = copy.deepcopy(task["answer"])
        if "value" in answer:
            answer["value"] += 2.0 * task["within"]
        elif "t" in answer:
            answer["cost"] *= 0.99  # cheaper than it is
        else:
            answer = {"cost": 1.0, "t": {p["name"]: p["ways"][0]["low"] for p in task["model"]["parts"]}}
        assert verdict(task, answer)[0] == "wrong"
        if "t" in answer:
            assert verdict(task, answer)[1] is False


@pytest.mark.parametrize("task", ALLOCATIONS, ids=[task["id"] for task in ALLOCATIONS])
def test_no_drawn_allocation_is_cheaper_than_the_right_one(task: Raw) -> None:
    """Drawn within the ranges, and near the answer, where most of what could be cheaper lies."""
    rng, model, answer = np.random.default_rng(1), task["model"], task["answer"]
    for _ in range(300):
        t = {}
        for p in model["parts"]:
            ways = p["ways"]
            if "t" in answer and rng.random() < 0.8:
                ways = [w for w in ways if w["low"] * (1 - 1e-9) <= answer["t"][p["name"]] <= w["high"] * (1 + 1e-9)]
            way = ways[rng.integers(len(ways))]
            t[p["name"]] = float(np.exp(rng.uniform(np.log(way["low"]), np.log(way["high"]))))
            if "t" in answer and way["low"] < way["high"] and rng.random() < 0.7:
                t[p["name"]] = float(
                    np.clip(answer["t"][p["name"]] * rng.lognormal(0.0, 0.05), way["low"], way["high"])
                )
        if conforms(model, t):
            assert "t" in answer
            assert cost_of(model, t) >= answer["cost"] * (1.0 - 1e-5)


def test_closed_forms_of_the_answers() -> None:
    """Of limits on sum t and on sum t^2, t ~ b^(1/2) and b^(1/3) (Lagrange); grades by hand."""
    parts = [part("a", 0.0, 1.0, 1e-6, 1e6), part("b", 0.0, 64.0, 1e-6, 1e6)]
    ways = tuple(p["ways"][0] for p in parts)
    assert _tolerances(parts, ways, [_bound("worst_case", 9.0)]) == pytest.approx([1.0, 8.0])
    assert _tolerances(parts, ways, [_bound("rss", 17.0**0.5)]) == pytest.approx([1.0, 4.0])
    two = allocation("grades", [graded("a", 25), graded("b", 25)], _bound("worst_case", 0.021))
    assert two["answer"]["cost"] == 6.0  # IT7 and IT7: just the limit


def test_rivals_are_feasible_as_they_claim() -> None:
    for task in ALLOCATIONS[:20:4]:
        for rival in (by_grades, by_slsqp):
            assert verdict(task, rival(task))[1] in (True, None)


def test_tolevo_is_right_on_some_through_its_tools() -> None:
    pytest.importorskip("mcp")
    some = [TASKS[at] for at in (1, 22, 38, 43)]
    assert score(by_tolevo(some), some) == {"right": 4, "wrong": 0, "refused": 0, "not as claimed": 0}
