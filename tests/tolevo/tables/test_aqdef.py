"""Q-DAS files in every form: values, attributes, times, limits (public descriptions of K keys)."""

from __future__ import annotations

import re
import time
from datetime import datetime
from pathlib import Path

import pytest

import tolevo
from tolevo.configuration.cost_files import opened_parts
from tolevo.tables import ReadOptions

HEAD = """K0100 2
K1001/1 4711
K1002/1 Zykloidenscheibe
K2001/1 10
K2002/1 Ø Bohrung
K2004/1 0
K2101/1 25,000
K2110/1 25,000
K2111/1 25,021
K2142/1 mm
K2001/2 20
K2002/2 Rundlauf
K2004/2 0
K2101/2 0
K2112/2 -0,004
K2113/2 0,004
K2142/2 mm
"""
KEYS = """K0001/1 25,004
K0002/1 0
K0004/1 1.3.2026/08:00:00
K0001/2 -0,0012
K0001/1 25,0065
K0002/1 255
K0004/1 1.3.2026/08:01:00
K0001/2 0,0021
"""
COMPACT = (
    "25.004\x140\x141.3.2026/08:00:00\x14\x14#B1\x0f-0.0012\x140\n"
    "25.0065\x14255\x141.3.2026/08:01:00\x14\x14#B1\x0f0.0021\x140\n"
)
MINUTES = [datetime(2026, 3, 1, 8, 0), datetime(2026, 3, 1, 8, 1)]


def read(folder: Path, text: str, name: str = "p.dfq") -> list[tolevo.tables.Characteristic]:
    (folder / name).write_bytes(text.replace("\n", "\r\n").encode("cp1252"))
    found: list[tolevo.tables.Characteristic] = tolevo.read_aqdef(folder / name)
    return found


def faults(folder: Path, text: str) -> str:
    with pytest.raises(tolevo.ConfigurationError) as caught:
        read(folder, text)
    return str(caught.value)


COMMAS = re.sub(r"(-?\d+)\.(\d+)(?=\x14)", r"\1,\2", COMPACT)


@pytest.mark.parametrize("values", [KEYS, COMPACT, COMMAS], ids=["keys", "points", "commas"])
def test_both_forms_read_the_same(tmp_path: Path, values: str) -> None:
    bore, runout = read(tmp_path, HEAD + values)
    assert (bore.part, bore.part_number, bore.name) == ("Zykloidenscheibe", "4711", "Ø Bohrung")
    assert (bore.nominal, bore.lower, bore.upper, bore.unit) == (25.0, 25.0, 25.021, "mm")
    assert bore.values == [25.004, None]  # the attribute 255 is "not valid"
    assert bore.attributes == [0, 255]
    assert bore.times == MINUTES
    assert (runout.lower, runout.upper) == (-0.004, 0.004)
    assert runout.values == [-0.0012, 0.0021]


def test_batches_and_a_pair_of_files(tmp_path: Path) -> None:
    (tmp_path / "p.dfx").write_text(COMPACT, newline="")
    bore, _ = read(tmp_path, HEAD, "p.dfd")
    assert bore.batches == ["B1", "B1"]
    assert bore.values == [25.004, None]


def test_a_part_of_a_pair_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(tolevo.ConfigurationError, match=r"p\.dfd: needs p\.dfx next to it"):
        read(tmp_path, HEAD, "p.dfd")


def test_several_parts_have_their_own_characteristics(tmp_path: Path) -> None:
    text = HEAD.replace("K0100 2", "K0100 3") + (
        "K1001/2 4712\nK1002/2 Stift\nK2001/3 10\nK2002/3 Radius\nK2101/3 3,000\n"
        "K2112/3 -0,002\nK2113/3 0,000\nK2142/3 mm\n" + KEYS + "K0001/3 2,9991\nK0001/3 2,9987\n"
    )
    bore, runout, radius = read(tmp_path, text)
    assert (bore.part, runout.part, radius.part) == ("Zykloidenscheibe", "Zykloidenscheibe", "Stift")
    assert (radius.nominal, radius.lower, radius.upper) == (3.0, 2.998, 3.0)
    assert radius.values == [2.9991, 2.9987]
    assert len(bore.values) == 2


