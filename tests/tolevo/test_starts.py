"""`start`: designs that a search begins from, from tables, runs and frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import tolevo
from tolevo.algorithms.archive import nondominated
from tolevo.algorithms.run import Run, values_of
from tolevo.algorithms.search import best_rows, search
from tolevo.algorithms.settings import Budget
from tolevo.errors import InputError


def stack(**more: Any) -> dict[str, Any]:
    """A stack of two parts: cost 2 + 0.1 / a_t + 0.4 / b_t."""
    part = {"sensitivity": 1.0, "nominal": 5.0, "t_min": 0.01, "t_max": 0.2}
    costs = [{"model": "reciprocal", "a": 1.0, "b": b} for b in (0.1, 0.4)]
    return {
        "problem": "stack",
        "references": "none",
        "requirement": {"name": "gap", "unit": "mm"},
        "objectives": {"minimise": ["cost", "variation"]},
        "algorithm": {"name": "nsga2", "generations": 2, "population": 20},
        "part": [part | {"name": "a", "cost": costs[0]}, part | {"name": "b", "cost": costs[1]}],
        **more,
    }


def optimal(count: int) -> pd.DataFrame:
    """Designs of least cost at equal variation: b_t / a_t = 4^(1/3), by Lagrange."""
    t = np.linspace(0.02, 0.1, count)
    return pd.DataFrame({"a_t": t, "b_t": 4.0 ** (1.0 / 3.0) * t})


@pytest.mark.parametrize("name", ["nsga2", "gde3", "random", "hybrid", "exact"])
def test_every_algorithm_begins_with_the_start(name: str) -> None:
    plan = tolevo.read(stack(algorithm={"name": name, "generations": 1}), start=optimal(12)).plan()
    assert plan.start is not None
    seen: list[np.ndarray] = []

    def values(function: Any, tasks: Any) -> Any:
        seen.extend(tasks if function is values_of else [])
        return [function(plan.problem, task) for task in tasks]

    result = search(plan.problem, plan.algorithm, plan.budget, 0, engine=plan.engine, start=plan.start, shared=values)
    designs = result.chosen if len(result.chosen) else result.x
    for x in plan.start:  # none of these is dominated, so that all of them are in the result
        assert np.any(np.all(designs == x, axis=1))


def test_the_first_generation_takes_the_best_and_counts_each_design_once() -> None:
    many = optimal(50)
    plan = tolevo.read(stack(algorithm={"name": "nsga2", "generations": 1, "population": 20}), start=many).plan()
    result = search(plan.problem, plan.algorithm, plan.budget, 0, start=plan.start)
    assert result.evaluations == 50
    few = tolevo.read(stack(), start=many.head(5)).plan()
    assert search(few.problem, few.algorithm, few.budget, 0, start=few.start).evaluations == 40


def test_best_rows_are_feasible_first_and_spread() -> None:
    f = np.column_stack([np.arange(10.0), 9.0 - np.arange(10.0)])
    g = np.full((10, 1), -1.0)
    assert best_rows(f, g, 4).tolist() == [0, 3, 6, 9]
    g[[0, 9], 0] = 1.0, 2.0
    assert best_rows(f, g, 10).tolist()[-2:] == [0, 9]
    assert len(nondominated(f)) == 10


def test_a_run_resumed_from_the_front_of_another_is_no_worse(tmp_path: Path) -> None:
    first = tolevo.run(stack(), tmp_path / "first", seed=1)
    more = optimal(3)
    more.to_csv(tmp_path / "more.csv", index=False)
    merged = stack(start=["first", "more.csv"])
    (tmp_path / "run.toml").write_text(tolevo.read(stack()).toml())
    run = tolevo.run(
        tmp_path / "run.toml", tmp_path / "second", seed=2, start=[tmp_path / "first", tmp_path / "more.csv"]
    )
    assert merged["start"] == ["first", "more.csv"]
    found = run.front[["cost", "variation"]].to_numpy()
    for point in first.front[["cost", "variation"]].to_numpy():
        assert np.any(np.all(found <= point * (1.0 + 1e-12), axis=1))
    notes = run.summary["notes"]
    assert any(f"the search starts from {len(first.front) + 3} designs" in note for note in notes)
    again = tolevo.run(tmp_path / "second" / "config.toml", tmp_path / "third")  # its start is in the file
    assert (tmp_path / "third" / "front.csv").read_bytes() == (tmp_path / "second" / "front.csv").read_bytes()
    assert again.status == "done"


def test_equal_and_infeasible_designs_are_told() -> None:
    start = pd.concat([optimal(3), optimal(3).head(1)])
    run = tolevo.run(stack(limits={"variation": 0.1}), start=start)
    notes = " ".join(run.summary["notes"])
    assert "the search starts from 3 designs" in notes
    assert "designs of start that equal another one are left out: 1" in notes
    assert "2 of them break a limit of this run" in notes
    assert run.front["variation"].max() <= 0.1 * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("a_t,b_t\n0.1,0.1\n0.1,0.3\n", "start: s.csv", "at most 0.2 mm, got 0.3"),
        ("a_t,b_t\n0.1,x\n", "start: s.csv", "x"),
        ("a_t\n0.1\n", "start: s.csv", "b_t is missing"),
        ("a_t [um],b_t [um]\n100,100\n", "start: s.csv", 'is stated in "um", but a_t is in "mm"'),
        ("a_t,b_t\n", "start", "row"),
    ],
)
def test_bad_starts_are_faults_with_their_rows(tmp_path: Path, text: str, place: str, message: str) -> None:
    (tmp_path / "s.csv").write_text(text)
    (tmp_path / "run.toml").write_text(tolevo.read(stack()).toml())
    with pytest.raises(InputError, match=r"(?s)" + message.replace("(", ".")) as caught:
        tolevo.read(tmp_path / "run.toml", ["start=s.csv"])
    assert caught.value.faults[0].place.startswith(place)


def test_other_faults_of_a_start(tmp_path: Path) -> None:
    for start in (3, [], ["nowhere.csv"], {"a_t": [0.1], "b_t": [0.1, 0.1]}, {"a_t": 0.1, "b_t": 0.1}):
        with pytest.raises(InputError, match="start"):
            tolevo.read(stack(start=start))
    with pytest.raises(InputError, match=r"whose columns have no names: give pandas\.DataFrame"):
        tolevo.read(stack(), start=np.array([[0.1, 0.1]]))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"holds no front\.csv: name the directory of a run"):
        tolevo.read(stack(), start=tmp_path)
    with pytest.raises(InputError, match="must be at least 3, the designs of start"):
        tolevo.read(stack(algorithm={"name": "nsga2", "evaluations": 2}), start=optimal(3))


def test_units_in_the_names_of_columns_are_converted(tmp_path: Path) -> None:
    """A table in millimetres for variables in micrometres."""
    names = [variable.name for variable in tolevo.read({"problem": "pose_accuracy"}).plan().problem.free]
    problem = tolevo.read({"problem": "pose_accuracy"}).plan().problem
    middle = 0.5 * (problem.xl + problem.xu)
    row = {
        n.replace("_um", " [mm]"): v * (1e-3 if n.endswith("_um") else 1.0) for n, v in zip(names, middle, strict=True)
    }
    pd.DataFrame([row]).to_csv(tmp_path / "s.csv", index=False)
    start = tolevo.read({"problem": "pose_accuracy"}, start=tmp_path / "s.csv").plan().start
    assert start is not None
    np.testing.assert_allclose(start[0], middle, rtol=1e-12)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_start_from_the_front_takes_a_fifth_of_the_evaluations(seed: int) -> None:
    """Least evaluations to 99 % of the hypervolume of the exact front."""
    part = {"sensitivity": 1.0, "nominal": 5.0, "t_min": 0.01, "t_max": 0.2}
    costs = [{"model": "reciprocal", "a": 1.0, "b": 0.1 * at} for at in range(1, 7)]
    parts = [part | {"name": f"p{at}", "cost": cost} for at, cost in enumerate(costs)]
    plan = tolevo.read(stack(part=parts, algorithm={"name": "nsga2", "generations": 100, "population": 40})).plan()
    exact = tolevo.run(stack(part=parts, algorithm={"name": "exact", "points": 200})).front[plan.problem.names]
    start = tolevo.read(stack(part=parts), start=exact.iloc[::4]).plan().start
    whole = Run(plan.problem, Budget(), 0)
    whole.evaluate(exact.to_numpy())
    target = 0.99 * whole.history[-1].hypervolume

    def needed(start: Any) -> int:
        result = search(plan.problem, plan.algorithm, plan.budget, seed, start=start)
        reached = [state.evaluations for state in result.history if state.hypervolume >= target]
        return reached[0] if reached else result.evaluations

    warm = needed(start)
    assert warm <= 100  # it does reach the target
    assert 5 * warm <= needed(None)
