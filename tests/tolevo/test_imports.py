"""What takes long to import is imported where it is used: a run of a second has no time for it."""

import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import GAP, HOUSING_AND_SHAFT

STACK = f"""{HOUSING_AND_SHAFT}
[algorithm]
name = "exact"
points = 20
"""
RUN = """
import sys, tolevo
plan = tolevo.read("c.toml")
print(sorted(set(sys.argv[1].split()) & set(sys.modules)))
tolevo.run(plan).write("out")
print(sorted(set(sys.argv[2].split()) & set(sys.modules)))
"""


def test_a_run_imports_no_statistics_and_no_registry_of_units(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(STACK, encoding="utf-8")
    reading = "matplotlib numba pint scipy.stats scipy.optimize openpyxl moocore tolevo.problems.rv_backlash"
    done = subprocess.run(
        [sys.executable, "-c", RUN, reading, reading.removeprefix("matplotlib ").replace("openpyxl ", "")],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.splitlines() == ["[]", "[]"]


LOADED = """
import sys
from tolevo.cli import app
try:
    app(sys.argv[2:], standalone_mode=False)
finally:
    print(sorted(set(sys.argv[1].split()) & set(sys.modules)))
"""
SCIENTIFIC = "pandas numba pint scipy.stats scipy.optimize scipy.interpolate matplotlib openpyxl moocore"


def loaded(names: str, *words: object) -> str:
    """Which of these modules a command loads, as it is printed last."""
    command = [sys.executable, "-c", LOADED, names, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[-1]


@pytest.mark.parametrize("name", ["rv40e_backlash", "tooth_modification", "rv_transmission_error", "pose_accuracy"])
def test_a_check_imports_neither_tables_nor_compilers_nor_solvers(name: str) -> None:
    others = "tolevo.commands.gap.configuration tolevo.commands.study.configuration"
    config = files("tolevo.configs").joinpath(f"{name}.toml")
    assert loaded(f"{SCIENTIFIC} {others}", "check", config, "--quiet") == "[]"


def test_a_page_is_rebuilt_without_models_and_algorithms(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(STACK, encoding="utf-8")
    assert loaded("pint numba", "run", tmp_path / "c.toml", "--out", tmp_path / "o", "--quiet") == "[]"
    computing = (
        "scipy numba pint pymoo sqlalchemy openpyxl tolevo.problems tolevo.models.inputs tolevo.algorithms.exact"
    )
    assert loaded(computing, "report", tmp_path / "o") == "[]"


def test_a_gap_analysis_imports_no_compiler_and_no_statistics(tmp_path: Path) -> None:
    torque = np.linspace(-400.0, 400.0, 60)
    table = pd.DataFrame({"torque": torque, "te": 0.25 * torque, "te_predicted": 0.2 * torque})
    table.to_csv(tmp_path / "d.csv", index=False)
    (tmp_path / "g.toml").write_text(GAP, encoding="utf-8")
    unused = "numba pint scipy.stats openpyxl sqlalchemy moocore tolevo.algorithms.exact tolevo.problems.stack"
    words = ("gap", tmp_path / "g.toml", tmp_path / "d.csv", "--out", tmp_path / "o", "--quiet", "--workers", 1)
    assert loaded(unused, *words) == "[]"


def test_drawings_do_not_compose_the_documentation_of_artists() -> None:
    code = "import tolevo.page.drawing; from matplotlib.lines import Line2D as L; print('agg_filter' in L.set.__doc__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_the_package_alone_is_light() -> None:
    code = "import sys, tolevo; print(sorted({'numpy', 'pandas', 'scipy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow  # a minute of imports
def test_every_module_can_be_the_first_that_is_imported() -> None:
    """Each in a copy of a process that has only the packages of others: no module leans on the order."""
    code = """
import importlib, os, pkgutil, sys
import matplotlib, numpy, pandas, pint, pyarrow, pydantic, pymoo.core.problem, scipy.optimize, scipy.stats, typer
import tolevo
names = []
for package in ("tolevo", "tolevo.models", "tolevo.problems", "tolevo.algorithms"):
    names += [one.name for one in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}.")]
print(*names)
"""
    names = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert len(names) > 200
    code = """
import importlib, os, sys
import matplotlib, numpy, pandas, pint, pyarrow, pydantic, pymoo.core.problem, scipy.optimize, scipy.stats, typer
for name in sys.argv[1:]:
    if not (child := os.fork()):
        try:
            importlib.import_module(name)
        except ImportError as error:
            print(name, error, flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""
    done = subprocess.run([sys.executable, "-c", code, *names], capture_output=True, text=True, check=True)
    assert done.stdout == ""
