"""The configurations of the documentation on costs and machines run as they stand."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read

EXAMPLES = Path(__file__).resolve().parent.parent / "docs" / "examples"


@pytest.mark.source_tree
@pytest.mark.parametrize("name", ["pin", "machines"])
def test_the_example_runs_and_is_proven(name: str, tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / f"{name}.toml", tmp_path)
    costs = (EXAMPLES / "costs.csv").read_text(encoding="utf-8")
    (tmp_path / "costs.csv").write_text(costs, encoding="cp1252")
    problem = read(tmp_path / f"{name}.toml").problem
    assert problem is not None
    found = search(problem, Exact(), Budget(), 1)
    designs = problem.complete(found.x)
    values = problem.outputs_of(designs)
    assert len(designs) == 1 and np.all(problem.violations(designs, values) <= 0.0)
    cost = values["cost"]
    assert proof(problem, {"cost": cost}, 1).bound[0] > cost[0] * (1.0 - 1e-5)
    assert next(one.unit for one in problem.outputs if one.name == "cost") == "EUR"
