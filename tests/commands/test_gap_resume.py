"""An analysis that was broken goes on with the replicates that it has, and ends the same."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import GAP
from tolevo import journal
from tolevo.commands.gap import blocks, close, null_model, scan, uncertainty
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.gap import GapOutcome, gap
from tolevo.commands.gap.plan import GapProgress
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.uncertainty import FILE, STEPS
from tolevo.directory import KINDS, MANIFEST, UNFINISHED, ownership, standing
from tolevo.directory.standing import present_files, write_manifest
from tolevo.errors import InputError
from tolevo.models.rv_reducer import batch
from tolevo.models.rv_reducer.population.contact import touch

GEARBOX = Path(__file__).resolve().parents[2] / "docs" / "gearbox"
pytestmark = pytest.mark.usefixtures("unrendered")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    torque = rng.uniform(-400.0, 400.0, 90)
    predicted = 0.2 * torque
    te = predicted + 0.05 * torque + rng.normal(0.0, 2.0, 90)
    frame = pd.DataFrame({"torque": torque, "te": te, "te_predicted": predicted})
    frame.to_csv(tmp_path / "data.csv", index=False)
    (tmp_path / "gap.toml").write_text(GAP, encoding="utf-8")
    return tmp_path


class Watch:
    """Counts replicates, and interrupts after so many."""

    def __init__(self, stop: int = 10**6) -> None:
        self.stop = stop
        self.seen: list[GapProgress] = []

    def __call__(self, progress: GapProgress) -> None:
        self.seen.append(progress)
        if progress.done >= self.stop:
            raise KeyboardInterrupt

    def first(self) -> int:
        """Replicates that were there when the bootstrap began."""
        return next(one.done for one in self.seen if one.phase == uncertainty.PHASE)


def analysed(folder: Path, out: str, *more: str, workers: int = 1, watch: Watch | None = None) -> GapOutcome:
    plan = read_gap(folder / "gap.toml", more)
    data = read_data(plan, folder / "data.csv")
    return gap(plan, data, folder / out, workers, watch, resume=True)


def lines(folder: Path) -> list[str]:
    return (folder / FILE).read_text(encoding="utf-8").splitlines()


def test_what_has_ended_is_not_made_again(folder: Path) -> None:
    whole = analysed(folder, "whole")
    assert whole.status == "done"
    kind = KINDS["gap"]  # what is not known by name would be in no manifest
    known = {*present_files(folder / "whole", (*kind.files, *kind.pages)), MANIFEST}
    assert {one.name for one in (folder / "whole").iterdir()} == known
    expected = (folder / "whole" / "gap.json").read_bytes()
    cut = analysed(folder, "cut", watch=Watch(stop=5))
    assert cut.status == "interrupted"
    assert "6 of 8 replicates are kept" in cut.lines[0] and "--resume" in cut.lines[0]
    there = {one.name for one in (folder / "cut").iterdir()}
    assert there == {FILE, STEPS, "config.toml", UNFINISHED}
    assert len(lines(folder / "cut")) == 1 + 6
    watch = Watch()
    assert analysed(folder, "cut", watch=watch).status == "done"
    assert watch.first() == 6
    assert (folder / "cut" / "gap.json").read_bytes() == expected
    assert lines(folder / "cut") == lines(folder / "whole")


def test_the_search_is_recalled(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The thresholds, the longest step of a search, are not simulated again, nor for more replicates."""
    analysed(folder, "whole")
    analysed(folder, "cut", watch=Watch(stop=1))

    def again(*arguments: object) -> None:
        raise AssertionError("simulated again")

    monkeypatch.setattr(scan, "strongest_evidence", again)
    assert analysed(folder, "cut").status == "done"
    assert (folder / "cut" / "gap.json").read_bytes() == (folder / "whole" / "gap.json").read_bytes()
    assert analysed(folder, "cut", "settings.bootstrap=9").status == "done"
    with pytest.raises(AssertionError):
        analysed(folder, "anew")


