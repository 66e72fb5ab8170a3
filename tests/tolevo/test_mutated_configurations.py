"""`tolevo check` on configurations that were broken at random: faults, never a traceback or a hang.

Mutated are all shipped files, all blocks of the documents, and kinds that are neither; how many
times: `tests/fuzzing.py`.
"""

import copy
import re
import tomllib
import traceback
import warnings
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from typer.testing import CliRunner

from tests.fuzzing import HANG, SEED, Hang, TooLarge, guarded, share
from tolevo.cli import app

COUNT = share(50)
CHUNKS = 16
"""Tests that share the mutations, so that all cores take part."""
Table = dict[str, Any]

OTHERS = {
    "latin": """
run = "pose_accuracy_ga.toml"
seeds = 3
response = "gap_percent"
[design]
kind = "latin_hypercube"
samples = 12
[vary]
"algorithm.population" = { low = 20, high = 80 }
""",
    "morris": """
seeds = 2
response = ["hypervolume"]
time_limit_s = 60
[run]
problem = "rv_backlash"
[run.limits]
interference_probability = 0.05
[run.propagation]
method = "moments"
[design]
kind = "morris"
trajectories = 10
levels = 4
[vary]
"algorithm.crossover.probability" = { low = 0.1, high = 0.9 }
"algorithm.mutation.eta" = { low = 5, high = 50, log = true, levels = 3 }
""",
    "sobol": """
run = "pose_accuracy_ga.toml"
seeds = 2
[design]
kind = "sobol"
samples = 128
[vary.algorithm]
population = { low = 20, high = 80, integer = true }
""",
    "factorial": """
run = "pose_accuracy_ga.toml"
seeds = 2
[design]
kind = "factorial"
[vary]
"algorithm.population" = [20, 40]
"algorithm.mutation.probability" = { low = 0.001, high = 0.08, levels = 4 }
[[reading]]
figure = "1"
says = "more is better"
key = "algorithm.population"
a = 20
b = 40
response = "gap_percent"
""",
    "gap": """
model = "rv_batch"
seed = 3
[parameters]
pitch_mid = "1 um"
[variables.pitch_um]
value = "3 um"
distribution = "normal"
[free]
pin_circle_radius_mm = "0.02 mm"
[effects]
consider = ["population", "wear"]
never = ["lot_offset"]
[noise]
backlash_arcmin = "3 arcsec"
[validation]
blocks = "auto"
[settings]
false_rate = 0.01
simulations = 1000
bootstrap = 20
[next_measurement]
readings = 30
effects = ["lot_mixture"]
[next_measurement.amount]
lot_mixture = 0.1
""",
    "gap_table": """
model = "table"
[columns]
Torque = { role = "torque", unit = "N m" }
n = { role = "speed", unit = "1/min" }
te = { role = "measured", unit = "deg" }
te_sim = { role = "predicted", unit = "arcsec", of = "te" }
[effects]
consider = "all"
[next_measurement]
readings = 20
[next_measurement.range]
Torque = ["-100 Nm", "100 Nm"]
n = { values = [5, 10, "15 1/min"] }
""",
    "model": """
model = "manipulator_pose"
seed = 0
[parameters]
half_length_mm = 200
arm_length_mm = [400, 400, 400]
ring_r_mm = [300, "0.65 m"]
[parameters.elementary_errors]
arm_length_1_um = 10
[zero]
dr_mm = 0.1
[[effect]]
name = "gravity_sag"
[effect.parameters]
moving_mass_kg = 3
""",
    "reducer": """
problem = "rv_reducer"
[parameters]
positions = 61
search_units = 64
report_units = 64
[limits]
interference_probability = 0.05
[algorithm]
name = "nsga2"
population = 20
generations = 10
[choice]
budget = 30
[choice.weights]
cost = 1
[rounding]
pin_radius_um = "R20"
""",
}
"""Kinds of configurations that are not shipped."""

