from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.study.designs import DESIGNS, PARTS, Factorial, LatinHypercube, Morris, OneAtATime, Sobol, Table
from tolevo.commands.study.plan import Design, Factor, Level
from tolevo.errors import InputError

SIZE = Factor("algorithm.population", levels=(20, 40, 60, 80))
RATE = Factor("algorithm.mutation.probability", low=0.001, high=0.08, log=True, count=3)
NAME = Factor("algorithm.crossover.name", levels=("sbx", "blend", "one_point"))
WHOLE = Factor("algorithm.eta", low=2, high=5, integer=True)
BASE: Mapping[str, Level] = {SIZE.key: 80, RATE.key: 0.08, NAME.key: "sbx", WHOLE.key: 3}
ALL = (SIZE, RATE, NAME, WHOLE)


def made(design: Design, factors: tuple[Factor, ...] = ALL, seed: int = 0) -> pd.DataFrame:
    frame = design.points(factors, BASE, np.random.default_rng(seed))
    assert list(frame.index) == list(range(len(frame)))
    return frame


def messages(design: Design, factors: tuple[Factor, ...] = ALL, seeds: int = 10) -> str:
    return "\n".join(str(fault) for fault in design.faults(factors, seeds))


def test_every_kind_is_known_by_its_name() -> None:
    kinds = ["factorial", "latin_hypercube", "morris", "one_at_a_time", "sobol", "table"]
    assert list(DESIGNS) == kinds
    assert all(DESIGNS[kind].kind == kind for kind in kinds)


def test_one_at_a_time_begins_with_the_run_and_changes_one_key() -> None:
    factors = (SIZE, RATE)
    frame = made(OneAtATime(), factors)
    assert frame.iloc[0].to_dict() == {SIZE.key: 80, RATE.key: 0.08}
    changed = frame.ne(pd.Series({SIZE.key: 80, RATE.key: 0.08})).sum(axis=1)
    assert changed.tolist() == [0, 1, 1, 1, 1, 1]
    assert frame[SIZE.key].tolist() == [80, 20, 40, 60, 80, 80]
    middle = np.sqrt(0.001 * 0.08)  # of a logarithmic range
    np.testing.assert_allclose(frame[RATE.key], [0.08] * 4 + [0.001, middle], rtol=1e-12)


def test_a_base_beside_the_levels_is_a_point_of_its_own() -> None:
    other = Factor(SIZE.key, levels=(20, 40))
    assert made(OneAtATime(), (other,))[SIZE.key].tolist() == [80, 20, 40]


def test_factorial_has_every_combination_once() -> None:
    factors = (SIZE, RATE, NAME)
    frame = made(Factorial(), factors)
    assert len(frame) == len(frame.drop_duplicates()) == 4 * 3 * 3
    assert frame[SIZE.key].dtype == np.int64
    assert set(frame[NAME.key]) == set(NAME.levels)


def test_latin_hypercube_has_one_setting_in_each_stratum() -> None:
    frame = made(LatinHypercube(samples=24))
    place = np.log(frame[RATE.key] / RATE.low) / np.log(RATE.high / RATE.low)
    assert sorted((place * 24).astype(int)) == list(range(24))
    assert frame[SIZE.key].value_counts().tolist() == [6] * 4
    assert frame[WHOLE.key].value_counts().tolist() == [6] * 4
    assert frame[NAME.key].value_counts().tolist() == [8] * 3


def test_morris_changes_one_place_at_each_step_and_uses_every_level_alike() -> None:
    frame = made(Morris(trajectories=400))
    shares = frame[[f"_share_{factor.key}" for factor in ALL]].to_numpy().reshape(400, 5, 4)
    steps = np.diff(shares, axis=1)
    assert np.all((np.abs(steps) > 1e-9).sum(axis=2) == 1)
    np.testing.assert_allclose(np.abs(steps).sum(axis=2), 2 / 3, rtol=1e-12)
    counts = frame[NAME.key].value_counts(normalize=True)
    assert counts.max() < 0.55 and counts.min() > 0.2  # 1/4, 1/2, 1/4 of four places
    changed = frame[[NAME.key]].ne(frame[[NAME.key]].shift()).to_numpy().reshape(400, 5)[:, 1:]
    np.testing.assert_array_equal(changed, np.abs(steps[:, :, 2]) > 1e-9)


