"""The directory of a result: its lock, its marks, what is retired, and what is refused."""

from __future__ import annotations

import json
import os
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from tolevo.directory import MANIFEST, UNFINISHED, Ownership, holders, standing
from tolevo.directory import own_folder as owned
from tolevo.directory.lock import LOCK, Held, acquire, hold
from tolevo.directory.standing import KINDS, digest, kind_of, read_manifest, read_unfinished, write_unfinished
from tolevo.errors import InputError
from tolevo.files import write_text


def made(place: Ownership, *names: str, text: str = "new") -> None:
    """Files as the command would write them."""
    for name in names:
        path = place.folder / name
        path.parent.mkdir(exist_ok=True)
        write_text(path, text)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A complete run, with a file of the user beside it."""
    folder = tmp_path / "out"
    with owned(folder, "run") as place:
        place.begin()
        made(place, "checkpoint.npz", "config.toml", "front.csv", "summary.json", "report.html")
        place.complete()
    (folder / "notes.txt").write_text("mine", encoding="utf-8")
    return folder


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def content(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in names(folder)}


# ---------------------------------------------------------------- one owner


def test_a_complete_set_has_the_digest_of_every_file_but_pages(out: Path) -> None:
    manifest = read_manifest(out)
    assert manifest is not None
    wanted = {"checkpoint.npz", "config.toml", "front.csv", "summary.json"}
    assert manifest.files == {name: digest(out / name) for name in wanted}
    assert names(out) == {*wanted, "report.html", "notes.txt", MANIFEST}
    assert standing(out).complete


def test_the_manifest_is_the_same_for_the_same_files(out: Path, tmp_path: Path) -> None:
    with owned(tmp_path / "other", "run") as place:
        place.begin()
        made(place, "summary.json", "front.csv", "config.toml", "checkpoint.npz")
        place.complete()
    assert (tmp_path / "other" / MANIFEST).read_bytes() == (out / MANIFEST).read_bytes()


@pytest.mark.parametrize(("resume", "overwrite"), [(False, True), (True, False), (False, False)])
def test_the_second_owner_is_refused_and_nothing_is_written(out: Path, resume: bool, overwrite: bool) -> None:
    with owned(out, "gap"):
        before = content(out)
        with pytest.raises(InputError) as caught, owned(out, "run", resume, overwrite):
            raise AssertionError("both have it")
        assert content(out) == before
    (fault,) = caught.value.faults
    assert fault.place == "--out"
    assert f"is in use by `tolevo gap` (process {os.getpid()} on {socket.gethostname()}" in str(fault)
    assert holders(out) == ""
    assert LOCK not in names(out)


def test_an_owner_that_changes_nothing_leaves_no_trace(out: Path, tmp_path: Path) -> None:
    before = content(out)
    with owned(out, "run", resume=True):
        pass
    with pytest.raises(InputError, match="holds the result of `tolevo run`"), owned(out, "study", resume=True):
        pass
    assert content(out) == before
    with owned(tmp_path / "deep" / "new", "run"):
        assert (tmp_path / "deep" / "new").is_dir()
    assert not (tmp_path / "deep").exists()


def test_what_is_not_to_be_replaced_is_looked_for_under_the_lock(out: Path) -> None:
    """A second start whose look at the directory came before the first one's end."""
    before = content(out)
    with pytest.raises(InputError, match="is not empty; name another directory"), owned(out, "run", overwrite=False):
        pass
    assert content(out) == before


def test_a_look_at_the_lock_is_no_owner(tmp_path: Path) -> None:
    """While somebody looks who holds it, a start waits for a moment instead of giving up."""
    looking = hold(tmp_path / LOCK)
    assert looking is not None
    timer = threading.Timer(0.05, os.close, (looking,))
    timer.start()
    acquire(tmp_path, "run").release()
    timer.join()


def test_a_lock_file_that_was_taken_away_is_no_lock(tmp_path: Path) -> None:
    """The one who waited for it must not believe to hold what the next one will make anew."""
    first = acquire(tmp_path, "run")
    late = os.open(tmp_path / LOCK, os.O_RDWR)
    first.release()
    second = acquire(tmp_path, "run")
    with pytest.raises(Held):
        acquire(tmp_path, "run")
    second.release()
    os.close(late)


# ---------------------------------------------------------------- what is retired


def test_the_old_result_goes_before_the_first_new_byte(out: Path) -> None:
    with owned(out, "run") as place:
        place.begin(keep=("config.toml",))
        assert names(out) == {"config.toml", "notes.txt", UNFINISHED, LOCK}
    here = standing(out)
    assert (here.command, here.manifest, here.faults) == ("run", None, ())
    assert here.unfinished is not None


def test_a_result_of_another_command_goes_as_well(out: Path) -> None:
    (out / "study.csv").write_text("point\n", encoding="utf-8")
    with owned(out, "reproduce") as place:
        place.begin()
        made(place, "checked/0_0.json", "claims.csv", "tables/a.csv", "figures/a.png")
        place.complete()
    assert kind_of(out) == "reproduce"
    assert names(out) == {"checked/0_0.json", "claims.csv", "tables/a.csv", "figures/a.png",
                          "notes.txt", MANIFEST}  # fmt: skip


class Killed(BaseException):
    """Stands for SIGKILL: nothing is done any more."""


