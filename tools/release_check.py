"""Builds sdist and wheel, installs each alone, and uses it: what must hold before a release.

Each goes into an environment of its own that shares the locked packages but not the project, so
that a file which the archive forgot is missed.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parent.parent
TRIED = """
import sys, tolevo
from pathlib import Path
assert Path(tolevo.__file__).is_relative_to(sys.prefix), tolevo.__file__
assert tolevo.__version__ == sys.argv[1], tolevo.__version__
result = tolevo.run(sys.argv[2])
assert result.front["gap_percent"].iloc[0] < 0.1
result.write("result")
assert Path("result/report.html").is_file()
print(f"least cost {result.front['cost'].iloc[0]:.2f}")
"""
"""A run from Python, of the configuration in the second argument."""
LICENCE, CHANGES = "LICENSE", "CHANGELOG.md"


def main() -> int:
    """Print what fails; exit status 1 where something does."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    number = str(version["version"])
    faults = _undescribed(number)
    with TemporaryDirectory(prefix="tolevo-release-") as place:
        built = Path(place) / "dist"
        _call(sys.executable, "-m", "build", "--no-isolation", "--outdir", str(built), str(ROOT))
        for archive in sorted(built.iterdir()):
            faults += _incomplete(archive)
            faults += _unusable(archive, Path(place), number)
    for fault in faults:
        print(f"release: {fault}", file=sys.stderr)
    print(f"version {number}: {'not ready' if faults else 'ready'}")
    return 1 if faults else 0


def _undescribed(number: str) -> list[str]:
    """Whether the changelog says what the version changes."""
    text = (ROOT / CHANGES).read_text(encoding="utf-8")
    found = re.search(rf"^## \[?{re.escape(number)}\]?", text, re.MULTILINE)
    return [] if found else [f"{CHANGES} has no section {number}: name what is Unreleased"]


def _incomplete(archive: Path) -> list[str]:
    """Files that an archive lacks."""
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as opened:
            names = opened.namelist()
        wanted = {"tolevo/py.typed", "tolevo/configs/rv40e_backlash.toml", "entry_points.txt"}
    else:
        with tarfile.open(archive) as opened_tar:
            names = opened_tar.getnames()
        wanted = {"tolevo/py.typed", "configs/rv40e_backlash.toml", "pyproject.toml", "README.md"}
    wanted |= {LICENCE}
    return [f"{archive.name} lacks {one}" for one in sorted(wanted)
            if not any(name.endswith(one) for name in names)]  # fmt: skip


def _unusable(archive: Path, place: Path, number: str) -> list[str]:
    """What goes wrong where only this archive of the project is installed."""
    folder = place / archive.name.removesuffix(".whl").removesuffix(".tar.gz") / archive.suffix[1:]
    venv.create(folder, symlinks=True)  # its own pip would bring an older setuptools
    python = str(folder / "bin" / "python")
    own = Path(_call(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"))
    shared = sysconfig.get_path("purelib")
    (own / "shared.pth").write_text(f"{shared}\n", encoding="utf-8")  # its own .pth files are not
    options = ("--quiet", "--no-deps", "--no-index", "--no-build-isolation")
    try:
        _call(sys.executable, "-m", "pip", "--python", python, "install", *options, "--ignore-installed", str(archive))
        configuration = _example(folder)
        print(archive.name, _call(python, "-c", TRIED, number, str(configuration), at=folder))
        _call(str(folder / "bin" / "tolevo"), "list", "--json", at=folder)
    except subprocess.CalledProcessError as error:
        return [f"{archive.name}: {error.cmd[:4]} failed\n{error.stdout}{error.stderr}"]
    return []


def _example(folder: Path) -> Path:
    """The mechanism of the README, as a file."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = re.search(r'```toml title="(\w+\.toml)"\n(.*?)```', text, re.DOTALL)
    assert found is not None
    path = folder / found[1]
    path.write_text(found[2], encoding="utf-8")
    return path


def _call(*command: str, at: Path | None = None) -> str:
    """Run a command away from the sources, and return what it prints."""
    left = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=at or Path(sys.prefix), env=left, check=True,
                          capture_output=True, text=True)  # fmt: skip
    return done.stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