def test_sobol_blocks_are_a_then_one_key_from_b_then_b() -> None:
    frame = made(Sobol(samples=64), (SIZE, RATE))
    for key in (SIZE.key, RATE.key):
        a, first, second, b = frame[key].to_numpy().reshape(64, 4).T
        np.testing.assert_array_equal(first, b if key == SIZE.key else a)
        np.testing.assert_array_equal(second, b if key == RATE.key else a)
    a = np.log(frame[RATE.key].to_numpy().reshape(64, 4)[:, 0] / RATE.low)
    for part in np.split(a, PARTS):  # each a sequence of its own
        strata = (part / np.log(RATE.high / RATE.low) * len(part)).astype(int)
        assert sorted(strata) == list(range(64 // PARTS))


@pytest.mark.parametrize("design", [LatinHypercube(), Morris(), Sobol()], ids=lambda d: d.kind)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_same_seed_gives_the_same_points_and_another_gives_others(design: Design, seed: int) -> None:
    pd.testing.assert_frame_equal(made(design, seed=seed), made(design, seed=seed))
    assert not made(design, seed=seed).equals(made(design, seed=seed + 1))


@pytest.mark.parametrize("design", [LatinHypercube(), Morris(), Sobol()], ids=lambda d: d.kind)
def test_every_value_lies_in_its_range_and_whole_numbers_stay_whole(design: Design) -> None:
    frame = made(design)
    assert frame[RATE.key].between(RATE.low, RATE.high).all()
    assert frame[WHOLE.key].dtype == np.int64
    assert set(frame[WHOLE.key]) == {2, 3, 4, 5}
    assert set(frame[SIZE.key]) <= set(SIZE.levels)


def test_a_design_too_small_says_what_it_needs() -> None:
    assert messages(OneAtATime(), (RATE,)) == ""
    flat = Factor("algorithm.eta", low=1.0, high=2.0)
    assert messages(OneAtATime(), (flat,)).startswith("vary.algorithm.eta: has one level or none")
    assert "kind: has 10201000 settings, 100000 at most" in messages(
        Factorial(), tuple(Factor(f"k{n}", low=0, high=1, count=c) for n, c in
                           enumerate((101, 101, 1000))))  # fmt: skip
    # the constant, a line and a curve of two ranges, 3 and 2 of the lists: 10 terms
    assert "samples: is 19" in messages(LatinHypercube(samples=19))
    assert "at least 20" in messages(LatinHypercube(samples=19))
    assert messages(LatinHypercube(samples=20)) == ""
    assert "trajectories: is 9" in messages(Morris(trajectories=9))
    assert "levels: is 5" in messages(Morris(levels=5))
    assert "samples: is 64" in messages(Sobol(samples=64))
    assert "use 128 or 256" in messages(Sobol(samples=200))
    assert messages(Sobol(samples=128)) == messages(Morris(trajectories=10)) == ""


@pytest.mark.parametrize("kind", ["factorial", "latin_hypercube", "morris", "sobol"])
def test_one_seed_cannot_tell_noise_from_an_effect(kind: str) -> None:
    factors = (SIZE, NAME)
    assert "seeds: is 1" in messages(DESIGNS[kind](), factors, seeds=1)
    assert messages(DESIGNS[kind](), factors, seeds=2) == ""


def test_a_table_is_read_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "settings.csv"
    file.write_text(f"{NAME.key},{SIZE.key},{WHOLE.key},{RATE.key}\nblend,40,2,0.05\nsbx,80,5,0.08\n")
    design = Table(str(file))
    assert messages(design) == ""
    frame = made(design)
    assert frame[NAME.key].tolist() == ["blend", "sbx"]
    assert frame[SIZE.key].tolist() == [40, 80] and frame[SIZE.key].dtype == np.int64
    assert frame[WHOLE.key].dtype == np.int64
    assert list(frame.columns) == [factor.key for factor in ALL]


def test_every_fault_of_a_table_is_named(tmp_path: Path) -> None:
    file = tmp_path / "settings.csv"
    file.write_text(f"{NAME.key},{SIZE.key},{WHOLE.key}\nblnd,40,2.5\nsbx,50,9\n")
    found = messages(Table(str(file)))
    assert f"column {RATE.key} is missing" in found
    assert 'got "blnd" (did you mean `blend`?)' in found
    assert "row 3, column algorithm.population: must be one of 20, 40, 60, 80, got 50" in found
    assert f"row 2, column {WHOLE.key}: must be a whole number, got 2.5" in found
    assert f"row 3, column {WHOLE.key}: must lie in [2, 5], got 9" in found
    with pytest.raises(InputError):
        Table(str(file)).points(ALL, BASE, np.random.default_rng(0))
    assert "does not exist" in messages(Table(str(tmp_path / "none.csv")))
    assert "file: is missing" in messages(Table())