def test_held_out_tests_noise_and_least_squares_are_recalled(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupted where only the files are missing: no digit differs, whatever the order in memory was."""

    def again(*arguments: object) -> None:
        raise AssertionError("computed again")

    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(journal, "MIN_RECORDED_SECONDS", 0.0)
    analysed(folder, "whole")
    with monkeypatch.context() as patch:
        patch.setattr("tolevo.commands.gap.gap.write", interrupt)
        assert analysed(folder, "cut").status == "interrupted"
    for module, name in ((blocks, "_held_out_fits"), (null_model, "_estimate_noise"), (close, "least_squares")):
        monkeypatch.setattr(module, name, again)
    assert analysed(folder, "cut").status == "done"
    assert (folder / "cut" / "gap.json").read_bytes() == (folder / "whole" / "gap.json").read_bytes()


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_every_step_can_be_the_last_before_an_interrupt(
    share: float, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken, step = list[int](), journal.Section.step

    def counted(section: journal.Section, check: int, compute: Any) -> Any:
        taken.append(check)
        if len(taken) == stop:
            raise KeyboardInterrupt
        return step(section, check, compute)

    monkeypatch.setattr(journal.Section, "step", counted)
    stop = -1
    analysed(folder, "whole")
    stop = int(share * len(taken))
    taken.clear()
    assert analysed(folder, "cut").status == "interrupted"
    assert analysed(folder, "cut").status == "done"
    assert (folder / "cut" / "gap.json").read_bytes() == (folder / "whole" / "gap.json").read_bytes()


def test_an_interrupt_while_the_result_is_sealed_changes_no_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A signal then keeps the steps; a file written after the manifest has its digest would make the result useless."""
    kept, seal = list[Callable[[], None]](), write_manifest

    @contextmanager
    def writing(save: Callable[[], None]) -> Iterator[None]:
        kept.append(save)
        yield

    def sealed(*arguments: Any) -> None:
        seal(*arguments)
        kept[0]()

    monkeypatch.setattr("tolevo.commands.gap.gap.writing", writing)
    monkeypatch.setattr(ownership, "write_manifest", sealed)
    monkeypatch.setattr(journal, "MIN_RECORDED_SECONDS", 0.0)
    assert analysed(folder, "sealed").status == "done"
    here = standing(folder / "sealed")
    assert here.complete and not here.faults


@pytest.mark.slow
def test_units_of_a_model_are_not_computed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupted where only the files are missing: units with a wider zone, most of the work, are known."""
    made: list[object] = []
    plan = read_gap(GEARBOX / "gap.toml")
    data = read_data(plan, GEARBOX / "units.csv")

    def counted(*arguments: Any) -> Any:
        made.append(arguments)
        return touch(*arguments)

    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(batch, "touch", counted)
    with monkeypatch.context() as patch:
        patch.setattr("tolevo.commands.gap.gap.write", interrupt)
        assert gap(plan, data, tmp_path / "out").status == "interrupted"
    first = len(made)
    made.clear()
    plan = read_gap(GEARBOX / "gap.toml")
    assert gap(plan, data, tmp_path / "out", resume=True).status == "done"
    assert 0 < len(made) < first / 3, (first, len(made))


def test_a_line_that_was_cut_is_made_again(folder: Path) -> None:
    assert analysed(folder, "out").status == "done"
    path = folder / "out" / FILE
    expected = (folder / "out" / "gap.json").read_bytes()
    path.write_bytes(path.read_bytes()[:-7])
    for name in ("gap.json", MANIFEST):  # as if it had been killed while it wrote that line
        (folder / "out" / name).unlink()
    watch = Watch()
    assert analysed(folder, "out", watch=watch).status == "done"
    assert watch.first() == 7
    assert (folder / "out" / "gap.json").read_bytes() == expected


def test_one_that_has_ended_opens_at_once(folder: Path) -> None:
    first = analysed(folder, "out")
    written = (folder / "out" / "gap.json").stat().st_mtime_ns
    watch = Watch()
    again = analysed(folder, "out", watch=watch)
    assert again.status == "done" and watch.seen == []
    assert again.lines[:-1] == first.lines
    assert (folder / "out" / "gap.json").stat().st_mtime_ns == written


def test_more_replicates_go_on_with_those_that_are_there(folder: Path) -> None:
    analysed(folder, "out")
    watch = Watch()
    analysed(folder, "out", "settings.bootstrap=11", watch=watch)
    assert watch.first() == 8
    assert len(lines(folder / "out")) == 1 + 11


def test_another_analysis_is_refused_with_every_difference(folder: Path) -> None:
    analysed(folder, "out", watch=Watch(stop=1))
    frame = pd.read_csv(folder / "data.csv")
    frame.assign(te=frame["te"] + 1e-9).to_csv(folder / "data.csv", index=False)
    with pytest.raises(InputError) as caught:
        analysed(folder, "out", "seed=4", "settings.bootstrap=3")
    said = str(caught.value)
    for part in ("seed: is 4, but the analysis to resume has 0", "settings.bootstrap: is 3",
                 "data: are not those of the analysis"):  # fmt: skip
        assert part in said


def test_a_folder_of_something_else_is_refused(folder: Path) -> None:
    (folder / "out").mkdir()
    (folder / "out" / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=f"holds no {FILE}"):
        analysed(folder, "out")
    assert [one.name for one in (folder / "out").iterdir()] == ["notes.txt"]


def test_processes_make_the_same_replicates(folder: Path) -> None:
    analysed(folder, "one")
    analysed(folder, "two", workers=2)
    same = ("gap.json", "corrected.toml")
    assert [(folder / "one" / n).read_bytes() for n in same] == [(folder / "two" / n).read_bytes() for n in same]
    assert sorted(lines(folder / "two")) == sorted(lines(folder / "one"))
