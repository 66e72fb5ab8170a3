"""Bounds, gaps and exact references in the files of a run."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

from tests.small_jobs import output_of
from tolevo.algorithms.exact.bounds import Proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.commands.run.proofs import are_informative_bounds, exact_front
from tolevo.configuration.reader import read

pytestmark = pytest.mark.usefixtures("unrendered")

A = np.array([2.0, 1.5, 1.0, 0.5])
B = np.array([0.04, 0.09, 0.01, 0.16])
S = np.array([1.0, 2.0, 0.5, 1.0])


def config(folder: Path, algorithm: str, method: str = "rss", more: str = "") -> Path:
    text = f'problem = "stack"\nseed = 3\n{more}\n[algorithm]\n{algorithm}\n'
    text += f'[requirement]\nunit = "mm"\nmethod = "{method}"\n'
    for at in range(4):
        text += (f'[[part]]\nname = "p{at}"\nsensitivity = {S[at]}\nt_min = 0.01\nt_max = 0.4\n'
                 f'cost = {{ model = "reciprocal", a = {A[at]}, b = {B[at]} }}\n')  # fmt: skip
    folder.mkdir(exist_ok=True)
    (folder / "c.toml").write_text(text, encoding="utf-8")
    return folder / "c.toml"


def run(configuration: Path, *arguments: object) -> tuple[pd.DataFrame, dict[str, object], Path]:
    out = configuration.parent / f"out{len(arguments)}"
    given = ["run", configuration, "--out", out, "--quiet", *arguments]
    output_of(*given)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    return pd.read_csv(out / "front.csv"), summary, out


def cheapest(limit: float) -> float:
    """Least cost with sqrt(sum (S t)^2) <= limit by Lagrange, where no end of a range binds."""

    def t(log_price: float) -> np.ndarray:
        return np.asarray(np.clip((B / (2.0 * np.exp(log_price) * S**2)) ** (1 / 3), 0.01, 0.4))

    root = brentq(lambda x: float(np.linalg.norm(S * t(x))) - limit, -20.0, 30.0, xtol=1e-14)
    return float(np.sum(A + B / t(root)))


NSGA2 = 'name = "nsga2"\npopulation = 20\ngenerations = 15'
LIMITED = "[limits]\nvariation = 0.3"


@pytest.fixture(scope="module")
def evolved(tmp_path_factory: pytest.TempPathFactory) -> tuple[pd.DataFrame, dict[str, object], Path]:
    return run(config(tmp_path_factory.mktemp("run"), NSGA2, more=f'references = "ga"\n{LIMITED}'))


def test_bounds_are_those_of_lagrange(evolved: tuple[pd.DataFrame, dict[str, object], Path]) -> None:
    front = evolved[0]
    expected = [cheapest(min(0.3, limit)) for limit in front["variation"]]
    np.testing.assert_allclose(front["bound"], expected, rtol=1e-8)
    assert np.all(front["bound"] <= front["cost"])
    gap = 100.0 * (front["cost"] / front["bound"] - 1.0)
    np.testing.assert_allclose(front["gap_percent"], gap, rtol=1e-6, atol=1e-9)
    assert np.all(front["gap_percent"] >= 0.0)
    assert front["gap_percent"].median() > 1e-3


def test_last_columns_are_bound_gap_and_knee(evolved: tuple[pd.DataFrame, dict[str, object], Path]) -> None:
    assert list(evolved[0].columns[-3:]) == ["bound", "gap_percent", "knee"]


def test_summary_states_quality_and_form(evolved: tuple[pd.DataFrame, dict[str, object], Path]) -> None:
    front, summary, out = evolved
    assert summary["gap_percent_median"] == pytest.approx(front["gap_percent"].median())
    assert summary["gap_percent_max"] == pytest.approx(front["gap_percent"].max())
    assert "its root sum square" in str(summary["bound_form"])
    ratio = float(str(summary["hypervolume_ratio"]))
    assert 0.5 < ratio <= 1.0001
    convergence = pd.read_csv(out / "convergence.csv")
    ratios = convergence["hypervolume_ratio"].to_numpy(dtype=float)
    assert ratios.max() <= 1.0001
    assert ratios[-1] == pytest.approx(ratio)
    known = ratios > 0.0
    whole = convergence["hypervolume"].to_numpy(dtype=float)[known] / ratios[known]
    np.testing.assert_allclose(whole, whole[0])


def test_exact_reference_stands_beside_the_one_by_ga(evolved: tuple[pd.DataFrame, dict[str, object], Path]) -> None:
    table = pd.read_csv(evolved[2] / "references.csv")
    rows = {str(row["label"]): row for row in table.to_dict("records")}
    exact = rows["exact, least cost within the limits"]
    assert exact["cost"] == pytest.approx(cheapest(0.3), rel=1e-9)
    assert exact["bound"] == pytest.approx(exact["cost"], rel=1e-9)
    assert exact["feasible"]
    assert rows["GA, least cost within the limits"]["cost"] >= exact["cost"] * (1.0 - 1e-12)


def test_front_of_exact_has_no_gap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def again(*given: object) -> None:
        raise AssertionError("the run has solved its front already")

    monkeypatch.setattr("tolevo.commands.run.proofs.exact_vectors", again)
    front, summary, _ = run(config(tmp_path, 'name = "exact"\npoints = 1000'))
    assert len(front) >= 990
    assert front["gap_percent"].max() < 1e-5
    ratio = float(str(summary["hypervolume_ratio"]))
    assert 0.9995 <= ratio <= 1.0001


def test_known_points_of_a_front_measure_as_those_solved_anew(tmp_path: Path) -> None:
    """Points between 300 known ones on the chords of their tolerances, against 4000 solved ones."""
    problem = read(config(tmp_path, 'name = "exact"')).problem
    assert problem is not None
    x = search(problem, Exact(points=300), Budget(), 1).x
    anew, known = exact_front(problem), exact_front(problem, x)
    assert anew is not None and known is not None
    assert known.hypervolume == pytest.approx(anew.hypervolume, rel=1e-5)
    assert exact_front(problem, 0.5 * (x + x.mean(axis=0))) is None  # proves to be no optimum


@pytest.mark.parametrize(
    ("method", "more", "statement"),
    [("rss", '[objectives]\nminimise = ["variation"]', "nothing is proven: cost is not an")],
)
def test_where_nothing_is_proven_bounds_are_empty(method: str, more: str, statement: str, tmp_path: Path) -> None:
    front, summary, _ = run(config(tmp_path, 'name = "exact"', method, more))
    assert len(front) and front["bound"].isna().all() and front["gap_percent"].isna().all()
    assert str(summary["bound_form"]).startswith(statement)
    assert summary["hypervolume_ratio"] is None
    assert any(statement in str(note) for note in summary["notes"])  # type: ignore[attr-defined]


def test_limits_that_a_bound_leaves_out_are_named(tmp_path: Path) -> None:
    more = "[limits]\nvariation = { min = 0.1, max = 0.3 }"
    front, summary, _ = run(config(tmp_path, NSGA2, more=more))
    assert "limits left out: variation" in str(summary["bound_form"])
    assert np.all(front["bound"] <= front["cost"])


def test_ratio_is_not_given_for_three_objectives(tmp_path: Path) -> None:
    more = '[objectives]\nminimise = ["cost", "variation", "worst_case"]'
    front, summary, _ = run(config(tmp_path, 'name = "exact"\npoints = 40', more=more))
    assert summary["hypervolume_ratio"] is None
    assert front["gap_percent"].max() < 1e-4


@pytest.mark.parametrize("algorithm", ['name = "exact"\npoints = 8', 'name = "hybrid"\ngenerations = 3'])
def test_same_configuration_same_bytes(algorithm: str, tmp_path: Path) -> None:
    _, _, first = run(config(tmp_path / "a", algorithm, more=LIMITED), "--workers", 1)
    _, _, again = run(config(tmp_path / "b", algorithm, more=LIMITED), "--workers", 1)
    _, _, other = run(config(tmp_path / "d", algorithm, more=LIMITED), "--workers", 2)
    for name in ("front.csv", "references.csv"):
        content = (first / name).read_bytes()
        assert content == (again / name).read_bytes()
        assert content == (other / name).read_bytes()


def test_a_bound_without_some_limits_says_nothing_of_points_far_above_it() -> None:
    far, near = np.array([30.0, 40.0, np.nan]), np.array([20.0, np.nan])
    kept = Proof(np.ones(3), "least cost")
    without = Proof(np.ones(3), "least cost", ("yield_percent",))
    front: Any = SimpleNamespace(n_obj=2, limits=[SimpleNamespace(name="yield_percent", count=1)])
    assert are_informative_bounds(front, kept, far) and are_informative_bounds(front, kept, near)
    assert not are_informative_bounds(front, without, far) and are_informative_bounds(front, without, near)
    least: Any = SimpleNamespace(n_obj=1, limits=front.limits)  # the only limit left out: the loosest tolerances
    assert are_informative_bounds(least, kept, near) and not are_informative_bounds(least, without, near)
    assert are_informative_bounds(least, without, np.array([0.0]))  # the loosest tolerances keep the limit as well
