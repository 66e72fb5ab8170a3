"""The worked example of docs/gearbox.md: from files of a works to a drawing and a named effect."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from openpyxl import load_workbook

from tests.small_jobs import output_of

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "gearbox.md"
FEW = {
    "check": (),
    "run": ("parameters.positions=13", "parameters.search_units=32",
            "parameters.report_units=64", "references=none",
            'algorithm.name="ga"', "algorithm.population=8", "algorithm.generations=2",
            'objectives.minimise=["cost"]', "limits.backlash_max_arcmin=6.0"),
    "gap": (),
}  # fmt: skip
"""Settings by command that make it short enough for a test."""
pytestmark = [pytest.mark.source_tree, pytest.mark.usefixtures("unrendered")]


def commands() -> list[list[str]]:
    text = PAGE.read_text(encoding="utf-8")
    return [shlex.split(line) for line in text.splitlines() if line.startswith("tolevo ")]


def follow(place: Path, *steps: str) -> Path:
    """Follow steps of the page; the folder below which their results are."""
    for words in commands():
        if words[1] not in steps:
            continue
        moved = [str(ROOT / one) if one.startswith("docs/") else one for one in words[1:]]
        moved = [str(place / one) if one.startswith("runs/") else one for one in moved]
        few = [part for one in FEW[moved[0]] for part in ("--set", one)]
        output_of(*moved, "--quiet", *few)
    return place / "runs"


def test_each_step_is_a_command_of_the_page() -> None:
    assert [words[1] for words in commands()] == ["check", "run", "gap"]


def test_the_spreadsheet_is_ready_for_the_drawing(tmp_path: Path) -> None:
    ended = follow(tmp_path, "check", "run")
    book = load_workbook(ended / "gearbox" / "allocation.xlsx")
    heads, *rows = book["Allocation"].iter_rows(values_only=True)
    pitch = [dict(zip(heads, row, strict=True)) for row in rows if "pitch_um" in row]
    assert pitch
    for one in pitch:
        ends = [float(str(one[key])) for key in ("lower_deviation", "upper_deviation", "rounded")]
        assert ends[1] - ends[0] == pytest.approx(2.0 * ends[2])
        assert one["unit"] == "um"
    mechanism = [row[0] for row in book["Mechanism"].iter_rows(values_only=True)]
    assert any("reducer RG-20 (drawing RG20-100-00)" in str(line) for line in mechanism)
    told = json.loads((ended / "gearbox" / "summary.json").read_text(encoding="utf-8"))
    assert "EUR" in json.dumps(told)


@pytest.mark.slow  # 18 s of CPU: at fewer positions of a turn an input is named beside the lot
def test_the_lot_that_is_off_is_named(tmp_path: Path) -> None:
    ended = follow(tmp_path, "gap")
    said = json.loads((ended / "gearbox_gap" / "gap.json").read_text(encoding="utf-8"))
    (effect,) = said["effects"]
    assert effect["name"] == "lot_offset"
    low, high = effect["parameters"]["offset_C_arcmin"]["interval"]
    assert low < 0.45 < high
    assert said["verdict"] in ("named", "ambiguous")
