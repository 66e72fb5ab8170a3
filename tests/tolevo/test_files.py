"""Files appear whole or not at all."""

import os
import shutil
import socket
import stat
import threading
from pathlib import Path

import pytest
from typer.testing import CliRunner

import tolevo
from tolevo.cli import app
from tolevo.errors import RunError
from tolevo.files import content, unwritable, write_bytes, write_text, write_with
from tolevo.section import force_counts

STACK = """
problem = "stack"
objectives = { minimise = ["cost"] }
limits = { variation = 0.2 }
requirement = { name = "g", unit = "mm", formula = "a - b" }
part = [
    { name = "a", nominal = 10.0, t_min = 0.01, t_max = 0.1, cost = { model = "reciprocal", a = 1.0, b = 0.1 } },
    { name = "b", nominal = 10.0, tolerance = 0.05 },
]
"""


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


def _strange(folder: Path, kind: str) -> Path:
    """A path that no output may replace; devices are copies of the null device."""
    path = folder / "t"
    if kind == "device":
        os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(str(path))
    elif kind == "link":
        (folder / "precious.csv").write_text("precious")
        path.symlink_to("precious.csv")
    elif kind == "dangling":
        path.symlink_to("nowhere")
    elif kind == "loop":
        path.symlink_to("t")
    elif kind == "below a link":
        path.symlink_to("nowhere")
        return path / "x"
    elif kind == "below a loop":
        path.symlink_to("t")
        return path / "x"
    elif kind == "long":
        return folder / ("n" * 250)
    elif kind == "long path":
        return Path(str(folder) + "/x" * 2500)
    elif kind == "below a file":
        (folder / "precious.csv").write_text("precious")
        return folder / "precious.csv" / "t"
    return path


def _state(folder: Path) -> list[tuple[str, int, int]]:
    return sorted((path.name, path.lstat().st_mode, path.lstat().st_size) for path in folder.iterdir())


COMMANDS = (
    ["evaluate", "c.toml", "d.csv"],
    ["evaluate", "c.toml", "d.csv", "--partitioned"],
    ["simulate", "m.toml", "d.csv"],
    ["template", "stack"],
    ["run", "c.toml", "--overwrite"],
    ["reproduce", "--overwrite"],
)
KINDS = (
    *("device", "pipe", "socket", "link", "dangling", "loop", "long"),
    *("below a link", "below a loop", "below a file", "long path"),
)


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_but_a_regular_file_is_replaced(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if kind == "device" and os.geteuid():
        pytest.skip("only root makes devices")
    monkeypatch.chdir(tmp_path)
    Path("c.toml").write_text(STACK)
    Path("m.toml").write_text('model = "rv_lost_motion"\n')
    Path("d.csv").write_text("a_t\n0.05\n")
    out = _strange(tmp_path, kind)
    before = _state(tmp_path)
    for command in COMMANDS:
        result = CliRunner().invoke(app, [*command, "--out", str(out)])
        assert (command, result.exit_code) == (command, 2)
        assert [line for line in result.stderr.splitlines() if line.startswith("--out: ")], command
        assert "Errno" not in result.stderr
    assert _state(tmp_path) == before


def test_a_table_of_something_else_is_replaced_by_overwrite_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("c.toml").write_text(STACK)
    Path("d.csv").write_text("a_t\n0.05\n")
    Path("e.csv").write_text("mine,too\n1,2\n")
    words = ["evaluate", "c.toml", "d.csv", "--out", "e.csv"]
    refused = CliRunner().invoke(app, words)
    assert (refused.exit_code, Path("e.csv").read_text()) == (2, "mine,too\n1,2\n")
    assert "--out: e.csv holds something else: name another file, or add --overwrite" in refused.stderr
    assert CliRunner().invoke(app, [*words, "--overwrite"]).exit_code == 0
    assert CliRunner().invoke(app, words).exit_code == 0  # a table of the same command


@pytest.mark.parametrize("kind", ["device", "socket", "dangling", "loop"])
def test_inputs_are_regular_files(kind: str, tmp_path: Path) -> None:
    if kind == "device" and os.geteuid():
        pytest.skip("only root makes devices")
    with pytest.raises(ValueError, match=r"is a device|is a socket|is a link to nothing|cannot be read"):
        content(_strange(tmp_path, kind))


def test_a_file_has_a_size_limit_and_a_pipe_as_well(tmp_path: Path) -> None:
    large = tmp_path / "large"
    with large.open("wb") as file:
        file.truncate(10**6)
    assert len(content(large, 10**6)) == 10**6
    with pytest.raises(ValueError, match="has 977 KiB or more, and 977 KiB is the most that is read"):
        content(large, 10**6 - 1)
    with force_counts():
        assert len(content(large, 1)) == 10**6
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for most, wanted in ((10, b"0123456789"), (9, b"")):
        writer = threading.Thread(target=pipe.write_bytes, args=(b"0123456789",))
        writer.start()
        if wanted:
            assert content(pipe, most, pipe=True) == wanted
        else:
            with pytest.raises(ValueError, match="is the most that is read"):
                content(pipe, most, pipe=True)
        writer.join()
    with pytest.raises(ValueError, match="is a pipe; name a file"):
        content(pipe)


def test_a_silent_pipe_is_not_waited_for_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tolevo.files.SILENCE", 0.01)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ValueError, match="through which nothing came"):
        content(tmp_path / "pipe", pipe=True)


@pytest.mark.parametrize("command", ["check", "evaluate", "run"])
def test_a_configuration_may_come_through_a_pipe(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("d.csv").write_text("a_t\n0.05\n")
    os.mkfifo("pipe")
    writer = threading.Thread(target=Path("pipe").write_text, args=(STACK,))
    writer.start()
    rest = {"check": [], "evaluate": ["d.csv", "--out", "e.csv"], "run": ["--out", "o"]}[command]
    result = CliRunner().invoke(app, [command, "pipe", *rest])
    writer.join()
    assert (result.exit_code, "is empty" in result.stderr) == (0, False)


@pytest.mark.parametrize("how", ["removed", "made again"])
def test_a_directory_that_is_removed_during_a_run_is_not_made_again(how: str, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(STACK + 'algorithm = { name = "ga", population = 8, generations = 9 }\n')
    out = tmp_path / "o"

    def progress(_: object) -> None:
        if (out / "config.toml").exists():
            shutil.rmtree(out)
            if how == "made again":
                out.mkdir()

    with pytest.raises(RunError, match="was removed while the command worked in it"):
        tolevo.run(tmp_path / "c.toml", out, progress=progress)
    assert out.exists() == (how == "made again")


def test_strange_members_of_a_result_are_faults(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(STACK)
    tolevo.run(tmp_path / "c.toml", tmp_path / "o")
    for name in (".tolevo-lock", "manifest.json", "front.csv"):
        (tmp_path / "o" / name).unlink(missing_ok=True)
        os.mkfifo(tmp_path / "o" / name)
        for words in (["report", "o"], ["run", "c.toml", "--out", "o", "--overwrite"]):
            result = CliRunner().invoke(app, [str(tmp_path / w) if w in ("o", "c.toml") else w for w in words])
            assert result.exit_code == 2
            assert f"{name}: is a pipe" in result.stderr
        (tmp_path / "o" / name).unlink()
