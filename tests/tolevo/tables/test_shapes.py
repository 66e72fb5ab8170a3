"""Tables of measuring machines in their shapes, each in four dialects: values, limits and parts must be right."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import tolevo
from tolevo import tables, units

PARTS = 12
NAMES = ("Bohrung Ø D1", "Breite L2", "Lage P3")
NOMINAL, LOWER, UPPER = (25.0, 40.0, 0.0), (25.0, 39.95, 0.0), (25.021, 40.05, 0.08)
VALUES = np.random.default_rng(44).normal((25.0104, 39.9873, 0.0412), (0.0035, 0.0081, 0.0077), (PARTS, 3)).round(4)
Cells = list[list[str]]
DIALECTS = {
    "German": (";", ",", "cp1252", "\r\n"),
    "tabs": ("\t", ".", "utf-8", "\n"),
    "bars": ("|", ",", "utf-16", "\r\n"),
    "commas": (",", ".", "utf-8-sig", "\n"),
}


def number(value: float, places: int = 4) -> str:
    return f"{value:.{places}f}"


def calypso() -> Cells:
    head = ["planid", "partnb", "id", "type", "actual", "nominal", "uppertol", "lowertol", "deviation", "exceed"]
    rows = [
        ["HOUSING-7", str(part + 1), name, "len", number(VALUES[part, at]), number(NOMINAL[at]),
         number(UPPER[at] - NOMINAL[at]), number(LOWER[at] - NOMINAL[at]), number(VALUES[part, at] - NOMINAL[at]), ""]
        for part in range(PARTS) for at, name in enumerate(NAMES)
    ]  # fmt: skip
    return [head, *rows]


def gom() -> Cells:
    head = ["Teil", "Element", "Nennwert", "Istwert", "Tol -", "Tol +", "Abw."]
    order = [(part, at) for at in range(3) for part in range(PARTS)]
    return [head] + [
        [str(part + 1), NAMES[at], number(NOMINAL[at]), number(VALUES[part, at]), number(LOWER[at] - NOMINAL[at]),
         number(UPPER[at] - NOMINAL[at]), number(VALUES[part, at] - NOMINAL[at])]
        for part, at in order
    ]  # fmt: skip


def limits_per_row() -> Cells:
    """No part is named: the k-th value of each characteristic is of the k-th part."""
    head = ["Merkmal", "Einheit", "Messwert", "Sollwert", "UGW", "OGW"]
    return [head] + [
        [name, "mm", number(VALUES[part, at]), number(NOMINAL[at]), number(LOWER[at]), number(UPPER[at])]
        for part in range(PARTS) for at, name in enumerate(NAMES)
    ]  # fmt: skip


def transposed() -> Cells:
    head = ["Merkmal", "Einheit", "Nennmaß", "OT", "UT", *(f"Teil {part + 1}" for part in range(PARTS)), "Mittelwert"]
    return [["Messprotokoll"], head] + [
        [name, "mm", number(NOMINAL[at]), number(UPPER[at] - NOMINAL[at]), number(LOWER[at] - NOMINAL[at]),
         *(number(value) for value in VALUES[:, at]), number(VALUES[:, at].mean())]
        for at, name in enumerate(NAMES)
    ]  # fmt: skip


def numbered() -> Cells:
    return [["Feature", *(str(part + 1) for part in range(PARTS))]] + [
        [name, *(number(value) for value in VALUES[:, at])] for at, name in enumerate(NAMES)
    ]


def wide() -> Cells:
    return [["Teil", *(f"{name} [mm]" for name in NAMES)]] + [
        [str(part + 1), *(number(value) for value in VALUES[part])] for part in range(PARTS)
    ]


def with_limits() -> Cells:
    head, *rows = wide()
    above = [("Nennmaß", NOMINAL), ("OGW", UPPER), ("UGW", LOWER)]
    below = [("Mittelwert", VALUES.mean(axis=0)), ("s", VALUES.std(axis=0)), ("Cpk", (1.0, 1.1, 0.9))]
    lines = [[[what, *(number(v) for v in values)] for what, values in some] for some in (above, below)]
    return [["Zeiss"], ["Plan", "7"], head, *lines[0], *rows, *lines[1]]


def short() -> Cells:
    """The last cells of two rows are not measured, and left away."""
    rows = wide()
    return [row[:-1] if at in (4, 9) else row for at, row in enumerate(rows)]


def blocks() -> Cells:
    head, *rows = wide()
    half = PARTS // 2
    mean = ["Mittelwert", *("25.0",) * 3]
    return [["Nest 1"], head, *rows[:half], mean, ["Nest 2"], head, *rows[half:], mean]


SHAPES: dict[str, Callable[[], Cells]] = {
    "Calypso": calypso, "GOM": gom, "limits in a row": limits_per_row, "transposed": transposed, "numbered": numbered,
    "wide": wide, "with limits": with_limits, "short rows": short, "blocks": blocks,
}  # fmt: skip
LIMITED = ("Calypso", "GOM", "limits in a row", "transposed", "with limits")


def written(rows: Cells, dialect: str) -> bytes:
    delimiter, decimal, encoding, end = DIALECTS[dialect]
    lines = [delimiter.join(c.replace(".", decimal) if c[-1:].isdigit() else c for c in row) for row in rows]
    return (end.join(lines) + end).encode(encoding)


def fixed_width(dialect: str) -> bytes:
    _, decimal, encoding, end = DIALECTS[dialect]
    head = f"{'Teil Nr':>8}{NAMES[0]:>16}{NAMES[1]:>14}{NAMES[2]:>12}"
    rows = [f"{part + 1:>8}" + "".join(f"{number(v):>{w}}" for v, w in zip(VALUES[part], (16, 14, 12), strict=True))
            for part in range(PARTS)]  # fmt: skip
    text = end.join(["Protokoll 7", "", head, *rows, f"{'Mean':>8}{25.0:>16.4f}{40.0:>14.4f}{0.04:>12.4f}"]) + end
    return text.replace(".", decimal).encode(encoding)


def assert_right(table: tables.Table, shape: str) -> None:
    frame = table.frame
    expected = VALUES.copy()
    if shape == "short rows":
        expected[[3, 8], 2] = np.nan
    np.testing.assert_array_equal(frame[list(NAMES)].to_numpy(dtype=float), expected)
    if shape in LIMITED:
        for at, name in enumerate(NAMES):
            stated = table.specifications[name]
            assert (stated.nominal, stated.lower, stated.upper) == (NOMINAL[at], LOWER[at], UPPER[at])
            assert stated.natural == ("lower" if name == "Lage P3" else "")
    if shape != "limits in a row":
        column = next(name for name in frame if name not in NAMES and tables.group_of(str(name)) == "part")
        assert [str(part).removeprefix("Teil ") for part in frame[column]] == [str(at + 1) for at in range(PARTS)]
    if shape == "blocks":
        assert frame["block"].tolist() == ["Nest 1"] * 6 + ["Nest 2"] * 6


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("shape", [*SHAPES, "fixed width"])
def test_a_shape_in_a_dialect_is_read_right(tmp_path: Path, shape: str, dialect: str) -> None:
    content = fixed_width(dialect) if shape == "fixed width" else written(SHAPES[shape](), dialect)
    (tmp_path / "t.txt").write_bytes(content)
    assert_right(tolevo.read_table(tmp_path / "t.txt"), shape)


def test_the_shape_is_said_and_can_be_stated(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_bytes(written(calypso(), "German"))
    assert "read as: a row per characteristic" in tolevo.read_table(tmp_path / "t.csv").notes
    as_it_stands = tolevo.read_table(tmp_path / "t.csv", shape="wide").frame
    assert len(as_it_stands) == 3 * PARTS
    assert list(as_it_stands)[4] == "actual"
    (tmp_path / "u.csv").write_text("Maß;A;B\nD1;1,5;1,6\nL2;2,5;2,6\n", encoding="utf-8")
    assert tolevo.read_table(tmp_path / "u.csv", shape="transposed").frame["L2"].tolist() == [2.5, 2.6]
    with pytest.raises(tolevo.ConfigurationError, match=r"--shape: must be one of long, wide, transposed"):
        tolevo.read_table(tmp_path / "u.csv", shape="tall")
    with pytest.raises(tolevo.ConfigurationError, match="it needs a column of characteristics"):
        tolevo.read_table(tmp_path / "u.csv", shape="long")


HEAD = "part;feature;actual;nominal;uppertol;lowertol\n"
FAULTS = {
    "two nominals": (f"{HEAD}1;A;10,1;10;0,2;-0,2\n2;A;10,1;10,5;0,2;-0,2\n", "A: has two nominal sizes: 10 and 10.5"),
    "inverted": ("part;id;actual;usl;lsl\n1;A;10,1;9,5;10,5\n2;A;10,2;9,5;10,5\n", "limit 10.5 is above the upper"),
    "unsigned": (f"{HEAD}1;A;10,1;10;0,2;0,1\n2;A;10,1;10;0,2;0,1\n", r"write their signs, \+0.01 or -0.01"),
    "unsigned, no upper": ("part;id;actual;nominal;lowertol\n1;A;9,9;10;0,2\n2;A;9,8;10;0,2\n", "write their signs"),
    "unsigned row": ("Teil;A\nSoll;10\nOT;0,2\nUT;0,1\n1;10,1\n2;10,15\n", r"row UT: .*write their signs"),
    "two units": ("part;id;unit;actual;nominal\n1;A;mm;1,5;1\n2;A;um;1,6;1\n", "has several units: mm and um"),
    "misread": ("part;id;actual;nominal;dev\n1;A;1,5;1;0,1\n2;A;1,6;1;0,6\n", "1 deviations are not actual less"),
    "no deviation": (f"{HEAD}1;A;10,1;10;10,2;9,8\n2;A;10,1;10;10,2;9,8\n", "name it a limit"),
    "no parts": ("id;actual;nominal\nA;1,5;1\nA;1,6;1\nB;2,5;2\n", "B has 1 values, A 2, and no column names"),
    "other names": ("Teil;D1;L2\n1;2,5;3,5\n2;2,6;3,6\nTeil;D3;L4\n1;4,5;5,5\n", "line 4 holds names of other columns"),
    "kinds of rows": ("a;b;c\n" + "1;2;3\n" * 9 + "1;2;3;4\n" * 4 + "1;2;3\n" * 9, r"row 11: 3 .* got 4 \(4 rows, of"),
    "statistics": ("Teil;D\n" + "1;2,5\n" * 6 + "Cpk;1,3\n7;7,5\n", '"Cpk" stands among the measurements'),
    "cut off": ("Teil;D\n1;10,123\n2;10,125\n3;10,124\n4;10,1", 'ends within its last number, "10,1"'),
    "nameless statistics": ("Teil;D1;L2\n1;25,1;40,1\n2;25,2;40,2\n3;25,3;40,3\n;25,2;40,2\n", "row 5: names no part"),
    "nameless first column": ("Nr;D1\n1;25,1\n2;25,2\n3;25,3\n;25,2\n;0,1\n", r"row 5: .*column Nr.* nor do 1 other"),
    "limits of one side": (f"{HEAD.replace('lower', '')}1;A;10,1;10;0,2;0,2\n2;A;9,9;10;0,2;0,2\n", "not say of which"),
    "a tolerance": ("part;id;actual;nominal;Tol\n1;A;10,1;10;0,2\n2;A;10,1;10;0,2\n", "column Tol: .*not say of which"),
    "no side of UTol": ("part;id;actual;nominal;UTol\n1;A;9,9;10;0,2\n2;A;9,8;10;0,2\n", "column UTol: .*which side"),
    "limits called otherwise": ("Teil;D\n1;2,5\n2;2,6\n3;2,6\nGrenzen;2,9\n", 'row 5: "Grenzen" names no part'),
    "limits among texts": ("Typ;D\nx;2,5\ny;2,6\nz;2,6\nTol. Mitte;2,9\n", 'row 5: "Tol. Mitte" names no part'),
    "nameless row": (f"{HEAD}1;A;10,1;10;0,2;-0,2\n2;A;10,1;10;0,2;-0,2\n3;;9,9;10;0,2;-0,2\n", "no characteristic"),
    "deviations called limits": ("No.;D\nNominal;10,0\nUSL;0,05\nLSL;-0,05\n1;10,1\n2;10,2\n", "no size near 10"),
    "wrong sides": (f"{HEAD}1;A;10,1;10;-0,2;0,2\n2;A;10,1;10;-0,2;0,2\n", "write their signs"),
    "limits of another word": ("No.;D\nRef;10,0\n1;10,1\n2;10,2\n3;10,3\n", 'row 2: "Ref" names no part'),
    "a column is missing": ("Merkmal;Teil 1;Teil 2;Teil 3\nD1;1,5;1,6;1,7\nL2;2,5;2,6\n", "row 3: 4 cells expected"),
    "a cell is missing": ("a;b;c\n1;20,5;3\n1;3\n1;20,6;3\n1;20,7;3\n", "row 3: 3 cells expected"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_what_is_wrong_or_has_two_readings_is_a_fault(tmp_path: Path, name: str) -> None:
    content, words = FAULTS[name]
    (tmp_path / "t.csv").write_text(content, encoding="utf-8")
    with pytest.raises(tolevo.ConfigurationError, match=words):
        tolevo.read_table(tmp_path / "t.csv")


def test_every_fault_of_a_long_table_at_once(tmp_path: Path) -> None:
    text = "part;id;actual;nominal;usl;lsl\n1;A;10,1;10;9,5;10,5\n2;A;10,2;11;9,5;10,5\n1;B;1,5;1;2;0\n2;B;1,6;1;2;0\n"
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    with pytest.raises(tolevo.ConfigurationError) as caught:
        tolevo.read_table(tmp_path / "t.csv")
    assert len(caught.value.faults) == 2


@pytest.mark.parametrize("dialect", ["German", "commas"])
@pytest.mark.parametrize("shape", [*SHAPES, "fixed width"])
def test_a_table_that_is_cut_within_its_last_numbers_is_never_read_without_a_word(
    tmp_path: Path, shape: str, dialect: str
) -> None:
    content = fixed_width(dialect) if shape == "fixed width" else written(SHAPES[shape](), dialect)
    *_, encoding, end = DIALECTS[dialect]
    text = content.decode(encoding)
    begin = text.rindex(end, 0, -len(end))
    silent = []
    for at in range(begin + len(end) + 1, len(text) - len(end)):
        (tmp_path / "t.txt").write_bytes(text[:at].encode(encoding))
        try:
            table = tolevo.read_table(tmp_path / "t.txt")
        except tolevo.ConfigurationError:
            continue
        read = table.frame.reindex(columns=list(NAMES)).to_numpy(dtype=float)
        expected = np.full(read.shape, np.inf)
        expected[:PARTS] = VALUES[: len(read)]
        right = (np.isnan(read) | (read == expected)).all()
        if not right and not any(note.startswith("no line break ends the last line") for note in table.notes):
            silent.append(text[begin:at])
    assert not silent


@pytest.mark.parametrize(
    ("lowers", "lower"), [("-0,05", 9.95), ("0,05", 9.95), ("+0,01", 10.01), ("0", 10.0)]
)  # fmt: skip
def test_lower_tolerances_by_their_signs(tmp_path: Path, lowers: str, lower: float) -> None:
    rows = "".join(f"{part};A;10,02;10;0,05;{lowers}\n" for part in range(3))
    (tmp_path / "t.csv").write_text(HEAD + rows, encoding="utf-8")
    assert tolevo.read_table(tmp_path / "t.csv").specifications["A"].lower == pytest.approx(lower, abs=1e-12)


def test_percentages_are_numbers_with_a_unit(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("Teil;Anteil;Rest [mm]\n1;12,5 %;1,5\n2;13 %;1,6\n", encoding="utf-8")
    table = tolevo.read_table(tmp_path / "t.csv")
    assert table.frame["Anteil"].tolist() == [12.5, 13.0]
    assert table.units == {"Anteil": "%", "Rest": "mm"}


def test_a_long_table_of_many_rows_is_read_as_a_short_one(tmp_path: Path) -> None:
    rng, count = np.random.default_rng(3), 4_000
    values = rng.normal(10.0, 0.01, (count, 5)).round(4)
    lines = [f"{part};F{at};{values[part, at]:.4f};10.0;0.05;-0.05\n" for part in range(count) for at in range(5)]
    (tmp_path / "t.csv").write_text(HEAD + "".join(lines), encoding="utf-8")
    begin = time.process_time()
    frame = tolevo.read_table(tmp_path / "t.csv").frame
    assert time.process_time() - begin < 3.0
    np.testing.assert_array_equal(frame[[f"F{at}" for at in range(5)]].to_numpy(dtype=float), values)


def read(folder: Path, text: str, name: str = "t.txt", shape: str | None = None) -> tables.Table:
    (folder / name).write_text(text, encoding="utf-8")
    return tolevo.read_table(folder / name, shape=shape)


DIMENSION = """DIM LOC{n}= LOCATION OF CIRCLE CIR{n}  UNITS=MM
AX    NOMINAL       MEAS       +TOL       -TOL        DEV     OUTTOL
X     {x:7.4f}    {x:7.4f}     0.1000     0.1000     0.0000     0.0000
D      2.0000     2.0012     0.0500     0.0500     0.0012     0.0000
"""


def test_blocks_of_features_name_their_characteristics(tmp_path: Path) -> None:
    table = read(tmp_path, DIMENSION.format(n=1, x=8.0) + DIMENSION.format(n=2, x=18.0))
    assert [table.specifications[f"LOC{n} X"].nominal for n in (1, 2)] == [8.0, 18.0]
    assert table.frame["LOC2 X"].tolist() == [18.0]  # both features are of one part


REPORT = """PART NAME : Housing
SER NUMBER : 17

