"""Files appear whole or not at all."""

import os
from pathlib import Path

import pytest

from tolevo.files import unwritable, write_bytes, write_text, write_with


def test_text_is_written_as_utf8_and_replaces(tmp_path: Path) -> None:
    path = tmp_path / "front.csv"
    write_text(path, "old")
    write_text(path, "µm\n")
    assert path.read_bytes() == "µm\n".encode()
    assert os.listdir(tmp_path) == ["front.csv"]


def test_failing_move_leaves_nothing(tmp_path: Path) -> None:
    target = tmp_path / "taken"
    target.mkdir()
    with pytest.raises(IsADirectoryError):
        write_bytes(target, b"content")
    assert os.listdir(tmp_path) == ["taken"]


def test_failing_flush_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "front.csv"
    write_text(path, "old")

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_text(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["front.csv"]


def test_failing_writer_leaves_nothing(tmp_path: Path) -> None:
    def writer(part: Path) -> None:
        part.write_text("half a")
        raise RuntimeError("writer broke")

    with pytest.raises(RuntimeError, match="writer broke"):
        write_with(tmp_path / "front.parquet", writer)
    assert os.listdir(tmp_path) == []


def test_writer_gets_the_name_and_its_file_appears(tmp_path: Path) -> None:
    names: list[str] = []

    def writer(part: Path) -> None:
        names.append(part.name)
        part.write_text("whole")

    write_with(tmp_path / "front.png", writer)
    assert names == ["front.png"]
    assert (tmp_path / "front.png").read_text() == "whole"
    assert os.listdir(tmp_path) == ["front.png"]


def test_writable_folder_has_no_fault_and_no_trace(tmp_path: Path) -> None:
    assert unwritable(tmp_path / "new" / "deep", "output") == []
    assert os.listdir(tmp_path) == []


def test_file_in_the_way_is_a_fault(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (fault,) = unwritable(tmp_path / "file" / "run", "output")
    assert fault.place == "output"
    assert "not a directory" in fault.message


def test_folder_that_refuses_is_a_fault() -> None:
    assert unwritable(Path("/proc/tolevo/run"), "output") != []  # refuses even root