NASTY: tuple[Any, ...] = (
    -1, 0, 1, 2, 10**8, 10**9, 10**12, 10**400, -(10**9), 2**63, 1e-300, 1e300, -1e9, 0.5,
    float("nan"), float("inf"), float("-inf"), True, False, "", "x", " ", "nan", "1", [], [1], [[]],
    [None], {}, [{}], {"a": 1}, {"low": 1, "high": 2}, {"low": 1, "high": 2, "levels": 10**9},
    {"value": 1}, {"min": 1, "max": 2}, "2 um", "2 um**9**9**9", "2 mm**", "2 um/0", "1'", "5 %um",
    "5 um!", "15 1/min", "0.25 Hz", "1e400 mm", "-5 kg", "um", "2 (", "()" * 60, "9" * 5000,
    "\x00", "ä€\U0001f600", "a" * 10_000, "../x.toml", "/", ".", "+0.02/-0.01", "25 H7", "IT6",
    "normal", "table", "monte_carlo", "exact", "hybrid", "nsga3", "half", "all", "auto",
    datetime(2024, 2, 29, tzinfo=UTC), [1, "a", True], [0.0] * 1000, ["2 um", 3], ["cost"],
    "a" * 50 + "(" * 50, "1/0", "x**x**x**9", "sqrt(-1)", "__import__('os')",
)  # fmt: skip


def corpus() -> dict[str, str]:
    """Texts of valid configurations by name."""
    folder = Path(str(files("tolevo.configs")))
    shipped = {one.stem: one.read_text("utf-8") for one in sorted(folder.glob("*.toml"))
               if not one.stem.startswith("claims")}  # fmt: skip
    return shipped | OTHERS | blocks()


def blocks() -> dict[str, str]:
    """The TOML of the documents and the files they show, where they are there, without sketches."""
    root = Path(__file__).parents[2]
    shown = sorted((root / "docs").glob("*/*.toml"))
    found = {f"{one.parent.name} {one.stem}": one.read_text("utf-8") for one in shown}
    for page in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        text = page.read_text("utf-8") if page.is_file() else ""
        for at, block in enumerate(re.findall(r"^```toml\b[^\n]*\n(.*?)^```", text, re.DOTALL | re.MULTILINE)):
            with suppress(tomllib.TOMLDecodeError):
                if tomllib.loads(block):
                    found[f"{page.stem} {at}"] = block
    return found


def mutated(texts: dict[str, str], rng: np.random.Generator) -> str:
    """One of the texts, with one to three faults."""
    names = sorted(texts)
    text = texts[names[rng.integers(len(names))]]
    if rng.random() < 0.15:
        return broken_text(text, rng)
    table = tomllib.loads(text)
    other = tomllib.loads(texts[names[rng.integers(len(names))]])
    for _ in range(1 + rng.integers(3)):
        places = list(paths(table))
        if not places:
            break
        mutate(table, places[rng.integers(len(places))], other, rng)
    return tomli_w.dumps(without_none(table))


def broken_text(text: str, rng: np.random.Generator) -> str:
    """The text with some characters lost, doubled or replaced, or lines in another order."""
    for _ in range(1 + rng.integers(4)):
        at = int(rng.integers(len(text)))
        size = int(rng.integers(1, 4))
        sign = "=[]{}\"'#.,\n 09e-\\"[rng.integers(17)]
        new = (text[at : at + size] * 2, "", sign, text[at : at + size][::-1])[rng.integers(4)]
        text = text[:at] + new + text[at + size :]
    if rng.random() < 0.2:
        lines = text.split("\n")
        one, two = rng.integers(len(lines), size=2)
        lines[one], lines[two] = lines[two], lines[one]
        text = "\n".join(lines)
    return text


Place = tuple[str | int, ...]


def paths(value: Any, place: Place = ()) -> Iterator[Place]:
    """Places of every value, tables and lists included."""
    inner: Any = value.items() if isinstance(value, dict) else enumerate(value)
    for key, one in inner:
        yield (*place, key)
        if isinstance(one, dict | list):
            yield from paths(one, (*place, key))