DIM DIA1= DIAMETER OF CIRCLE CIR1  UNITS=MM
AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL
M      25.000      0.021      0.000     25.008      0.008      0.000 --#------

DIM DIA2= DIAMETER OF CIRCLE CIR2  UNITS=MM
AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL
M      25.000      0.021      0.000     25.012      0.012      0.000 ----#----
"""


def test_axes_below_titles_of_features_are_of_different_features(tmp_path: Path) -> None:
    """A report with lines above and a bar in each row; two bores of one size are no two parts."""
    table = read(tmp_path, REPORT)
    assert table.frame[["DIA1 M", "DIA2 M"]].to_numpy().tolist() == [[25.008, 25.012]]
    assert table.specifications["DIA2 M"].upper == pytest.approx(25.021)
    parts = read(
        tmp_path, REPORT.replace("DIM DIA1= DIAMETER OF CIRCLE CIR1", "Part 1").replace("DIM DIA2= ", "Part 2 ")
    )
    assert "DIA2 M" not in parts.frame


def test_limits_and_units_in_rows_above_the_measurements(tmp_path: Path) -> None:
    rows = "1,2026/03/01 10:00:01,OK,10.012,5.001\n2,2026/03/01 10:00:21,OK,10.002,5.003\n"
    for unit, nominal, upper, lower in (("Unit", "Design value", "Upper tol", "Lower tol"),
                                        ("单位", "设计值", "公差上限", "公差下限")):  # fmt: skip
        limits = f"{unit},,,mm,mm\n{nominal},,,10.0,5.0\n{upper},,,0.05,0.02\n{lower},,,-0.05,-0.02\n"
        table = read(tmp_path, f"Program,Cover\n\nNo.,Date,Judgement,D1,D2\n{limits}{rows}")
        assert table.frame["D1"].tolist() == [10.012, 10.002]
        assert table.specifications["D2"] == tables.Specification(5.0, 4.98, 5.02)
        assert table.units == {"D1": "mm", "D2": "mm"}


@pytest.mark.parametrize("head", ["InspItem,Nominal,Actual,Pass", "Item-No.,Soll-Wert,Ist-Wert,i.O."])
def test_a_first_column_of_any_name_names_characteristics(tmp_path: Path, head: str) -> None:
    """With limits beside the values, or where the shape is stated; set points of machines are no characteristics."""
    with_limit = f"{head},USL\nShaft OD,40.012,40.009,YES,40.1\nRunout,0.02,0.015,YES,0.03\n"
    plain = with_limit.replace(",USL", "").replace(",40.1", "").replace(",0.03", "")
    for text, shape in ((with_limit, None), (plain, "long")):
        table = read(tmp_path, text, shape=shape)
        assert table.frame["Runout"].tolist() == [0.015]
        assert table.specifications["Shaft OD"].nominal == 40.012
    assert len(read(tmp_path, plain).frame) == 2
    for names in ("2026-01-01 2026-01-02", "W1 W1"):  # dates name nothing, nor do the labels of tools
        first, second = names.split()
        again = read(
            tmp_path, with_limit.replace("Shaft OD", first).replace("Runout", second).replace("0.02,0.015", "40,40")
        )
        assert (len(again.frame) == 2 and "Actual" in again.frame) or "Ist-Wert" in again.frame


@pytest.mark.parametrize("title", ["Messung {}", "Run {}", "Teil-Nr. A{}", "Protokoll 01.03.202{}"])
def test_titles_of_parts_and_reports_are_of_no_features(tmp_path: Path, title: str) -> None:
    blocks = [
        f"{title.format(at)}\nAX;NOMINAL;MEAS;+TOL;-TOL\nX;10;10.0{at};0.1;-0.1\nY;10;10.1{at};0.1;-0.1\n"
        for at in (1, 2)
    ]
    assert read(tmp_path, "\n".join(blocks)).frame["X"].tolist() == [10.01, 10.02]


def test_numbered_titles_of_one_word_are_asked_about(tmp_path: Path) -> None:
    blocks = [f"Shaft {at}\nAX;NOMINAL;MEAS;+TOL;-TOL\nX;10;10.0{at};0.1;-0.1\n" for at in (1, 2)]
    with pytest.raises(tolevo.ConfigurationError, match='"Shaft 1", "Shaft 2"'):
        read(tmp_path, "\n".join(blocks))


@pytest.mark.parametrize("cell", ["Ø±0,05", "30°±1°", "20\xa0°C", "µ²", "(±°)"])
def test_signs_of_units_and_tolerances_are_western(tmp_path: Path, cell: str) -> None:
    (tmp_path / "t.csv").write_bytes(f"Teil;Länge;Notiz\n1;2,5;{cell}\n2;2,6;\n3;2,6;Größe geprüft\n".encode("cp1252"))
    assert tolevo.read_table(tmp_path / "t.csv").frame["Notiz"].tolist()[0] == cell


def test_rows_of_measurements_that_are_numbered_otherwise_are_kept(tmp_path: Path) -> None:
    table = read(tmp_path, "Nr.;L\n1;10,01\n2;10,02\n3;10,03\n3a;10,02\n4;10,01\n")
    assert table.frame["L"].tolist() == [10.01, 10.02, 10.03, 10.02, 10.01]
    assert len(read(tmp_path, "load_N;x\n10;10,01\n20;10,02\n30;10,03\nover;10,02\n50;10,01\n").frame) == 5
    assert len(read(tmp_path, "Probe;x\nS-D;2,5\nA-B;2,6\nC-P;2,7\n").frame) == 3


def test_few_signs_of_two_bytes_do_not_tell_their_encoding(tmp_path: Path) -> None:
    for text in ("孔1;B\n1,5;2\n2,5;3\n", "特征;B\n1,5;2\n2,5;3\n", "Item;B;孔\n1,5;2;3\n2,5;3;4\n"):
        (tmp_path / "t.csv").write_bytes(text.encode("gb18030"))
        with pytest.raises(tolevo.ConfigurationError, match="encoding cannot be determined"):
            tolevo.read_table(tmp_path / "t.csv")


def test_rows_shorter_than_the_names_of_calypso(tmp_path: Path) -> None:
    names = "partnb\tid\tactual\tnominal\tuppertol\tlowertol\tgroup1\tgroup2\n"
    table = read(tmp_path, names + "1\tA\t10.01\t10.0\t0.02\t-0.02\n2\tA\t10.02\t10.0\t0.02\t-0.02\n")
    assert table.frame["A"].tolist() == [10.01, 10.02]
    assert "no row has the last 2 cells: empty" in table.notes
    with pytest.raises(tolevo.ConfigurationError, match="4 cells expected"):
        read(tmp_path, "partnb\tload\tactual\tgroup1\n1\t7\t10.01\n2\t8\t10.02\n")


def test_a_first_column_without_a_name_is_no_other_column(tmp_path: Path) -> None:
    text = "            ACT     NOM     DEV\nXAXIS     9.997  10.000  -0.003\nYAXIS    19.998  20.000  -0.002\n"
    with pytest.raises(tolevo.ConfigurationError, match="column 1 has no name"):
        read(tmp_path, text)


def test_lower_tolerances_with_their_sign_below_minus_tol(tmp_path: Path) -> None:
    text = "Feature,Axis,Nominal,+Tol,-Tol,Meas\nC1,X,8.0,0.1,-0.1,8.01\nC1,D,1.0,0.05,-0.05,1.01\n"
    assert read(tmp_path, text).specifications["C1 X"].lower == pytest.approx(7.9)
    with pytest.raises(tolevo.ConfigurationError, match="write their signs"):  # 8.1/8.05 in PC-DMIS, or 8.1/7.95
        read(tmp_path, "Feature,Nominal,+Tol,-Tol,Meas\nC1,8.0,0.1,-0.05,8.01\nC2,1.0,0.1,-0.05,1.01\n")


def test_long_percentages_are_read_like_short_ones(tmp_path: Path) -> None:
    rows = [f"{at},{at % 7}.5 %,x" for at in range(40_000)]
    table = read(tmp_path, "\n".join(["n,share,text", *rows, ""]), "t.csv")
    assert table.units["share"] == "%"
    assert table.frame["share"].iloc[:3].tolist() == [0.5, 1.5, 2.5]


def test_long_blocks_are_read_like_short_ones(tmp_path: Path) -> None:
    def text(rows: int) -> str:
        blocks = ["\n".join([f"Nest {b}", "Part,Bore", *(f"{at},{at * 0.0015 + b:.4f}" for at in range(rows)), "", ""])
                  for b in range(3)]  # fmt: skip
        return "\n".join(blocks)

    few, many = read(tmp_path, text(5), "few.csv"), read(tmp_path, text(12_000), "many.csv")
    assert (
        few.frame["block"].unique().tolist() == many.frame["block"].unique().tolist() == ["Nest 0", "Nest 1", "Nest 2"]
    )
    assert len(many.frame) == 36_000
    for b in range(3):
        one = many.frame[many.frame["block"] == f"Nest {b}"]
        assert np.allclose(one["Bore"], np.arange(12_000) * 0.0015 + b, atol=5.1e-5)


def test_long_tables_of_fixed_width_are_read_like_short_ones(tmp_path: Path) -> None:
    rows = [f"{at:>9d}{at * 0.001:>14.4f}  part {at % 5}" for at in range(3_000)]
    head = f"{'Part No':>9}{'Bore Dia':>14}  Name of it"
    table = read(tmp_path, "\n".join([head, *rows, ""]))
    assert table.frame["Bore Dia"].tolist() == pytest.approx([round(at * 0.001, 4) for at in range(3_000)])
    assert table.frame["Name of it"].iloc[7] == "part 2"


def test_a_column_of_units_beside_measurements(tmp_path: Path) -> None:
    assert read(tmp_path, "part,d,unit\n1,10.5,um\n2,10.6,um\n", "t.csv").units == {"d": "um"}
    for text in ("part,d [mm],unit\n1,10.5,um\n2,10.6,um\n", "part,d,unit\n1,10.5,um\n2,10.6,mm\n"):
        with pytest.raises(tolevo.ConfigurationError, match=r"d: has several units: .*um"):
            read(tmp_path, text, "t.csv")


HEADINGS = {
    "Ob. Tol;Unt. Tol": ("0,05", "-0,02"),
    "UTol;LTol": ("0,05", "-0,02"),
    "OTol;UTol": ("0,05", "-0,02"),
    "Tol (+);Tol (-)": ("0,05", "-0,02"),
    "Tol. oben;Tol. unten": ("0,05", "-0,02"),
    "Upper Dev [um];Lower Dev [um]": ("50", "-20"),
    "Höchstmaß;Mindestmaß": ("10,05", "9,98"),
    "Upper Tolerance Limit;Lower Tolerance Limit": ("10,05", "9,98"),
}


@pytest.mark.parametrize("heading", HEADINGS)
def test_limits_by_what_they_are_called(tmp_path: Path, heading: str) -> None:
    upper, lower = HEADINGS[heading]
    rows = "".join(f"{part};A;10,0{part};10;{upper};{lower}\n" for part in range(1, 5))
    stated = read(tmp_path, f"Teil;Merkmal;Istwert [mm];Nennmaß [mm];{heading}\n{rows}").specifications["A"]
    assert (stated.nominal, stated.lower, stated.upper) == (10.0, 9.98, 10.05)
    row_names, cells = heading.split(";"), (upper, lower)
    if "um" not in heading:  # a row has the unit of its column
        rows = "".join(f"{name};{cell}\n" for name, cell in zip(["Soll", *row_names], ["10", *cells], strict=True))
        stated = read(tmp_path, f"Teil;A [mm]\n{rows}1;10,01\n2;10,02\n3;10,03\n").specifications["A"]
        assert (stated.nominal, stated.lower, stated.upper) == (10.0, 9.98, 10.05)


def test_units_in_capitals_and_in_cells(tmp_path: Path) -> None:
    rows = "1;A;10,01;10;MM\n2;A;10,02;10;mm\n1;W;30,5;30;Grad\n2;W;30,6;30;DEG\n"
    assert read(tmp_path, f"part;id;actual;nominal;unit\n{rows}").units == {"A": "mm", "W": "deg"}
    table = read(tmp_path, "part;id;nominal;uppertol;actual\n1;A;10 mm;0,05 mm;10,01 mm\n2;A;10 mm;0,05 mm;n.a.\n")
    assert table.units == {"A": "mm"}
    assert table.specifications["A"].upper == 10.05
    assert table.frame["A"].tolist() == [10.01, None]
    labels = read(tmp_path, "part;Typ;A\n1A;3A;10,01mm\n2A;4A;10,02mm\n")
    assert labels.frame["part"].tolist() == ["1A", "2A"]
    assert labels.units == {"A": "mm"}
    assert read(tmp_path, "part;A\n1;10,01 mm\n2;395 um\n").frame["A"].tolist() == ["10,01 mm", "395 um"]
    with pytest.raises(tolevo.ConfigurationError, match="has cells in um, and another unit in its name"):
        read(tmp_path, "part;A [mm]\n1;10,1 um\n2;10,2 um\n")


@pytest.mark.parametrize("word", ["Länge", "Größe", "Höhe", "Außenmaß", "Prüfmaß", "Abstand [µm]", "Fläche", "Nähe °"])
def test_words_with_accents_are_no_signs_of_two_bytes(tmp_path: Path, word: str) -> None:
    (tmp_path / "t.csv").write_bytes(f"Teil;{word};D2\n1;10,01;2,5\n2;10,02;2,6\n".encode("cp1252"))
    assert f"{word.partition(' [')[0]}" in tolevo.read_table(tmp_path / "t.csv").columns.names


def test_signs_of_two_bytes_stay_signs(tmp_path: Path) -> None:
    text = "零件;长度;直径;测量值\n一;10.01;2.5;尺寸一\n二;10.02;2.6;尺寸二\n"
    (tmp_path / "t.csv").write_bytes(text.encode("gb18030"))
    assert "长度" in tolevo.read_table(tmp_path / "t.csv").columns.names


def test_a_footer_with_remarks_and_last_rows_that_are_short(tmp_path: Path) -> None:
    rows = "".join(f"P{part};10,0{part};2,{part}5\n" for part in range(6))
    table = read(tmp_path, f"Teil;D1;L2\n{rows}Mean;10,025;2,75\n3 Sigma;0,05;0,5\nParts measured: 6;;\nEnd;;\n")
    assert table.frame["D1"].tolist() == [10.0, 10.01, 10.02, 10.03, 10.04, 10.05]
    rows = "".join(f"P{part};10,0{part};2,{part}5{';ok' if part % 5 == 0 else ''}\n" for part in range(9))
    assert read(tmp_path, f"Teil;D1;L2;remark\n{rows}").frame["L2"].tolist() == pytest.approx(
        [2.05 + 0.1 * at for at in range(9)]
    )


def test_a_table_of_prices_is_read_without_the_library_of_units(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It takes a third of a second to read, at every start."""

    def asked(name: str) -> None:
        raise AssertionError(name)

    monkeypatch.setattr(units, "look_up_unit", asked)
    path = tmp_path / "prices.csv"
    path.write_text("variable;t [um];cost [EUR]\npin_one_um;1;10,50\npin_two_um;1,6;6,72\n", encoding="utf-8")
    columns = tolevo.read_table(path, decimal=",").columns.cells
    assert columns == {"variable": ["pin_one_um", "pin_two_um"], "t": ["1", "1.6"], "cost [EUR]": ["10.50", "6.72"]}
