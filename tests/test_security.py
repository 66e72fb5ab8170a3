"""What SECURITY.md promises: no code comes out of a file, and no plugin runs before it is named."""

from __future__ import annotations

import ast
import io
import pickle
import re
import shutil
import sys
import zipfile
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from tests.small_jobs import HOUSING_AND_SHAFT, output_of, tolevo, written
from tolevo.algorithms.checkpoint import Checkpoint
from tolevo.errors import InputError
from tolevo.files import seal_content as sealed

ROOMS = ("", "models", "problems", "algorithms")
RUNS_CODE = {
    "pickle": {"load", "loads", "Unpickler"},
    "marshal": {"load", "loads"},
    "shelve": {"open"},
    "pd": {"read_pickle", "eval"},
    "pandas": {"read_pickle", "eval"},
    "numpy": {"load"},
    "np": {"load"},
    "yaml": {"load", "unsafe_load", "full_load"},
    "os": {"system", "popen", "execv", "execve"},
    "subprocess": {"run", "Popen", "call", "check_call", "check_output"},
}
"""Calls that may run what stands in a file, or a command."""
MODULES = {"joblib", "dill", "cloudpickle", "yaml", "shelve", "marshal", "ctypes", "code", "runpy"}
BUILTINS = ("eval", "exec", "compile", "__import__")
RISKY = re.compile(r"\b(?:" + "|".join([*RUNS_CODE, *MODULES, *BUILTINS]) + r")\b")
ALLOWED = {
    ("execution.py", "pickle.loads"): "what the command sent to its worker",
    ("testing.py", "pickle.loads"): "what the test itself has just pickled",
    ("agents.py", "ctypes"): "the number of the server's own thread, which is interrupted after its time limit",
}
"""Each with where its bytes come from: from memory, never from a file."""
NORMAL = HOUSING_AND_SHAFT.replace("b = 0.75 }\n", 'b = 0.75 }\ndistribution = "normal"\n')
STACK = f"""{NORMAL}
[algorithm]
name = "nsga2"
population = 8
generations = 3
"""


def sources() -> Iterator[tuple[str, str]]:
    """The text of every module of the package with its place in it."""
    for room in ROOMS:
        folder = Path(str(files(f"tolevo.{room}".rstrip("."))))
        for path in sorted(folder.rglob("*.py")):
            yield str(Path(room) / path.relative_to(folder)), path.read_text("utf-8")


def dangers(tree: ast.Module) -> Iterator[str]:
    """Calls and imports of `tree` that may run what stands in a file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names if one.name.split(".")[0] in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [one.name for one in node.names]
            if node.module.split(".")[0] in MODULES:
                yield node.module
            risky = RUNS_CODE.get(node.module, set())
            yield from (f"{node.module}.{name}" for name in names if name in risky)
        elif isinstance(node, ast.Call):
            yield from _call(node)


def _call(node: ast.Call) -> Iterator[str]:
    called = node.func
    if isinstance(called, ast.Name) and called.id in BUILTINS:
        yield called.id
    if not isinstance(called, ast.Attribute) or not isinstance(called.value, ast.Name):
        return
    if called.attr in RUNS_CODE.get(called.value.id, ()):
        given = {one.arg: one.value for one in node.keywords}.get("allow_pickle")
        if not (isinstance(given, ast.Constant) and given.value is False):
            yield f"{called.value.id}.{called.attr}"


def test_no_module_runs_what_stands_in_a_file() -> None:
    searched = dict(sources())
    assert {"registry.py", "commands/study/trial.py", "page/page.py"} <= set(searched)
    found = {
        (place, one)
        for place, text in searched.items()
        if RISKY.search(text)  # the others need not be parsed
        for one in dangers(ast.parse(text))
    }
    assert found == set(ALLOWED)


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("import pickle\npickle.load(file)", ["pickle.load"]),
        ("from pickle import loads", ["pickle.loads"]),
        ("np.load(path)", ["np.load"]),
        ("np.load(path, allow_pickle=True)", ["np.load"]),
        ("np.load(path, allow_pickle=False)", []),
        ("pd.read_pickle(path)", ["pd.read_pickle"]),
        ("import joblib", ["joblib"]),
        ("eval(text)", ["eval"]),
        ("subprocess.run(words)", ["subprocess.run"]),
    ],
)
def test_the_search_of_sources_sees_it(code: str, found: list[str]) -> None:
    assert list(dangers(ast.parse(code))) == found


class Hostile:
    """Whoever unpickles it makes a file."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return open, (str(self.marker), "w")


@pytest.fixture
def marker(tmp_path: Path) -> Path:
    """A file that is made where hostile code has run."""
    return tmp_path / "marker"


def hostile_files(marker: Path) -> dict[str, bytes]:
    """A pickle as it is, sealed as ours are, and as the arrays of a file that is otherwise ours."""
    bare = pickle.dumps(Hostile(marker))
    archive, content = io.BytesIO(), io.BytesIO()
    objects = np.array([Hostile(marker)], dtype=object)
    np.savez(archive, allow_pickle=True, format=objects, identity=objects)
    with zipfile.ZipFile(content, "w") as packed:
        packed.writestr("format.npy", bare)
    return {"bare": bare, "sealed": sealed(bare), "arrays": sealed(archive.getvalue()),
            "packed": sealed(content.getvalue())}  # fmt: skip


