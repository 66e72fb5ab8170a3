"""The tests in environments with the lowest and the newest versions that pyproject.toml allows.

`make test-versions [PYTHONS="3.11 3.13"] [TESTS="tests/models tests/tolevo"]`: for every Python from
3.11 to 3.13 that is installed (missing ones are named), each in an environment of its own in
`.venv-versions/`, without slow tests. A version that has no wheel for a Python is no version
for it. A table says what passed; status 1 where one fails.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLACE = ROOT / ".venv-versions"
PYTHONS = ("3.11", "3.12", "3.13")
RESOLUTIONS = ("lowest-direct", "highest")
EXTRAS = "dev,gap,study"
UV = ROOT / ".venv" / "bin" / "uv"


def installed(version: str) -> str | None:
    """The interpreter of that version, where there is one: nothing is downloaded.

    Those that pyenv keeps without offering them count as well, the newest of a version.
    """
    options = ["--no-project", "--no-python-downloads"]
    found = _output([str(UV), "python", "find", *options, version])
    folder = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    kept = {int(one.parts[-3].rpartition(".")[2]): str(one)
            for one in folder.glob(f"{version}.*/bin/python")
            if one.parts[-3].rpartition(".")[2].isdigit()}  # fmt: skip
    return found or (kept[max(kept)] if kept else None)


def _output(command: list[str]) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()  # noqa: S603


def tried(version: str, python: str, resolution: str) -> str:
    """What came of one environment: `passed`, or the step that failed."""
    folder = PLACE / f"{version}-{resolution}"
    own = str(folder / "bin" / "python")
    install = [str(UV), "pip", "install", "--quiet", "--python", own, "--resolution", resolution,
               "--only-binary", ":all:"]  # fmt: skip
    chosen = os.environ.get("TESTS", "").split()
    steps = {
        "environment": [str(UV), "venv", "--quiet", "--clear", "--seed", "--python", python,
                        str(folder)],
        "installation": [*install, "--editable", f"{ROOT}[{EXTRAS}]"],
        "tests": [own, "-m", "pytest", "-q", "--numprocesses", "logical", "--dist", "worksteal",
                  "-m", "not slow", *chosen],
    }  # fmt: skip
    one_thread = os.environ | {"OPENBLAS_NUM_THREADS": "1"}  # as in `make test`
    for name, command in steps.items():
        if subprocess.run(command, cwd=ROOT, env=one_thread, check=False).returncode:  # noqa: S603
            return f"{name} failed"
    return "passed"


def main() -> int:
    """0 where every combination of what is installed passes."""
    wanted = os.environ.get("PYTHONS", "").split() or list(PYTHONS)
    rows = []
    for version in wanted:
        python = installed(version)
        if python is None:
            rows.append((version, "", "not installed: not tested"))
            continue
        rows += [(version, one, tried(version, python, one)) for one in RESOLUTIONS]
    for version, resolution, result in rows:
        print(f"Python {version:5} {resolution:14} {result}")
    return int(any(result.endswith("failed") for _, _, result in rows))


if __name__ == "__main__":
    sys.exit(main())
