"""One table of three parts in the dialects of measuring rooms: all must read the same."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tolevo

ROWS = [
    ("1", "S1", "2026-03-01 08:00", 0.412, 25.0031),
    ("2", "S2", "2026-03-01 08:05", 0.398, 24.9987),
    ("3", "S3", "2026-03-01 08:10", 0.455, 1024.5),
]
WESTERN = ("Teil", "Serie", "Zeit", "Spiel [arcmin]", "Ø Bohrung [mm]")
CHINESE = ("零件", "批次", "时间", "间隙 [arcmin]", "孔径 [mm]")
TAIWANESE = ("零件", "批次", "時間", "間隙 [arcmin]", "孔徑 [mm]")
JAPANESE = ("部品番号", "ロット", "時間", "隙間 [arcmin]", "穴径 [mm]")


def written(
    delimiter: str = ";",
    decimal: str = ",",
    names: tuple[str, ...] = WESTERN,
    thousands: str = "",
    end: str = "\r\n",
    quote: str = "",
) -> str:
    def number(value: float) -> str:
        text = f"{value:,}" if thousands else f"{value}"
        return text.translate({ord(","): thousands, ord("."): decimal})

    def line(cells: list[str]) -> str:
        return delimiter.join(f"{quote}{cell}{quote}" for cell in cells) + end

    rows = [[*row[:3], number(row[3]), number(row[4])] for row in ROWS]
    return line(list(names)) + "".join(map(line, rows))


def shifted(text: str, above: str) -> str:
    return above + text


UNIT_ROW = written().replace(" [arcmin]", "").replace(" [mm]", "").replace(
    "Bohrung\r\n", "Bohrung\r\n-;-;-;arcmin;mm\r\n")  # fmt: skip
BRACKET_ROW = UNIT_ROW.replace("-;-;-;arcmin;mm", ";;;[arcmin];[mm]")
DIALECTS: dict[str, tuple[str, str]] = {
    "German, cp1252": (written(), "cp1252"),
    "German, UTF-8": (written(), "utf-8"),
    "German, byte order mark": (written(), "utf-8-sig"),
    "German, UTF-16": (written(), "utf-16"),
    "German, UTF-16 without a mark": (written(), "utf-16-le"),
    "German, UTF-16 big-endian": (written(), "utf-16-be"),
    "German, thousands": (written(thousands="."), "cp1252"),
    "Swiss, apostrophes": (written(decimal=".", thousands="'"), "cp1252"),
    "French, narrow spaces": (written(thousands="\u202f"), "utf-8"),
    "French, no-break spaces": (written(thousands="\u00a0"), "cp1252"),
    "tabs": (written("\t"), "cp1252"),
    "tabs, points": (written("\t", "."), "utf-8"),
    "bars": (written("|"), "utf-8"),
    "commas and points": (written(",", "."), "utf-8"),
    "commas, thousands in quotes": (written(",", ".", quote='"', thousands=","), "utf-8"),
    "commas, decimal commas in quotes": (written(",", ",", quote='"'), "utf-8"),
    "semicolons in quotes": (written(quote='"'), "cp1252"),
    "sep= line": (shifted(written(), "sep=;\r\n"), "cp1252"),
    "sep= line, tab": (shifted(written("\t"), "sep=\t\r\n"), "utf-8"),
    "preamble": (shifted(written(), "Protokoll\r\nPlan: RV-40E;Rev 3\r\n\r\n"), "cp1252"),
    "padded preamble": (
        shifted(written(), "Protokoll;;;;\r\nDatum;01.03.2026;;;\r\n;;;;\r\n"), "cp1252"),
    "comment lines": (shifted(written(), "# made by a bench\n# second line\n"), "utf-8"),
    "unit row": (UNIT_ROW, "cp1252"),
    "unit row in brackets": (BRACKET_ROW, "utf-8"),
    "delimiter at the ends": (written().replace("\r\n", ";\r\n"), "cp1252"),
    "summary below": (written() + "Mittelwert;;;0,4217;358,2\r\n", "cp1252"),
    "limits below the names": (
        written().replace("[mm]\r\n", "[mm]\r\nNennmaß;;;0,4;25,0\r\nOT;;;0,1;0,02\r\n"), "cp1252"),
    "round brackets": (
        written(names=("Teil", "Serie", "Zeit", "Spiel (arcmin)", "Bohrung (mm)")), "utf-8"),
    "Chinese, GBK": (written(",", ".", CHINESE), "gbk"),
    "Chinese, GB18030": (written(";", ".", CHINESE), "gb18030"),
    "Chinese, Big5": (written(",", ".", TAIWANESE), "big5"),
    "Japanese, Shift-JIS": (written(",", ".", JAPANESE), "cp932"),
    "Chinese, full-width brackets": (
        written(",", ".", ("零件", "批次", "时间", "间隙（arcmin）", "孔径（mm）")), "gbk"),
    "Unix line ends": (written(end="\n"), "cp1252"),
}  # fmt: skip


def assert_right(found: tolevo.tables.Table) -> None:
    frame = found.frame
    assert frame.shape == (3, 5)
    np.testing.assert_array_equal(frame.iloc[:, 3].to_numpy(dtype=float), [r[3] for r in ROWS])
    np.testing.assert_array_equal(frame.iloc[:, 4].to_numpy(dtype=float), [r[4] for r in ROWS])
    assert frame.iloc[:, 0].tolist() == [1, 2, 3]
    assert frame.iloc[:, 1].tolist() == ["S1", "S2", "S3"]
    assert list(found.units.values()) == ["arcmin", "mm"]


@pytest.mark.parametrize("name", DIALECTS)
def test_a_dialect_is_read_right(tmp_path: Path, name: str) -> None:
    text, encoding = DIALECTS[name]
    (tmp_path / "t.csv").write_bytes(text.encode(encoding))
    assert_right(tolevo.read_table(tmp_path / "t.csv"))


ASKED: dict[str, tuple[bytes, str]] = {
    "three decimals, comma": (b"Teil\tLaenge\n1\t1,234\n2\t1,235\n", "--decimal"),
    "three decimals, point": (b"Teil;Laenge\n1;1.234\n2;1.235\n", "--decimal"),
    "three decimals, tab": (b"Teil\tLaenge\n1\t12.234\n2\t1.235\n", "--decimal"),
    "one column": (b"Laenge\n1.234\n1.235\n", "--decimal"),
    "thousands or another sign": (b"a;b\n0,5;1.234\n0,6;1.235\n", "--decimal"),
    "both signs in one column": (b"a;b\n1;0,412\n2;0.398\n", "--decimal"),
    "two delimiters": (b"a,b;c,d\n1,2;3,4\n5,6;7,8\n", "--delimiter"),
    "unit behind a comma": (b"Laenge, mm\n1,5\n1,6\n", "--delimiter"),
    "Czech": ("Průměr;Vůle\n0,5;1,5\n".encode("cp1250"), "--encoding"),
    "Czech, short": ("Křivka;a\n0,5;1,5\n".encode("cp1250"), "--encoding"),
    "Polish": ("Średnica;Długość\n0,5;1,5\n".encode("cp1250"), "--encoding"),
    "Russian": ("Зазор;Диаметр\n0,5;1,5\n".encode("cp1251"), "--encoding"),
    "DOS": ("Maß;Länge\n0,5;1,5\n".encode("cp850"), "--encoding"),
    "DOS, sharp s alone": ("Maß;x\n0,5;1,5\n".encode("cp850"), "--encoding"),
    "old Macintosh": ("Länge;Größe\n0,5;1,5\n".encode("mac_roman"), "--encoding"),
    "zero bytes": (b"a;b\n0,5;1,\x005\n", "not text"),
    "no names": (b"1;0,5\n2;0,6\n", "no column names"),
    "two rows of names": (b"Serie;Spiel\nS1;defekt\nS2;0,4\nS3;0,5\n", "both be the column names"),
    "decimal commas between commas": (b"a,b\n0,412,25,0031\n0,398,24,9987\n", "cells expected"),
    "old workbook": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 600, ".xlsx"),
}


@pytest.mark.parametrize("name", ASKED)
def test_what_has_two_readings_is_asked_for(tmp_path: Path, name: str) -> None:
    content, said = ASKED[name]
    (tmp_path / "t.csv").write_bytes(content)
    with pytest.raises(tolevo.ConfigurationError, match=said) as caught:
        tolevo.read_table(tmp_path / "t.csv")
    assert all(fault.place for fault in caught.value.faults)


@pytest.mark.parametrize(
    ("content", "column", "values"),
    [
        (b"Nr.;Laenge\n1;68,001\n2;68,006\n", "Laenge", [68.001, 68.006]),
        (b"Nr.;Laenge;Kraft\n1;1,234;5.000.000\n2;1,235;6.000.000\n", "Laenge", [1.234, 1.235]),
        (b"Laenge\n0,412\n-1,398\n", "Laenge", [0.412, -1.398]),
        (b"Teil;Welle 7\nNr.;Abstand [mm]\n1;68,001\n2;68,006\n", "Abstand", [68.001, 68.006]),
        ("a;b\n1.5;−3.2\n2.5;1.5\n".encode(), "b", [-3.2, 1.5]),
    ],
)
def test_semicolons_leave_the_comma_for_decimals(
    tmp_path: Path, content: bytes, column: str, values: list[float]
) -> None:
    (tmp_path / "t.csv").write_bytes(content)
    assert tolevo.read_table(tmp_path / "t.csv").frame[column].tolist() == values


@pytest.mark.parametrize(
    ("content", "stated", "column", "values"),
    [
        (b"Teil;Laenge\n1;1,234\n2;1,235\n", {"decimal": ","}, "Laenge", [1.234, 1.235]),
        (b"Teil;Laenge\n1;1,234\n2;1,235\n", {"decimal": "."}, "Laenge", [1234.0, 1235.0]),
        (b"a;b\n0,5;1.234\n0,6;1.235\n", {"decimal": ","}, "b", [1234.0, 1235.0]),
        ("Průměr;b\n0,5;1\n".encode("cp1250"), {"encoding": "cp1250"}, "Průměr", [0.5]),
        (b"a,b;c,d\n1,2;3,4\n", {"delimiter": "semicolon", "decimal": ","}, "c,d", [3.4]),
    ],
)
def test_what_is_stated_decides(
    tmp_path: Path, content: bytes, stated: dict[str, str], column: str, values: list[float]
) -> None:
    (tmp_path / "t.csv").write_bytes(content)
    found = tolevo.read_table(tmp_path / "t.csv", **stated)
    assert found.frame[column].tolist() == values


def test_missing_and_invalid_values_are_none(tmp_path: Path) -> None:
    text = "Teil;Spiel\n1;0,412\n2;n.i.O.\n3;\n4;---\n5;kaputt\n6;#NV\n7;0,455\n"
    (tmp_path / "t.csv").write_text(text)
    found = tolevo.read_table(tmp_path / "t.csv")
    assert found.frame["Spiel"].tolist() == [0.412, None, None, None, None, None, 0.455]
    assert any("5 cells hold no number" in note and "kaputt" in note for note in found.notes)


def test_serial_numbers_keep_their_zeros(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("Serial;x\n0012;0,5\n0013;0,6\n12345678901234567890;0,7\n")
    frame = tolevo.read_table(tmp_path / "t.csv").frame
    assert frame["Serial"].tolist() == ["0012", "0013", "12345678901234567890"]


def noisy(count: int) -> pd.DataFrame:
    rng = np.random.default_rng(5)
    return pd.DataFrame(
        {
            "Teil": np.arange(count),
            "Serie": [f"S{at % 7}" for at in range(count)],
            "Spiel [arcmin]": rng.normal(0.4, 0.05, count).round(4),
            "Kraft [N]": rng.normal(1500.0, 300.0, count).round(2),
        }
    )


CHANGES: dict[str, Callable[[str], str]] = {
    "plain": lambda text: text,
    "missing": lambda text: text.replace(";S3;0,4", ";S3;n.i.O.;;").replace(";;", ";", 1),
    "empty line": lambda text: text.replace("\n1500;", "\n\n1500;"),
    "quotes": lambda text: text.replace("S5", '"S5"'),
    "summary": lambda text: text + "Mittelwert;;0,4;1500,1\n",
}


@pytest.mark.parametrize("change", ["plain", "empty line", "quotes", "summary"])
def test_long_files_are_read_as_short_ones(tmp_path: Path, change: str) -> None:
    frame = noisy(20_000)
    text = CHANGES[change](frame.to_csv(sep=";", decimal=",", index=False))
    (tmp_path / "t.csv").write_text(text)
    found = tolevo.read_table(tmp_path / "t.csv")
    assert len(found.frame) == len(frame)
    np.testing.assert_array_equal(found.frame["Spiel"], frame["Spiel [arcmin]"])
    np.testing.assert_array_equal(found.frame["Kraft"], frame["Kraft [N]"])
    assert found.frame["Serie"].tolist() == frame["Serie"].tolist()
    assert found.cells["Teil"].tolist()[:2] == ["0", "1"]
    after = 1 if change == "empty line" else 0
    assert found.frame.index[-1] == len(frame) + 1 + after


def test_a_long_file_with_thousands_and_marks(tmp_path: Path) -> None:
    frame = noisy(20_000)
    forces = [f"{v:,.2f}".translate({44: ".", 46: ","}) for v in frame["Kraft [N]"]]
    forces[777] = "n.i.O."
    frame.assign(**{"Kraft [N]": forces}).to_csv(tmp_path / "t.csv", sep=";", decimal=",", index=False)
    found = tolevo.read_table(tmp_path / "t.csv")
    expected = frame["Kraft [N]"].astype(object)
    expected[777] = None
    assert found.frame["Kraft"].tolist() == expected.tolist()
    assert any('row 779 "n.i.O."' in note for note in found.notes)


def test_a_mixed_column_of_a_long_file_is_refused(tmp_path: Path) -> None:
    text = noisy(20_000).to_csv(sep=";", decimal=",", index=False).replace(";S3;0,", ";S3;0.", 3)
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(tolevo.ConfigurationError, match=r"Spiel.*decimal points in some"):
        tolevo.read_table(tmp_path / "t.csv")


def test_a_single_zero_byte_is_named(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_bytes(b"part,d\n1,10.0\0\n2,10.1\n")
    with pytest.raises(tolevo.ConfigurationError, match="zero bytes"):
        tolevo.read_table(tmp_path / "t.csv")
