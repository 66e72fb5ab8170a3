from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo import tables
from tolevo.errors import InputError


def csv(folder: Path, content: str | bytes) -> Path:
    path = folder / "designs.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def faults_of_form(path: Path) -> list[str]:
    with pytest.raises(InputError) as caught:
        tables.read_table(path)
    return [str(fault) for fault in caught.value.faults]


def test_cells_rows_and_byte_order_mark(tmp_path: Path) -> None:
    frame = tables.read_table(csv(tmp_path, "\ufeffa, b\r\n\r\n1, 2\r\n")).cells
    assert frame.columns.tolist() == ["a", "b"]
    assert frame.index.tolist() == [3]
    assert frame.iloc[0, :].to_list() == ["1", "2"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b" \n\n", "is empty"),
        (b"a,b\n\xff,1\n", "state --encoding"),
        (b"a,b\n", "has no rows"),
        (b"a,a\n1,2\n", "column a appears 2 times"),
        (b"a,\n1,2\n", "column 2 has no name"),
        (b'a,b\n1,"2\n', "is not CSV"),
    ],
)
def test_faults_of_form(tmp_path: Path, content: bytes, said: str) -> None:
    assert said in "\n".join(faults_of_form(csv(tmp_path, content)))


def test_missing_file_and_directory(tmp_path: Path) -> None:
    assert faults_of_form(tmp_path / "no.csv") == ["no.csv: does not exist"]
    assert "is a directory" in faults_of_form(tmp_path)[0]


def test_broken_parquet(tmp_path: Path) -> None:
    path = tmp_path / "x.parquet"
    path.write_bytes(b"a,b\n1,2\n")
    assert "is not a Parquet file" in faults_of_form(path)[0]


def test_every_ragged_row_is_named(tmp_path: Path) -> None:
    found = faults_of_form(csv(tmp_path, "a,b\n1\n1,2\n1,2,3\n"))
    assert [fault.split(": 2 cells")[0] for fault in found] == ["designs.csv: row 2", "designs.csv: row 4"]


def test_every_fault_of_content_at_once(tmp_path: Path) -> None:
    frame = tables.read_table(csv(tmp_path, "aa,bb,ccx,u\nx,1,1,k\n,nan,1,\n1_0,inf,1,k\n")).cells
    _, faults = tables.parse_columns(frame, "d.csv", ["aa", "bb", "cc", "u"], text=["u"])
    assert list(map(str, faults)) == [
        "d.csv: column cc is missing",
        "d.csv: column ccx is not known (did you mean `cc`?); remove it",
        'd.csv: row 2, column aa: must be a number, got "x"',
        "d.csv: row 3, column aa: is empty; give a number",
        'd.csv: row 4, column aa: must be a number, got "1_0"',
        "d.csv: row 3, column bb: must be a finite number, got nan",
        "d.csv: row 4, column bb: must be a finite number, got inf",
        "d.csv: row 3, column u: is empty",
    ]


def test_many_bad_cells_are_counted(tmp_path: Path) -> None:
    frame = tables.read_table(csv(tmp_path, "a\n" + "x\n" * 250)).cells
    _, faults = tables.parse_columns(frame, "d.csv", ["a"])
    assert len(faults) == tables.SHOWN + 1
    assert str(faults[-1]) == "d.csv: column a: 150 more bad cells"


@pytest.mark.parametrize("name", ["t.csv", "t.parquet"])
def test_what_is_written_is_read_to_the_last_bit(tmp_path: Path, name: str) -> None:
    frame = pd.DataFrame({"a": np.random.default_rng(0).random(50), "n": np.arange(50)})
    tables.write(frame, tmp_path / name)
    again, faults = tables.parse_columns(tables.read_table(tmp_path / name).cells, name, ["a"], ["n"])
    assert not faults
    np.testing.assert_array_equal(again.to_numpy(), frame.to_numpy(dtype=float))
    assert [path.name for path in tmp_path.iterdir()] == [name]
