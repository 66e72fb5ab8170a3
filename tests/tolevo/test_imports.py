"""What takes long to import is imported where it is used: a run of a second has no time for it."""

import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

from tests.small_jobs import HOUSING_AND_SHAFT

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


CHECK = """
import sys, tolevo
for name in sys.argv[1:]:
    tolevo.check(name)
print("numba" in sys.modules)
"""


def test_what_computes_no_rotation_and_no_unit_by_contact_imports_no_compiler() -> None:
    configs = files("tolevo.configs")
    names = [str(configs.joinpath(f"{name}.toml")) for name in ("tooth_modification", "rv_transmission_error")]
    done = subprocess.run([sys.executable, "-c", CHECK, *names], capture_output=True, text=True, check=True)
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
