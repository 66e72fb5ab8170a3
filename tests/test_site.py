"""Every command and code block of the README and of the site is executed, or marked as an excerpt.

A block says in its title what it is: the name of a file that the reader saves ("seat.toml"), how
long a command takes ("takes 4 s"), or that it is an excerpt. The blocks of a page are executed in
their order, in a directory that holds nothing but `configs`, `docs` and `tests` of the project and
what earlier blocks of the page made. `make test` runs long commands and configurations with fewer
evaluations, and most pages without rendering their figures, `make test-long` as they stand.
"""

from __future__ import annotations

import re
import shlex
import shutil
import tomllib
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.blanks import blanks
from tolevo.cli import app

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LONG_PAGES = "serial_arm", "gearbox", "tour_researcher", "robot_joint"
"""Pages whose blocks `make test-long` alone runs."""
FENCE = re.compile(r'^```(\w*)(?: title="([^"]*)")?[ \t]*\n(.*?)^```', re.MULTILINE | re.DOTALL)
CODE = ("console", "csv", "python", "sh", "toml")
TAKES = re.compile(r"takes \d+ (s|min)\b")
FILE = re.compile(r"\w+\.(toml|csv)")
FEW = ("algorithm.population=8", "algorithm.generations=2")
REDUCER = ("parameters.positions=13", "parameters.search_units=32", "parameters.report_units=64",
           "references=none", "limits.backlash_max_arcmin=6.0")  # fmt: skip
EXACT = ("algorithm.points=3", "references=none")
ARM = (*EXACT, "propagation.samples=2048")
SHORTENED = {"stack_clutch.toml": (("generations = 100", "generations = 10"),)}
"""Configurations that Python blocks and commands run, with what is shorter in them."""
BATCH = ("settings.simulations=200", 'effects.consider=["spread_inflation", "lot_mixture"]')
REDUCED: dict[str, tuple[str, ...]] = {
    "gap docs/gearbox/gap.toml": ("settings.simulations=200", 'effects.consider=["lot_offset"]'),
    "gap docs/rv40e_batch/gap.toml": BATCH,
    "gap tests/data/ur5/ur5.toml": ("settings.simulations=200", 'effects.consider=["delay"]'),
    "run configs/pose_accuracy.toml": EXACT,
    "run configs/pose_accuracy_ga.toml": ("algorithm.population=40", "algorithm.generations=40"),
    "run configs/robot_arm": ARM,
    "run configs/robot_manipulator.toml": EXACT,
    "run configs/rv40e_least_cost.toml": REDUCER,
    "run configs/rv_transmission_error.toml": (
        "algorithm.population=20", "algorithm.generations=20", "references=none"),
    "run configs/tooth_modification.toml": (*FEW, "references=none"),
    "run docs/gearbox/reducer.toml": (
        *REDUCER, *FEW, 'algorithm.name="ga"', 'objectives.minimise=["cost"]'),
    "run runs/rv40e_gap/corrected.toml": (*FEW, "references=none"),
    "study configs/document_ga_study.toml": (
        "seeds=6", "run.algorithm.generations=3", 'response=["gap_percent"]', "reading=[]"),
}  # fmt: skip
"""Settings that shorten a command of more than 20 s, by what is in it; the first that fits."""
OTHERWISE = {"reproduce --out": ("configs/claims_a.toml",), "--workers 2": ("--workers", "1")}
"""Arguments that shorten a command that has no such setting; the last of two `--workers` counts."""
RENDERED = ("README", "python")
"""Pages of which `make test` renders the figures: those of every command."""
pytestmark = pytest.mark.source_tree


@dataclass(frozen=True)
class Block:
    kind: str
    title: str
    text: str

    @property
    def excerpt(self) -> bool:
        return self.title.startswith("excerpt")

    @property
    def commands(self) -> list[str]:
        lines = self.text.replace("\\\n", " ").splitlines() if self.kind in ("console", "sh") else []
        return [line for line in lines if line.strip()]


def quoted(found: re.Match[str]) -> str:
    """A file that a page shows, or some lines of it."""
    lines = (ROOT / found[1]).read_text(encoding="utf-8").splitlines()
    return "\n".join(lines[int(found[2]) - 1 : int(found[3])] if found[2] else lines)


