"""What the wheel holds: every module, every data file, one version number everywhere."""

import importlib
import importlib.metadata
import importlib.resources
import pkgutil
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

import tolevo

ROOT = Path(__file__).resolve().parent.parent
PYPROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
FOLDERS: dict[str, str] = PYPROJECT["tool"]["setuptools"]["package-dir"]


def installed_packages() -> list[str]:
    """Dotted name of every package that is installed, below each mapped name."""
    found = {name for name in FOLDERS if name != "tolevo.configs"}
    for package in [*found]:
        path = importlib.import_module(package).__path__
        found |= {module.name for module in pkgutil.walk_packages(path, f"{package}.") if module.ispkg}
    return sorted(found)


PACKAGES = installed_packages()


def packages_on_disk() -> set[str]:
    """Dotted name of every folder with Python files below the mapped folders."""
    return {
        ".".join([package, *file.parent.relative_to(ROOT / folder).parts])
        for package, folder in FOLDERS.items()
        for file in (ROOT / folder).rglob("*.py")
    }


@pytest.mark.source_tree
def test_setup_finds_every_folder_with_python_files() -> None:
    text = "from distutils.core import run_setup; print(*run_setup('setup.py', stop_after='init').packages)"
    done = subprocess.run(
        [sys.executable, "-c", "import setuptools; " + text], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) == packages_on_disk()


@pytest.mark.source_tree
def test_every_folder_with_python_files_has_its_init() -> None:
    folders = {file.parent for folder in FOLDERS.values() for file in (ROOT / folder).rglob("*.py")}
    assert [folder for folder in folders if not (folder / "__init__.py").is_file()] == []


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_imports_by_its_dotted_name(package: str) -> None:
    path = importlib.import_module(package).__path__
    for module in pkgutil.iter_modules(path, prefix=f"{package}."):
        assert importlib.import_module(module.name).__name__ == module.name


@pytest.mark.parametrize(
    "entry_point",
    list(importlib.metadata.distribution("tolevo").entry_points),
    ids=lambda entry_point: f"{entry_point.group}:{entry_point.name}",
)
def test_every_entry_point_loads(entry_point: importlib.metadata.EntryPoint) -> None:
    assert callable(entry_point.load())


def test_typing_marker_is_shipped() -> None:
    assert importlib.resources.files("tolevo").joinpath("py.typed").is_file()


def test_configurations_are_shipped() -> None:
    names = {file.name for file in importlib.resources.files("tolevo.configs").iterdir()}
    assert {"rv40e_backlash.toml", "rv40e_least_cost.toml"} <= names


def test_installed_version_is_the_project_version() -> None:
    assert tolevo.__version__ == PYPROJECT["project"]["version"]


@pytest.mark.source_tree
def test_citation_names_the_project_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [tolevo.__version__]
