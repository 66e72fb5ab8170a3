"""A bound on the condition that the other objective is convex, against functions whose convexity is known."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import tolevo
from tolevo.algorithms.exact import conditional
from tolevo.algorithms.exact.conditional import ENDS, Held, convexity, least_value
from tolevo.problems.tolerance_problem import ToleranceProblem

STACK: dict[str, Any] = {
    "problem": "stack",
    "objectives": {"minimise": ["cost", "variation"]},
    "requirement": {"name": "gap", "unit": "mm", "method": "rss"},
    "part": [
        {"name": name, "nominal": 10.0, "unit": "mm", "sensitivity": 1.0, "t_min": 0.01, "t_max": 0.5,
         "cost": {"model": "reciprocal", "a": 1.0, "b": 0.1}}
        for name in "abc"
    ],
}  # fmt: skip


@pytest.fixture
def problem() -> ToleranceProblem:
    configured = tolevo.read(STACK).problem
    assert configured is not None
    return configured


def values_by(function: Callable[[np.ndarray], float]) -> Any:
    """Q as a function of the search vector, in the place of the model."""

    def shared(_: object, tasks: Sequence[Held]) -> list[np.ndarray]:
        return [np.append(function(task.x), task.x) for task in tasks]

    return shared


POINTS = np.array([[0.02, 0.03, 0.4], [0.1, 0.05, 0.2], [0.3, 0.45, 0.05]])
UNIT = np.ones(2)


def tried(problem: ToleranceProblem, function: Callable[[np.ndarray], float]) -> Any:
    return convexity(problem, POINTS, 1, UNIT, np.random.default_rng(3), values_by(function))


def test_a_convex_function_exceeds_no_chord(problem: ToleranceProblem) -> None:
    found = tried(problem, lambda x: float(np.exp(x).sum() + x @ x))
    assert (found.excess, found.above) == (0.0, 0)
    assert found.chords == ENDS * (ENDS - 1) // 2


def test_a_concave_function_exceeds_every_chord_by_a_quarter_of_its_square(problem: ToleranceProblem) -> None:
    """-x.x lies |a - b|^2/4 above the middle of its chord; all ends lie in the ranges of the points."""
    seen = list[np.ndarray]()

    def concave(x: np.ndarray) -> float:
        seen.append(x)
        return -float(x @ x)

    found = tried(problem, concave)
    ends = np.array(seen[:ENDS])
    longest = max(float(np.sum((a - b) ** 2)) for a in ends for b in ends)
    assert found.above == found.chords
    assert found.excess == pytest.approx(longest / 4.0, rel=1e-9)
    assert np.all(ends >= POINTS.min(axis=0)) and np.all(ends <= POINTS.max(axis=0))


def test_values_that_keep_no_limit_count_for_nothing(problem: ToleranceProblem) -> None:
    assert tried(problem, lambda x: np.nan) is None


def test_tolerances_are_held(problem: ToleranceProblem) -> None:
    """Without anything to set, Q is the value of the model: the root sum of squares."""
    x = np.array([0.1, 0.2, 0.2])
    np.testing.assert_allclose(least_value(problem, Held(x, UNIT, 1)), [0.3, *x], rtol=1e-12)


def test_the_rest_is_set_to_its_best() -> None:
    """Least backlash over modification and stagger at held tolerances: no value of a scan is less."""
    table = {
        "problem": "rv_reducer", "seed": 1, "references": "none",
        "parameters": {"positions": 11}, "propagation": {"samples": 128},
        "objectives": {"minimise": ["cost", "backlash_max_arcmin"]}, "limits": {"interference_probability": 0.05},
    }  # fmt: skip
    whole = tolevo.read(table).problem
    assert whole is not None
    middle = 0.5 * (whole.xl + whole.xu)
    unit = np.array([10.0, 1.0])
    best = least_value(whole, Held(middle, unit, 1))[0]
    rng, finer = np.random.default_rng(2), whole.finer()
    free = np.array([not (v.tolerance or v.integer) for v in whole.free])
    scanned = np.where(free, whole.xl + rng.random((60, len(middle))) * (whole.xu - whole.xl), middle)
    f, g = finer.searched(scanned)
    kept = np.all(g <= 0.0, axis=1)
    assert np.any(kept)
    assert best <= f[kept, 1].min() * (1.0 + 1e-3)
    assert np.any(f[kept, 1] > best * 1.05)


def test_grades_are_not_mixed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Points of one grade each have no chord."""
    whole = tolevo.read({"problem": "rv_reducer", "limits": {"interference_probability": 0.05}}).problem
    assert whole is not None
    integer = np.array([v.integer for v in whole.free])
    points = np.tile(whole.xu, (3, 1))
    points[:, integer] = np.array([[5.0], [6.0], [7.0]])
    monkeypatch.setattr(conditional, "least_value", None)
    assert convexity(whole, points, 1, UNIT, np.random.default_rng(0), values_by(lambda x: 0.0)) is None