def blocks(page: Path) -> list[Block]:
    text = re.sub(r'^--8<-- "(.*?)(?::(\d+):(\d+))?"$', quoted, page.read_text(encoding="utf-8"), flags=re.M)
    return [Block(*found) for found in FENCE.findall(text)]


def executed(page: Path) -> list[Block]:
    return [one for one in blocks(page) if one.kind in CODE and not one.excerpt]


def reduced_at(page: Path) -> bool:
    """Whether a page has a command that `make test` shortens."""
    lines = [block.text for block in executed(page)]
    return any(start in line for line in lines for start in (*REDUCED, *OTHERWISE, *SHORTENED))


@pytest.mark.parametrize("page", PAGES, ids=lambda one: one.stem)
def test_every_block_is_executed_or_an_excerpt(page: Path) -> None:
    wrong = []
    for block in blocks(page):
        if block.kind not in CODE:
            hidden = re.search(r"^(tolevo|make|pip|python3?) ", block.text, re.MULTILINE)
            wrong += [f"commands without a language: {block.text[:60]}"] if hidden else []
        elif block.excerpt:
            _readable(block)
        else:
            title = FILE.fullmatch if block.kind in ("csv", "toml") else TAKES.search
            wrong += [] if title(block.title) else [f"no title: {block.kind} {block.text[:60]}"]
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    wrong += [f"indented: {line}" for line in re.findall(r"^    (?:tolevo|make) .*", text, re.M)]
    assert wrong == []


def _readable(block: Block) -> None:
    """An excerpt is at least in its language."""
    if block.kind == "toml":
        tomllib.loads(block.text)
    elif block.kind == "python":
        compile(block.text, "excerpt", "exec")


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(one, marks=[pytest.mark.slow] if one.stem in LONG_PAGES else [], id=one.stem)
        for one in PAGES
        if executed(one)
    ],
)
def test_the_blocks_of_a_page_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with nullcontext() if page.stem in RENDERED else blanks():
        _run(page, tmp_path, monkeypatch, reduced=True)


@pytest.mark.slow
@pytest.mark.parametrize("page", [one for one in PAGES if reduced_at(one)], ids=lambda one: one.stem)
def test_the_long_blocks_of_a_page_run_as_they_stand(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _run(page, tmp_path, monkeypatch, reduced=False)


def _run(page: Path, place: Path, monkeypatch: pytest.MonkeyPatch, *, reduced: bool) -> None:
    """Execute the blocks of a page in an empty directory."""
    for name in ("docs", "tests"):
        (place / name).symlink_to(ROOT / name)
    shutil.copytree(ROOT / "configs", place / "configs")
    for name, changes in SHORTENED.items() if reduced else ():
        text = (ROOT / "configs" / name).read_text(encoding="utf-8")
        for long, short in changes:
            assert long in text
            text = text.replace(long, short)
        (place / "configs" / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(place)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, object] = {}
    for block in executed(page):
        if block.kind == "csv":
            (place / block.title).write_text(block.text, encoding="utf-8")
    used = " ".join(line for block in executed(page) for line in (*block.commands, block.text))
    for block in executed(page):
        if block.kind == "toml":
            (place / block.title).write_text(block.text, encoding="utf-8")
            table = tomllib.loads(block.text)
            if {"problem", "model", "vary"} & set(table) and used.count(block.title) == 0:
                _tolevo(f"check {block.title}", reduced)
        elif block.kind == "python":
            exec(compile(block.text, f"{page.name}: {block.title}", "exec"), names)
        for line in block.commands:
            program, _, rest = line.partition(" ")
            assert program == "tolevo", f"not executed by this test, mark it: {line}"
            _tolevo(rest, reduced)


def _tolevo(line: str, reduced: bool) -> None:
    words = shlex.split(line, comments=True)
    if reduced:
        settings = next((few for part, few in REDUCED.items() if part in line), ())
        words += [word for one in settings for word in ("--set", one)]
        words += [word for part, more in OTHERWISE.items() if part in line for word in more]
    done = CliRunner().invoke(app, words)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, f"tolevo {line}\n{done.output}"