def test_keys_for_all_and_keys_without_an_index(tmp_path: Path) -> None:
    text = "K1002 Stift\nK2142/0 mm\nK2002 Radius\nK2101 3\nK0001 3,001\nK0004/0 2026-03-01/08:00\n"
    (radius,) = read(tmp_path, text)
    assert (radius.unit, radius.nominal, radius.values) == ("mm", 3.0, [3.001])
    assert radius.times == [datetime(2026, 3, 1, 8, 0)]


def test_counts_of_an_attributive_characteristic(tmp_path: Path) -> None:
    text = "K1002 Stift\nK2002 Kratzer\nK2004 1\nK0020 50\nK0021 2\nK0020 50\nK0021 0\n"
    (scratches,) = read(tmp_path, text)
    assert scratches.attributive
    assert (scratches.values, scratches.sizes) == ([2.0, 0.0], [50, 50])


def test_no_limit_where_the_file_says_so(tmp_path: Path) -> None:
    bore, _ = read(tmp_path, HEAD.replace("K2142/1", "K2120/1 0\nK2142/1") + KEYS)
    assert (bore.lower, bore.upper) == (None, 25.021)
    assert bore.denied == ["K2110 = 25,000 is not used: K2120 = 0 states that there is no lower limit"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("K2142/1", "K2113/1 0,030\nK2142/1", "its upper limit is 25.021, but the nominal 25 with"),
        ("K2110/1 25,000", "K2110/1 25,030", "the lower limit 25.03 is above the upper limit"),
        ("K2002/2 Rundlauf\n", "K2002/2 Rundlauf\nK2002/2 Planlauf\n", '"Rundlauf" above'),
        ("K2001/2 20\nK2002/2 Rundlauf", "K2001/2 10\nK2002/2 Ø Bohrung", "is described twice"),
        ("1.3.2026/08:01:00", "2026-03-01/08:01:00", "times in two formats"),
        ("25,0065", "25,00,65", 'must be a number, got "25,00,65"'),
        ("25,0065", "1.025,0065", 'must be a number, got "1.025,0065"'),
        ("K0001/2 0,0021", "K0001/7 0,0021", "characteristic 7 is not described"),
        ("K0100 2", "K0100 3", "K0100 announces 3 characteristics, 2 are described"),
    ],
)  # fmt: skip
def test_faults_with_their_places(tmp_path: Path, old: str, new: str, said: str) -> None:
    found = faults(tmp_path, (HEAD + KEYS).replace(old, new))
    assert said in found
    assert all(line.startswith("p.dfq") for line in found.splitlines())


def test_more_values_than_characteristics(tmp_path: Path) -> None:
    assert "3 characteristics in a line, 2 are described" in faults(tmp_path, HEAD + "1\x0f2\x0f3\n")


def test_as_a_table(tmp_path: Path) -> None:
    (tmp_path / "p.dfq").write_bytes((HEAD + KEYS).encode("cp1252"))
    found = tolevo.read_table(tmp_path / "p.dfq")
    assert found.frame["Ø Bohrung"].tolist() == [25.004, None]
    assert found.frame["Rundlauf"].tolist() == [-0.0012, 0.0021]
    assert found.units == {"Ø Bohrung": "mm", "Rundlauf": "mm"}
    assert found.notes == ("Ø Bohrung: 1 values are missing or not valid",)


def test_characteristics_of_one_name_keep_their_columns(tmp_path: Path) -> None:
    (tmp_path / "p.dfq").write_bytes((HEAD.replace("Ø Bohrung", "Rundlauf") + KEYS).encode("cp1252"))
    frame = tolevo.read_table(tmp_path / "p.dfq").frame
    assert frame["Zykloidenscheibe Rundlauf 10"].tolist() == [25.004, None]
    assert frame["Zykloidenscheibe Rundlauf 20"].tolist() == [-0.0012, 0.0021]


