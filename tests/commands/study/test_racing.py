"""Racing: the same recommendation for half of the runs, and the best stays in the race."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from tests.small_jobs import POSE_BY_GA
from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.plan import StudyPlan
from tolevo.commands.study.storage import DATABASE, Database
from tolevo.commands.study.study import ALPHA, looks, settings_behind_leader, study, trailing_settings
from tolevo.commands.study.trial import Surveying
from tolevo.errors import InputError, RunError
from tolevo.execution import InProcess, Lost, Result, TaskT

pytestmark = pytest.mark.usefixtures("unrendered")

Array = NDArray[np.float64]
SETTINGS, SEEDS, STUDIES = 16, 30, 20
NOISES: dict[str, Callable[[np.random.Generator], Array]] = {
    "normal": lambda rng: rng.normal(size=(SETTINGS, SEEDS)),
    "skewed": lambda rng: rng.exponential(size=(SETTINGS, SEEDS)),
    "heavy tails": lambda rng: rng.standard_t(3, size=(SETTINGS, SEEDS)),
}
RUN = POSE_BY_GA.format(mrad=0.6, more="yaw_mrad = 0.6", population=10, generations=12)
STUDY = """
run = "run.toml"
seeds = 12
response = ["gap_percent"]
[design]
kind = "factorial"
[vary]
"algorithm.population" = [4, 8, 12, 24]
"algorithm.generations" = [2, 4, 12, 24]
"""


def landscape(rng: np.random.Generator) -> Array:
    """Four by four settings with a best place and an interaction, in units of the noise."""
    a, b = np.meshgrid(np.linspace(-1, 1, 4), np.linspace(-1, 1, 4))
    x, y = rng.uniform(-0.6, 0.6, 2)
    return np.asarray((3 * (a - x) ** 2 + 3 * (b - y) ** 2 + a * b).ravel())


def raced(values: Array) -> tuple[NDArray[np.bool_], int]:
    """Settings that stay to the end, and how many runs it took."""
    racing, runs = np.ones(len(values), dtype=bool), np.full(len(values), values.shape[1])
    for look, seeds in enumerate(looks(values.shape[1]), start=1):
        out = trailing_settings([values[:, :seeds]], racing, look)
        runs[out], racing = seeds, racing & ~out
    return racing, int(runs.sum())


@pytest.mark.parametrize("noise", NOISES)
def test_same_recommendation_for_half_of_the_runs(noise: str) -> None:
    """20 studies of 16 settings and 30 seeds: that of all runs is the best median of even seeds."""
    same, runs = 0, []
    for number in range(STUDIES):
        rng = np.random.default_rng([number, 3])
        values = landscape(rng)[:, None] + NOISES[noise](rng) + rng.normal(size=SEEDS)
        racing, count = raced(values)
        medians = np.median(values[:, ::2], axis=1)
        same += int(np.argmin(np.where(racing, medians, np.inf)) == np.argmin(medians))
        runs.append(count / values.size)
    assert same >= 18
    assert np.mean(runs) <= 0.5


def test_of_equal_settings_one_leaves_rarely() -> None:
    """All settings are the same: the chance that a given one leaves is below alpha."""
    rng, left, studies = np.random.default_rng(1), 0, 300
    for _ in range(studies):
        left += int(not raced(rng.normal(size=(SETTINGS, SEEDS)))[0][0])
    assert left <= binom.ppf(0.999, studies, ALPHA)


def test_looks_do_not_depend_on_how_many_seeds_there_are() -> None:
    assert list(looks(30)) == [5, 7, 10, 14, 20, 28]
    assert list(looks(100))[:6] == list(looks(30))
    assert not list(looks(5))


def test_a_leader_in_one_response_stays() -> None:
    values = np.arange(8.0)[:, None] + np.zeros(12)
    assert settings_behind_leader(values, 1).any()
    assert not trailing_settings([values, -values], np.ones(8, dtype=bool), 1)[[0, 7]].any()


def test_what_failed_everywhere_is_behind() -> None:
    values = np.tile(np.arange(12.0), (10, 1)) + np.random.default_rng(0).random((10, 12))
    values[4] = np.inf
    assert settings_behind_leader(values, 1)[4]


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> StudyPlan:
    folder = tmp_path_factory.mktemp("raced")
    (folder / "run.toml").write_text(RUN, encoding="utf-8")
    (folder / "study.toml").write_text(STUDY + "[stop]\nhopeless = true\n", encoding="utf-8")
    return read_study(folder / "study.toml")


class Late(InProcess):
    """Two workers, one of which takes until the end of all to measure a reference."""

    workers = 2

    def __init__(self, after: int = 10**9) -> None:
        self.left = after
        self.surveys = 0

    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        late: list[TaskT] = []
        while (task := source()) is not None:
            if isinstance(task, Surveying):
                self.surveys += 1
                late.append(task)
                continue
            if not self.left:
                raise RunError("the scheduler was lost")
            self.left -= 1
            yield task, function(task)
        for one in late:
            yield one, function(one)


@pytest.mark.long
@pytest.mark.slow
def test_a_real_study_is_raced_the_same_wherever_it_runs(plan: StudyPlan, tmp_path: Path) -> None:
    """Broken and gone on with, references measured before or after the runs: the same table."""
    outcome = study(plan, tmp_path / "a", InProcess())
    assert any("settings were stopped" in line for line in outcome.lines)
    table = pd.read_csv(tmp_path / "a" / "study.csv")
    assert len(table) == plan.total
    made = (table["status"] != "stopped").sum()
    assert made < 0.85 * plan.total
    reasons = table.loc[table["status"] == "stopped", "reason"].unique()
    assert all(one.startswith("behind beyond chance after") for one in reasons)
    with pytest.raises(RunError, match="--resume"):
        study(plan, tmp_path / "b", Late(after=3))
    again = Late()
    study(plan, tmp_path / "b", again, resume=True)
    assert (tmp_path / "b/study.csv").read_bytes() == (tmp_path / "a/study.csv").read_bytes()
    third = Late()
    study(plan, tmp_path / "b", third, resume=True)
    assert (again.surveys, third.surveys) == (1, 0)  # never again
    with Database(tmp_path / "b" / DATABASE, len(plan.points), plan.settings.responses) as kept:
        assert len(kept.yardsticks()) == 1


def test_without_racing_references_come_late_as_well(tmp_path: Path) -> None:
    (tmp_path / "run.toml").write_text(RUN, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY.replace("seeds = 12", "seeds = 2"), encoding="utf-8")
    plan = read_study(tmp_path / "study.toml")
    study(plan, tmp_path / "a", InProcess())
    study(plan, tmp_path / "b", Late())
    assert (tmp_path / "b/study.csv").read_bytes() == (tmp_path / "a/study.csv").read_bytes()


def test_leaders_are_the_design_of_a_finer_study(tmp_path: Path) -> None:
    """Multi-fidelity: all settings by a short study, those not behind again by a longer one."""
    (tmp_path / "run.toml").write_text(RUN, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY.replace("seeds = 12", "seeds = 6"), encoding="utf-8")
    study(read_study(tmp_path / "study.toml"), tmp_path / "coarse", InProcess())
    leaders = pd.read_csv(tmp_path / "coarse" / "leaders.csv")
    assert 1 <= len(leaders) < SETTINGS
    medians = pd.read_csv(tmp_path / "coarse" / "medians.csv")
    table = pd.read_csv(tmp_path / "coarse" / "study.csv")
    best = table[table["point"] == medians["median"].idxmin()].iloc[0]
    keys = [str(name) for name in leaders]
    assert (leaders == best[keys].to_numpy()).all(axis=1).any()
    again = STUDY.replace('kind = "factorial"', 'kind = "table"\nfile = "coarse/leaders.csv"')
    again = again.replace("seeds = 12", 'seeds = 2\n"run.limits.yaw_mrad" = 0.5')
    (tmp_path / "again.toml").write_text(again, encoding="utf-8")
    finer = read_study(tmp_path / "again.toml")
    assert len(finer.points) == len(leaders)
    resolved = tomllib.loads(finer.settings.configuration)
    assert "0.5" in str(resolved["run"]["limits"]["yaw_mrad"])


def test_a_design_that_needs_every_run_is_not_raced(tmp_path: Path) -> None:
    (tmp_path / "run.toml").write_text(RUN, encoding="utf-8")
    text = STUDY.replace('kind = "factorial"', 'kind = "morris"')
    text += "[stop]\nhopeless = true\nhopeful = 1\n"
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_study(tmp_path / "study.toml")
    assert "stop.hopeless: is not available for morris, whose statistics need every run" in str(caught.value)
    assert "stop.hopeful: is not a known key" in str(caught.value)
