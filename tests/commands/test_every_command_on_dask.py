"""Every command on a Dask scheduler: the same bytes as in one process."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from tests.small_jobs import CLAIMS as ONE_CLAIM
from tests.small_jobs import EXCEED, GAP
from tolevo import dask_cluster
from tolevo.algorithms.checkpoint import Checkpoint
from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.cli import app
from tolevo.commands.run.front import Designs
from tolevo.commands.run.references import SideSearch
from tolevo.commands.run.run import Sides
from tolevo.errors import InputError
from tolevo.execution import Execution, executor_of
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.settings import Settings

pytestmark = pytest.mark.usefixtures("unrendered")

distributed = pytest.importorskip("distributed")

RUN = """
problem = "rv_backlash"
seed = 4
[parameters]
reading = "printed"
[algorithm]
name = "nsga2"
population = 12
generations = 3
"""
CLAIMS = ONE_CLAIM + EXCEED


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A scheduler with two workers, threads of this process: what they are sent is pickled."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, protocol="tcp://", host="127.0.0.1",
        dashboard_address=None,
    ) as cluster:  # fmt: skip
        yield cluster.scheduler_address


def tolevo(*words: object) -> Result:
    found = CliRunner().invoke(app, [str(word) for word in words])
    assert found.exit_code == 0, found.output
    return found


def test_side_searches_of_a_run(address: str, tmp_path: Path) -> None:
    """The searches beside the main one: in this process, in one beside it, and on the scheduler."""
    problem, budget = RvBacklash(), Budget(generations=2)
    searches = tuple(
        SideSearch(f"{seed}", problem, NSGA2(population=8), budget, seed, relaxed=False) for seed in range(3)
    )
    found = []
    for at, where in enumerate((Execution(1), Execution(2), Execution(dask=address))):
        with Sides(searches, where, Checkpoint(tmp_path / str(at), "")) as sides:
            sides.finish()
            found.append(sides.fronts())
    for side in searches:
        first, *others = (fronts[side] for fronts in found)
        assert first is not None
        for other in others:
            assert other is not None
            pd.testing.assert_frame_equal(first, other, check_exact=True)


def test_the_designs_of_a_search(address: str) -> None:
    problem = RvReducer(Settings(parameters={"search_units": 24, "search_positions": 7}))
    found = []
    for where in (Execution(1), Execution(dask=address)):
        with Designs(problem, where, lambda: 0) as designs:
            found.append(search(problem, NSGA2(population=32), Budget(generations=2), 3,
                                shared=designs.results))  # fmt: skip
            assert designs.helpers == (2 if where.dask else 0)
    for name in ("x", "f", "miss"):
        np.testing.assert_array_equal(*(getattr(one, name) for one in found))


def test_evaluate_and_simulate(address: str, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(RUN, encoding="utf-8")
    text = tolevo("template", "designs", "--config", tmp_path / "c.toml").stdout
    (tmp_path / "d.csv").write_text(text + text.partition("\n")[2] * 60, encoding="utf-8")
    for name, where in (("a", ()), ("b", ("--dask", address, "--block-rows", 64))):
        tolevo("evaluate", tmp_path / "c.toml", tmp_path / "d.csv", "--out",
               tmp_path / f"{name}.csv", "--quiet", *where)  # fmt: skip
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_gap(address: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    torque = rng.uniform(-400.0, 400.0, 90)
    te = 0.25 * torque + rng.normal(0.0, 2.0, 90)
    pd.DataFrame({"torque": torque, "te": te, "te_predicted": 0.2 * torque}).to_csv(tmp_path / "data.csv", index=False)
    (tmp_path / "gap.toml").write_text(GAP, encoding="utf-8")
    for name, where in (("a", ("--workers", 1)), ("b", ("--dask", address))):
        tolevo("gap", tmp_path / "gap.toml", tmp_path / "data.csv", "--out", tmp_path / name,
               "--quiet", *where)  # fmt: skip
    assert (tmp_path / "a/gap.json").read_bytes() == (tmp_path / "b/gap.json").read_bytes()


def test_reproduce(address: str, tmp_path: Path) -> None:
    verdicts = []
    (tmp_path / "paper.toml").write_text(CLAIMS, encoding="utf-8")
    for name, where in (("a", ("--workers", 1)), ("b", ("--dask", address))):
        out = tmp_path / name
        tolevo("reproduce", tmp_path / "paper.toml", "--out", out, "--quiet", *where)
        verdicts.append(json.loads((out / "claims.json").read_text(encoding="utf-8")))
    assert verdicts[0] == verdicts[1]


def test_workers_of_another_version_are_refused(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both versions are named, and nothing is written."""
    own = version("tolevo")
    monkeypatch.setattr(dask_cluster, "version", lambda name: "9.9.9")
    with pytest.raises(InputError) as caught:
        executor_of(1, address)
    assert f"have tolevo {own}, this is tolevo 9.9.9" in str(caught.value)
    (tmp_path / "c.toml").write_text(RUN, encoding="utf-8")
    words = ["run", tmp_path / "c.toml", "--out", tmp_path / "o", "--dask", address]
    ended = CliRunner().invoke(app, [str(word) for word in words])
    assert ended.exit_code == 2
    assert "9.9.9" in ended.stderr
    assert not (tmp_path / "o").exists()
