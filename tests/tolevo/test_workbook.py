"""A stack as a workbook: out, in and out again; faults at their cells; a result that calculates by itself."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from openpyxl import Workbook, load_workbook
from typer.testing import CliRunner

import tolevo
from tolevo.cli import app
from tolevo.configuration.reader import read
from tolevo.configuration.workbook import read_sheets, write_sheets
from tolevo.errors import InputError

FLANGE = """
problem = "stack"
seed = 3
name = "flange"
[objectives]
minimise = ["cost"]
[algorithm]
name = "exact"
[rounding]
steps = [0.01, 0.02, 0.03, 0.05, 0.08, 0.12]
[limits]
"gap.worst_case" = 0.4
tilt = { rss = 0.3 }
[[requirement]]
name = "gap"
unit = "mm"
lower = 0.1
upper = 0.9
[[requirement]]
name = "tilt"
unit = "mm"
upper = 2.0
nominal = 1.5
[[part]]
name = "hub"
unit = "mm"
nominal = 40.5
sensitivity = { gap = 1.0, tilt = 0.5 }
t_min = 0.01
t_max = 0.2
cp = 1.33
shift = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.05 }
[[part]]
name = "ring"
unit = "mm"
count = 2
nominal = 20.0
sensitivity = { gap = -1.0, tilt = 0.25 }
[[part.process]]
name = "turned"
t_min = 0.05
t_max = 0.2
cost = { model = "reciprocal", a = 0.5, b = 0.04 }
[[part.process]]
name = "ground"
t_min = 0.01
t_max = 0.05
cost = { model = "reciprocal_power", a = 2.0, b = 0.02, k = 1.2 }
[[part]]
name = "shim"
unit = "um"
nominal = 0.0
sensitivity = { gap = 0.001, tilt = 0.002 }
limits = "+20/-10"
[[part]]
name = "bush"
unit = "mm"
nominal = 10.0
distribution = "uniform"
sensitivity = { gap = 1.0, tilt = -1.0 }
tolerance = 0.015
[[correlation]]
parts = ["hub", "ring_1"]
coefficient = 0.4
"""


def edited(path: Path, cells: dict[str, Any]) -> Path:
    """The workbook with other cells: "Parts!D3" by name."""
    book = load_workbook(path)
    for place, value in cells.items():
        title, _, cell = place.partition("!")
        book[title][cell] = value
    book.save(path)
    return path


def cell_of(path: Path, title: str, row: int, column: str) -> str:
    """The place of the cell below a heading."""
    head = next(load_workbook(path)[title].iter_rows(max_row=1, values_only=True))
    return f"{title}!{chr(ord('A') + list(head).index(column))}{row}"


@pytest.fixture
def flange(tmp_path: Path) -> Path:
    path = tmp_path / "flange.xlsx"
    path.write_bytes(write_sheets(tomllib.loads(FLANGE)))
    return path


def value_in(book: Any, title: str, place: str) -> Any:
    """A cell as a spreadsheet computes it: ranges as vectors, and the four functions that the sheets use."""
    stored: Any = book[title][place.replace("$", "")].value
    if not isinstance(stored, str) or not stored.startswith("="):
        return stored
    names: dict[str, Any] = {}

    def reference(match: re.Match[str]) -> str:
        sheet, first, last = match[1] or title, match[2].replace("$", ""), match[3]
        name = f"v{len(names)}"
        if last is None:
            names[name] = value_in(book, sheet, first)
        else:
            area = book[sheet][f"{first}:{last[1:].replace('$', '')}"]
            names[name] = np.array([value_in(book, sheet, cell.coordinate) for (cell,) in area], dtype=float)
        return name

    text = re.sub(r"(?:(\w+)!)?(\$?[A-Z]{1,2}\$?\d+)(:\$?[A-Z]{1,2}\$?\d+)?", reference, stored[1:])
    functions = {
        "SUMPRODUCT": lambda *columns: float(np.prod(columns, axis=0).sum()),
        "SQRT": np.sqrt,
        "AND": lambda *tests: all(tests),
    }
    return eval(text, {"__builtins__": {}}, functions | names)


def test_tables_come_back_as_they_were(flange: Path) -> None:
    """The same configuration by the file and by the workbook, and the same workbook of both."""
    stated = tomllib.loads(FLANGE)
    assert read(flange).toml() == read(stated).toml()
    content = flange.read_bytes()
    sheets = read_sheets(content, "flange.xlsx")
    assert sheets.tables["part"] == stated["part"]
    assert write_sheets(sheets.tables) == content  # nor does it depend on the clock


def test_one_requirement_in_a_list_stays_in_a_list() -> None:
    stated = tomllib.loads(FLANGE.replace("tilt = { rss = 0.3 }\n", ""))
    stated["requirement"] = stated["requirement"][:1]
    for part in stated["part"]:
        part["sensitivity"] = {"gap": part["sensitivity"]["gap"]}
    assert read_sheets(write_sheets(stated), "x").tables == stated


def test_the_template_is_the_configuration_of_the_clutch(tmp_path: Path) -> None:
    path = tmp_path / "stack.xlsx"
    done = CliRunner().invoke(app, ["template", "stack", "--out", str(path)])
    assert done.exit_code == 0, done.output
    again = CliRunner().invoke(app, ["template", "stack", "--out", str(path)])
    assert again.exit_code == 2  # it is the user's file now
    clutch = Path(str(tolevo.__file__)).parents[1] / "configs" / "stack_clutch.toml"
    assert read(path).toml() == read(clutch).toml()
    book = load_workbook(path)
    assert book.sheetnames == ["Stack", "Requirements", "Parts", "Costs"]
    lists = {rule.formula1 for sheet in book for rule in sheet.data_validations.dataValidation}
    assert '"worst_case,rss,shifted_rss,monte_carlo"' in lists
    assert any(text.startswith("Parts!$A$2") for text in lists)
    assert all(book["Parts"].cell(1, at).comment for at in range(1, 9))


def test_faults_are_placed_at_their_cells(flange: Path) -> None:
    """A fault for each cell, all at once, by the command, with status 2 and nothing written."""
    edited(flange, {
        cell_of(flange, "Parts", 2, "t_min"): -1.0,
        cell_of(flange, "Parts", 4, "unit"): "mn",
        cell_of(flange, "Costs", 3, "model"): "recipocal",
        cell_of(flange, "Requirements", 3, "upper"): "much",
        cell_of(flange, "Requirements", 2, "limits.worst_case"): "a little",
    })  # fmt: skip
    out = flange.parent / "out"
    done = CliRunner().invoke(app, ["run", str(flange), "--out", str(out)])
    assert done.exit_code == 2
    assert not out.exists()
    lines = done.stderr.splitlines()
    for title, row, column in (("Parts", 2, "t_min"), ("Parts", 4, "unit"), ("Costs", 3, "model"),
                               ("Requirements", 3, "upper"), ("Requirements", 2, "limits.worst_case")):  # fmt: skip
        place = f"flange.xlsx: {cell_of(flange, title, row, column)} ("
        assert any(line.startswith(place) for line in lines), (place, lines)


@pytest.mark.parametrize(
    ("cells", "place", "words"),
    [
        ({"Parts!A3": None}, "Parts!A3", "is missing"),
        ({"Costs!A2": "hubb"}, "Costs!A2", 'must be a part of the sheet "Parts", got "hubb"'),
        ({"Costs!B3": None}, "Parts!A3 (part[1])", "too many"),
        ({"Parts!Z2": 5.0}, "Parts!Z2", "without a heading"),
        ({"Parts!B1": "name"}, "Parts!B1", "heads two columns"),
        ({"Parts!C3": "=20*1"}, "Parts!C3", "formula without a stored value"),
        ({"Stack!B3": "[1, 2"}, "Stack!B3", "no list or table of TOML"),
        ({"Stack!A3": "a b"}, "Stack!A3", "is no key"),
        ({"Stack!A3": None}, "Stack!B3", "value without a key"),
    ],
)
def test_what_a_sheet_cannot_mean(flange: Path, cells: dict[str, Any], place: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        read(edited(flange, cells))
    assert any(
        fault.place.startswith(f"flange.xlsx: {place}") and words in str(fault) for fault in caught.value.faults
    ), caught.value.faults


def test_a_cell_that_cannot_be_read_is_one_fault(tmp_path: Path) -> None:
    """The formula needs the nominal of the hub, which is not said to be missing as well."""
    clutch = Path(str(tolevo.__file__)).parents[1] / "configs" / "stack_clutch.toml"
    (tmp_path / "clutch.xlsx").write_bytes(write_sheets(tomllib.loads(clutch.read_text(encoding="utf-8"))))
    with pytest.raises(InputError) as caught:
        read(edited(tmp_path / "clutch.xlsx", {"Parts!C2": "=55+0.29"}))
    assert [fault.place for fault in caught.value.faults] == ["clutch.xlsx: Parts!C2"]


def test_a_percentage_of_a_cell_is_a_percentage(tmp_path: Path) -> None:
    book = Workbook()
    book.active.append(["name", "tolerance"])
    book.active.append(["pin", 0.01])
    book.active.title = "Parts"
    book.active["B2"].number_format = "0.0%"
    book.save(tmp_path / "p.xlsx")
    assert read_sheets((tmp_path / "p.xlsx").read_bytes(), "p.xlsx").tables["part"] == [
        {"name": "pin", "tolerance": "1 %"}
    ]


def test_a_file_that_is_no_workbook_is_refused(tmp_path: Path) -> None:
    (tmp_path / "stack.xlsx").write_bytes(b"PK\x03\x04 and nothing else")
    with pytest.raises(InputError, match=r"stack.xlsx: is not a workbook"):
        read(tmp_path / "stack.xlsx")


def test_a_run_writes_a_workbook_that_calculates_by_itself(flange: Path) -> None:
    """Worst case and root of squares by formulas agree with the product, also at other tolerances."""
    out = flange.parent / "out"
    by_file = tolevo.run(tomllib.loads(FLANGE))
    done = tolevo.run(flange, out)
    assert done.front.equals(by_file.front)
    copy = out / "stack.xlsx"
    assert read(copy).toml() == read(flange).toml()  # the input is as it was
    book = load_workbook(copy)
    problem = read(flange).problem
    assert problem is not None
    parts = [row[0].value for row in book["Allocation"].iter_rows(min_row=2)]
    assert parts == ["hub", "ring", "shim", "bush"]
    cost = {"E2": 0.05, "E3": 0.03, "E4": 15.0, "E5": 0.02}
    for changed in ({}, cost):
        for place, value in changed.items():
            book["Allocation"][place] = value
        t = np.array([[book["Allocation"][f"E{row}"].value for row in range(2, 6)]])
        ring, process = book["Allocation"]["E3"].value, problem.names.index("ring_process")
        design = np.insert(t, process, float(ring <= 0.05), axis=1)
        outputs = problem.outputs_of(design)
        for row, name in ((2, "gap"), (3, "tilt")):
            worst, rss = outputs[f"{name}.worst_case"][0], outputs[f"{name}.rss"][0]
            np.testing.assert_allclose(value_in(book, "Analysis", f"F{row}"), worst, rtol=1e-12)
            np.testing.assert_allclose(value_in(book, "Analysis", f"J{row}"), rss, rtol=1e-12)
            if not changed:
                stored = [book["Analysis"][f"{column}{row}"].value for column in "OP"]
                np.testing.assert_allclose(stored, [worst, rss], rtol=1e-12)
    nominal, upper = value_in(book, "Analysis", "C2"), value_in(book, "Analysis", "E2")
    greatest = value_in(book, "Analysis", "H2")
    assert greatest == pytest.approx(nominal + value_in(book, "Analysis", "F2"))
    assert value_in(book, "Analysis", "M2") == (greatest <= upper and value_in(book, "Analysis", "G2") >= 0.1)


def test_an_analysis_writes_the_same_sheets(flange: Path) -> None:
    """At the loosest tolerances: least and greatest by formulas are those of the table."""
    out = flange.parent / "analysis"
    found = tolevo.analyse(flange, out).requirements.set_index("requirement")
    book = load_workbook(out / "stack.xlsx")
    for row, name in ((2, "gap"), (3, "tilt")):
        assert book["Analysis"][f"A{row}"].value == name
        for column, key in (("G", "worst_case_least"), ("H", "worst_case_greatest"),
                            ("I", "mean"), ("K", "rss_least"), ("L", "rss_greatest")):  # fmt: skip
            np.testing.assert_allclose(value_in(book, "Analysis", f"{column}{row}"), found[key][name], rtol=1e-9)
        assert value_in(book, "Analysis", f"M{row}") == found["kept_worst_case"][name]


def test_a_result_is_replaced_where_the_copy_is_run_again(flange: Path) -> None:
    first, second = flange.parent / "a", flange.parent / "b"
    tolevo.run(flange, first)
    tolevo.run(first / "stack.xlsx", second)
    one, other = (load_workbook(folder / "stack.xlsx") for folder in (first, second))
    assert one.sheetnames == other.sheetnames == ["Stack", "Requirements", "Parts", "Costs", "Allocation", "Analysis"]
    assert (first / "allocation.csv").read_bytes() == (second / "allocation.csv").read_bytes()
