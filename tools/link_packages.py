"""Lay the mapped folders out as one import tree, ``.links/tolevo``, for tools that read files.

The folders ``tolevo``, ``models``, ... become one package only when they are installed; mypy and the
import linter do not follow an editable install. Every Python file is linked on its own:
not every tool walks through a linked folder. What stands beside the package is linked too, so that
``.links`` is a project of its own.
"""

import shutil
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINKS = ROOT / ".links"
BESIDE = ("pyproject.toml", "tests", "benchmarks", "tools")


def package_folders() -> dict[str, str]:
    """Folder of every mapped package, by dotted name, as ``pyproject.toml`` says."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    folders: dict[str, str] = project["tool"]["setuptools"]["package-dir"]
    return folders


def link_folder(folder: Path, target: Path) -> None:
    """Link the Python files of ``folder``, and ``py.typed``, to the same places in ``target``."""
    for source in [*folder.rglob("*.py"), *folder.rglob("py.typed")]:
        link = target / source.relative_to(folder)
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(source)


def main() -> None:
    """Make the tree afresh: a file that was renamed must not leave a dead link."""
    shutil.rmtree(LINKS, ignore_errors=True)
    for package, folder in package_folders().items():
        link_folder(ROOT / folder, LINKS.joinpath(*package.split(".")))
    for name in BESIDE:
        (LINKS / name).symlink_to(ROOT / name)


if __name__ == "__main__":
    main()
