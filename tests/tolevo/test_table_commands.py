"""Tables of a works through the commands: mapped columns, what is asked for, templates."""

import tomllib
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import Result

from tests.small_jobs import tolevo
from tolevo.commands.template import KINDS

EXPORT = (
    "Seriennr.;Datum;Drehmoment [N mm];Drehrichtung;Spiel [arcsec]\r\n"
    "4711;01.03.2026;100000;1;24,72\r\n4712;02.03.2026;-200000;-1;23,88\r\n"
)
COLUMNS = """
model = "rv_lost_motion"
[columns]
"Drehmoment [N mm]" = { role = "torque" }
Drehrichtung = "direction"
Spiel = { role = "measured", unit = "arcsec" }
"""


def simulated(folder: Path, config: str, table: bytes, *options: str) -> Result:
    (folder / "c.toml").write_text(config, encoding="utf-8")
    (folder / "in.csv").write_bytes(table)
    return tolevo("simulate", folder / "c.toml", folder / "in.csv", "--out", folder / "o.csv", *options)


def test_a_german_export_needs_no_hand_edit(tmp_path: Path) -> None:
    done = simulated(tmp_path, COLUMNS, EXPORT.encode("utf-8-sig"))
    assert done.exit_code == 0, done.stderr
    assert pd.read_csv(tmp_path / "o.csv")["torque_Nm"].tolist() == [100.0, -200.0]
    first = done.stderr.splitlines()
    assert first[0].startswith("read: in.csv: 2 rows; utf-8-sig, delimiter semicolon, decimal comma")
    assert "read: not used: Seriennr., Datum" in first


@pytest.mark.parametrize(
    ("config", "said"),
    [
        ('[columns]\nSpiel = "twist"', '"twist" is not a column of the model'),
        ('[columns]\nSpiel = { role = "payload" }', 'no column of the model has the role "payload"'),
        ('[columns]\nSpiel = { role = "measured", unit = "kg" }', "cannot be stated in arcmin"),
        ("[columns]\nSpiel = 3", "must be a name of a column of the model"),
        ('[columns]\nSpitzel = { role = "measured" }', "did you mean `Spiel`"),
    ],
)
def test_faults_of_the_mapping(tmp_path: Path, config: str, said: str) -> None:
    done = simulated(tmp_path, f'model = "rv_lost_motion"\n{config}\n', EXPORT.encode())
    assert done.exit_code == 2
    assert said in done.stderr
    assert not (tmp_path / "o.csv").exists()


def test_what_is_ambiguous_names_the_option_that_decides(tmp_path: Path) -> None:
    table = b"torque_Nm\tdirection\n1,234\t1\n1,235\t1\n"
    asked = simulated(tmp_path, 'model = "rv_lost_motion"\n', table)
    assert (asked.exit_code, "--decimal" in asked.stderr) == (2, True)
    done = simulated(tmp_path, 'model = "rv_lost_motion"\n', table, "--decimal", ",")
    assert done.exit_code == 0, done.stderr
    assert pd.read_csv(tmp_path / "o.csv")["torque_Nm"].tolist() == [1.234, 1.235]


@pytest.mark.parametrize("option", [("--encoding", "nonsense"), ("--delimiter", "x"), ("--decimal", ";")])
def test_options_that_cannot_be(tmp_path: Path, option: tuple[str, str]) -> None:
    done = simulated(tmp_path, 'model = "rv_lost_motion"\n', EXPORT.encode(), *option)
    assert done.exit_code == 2
    assert option[0] in done.stderr


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "qdas"])
def test_templates_are_filled_in(tmp_path: Path, kind: str) -> None:
    path = tmp_path / ("t.toml" if kind in ("stack", "gap") else "t.csv")
    assert tolevo("template", kind, "--out", path).exit_code == 0
    if path.suffix == ".csv":
        frame = pd.read_csv(path)
        assert len(frame) > 1
        assert frame.drop(columns="process", errors="ignore").notna().all(axis=None)
    else:
        assert tomllib.loads(path.read_text(encoding="utf-8"))
    assert tolevo("template", kind, "--out", path).exit_code == 2  # it is there already


def test_a_template_of_designs_can_be_evaluated(tmp_path: Path) -> None:
    assert tolevo("template", "designs", "--out", tmp_path / "d.csv").exit_code == 0
    (tmp_path / "c.toml").write_text('problem = "rv_backlash"\n')
    with_it = tolevo("template", "designs", "--config", tmp_path / "c.toml")
    (tmp_path / "d.csv").write_text(with_it.stdout)
    out = tmp_path / "o.csv"
    done = tolevo("evaluate", tmp_path / "c.toml", tmp_path / "d.csv", "--out", out)
    assert done.exit_code == 0, done.stderr
    assert len(pd.read_csv(out)) == 2


def test_an_unknown_template(tmp_path: Path) -> None:
    done = tolevo("template", "unts", "--out", tmp_path / "x")
    assert done.exit_code == 2
    assert "did you mean `units`" in done.stderr


DATED = (
    "Datum;Drehmoment [N mm];Drehrichtung\n"
    "01.03.2026 08:00:10;100000;1\n01.03.2026 08:00:00;50000;1\n02.03.2026 08:00:00,5;-200000;-1\n"
)
CLOCK = COLUMNS.replace('Spiel = { role = "measured", unit = "arcsec" }', 'Datum = { role = "time" }')


def test_a_column_of_dates_is_a_time(tmp_path: Path) -> None:
    done = simulated(tmp_path, CLOCK, DATED.encode())
    assert done.exit_code == 0, done.stderr
    assert 'read: "Datum" is read as time_s: seconds since 2026-03-01 08:00:00' in done.stderr
    assert pd.read_csv(tmp_path / "o.csv")["time_s"].tolist() == [10.0, 0.0, 86400.5]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("01.03.2026 08:00:00", "2026-03-01 08:00:00", "has times in two formats"),
        ("01.03.2026 08:00:00", "31.02.2026 08:00:00", "is not a time"),
        (".03.2026", "/03/2026", "with the day or the month first"),
    ],
)
def test_faults_of_dates(tmp_path: Path, old: str, new: str, said: str) -> None:
    done = simulated(tmp_path, CLOCK, DATED.replace(old, new).encode())
    assert done.exit_code == 2
    assert "in.csv: column Datum: " in done.stderr
    assert said in done.stderr


def test_dates_with_slashes_are_read_where_a_day_decides(tmp_path: Path) -> None:
    text = DATED.replace("02.03.2026", "13.03.2026").replace(".03.2026", "/03/2026")
    done = simulated(tmp_path, CLOCK, text.encode())
    assert done.exit_code == 0, done.stderr
    assert pd.read_csv(tmp_path / "o.csv")["time_s"].tolist() == [10.0, 0.0, 12 * 86400 + 0.5]