def at(value: Any, place: Place) -> Any:
    for key in place:
        value = value[key]
    return value


def mutate(table: Table, place: Place, other: Table, rng: np.random.Generator) -> None:
    """One fault at a place."""
    holder, key = at(table, place[:-1]), place[-1]
    value = holder[key]
    match rng.integers(8):
        case 0 | 1 | 2:
            holder[key] = copy.deepcopy(NASTY[rng.integers(len(NASTY))])
        case 3 if isinstance(value, int | float) and not isinstance(value, bool):
            factor = (-1, 0, 2, 10**3, 10**6, 10**9)[rng.integers(6)]
            holder[key] = value * factor if rng.random() < 0.8 else value // 10**6
        case 4:
            del holder[key]
        case 5 if isinstance(holder, dict):
            name = str(key)
            cut = int(rng.integers(len(name) + 1))
            holder[name[:cut] + "x" * int(rng.integers(2)) + name[cut + 1 :]] = holder.pop(key)
        case 6:
            places = list(paths(other))
            holder[key] = copy.deepcopy(at(other, places[rng.integers(len(places))]))
        case _ if isinstance(holder, dict):
            places = list(paths(other))
            chosen = places[rng.integers(len(places))]
            holder[str(chosen[-1])] = copy.deepcopy(at(other, chosen))


def without_none(value: Any) -> Any:
    """TOML has no null."""
    if isinstance(value, dict):
        return {key: without_none(one) for key, one in value.items() if one is not None}
    return [without_none(one) for one in value if one is not None] if isinstance(value, list) \
        else value  # fmt: skip


def outcome(path: Path) -> str:
    """What is wrong with how `check` takes a file; empty where it is accepted or refused."""
    try:
        with guarded(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = CliRunner().invoke(app, ["check", str(path)])
    except Hang:
        return f"hangs for more than {HANG} s"
    except TooLarge as error:
        return f"takes {error}"
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        return "".join(traceback.format_exception(result.exception))
    if result.exit_code not in (0, 2):
        return f"status {result.exit_code}: {result.stderr}"
    if result.exit_code == 2 and not all(": " in line for line in result.stderr.splitlines()[:1]):
        return f"a fault without its place: {result.stderr}"
    return ""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with what the configurations name."""
    shipped = Path(str(files("tolevo.configs")))
    for one in shipped.glob("*.toml"):
        (tmp_path / one.name).write_text(one.read_text("utf-8"), encoding="utf-8")
    return tmp_path


def test_blocks_with_titles_and_files_that_pages_show_are_mutated() -> None:
    if not (root := Path(__file__).parents[2] / "docs").is_dir():
        pytest.skip("the documents are not there")
    names = set(blocks())
    assert {one.stem for one in (root / "examples").glob("*.toml")} <= {name.split(" ")[1] for name in names}
    assert {"rv_reducer 0", "conventions 0", "robot_joint 0"} <= names


def test_what_is_mutated_is_valid(folder: Path) -> None:
    for name, text in OTHERS.items():
        path = folder / f"{name}_.toml"
        path.write_text(text, encoding="utf-8")
        result = CliRunner().invoke(app, ["check", str(path)])
        assert result.exit_code == 0, f"{name}: {result.output}"


@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_a_broken_configuration_is_refused_or_taken(folder: Path, chunk: int) -> None:
    texts, bad = corpus(), []
    CliRunner().invoke(app, ["check", str(folder / "rv40e_backlash.toml")])  # imports take time
    for number in range(chunk, COUNT, CHUNKS):
        text = mutated(texts, np.random.default_rng((SEED, number)))
        path = folder / "mutated.toml"
        path.write_text(text, encoding="utf-8")
        if wrong := outcome(path):
            bad.append(f"mutation {number}: {wrong}\n{text[:3000]}")
    assert not bad, f"{len(bad)} of {COUNT}:\n" + "\n\n".join(bad[:5])
