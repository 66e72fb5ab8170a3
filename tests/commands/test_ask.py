"""`tolevo ask` and `tolevo tell`: a search by files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import tolevo
from tolevo.errors import InputError
from tolevo.files import read_own_csv

SETTINGS = {"name": "nsga2", "population": 10, "generations": 3}


def stack(**more: Any) -> dict[str, Any]:
    """A stack of two parts: cost 2 + 0.1 / a_t + 0.1 / b_t."""
    part: dict[str, Any] = {"sensitivity": 1.0, "nominal": 5.0, "t_min": 0.01, "t_max": 0.2}
    part["cost"] = {"model": "reciprocal", "a": 1.0, "b": 0.1}
    return {
        "problem": "stack",
        "references": "none",
        "requirement": {"name": "gap", "unit": "mm"},
        "objectives": {"minimise": ["cost", "variation"]},
        "algorithm": SETTINGS,
        "part": [part | {"name": "a"}, part | {"name": "b"}],
        **more,
    }


def answers(designs: pd.DataFrame) -> pd.DataFrame:
    """The bench: cost and variation of designs, by hand."""
    a, b = designs["a_t"].astype(float), designs["b_t"].astype(float)
    return pd.DataFrame({"id": designs["id"], "cost": 2.0 + 0.1 / a + 0.1 / b, "variation": np.hypot(a, b)})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    tolevo.ask(stack(), tmp_path / "search")
    return tmp_path / "search"


def read(folder: Path, name: str) -> pd.DataFrame:
    return read_own_csv(folder / name)


def test_files_find_what_run_finds(folder: Path) -> None:
    for _ in range(int(str(SETTINGS["generations"]))):
        results = answers(read(folder, "designs.csv")).sample(frac=1, random_state=3)
        results.head(4).to_csv(folder / "some.csv", index=False)  # partly, in any order
        tolevo.tell(folder, folder / "some.csv")
        found = tolevo.tell(folder, results)  # the four again: counted once
    assert found.done
    assert found.told["id"].tolist() == list(range(1, 31))
    loop = tolevo.search(stack())
    for _ in range(3):
        x = loop.ask()
        loop.tell(x, answers(x.assign(id=0))[["cost", "variation"]])
    pd.testing.assert_frame_equal(read(folder, "front.csv")[["a_t", "b_t"]], loop.result().front[["a_t", "b_t"]])
    assert not len(read(folder, "designs.csv"))
    more = tolevo.ask(stack(algorithm=SETTINGS | {"generations": 4}), folder)  # the budget may grow
    assert more.designs["id"].tolist() == list(range(31, 41))


def test_evaluations_are_never_exceeded(tmp_path: Path) -> None:
    few = {"name": "nsga2", "population": 10, "evaluations": 14}
    found = tolevo.ask(stack(algorithm=few), tmp_path / "s")
    while not found.done:
        found = tolevo.tell(tmp_path / "s", answers(found.designs))
    assert len(found.told) == 14


def test_failed_and_open_rows(folder: Path) -> None:
    results = answers(read(folder, "designs.csv")).astype(object)
    results.loc[0, "cost"], results.loc[1, ["cost", "variation"]] = "failed", ["", ""]
    notes: list[str] = []
    found = tolevo.tell(folder, results.astype(str), tell=notes.append)
    assert "note: results taken: 9" in notes
    assert 'note: rows without a result yet ("failed" marks one that failed): 1' in notes
    assert found.designs["id"].tolist() == [2]
    assert found.told.set_index("id").loc[1].isna().all()
    assert 1 not in found.front["id"].tolist()


def test_a_column_failed_marks_evaluations_that_failed(folder: Path) -> None:
    results = answers(read(folder, "designs.csv"))
    with pytest.raises(InputError, match=r'column failed: must be true or false for each design, got "perhaps"'):
        tolevo.tell(folder, results.assign(failed=["perhaps"] + [""] * (len(results) - 1)))
    found = tolevo.tell(folder, results.assign(failed=["yes"] + [""] * (len(results) - 1)))
    assert found.told.set_index("id").isna().all(axis=1).sum() == 1
    assert 1 not in found.front["id"].tolist()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.assign(id=t["id"] + 5), "11 was never asked for"),
        (lambda t: t.assign(cost=["x", *t["cost"][1:]]), 'must be a number, or "failed", got x'),
        (lambda t: t.astype(str).assign(cost=["", *t["cost"][1:]]), "column cost: must be a number, .*, got nothing"),
        (lambda t: t.drop(columns="variation"), "variation is missing"),
        (lambda t: t.drop(columns="id"), "id is missing"),
        (lambda t: t.assign(id=t["id"] + 0.5), "must be a whole number"),
        (lambda t: t.assign(a_t=0.123), "is not the design 1 that was asked for"),
        (lambda t: pd.concat([t, t.head(1).assign(cost=1.0)], ignore_index=True), "contradicts the result of design 1"),
    ],
)
def test_faults_write_nothing(folder: Path, change: Callable[[pd.DataFrame], pd.DataFrame], message: str) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(InputError, match=message):
        tolevo.tell(folder, change(answers(read(folder, "designs.csv"))))
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_results_in_other_units_are_faults(folder: Path) -> None:
    before = read_own_csv(folder / "told.csv")
    results = answers(read(folder, "designs.csv")).rename(columns={"variation": "variation [um]"})
    results.to_csv(folder / "um.csv", index=False)
    with pytest.raises(InputError, match=r'um\.csv: column variation .* stated in "um", but variation is in "mm"'):
        tolevo.tell(folder, folder / "um.csv")
    pd.testing.assert_frame_equal(read_own_csv(folder / "told.csv"), before)


def test_columns_of_designs_that_results_need_not_hold(tmp_path: Path) -> None:
    found = tolevo.ask(stack(columns={"Nabe": "a_t"}), tmp_path / "s")
    assert len(tolevo.tell(tmp_path / "s", answers(found.designs)).told) == len(found.designs)


def test_other_searches_and_directories_are_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds a search with another seed"):
        tolevo.ask(stack(seed=9), folder)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="is not empty"):
        tolevo.ask(stack(), tmp_path / "mine")
    with pytest.raises(InputError, match="holds no search that was asked"):
        tolevo.tell(tmp_path / "mine", pd.DataFrame({"id": [1]}))
    with pytest.raises(InputError) as caught:
        tolevo.tell(tmp_path / "mine", tmp_path / "none.csv")
    assert [fault.message.partition(":")[0] for fault in caught.value.faults] == [
        "holds no search that was asked",
        "does not exist",
    ]
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    for resume in (False, True):  # what a bench has measured cannot be computed again
        with pytest.raises(InputError, match="holds a search of `tolevo ask`, which no other command continues"):
            tolevo.run(stack(), folder, overwrite=not resume, resume=resume)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    with pytest.raises(InputError, match="evaluates designs itself"):
        tolevo.ask(stack(algorithm={"name": "exact"}), tmp_path / "exact")


CALLS = ("open", "replace", "fsync", "unlink", "ftruncate")
"""Calls of the system before which a process is killed."""


def killed(moment: int, act: Callable[[], object]) -> bool:
    """Run `act` in a forked process that is killed before its call number `moment`; whether it was."""
    child = os.fork()
    if child == 0:
        left = [moment]

        def counting(call: Callable[..., Any]) -> Callable[..., Any]:
            def wrapped(*arguments: Any, **options: Any) -> Any:
                left[0] -= 1
                if left[0] < 0:
                    os.kill(os.getpid(), 9)
                return call(*arguments, **options)

            return wrapped

        for name in CALLS:
            setattr(os, name, counting(getattr(os, name)))
        try:
            act()
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -9


def test_killed_at_twenty_moments_nothing_is_lost_nor_counted_twice(tmp_path: Path) -> None:
    """A bench that repeats each command until it has ended; each is killed at every moment in turn."""
    clean, killed_often = tmp_path / "clean", tmp_path / "killed"
    tolevo.ask(stack(), clean)
    kills = 0
    for moment in range(20):
        if not killed(moment, lambda: tolevo.ask(stack(), killed_often)):
            break
        kills += 1
    tolevo.ask(stack(), killed_often)
    for _ in range(2):
        results = answers(read(clean, "designs.csv"))
        told = read(killed_often, "told.csv")
        for moment in range(20):
            if not killed(moment, lambda results=results: tolevo.tell(killed_often, results.head(6))):  # type: ignore[misc]
                break
            kills += 1
            after = read(killed_often, "told.csv")
            assert after["id"].is_unique
            assert set(told["id"]) <= set(after["id"])  # nothing is lost
            assert len(after) in (len(told), len(read(clean, "told.csv")) + 6)  # a table is taken whole or not
            told = after
        tolevo.tell(killed_often, results)
        tolevo.tell(clean, results)
        for name in ("designs.csv", "told.csv", "front.csv", "config.toml"):
            assert (clean / name).read_bytes() == (killed_often / name).read_bytes()
    assert kills >= 20