@pytest.fixture
def broken_in_retiring(out: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An `--overwrite` that was killed after it had removed one file of the old result."""
    unlink, gone = Path.unlink, list[str]()

    def cut(self: Path, missing_ok: bool = False) -> None:
        if self.name in KINDS["run"].files and gone:
            raise Killed
        if self.name in KINDS["run"].files:
            gone.append(self.name)
        unlink(self, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", cut)
    with pytest.raises(Killed), owned(out, "run") as place:
        place.begin()
    monkeypatch.undo()
    assert gone == ["checkpoint.npz"]
    return out


def test_a_kill_while_it_goes_leaves_nothing_that_looks_whole(broken_in_retiring: Path) -> None:
    here = standing(broken_in_retiring)
    assert not here.complete
    assert here.unfinished is not None
    assert "front.csv" in here.unfinished.retiring
    with owned(broken_in_retiring, "run", resume=True) as place:
        assert place.blank  # nothing of the old result is gone on with
        assert names(broken_in_retiring) == {"notes.txt", UNFINISHED, LOCK}


def test_a_mark_may_name_no_file_elsewhere(tmp_path: Path) -> None:
    """A directory from somebody else must not remove what is not in it."""
    out, mine = tmp_path / "out", tmp_path / "config.toml"
    out.mkdir()
    mine.write_text("mine", encoding="utf-8")
    write_unfinished(out, "run", "t", ["../config.toml", str(mine), "notes.txt", "front.csv"])
    mark = read_unfinished(out)
    assert mark is not None
    assert mark.retiring == ("front.csv",)


def test_leftovers_of_killed_processes_go_at_the_next_start(out: Path) -> None:
    left = [out / ".front.csv.0a1b2c3d.part", out / ".front.csv.ab_12x9z"]
    folder = out / ".front.parquet.0a1b2c3d.part"
    folder.mkdir()
    for path in (*left, folder / "front.parquet", out / ".mine.part", out / ".profile"):
        path.write_text("half a", encoding="utf-8")
    with owned(out, "run") as place:
        place.begin()
    assert {name for name in names(out) if name.startswith(".")} == {".mine.part", ".profile"}
    assert not folder.exists()


# ---------------------------------------------------------------- one verdict


def faults(folder: Path) -> list[str]:
    return [str(one) for one in standing(folder).faults]


def test_a_file_of_another_result_is_a_fault(out: Path) -> None:
    (out / "front.csv").write_text("other", encoding="utf-8")
    (out / "choices.csv").write_text("other", encoding="utf-8")
    first, second = faults(out)
    assert first.startswith(f"{out}/front.csv: is not the file that this result was completed with")
    assert second.startswith(f"{out}/choices.csv: does not belong to this result")
    assert all("remove manifest.json" in one for one in (first, second))
    with pytest.raises(InputError, match=r"front\.csv: is not the file"), owned(out, "run", resume=True):
        pass
    assert LOCK not in names(out)


def test_pages_and_files_of_the_user_do_not_count(out: Path) -> None:
    (out / "report.html").write_text("built again", encoding="utf-8")
    (out / "front.png").unlink(missing_ok=True)
    (out / "summary.txt").write_text("a file of the user, of no run", encoding="utf-8")
    assert standing(out).complete


def test_a_file_that_is_gone_is_no_mixture(out: Path) -> None:
    (out / "front.csv").unlink()
    here = standing(out)
    assert (here.faults, here.missing, here.complete) == ((), ("front.csv",), False)


@pytest.mark.parametrize("name", [MANIFEST, UNFINISHED])
@pytest.mark.parametrize("text", ["", "{", "[]", '{"command": "run"}', "\xff", "[" * 100_000, '{"sha256": "0"}'])
def test_a_damaged_mark_is_refused_not_believed(out: Path, name: str, text: str) -> None:
    (out / MANIFEST).unlink()
    (out / name).write_bytes(text.encode("latin-1"))
    (fault,) = standing(out).faults
    assert fault.place == f"{out}/{name}"
    assert fault.message.startswith("cannot be read: ")


def test_every_byte_of_the_manifest_counts(out: Path) -> None:
    """Each byte changed in turn: refused, or its values are the same."""
    before, whole = read_manifest(out), (out / MANIFEST).read_bytes()
    for at in range(len(whole)):
        changed = bytearray(whole)
        changed[at] ^= 0x01
        (out / MANIFEST).write_bytes(changed)
        here = standing(out)
        assert here.faults or here.manifest == before


def test_a_newer_manifest_says_to_update(out: Path) -> None:
    from tolevo.files import seal_record as sealed_record

    record = {"command": "run", "status": "done", "format": 2, "version": "9.1", "files": {}}
    (out / MANIFEST).write_text(json.dumps(sealed_record(record)), encoding="utf-8")
    (fault,) = standing(out).faults
    assert "tolevo 9.1 wrote it, which is newer: update tolevo" in fault.message


# ---------------------------------------------------------------- umask


@pytest.fixture(params=[0o022, 0o002, 0o027, 0o077])
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield int(request.param)
    os.umask(before)


def test_files_keep_the_umask(tmp_path: Path, umask: int) -> None:
    with owned(tmp_path / "out", "run") as place:
        place.begin()
        made(place, "front.csv", "config.toml")
        lock = (tmp_path / "out" / LOCK).stat().st_mode & 0o777
        place.complete()
    modes = {path.stat().st_mode & 0o777 for path in (tmp_path / "out").iterdir()}
    assert modes | {lock} == {0o666 & ~umask}
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o777 & ~umask
