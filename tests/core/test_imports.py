"""What takes long to import is imported where it is used: a run of a second has no time for it."""

import subprocess
import sys
from pathlib import Path

STACK = """
problem = "stack"
[requirement]
name = "gap"
unit = "mm"
lower = -0.2
upper = 0.2
[[part]]
name = "housing"
nominal = 55.29
unit = "mm"
sensitivity = 1.0
t_min = 0.003
t_max = 0.25
cost = { model = "reciprocal", a = 3.5, b = 0.75 }
[[part]]
name = "shaft"
nominal = 35.0
unit = "mm"
sensitivity = -1.0
t_min = 0.003
t_max = 0.25
cost = { model = "reciprocal", a = 2.0, b = 0.3 }
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


def test_a_run_imports_no_statistics_no_registry_of_units_and_no_spreadsheets(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(STACK, encoding="utf-8")
    reading = "matplotlib numba pint scipy.stats scipy.optimize openpyxl moocore tolevo.problems.rv_backlash"
    done = subprocess.run(
        [sys.executable, "-c", RUN, reading, reading.removeprefix("matplotlib ")],
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
    configs = Path(__file__).parents[2] / "configs"
    names = [str(configs / f"{name}.toml") for name in ("tooth_modification", "rv_transmission_error")]
    done = subprocess.run([sys.executable, "-c", CHECK, *names], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_the_package_alone_is_light() -> None:
    code = "import sys, tolevo; print(sorted({'numpy', 'pandas', 'scipy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