def test_the_hostile_file_does_harm_where_it_is_unpickled(marker: Path) -> None:
    pickle.loads(hostile_files(marker)["bare"]).close()
    assert marker.is_file()


@pytest.mark.parametrize("kind", ["bare", "sealed", "arrays", "packed"])
def test_no_checkpoint_is_unpickled(marker: Path, tmp_path: Path, kind: str) -> None:
    path = tmp_path / "checkpoint.npz"
    path.write_bytes(hostile_files(marker)[kind])
    with pytest.raises(InputError, match="cannot be read"):
        Checkpoint.read(path)
    assert not marker.exists()


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with a small run and its configuration."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "run.toml").write_text(STACK, encoding="utf-8")
    output_of("run", folder / "run.toml", "--out", folder / "out", "--quiet")
    return folder


def test_no_file_of_a_result_is_unpickled(finished: Path, marker: Path, tmp_path: Path) -> None:
    """Each in turn: `report` and `--resume` refuse it, do without it, or write it again."""
    names = sorted(path.name for path in (finished / "out").iterdir() if path.is_file())
    assert {"front.csv", "front.parquet", "config.toml", "summary.json"} <= set(names)
    for name in names:
        out = tmp_path / "out"
        shutil.copytree(finished / "out", out)
        (out / name).write_bytes(hostile_files(marker)["bare"])
        for words in (("report", out), ("run", finished / "run.toml", "--out", out, "--resume")):
            assert tolevo(*words, "--quiet").exit_code in (0, 1, 2)
        assert not marker.exists(), name
        shutil.rmtree(out)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".xlsx", ".dfq", ".pkl"])
def test_no_table_is_unpickled(marker: Path, tmp_path: Path, suffix: str) -> None:
    (tmp_path / "c.toml").write_text('model = "rv_lost_motion"\n', encoding="utf-8")
    path = tmp_path / f"table{suffix}"
    path.write_bytes(pickle.dumps(Hostile(marker)))
    words = ("simulate", tmp_path / "c.toml", path, "--out", tmp_path / "o.csv")
    assert tolevo(*words).exit_code == 2
    assert not marker.exists()


GROUPS = ("models", "problems", "algorithms", "effects", "calculations", "curves",
          "distributions", "designs")  # fmt: skip


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, marker: Path) -> str:
    """An installed plugin with a name in every group, whose import leaves a file."""
    site = tmp_path / "site"
    info = site / "tolevo_eager-1.0.dist-info"
    info.mkdir(parents=True)
    code = f"open({str(marker)!r}, 'w').close()\nclass Normal:\n    '''Does harm.'''\n"
    (site / "tolevo_eager.py").write_text(code, encoding="utf-8")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: tolevo-eager\nVersion: 1.0\n")
    entries = "\n".join(f"[tolevo.{one}]\neager = tolevo_eager:Normal\n" for one in GROUPS)
    (info / "entry_points.txt").write_text(entries, encoding="utf-8")
    monkeypatch.syspath_prepend(site)
    monkeypatch.delitem(sys.modules, "tolevo_eager", raising=False)
    return "tolevo_eager"


def test_a_plugin_is_imported_only_when_it_is_named(plugin: str, marker: Path, tmp_path: Path) -> None:
    path = written(tmp_path / "run.toml", STACK)
    shown = tolevo("list")
    assert shown.stdout.count("eager") >= len(GROUPS)
    gap = 'model = "rv_lost_motion"\n[effects]\nconsider = ["wear"]\n'
    (tmp_path / "gap.toml").write_text(gap, encoding="utf-8")
    for words in (
        ("check", path),
        ("run", path, "--out", tmp_path / "out", "--quiet"),
        ("report", tmp_path / "out"),
        ("check", tmp_path / "gap.toml"),
    ):
        output_of(*words)
        assert not marker.exists(), words
        assert plugin not in sys.modules
    named = STACK.replace('distribution = "normal"', 'distribution = "eager"')
    path.write_text(named, encoding="utf-8")
    assert tolevo("check", path).exit_code == 2  # it is no distribution
    assert marker.exists()


def test_a_formula_is_no_python(tmp_path: Path, marker: Path) -> None:
    """Names beyond those of the parts, attributes and calls are faults of the formula."""
    for formula in (
        f"open('{marker}', 'w')",
        "().__class__.__bases__[0].__subclasses__()",
        "__import__('os').system('true')",
        "housing.__class__",
        "(lambda: housing)()",
        "[housing for housing in (1, 2)]",
    ):
        text = STACK.replace("upper = 0.2\n", f'upper = 0.2\nformula = "{formula}"\n')
        path = tmp_path / "run.toml"
        path.write_text(text.replace("sensitivity = 1.0\n", "").replace("sensitivity = -1.0\n", ""))
        ended = tolevo("check", path)
        assert ended.exit_code == 2
        assert "formula" in ended.stderr
        assert not marker.exists()
