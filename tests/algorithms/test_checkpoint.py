"""Saved searches, and what cannot be saved."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
import pytest

from tolevo.algorithms.checkpoint import Checkpoint
from tolevo.algorithms.gde3 import GDE3
from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.random_search import RandomSearch
from tolevo.algorithms.run import Progress
from tolevo.algorithms.search import SearchResult, search
from tolevo.algorithms.settings import AlgorithmSettings, Budget
from tolevo.errors import InputError
from tolevo.files import seal_content
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, PropagationSetting, Settings

SMALL = Settings(propagation=PropagationSetting(method="moments"), limits={"interference_probability": Bound(high=0.5)})
CASES = [
    (NSGA2(population=20), "pymoo"),
    (NSGA2(population=20), "array"),
    (GDE3(population=20), "pymoo"),
    (GDE3(population=20), "array"),
    (RandomSearch(population=20), "pymoo"),
]


def found(
    settings: AlgorithmSettings, engine: str, budget: Budget, keeper: Checkpoint | None = None, report: Any = None
) -> SearchResult:
    return search(RvBacklash(SMALL), settings, budget, 3, report, engine, keeper)


def assert_equal(one: SearchResult, other: SearchResult) -> None:
    for name in ("x", "f", "miss"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    rows = [
        [(p.generation, p.evaluations, p.hypervolume, p.feasible_fraction) for p in each.history]
        for each in (one, other)
    ]
    assert rows[0] == rows[1]


@pytest.mark.parametrize(("settings", "engine"), CASES)
@pytest.mark.parametrize(
    ("budget", "larger"),
    [(Budget(generations=4), Budget(generations=9)), (Budget(evaluations=73), Budget(evaluations=151))],
    ids=["generations", "evaluations"],
)
def test_a_larger_budget_goes_on_as_if_unbroken(
    settings: AlgorithmSettings, engine: str, budget: Budget, larger: Budget, tmp_path: Path
) -> None:
    path = tmp_path / "checkpoint.npz"
    part = found(settings, engine, budget, Checkpoint(path, ""))
    assert_equal(part, found(settings, engine, budget))
    assert_equal(found(settings, engine, budget, Checkpoint.read(path)), part)
    whole = found(settings, engine, larger)
    assert_equal(found(settings, engine, larger, Checkpoint.read(path)), whole)


def test_time_goes_on_from_the_stored_seconds(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    found(NSGA2(population=20), "pymoo", Budget(time_limit_s=0.3), Checkpoint(path, ""))
    again = found(NSGA2(population=20), "pymoo", Budget(time_limit_s=0.3), Checkpoint.read(path))
    assert 0.2 < again.history[-1].seconds < 5.0
    more = Budget(generations=again.history[-1].generation + 1)
    last = found(NSGA2(population=20), "pymoo", more, Checkpoint.read(path)).history
    assert last[-1].seconds > last[-2].seconds >= 0.2


def test_a_checkpoint_is_small_and_no_pickle(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    found(NSGA2(population=20), "pymoo", Budget(generations=5), Checkpoint(path, "text"))
    with np.load(path, allow_pickle=False) as file:
        kinds = {file[key].dtype.kind for key in file.files}
    assert kinds <= set("biufU")
    assert path.stat().st_size < 100_000


@dataclass(frozen=True, slots=True)
class Missing(NSGA2):
    """Names an attribute that there is not."""

    state: ClassVar[tuple[str, ...]] = ("survival.nothing",)


@dataclass(frozen=True, slots=True)
class Weighted(NSGA2):
    """Its next generation depends on attributes that pymoo's does not have."""

    state: ClassVar[tuple[str, ...]] = ("survival.weights", "shrink", "unset")

    def build(self, problem: Any) -> Any:
        algorithm = NSGA2.build(self, problem)
        algorithm.survival.weights = np.zeros(2)
        algorithm.shrink, algorithm.unset = 1.0, None
        advance = algorithm._advance

        def changed(infills: Any = None, **kwargs: Any) -> None:
            algorithm.survival.weights = algorithm.survival.weights + np.array([1.0, 2.0])
            algorithm.shrink *= 0.5
            if algorithm.survival.weights[1] * algorithm.shrink == 4 * 2.0 / 16.0:
                algorithm.random_state.random(7)  # only where both were restored
            advance(infills=infills, **kwargs)

        algorithm._advance = changed
        return algorithm


def stop(state: Progress) -> None:
    if state.generation == 4:
        raise KeyboardInterrupt


def test_named_attributes_are_saved(tmp_path: Path) -> None:
    path, settings = tmp_path / "checkpoint.npz", Weighted(population=20)
    found(settings, "pymoo", Budget(generations=9), Checkpoint(path, "", every=0.0), stop)
    again = found(settings, "pymoo", Budget(generations=9), Checkpoint.read(path))
    assert_equal(again, found(settings, "pymoo", Budget(generations=9)))
    plain = found(NSGA2(population=20), "pymoo", Budget(generations=9))
    assert not np.array_equal(again.x, plain.x)  # the attributes do matter


def test_what_cannot_be_saved_starts_anew(tmp_path: Path) -> None:
    path, settings = tmp_path / "checkpoint.npz", Missing(population=20)
    found(settings, "pymoo", Budget(generations=9), Checkpoint(path, "", every=0.0), stop)
    kept = Checkpoint.read(path)
    assert kept.unsavable
    assert kept.saved() is None
    again = found(settings, "pymoo", Budget(generations=9), kept)
    assert_equal(again, found(NSGA2(population=20), "pymoo", Budget(generations=9)))


def test_a_state_that_does_not_fit_starts_anew(tmp_path: Path) -> None:
    """As after an update of a plugin that names more attributes than were saved."""
    path, budget = tmp_path / "checkpoint.npz", Budget(generations=9)
    found(NSGA2(population=20), "pymoo", budget, Checkpoint(path, "", every=0.0), stop)
    kept = Checkpoint.read(path)
    assert_equal(found(Weighted(population=20), "pymoo", budget, kept),
                 found(Weighted(population=20), "pymoo", budget))  # fmt: skip


def test_tables_come_back_as_they_were(tmp_path: Path) -> None:
    table = pd.DataFrame({"a": [0.1, np.nan], "grade": [4, 5], "knee": [True, False], "name": ["x", "y"]})
    kept = Checkpoint(tmp_path / "c.npz", "[algorithm]\n")
    kept.keep("one", table)
    kept.keep("none", pd.DataFrame(columns=["a", "b"]))
    again = Checkpoint.read(tmp_path / "c.npz")
    assert again.identity == "[algorithm]\n"
    pd.testing.assert_frame_equal(again.tables["one"], table)
    assert again.tables["one"].to_csv() == table.to_csv()
    assert list(again.tables["none"].columns) == ["a", "b"]
    assert not len(again.tables["none"])


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 broken", b"text"])
def test_a_broken_file_is_named(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"checkpoint.npz: cannot be read: .* --overwrite"):
        Checkpoint.read(path)


def test_a_file_of_another_format_is_named(tmp_path: Path) -> None:
    path, file = tmp_path / "checkpoint.npz", io.BytesIO()
    np.savez(file, format=np.array(99))
    path.write_bytes(seal_content(file.getvalue()))
    with pytest.raises(InputError, match="cannot be read: format 99, expected 4"):
        Checkpoint.read(path)
    path.write_bytes(file.getvalue())  # as earlier versions wrote it
    with pytest.raises(InputError, match="of another version: it does not end with its digest"):
        Checkpoint.read(path)