def test_characteristics_that_nothing_tells_apart_are_named_by_their_place(tmp_path: Path) -> None:
    text = HEAD.replace("Ø Bohrung", "Rundlauf").replace(
        "K2001/2 20", "K1001/2 4712\nK1002/2 Zykloidenscheibe\nK2001/2 10"
    )
    (tmp_path / "p.dfq").write_bytes((text + KEYS).encode("cp1252"))
    frame = tolevo.read_table(tmp_path / "p.dfq").frame
    assert frame["Zykloidenscheibe Rundlauf #1"].tolist() == [25.004, None]
    assert frame["Zykloidenscheibe Rundlauf #2"].tolist() == [-0.0012, 0.0021]


def test_times_above_the_values_that_they_belong_to(tmp_path: Path) -> None:
    """`K0004/0` before the values of a part; one of a value alone wins; three parts, two characteristics."""
    rows = [f"K0004/0 2026-03-01/08:0{at}:00\nK0001/1 25.00{at}\nK0001/2 0.00{at}\n" for at in range(3)]
    rows[1] += "K0004/2 2026-03-01/09:00:00\n"
    bore, runout = read(tmp_path, HEAD + "".join(rows))
    assert bore.values == [25.0, 25.001, 25.002]
    assert bore.times == [datetime(2026, 3, 1, 8, at) for at in range(3)]
    assert runout.times == [bore.times[0], datetime(2026, 3, 1, 9, 0), bore.times[2]]
    lines = [f"K0004/0 2026-03-01/08:0{at}:00\n25.00{at}\x140\x0f0.00{at}\x140\n" for at in range(3)]
    assert [c.times for c in read(tmp_path, HEAD + "".join(lines))] == [bore.times] * 2
    assert "K0006/0 is given twice" in faults(tmp_path, HEAD + KEYS + "K0006/0 1\nK0006/0 2\nK0004/0 1.3.2026\n")


def test_a_time_that_nobody_needs_is_no_fault(tmp_path: Path) -> None:
    text = (HEAD + KEYS).replace("1.3.2026/08:01:00", "yesterday")
    assert '"yesterday" is not a time' in faults(tmp_path, text)
    (tmp_path / "p.dfq").write_bytes(text.encode("cp1252"))
    found = tolevo.read_table(tmp_path / "p.dfq")
    assert found.frame["Rundlauf"].tolist() == [-0.0012, 0.0021]
    assert "time" not in found.frame
    assert 'times are not used: p.dfq: row 22: K0004: "yesterday" is not a time' in "".join(found.notes)
    measured = opened_parts(tmp_path / "p.dfq", ReadOptions())
    assert measured.characteristic("Rundlauf")["values"] == [-0.0012, 0.0021]


@pytest.mark.parametrize("kind", ["digits", "parts", "all"])
def test_long_files_are_read_or_refused_at_once(kind: str, tmp_path: Path) -> None:
    """Less than 2 s of CPU: 20,000 digits took 19 s, 20,000 parts 57 s, K0004/0 after each of them 105 s."""
    parts = [f"K1001/{at} {at}\nK2001/{at} {at}\nK2002/{at} d\nK0001/{at} 1.5\n" for at in range(1, 4001)]
    if kind == "digits":
        text = f"K1001 1\nK2002 d\n{'9' * 20000}\n{'9' * 20000}K0001/1 3\nK2002/{'9' * 5000} x\n"
    else:
        text = "".join(f"{part}K0004/0 2026-03-01/08:00\n" if kind == "all" else part for part in parts)
    begin = time.process_time()
    if kind == "digits":
        assert max(map(len, faults(tmp_path, text).splitlines())) < 200
    else:
        assert len(read(tmp_path, text)) == 4000
    assert time.process_time() - begin < 2.0
