"""The Python interface: results without files, the same bytes as the commands, every fault."""

from __future__ import annotations

import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from threadpoolctl import threadpool_info, threadpool_limits
from typer.testing import CliRunner

import tolevo
from tolevo import api
from tolevo.cli import app
from tolevo.configuration import reader
from tolevo.errors import refuse

CLUTCH = Path(str(files("tolevo.configs") / "stack_clutch.toml"))
SMALL = ("algorithm.population=20", "algorithm.generations=5")
SAME = ("config.toml", "front.csv", "front.json", "references.csv", "choices.csv", "allocation.csv")
"""Files without times."""


@pytest.fixture(scope="module")
def result() -> tolevo.Run:
    return tolevo.run(tolevo.read(CLUTCH, SMALL))


def test_a_run_returns_frames_and_writes_what_the_command_writes(result: tolevo.Run, tmp_path: Path) -> None:
    assert result.status == "done"
    assert {"cost", "variation", "hub_t"} <= set(result.front)
    assert result.write(tmp_path / "door") == tmp_path / "door"
    options = [option for one in SMALL for option in ("--set", one)]
    arguments = ["run", str(CLUTCH), "--out", str(tmp_path / "command"), "--quiet", *options]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    names = {path.name for path in (tmp_path / "command").iterdir()}
    assert {path.name for path in (tmp_path / "door").iterdir()} == names
    for name in SAME:
        both = [(tmp_path / folder / name).read_bytes() for folder in ("door", "command")]
        assert both[0] == both[1], name
    again = CliRunner().invoke(app, ["report", str(tmp_path / "door")])
    assert again.exit_code == 0, again.output


def test_nothing_is_written_without_being_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    states: list[int] = []
    found = tolevo.run(CLUTCH, settings=SMALL, progress=lambda state: states.append(state.generation))
    assert states
    assert states[-1] == 5
    assert "<html" in found.page
    assert found._repr_html_().startswith("<pre>")
    assert list(tmp_path.iterdir()) == []


def test_what_is_there_is_replaced_only_when_told(result: tolevo.Run, tmp_path: Path) -> None:
    result.write(tmp_path / "o")
    with pytest.raises(tolevo.ConfigurationError, match="not empty"):
        result.write(tmp_path / "o")
    result.write(tmp_path / "o", overwrite=True)
    with pytest.raises(tolevo.ConfigurationError, match="not empty"):
        tolevo.run(CLUTCH, tmp_path / "o", settings=SMALL)


def test_a_front_is_evaluated_as_it_stands(result: tolevo.Run) -> None:
    found = tolevo.evaluate(CLUTCH, result.front)
    pd.testing.assert_series_equal(found["cost"].reset_index(drop=True), result.front["cost"])
    assert any(note.startswith("not used: cost, variation") for note in found.attrs["notes"])
    with pytest.raises(tolevo.ConfigurationError) as caught:
        tolevo.evaluate(CLUTCH, result.front.drop(columns=["hub_t", "cage_t"]))
    assert [fault.message for fault in caught.value.faults] == [
        "column hub_t is missing", "column cage_t is missing",
    ]  # fmt: skip


def test_a_model_is_simulated_from_dictionaries_and_frames() -> None:
    inputs = pd.DataFrame({"torque_Nm": [100.0, -200.0], "direction": [1, -1]})
    found = tolevo.simulate({"model": "rv_lost_motion"}, inputs)
    assert found["twist_arcmin"].iloc[0] > 0.0 > found["twist_arcmin"].iloc[1]
    assert tolevo.check({"model": "rv_lost_motion"}).startswith('model = "rv_lost_motion"')


def test_a_gap_of_a_frame(tmp_path: Path) -> None:
    config = tmp_path / "gap.toml"
    config.write_text('model = "table"\n[columns]\nload_Nm = { role = "torque" }\n'
                      'y = { role = "measured", unit = "arcmin" }\n', encoding="utf-8")  # fmt: skip
    with pytest.raises(tolevo.ConfigurationError) as caught:
        tolevo.gap(config, pd.DataFrame({"load_Nm": [1.0, 2.0]}))
    assert any('no column has the role "predicted"' in str(fault) for fault in caught.value.faults)


def test_what_the_user_should_know_is_told_as_the_command_prints_it(tmp_path: Path) -> None:
    lines: list[str] = []
    (tmp_path / "t.csv").write_text("torque_Nm;direction\n100,5;1\n", encoding="utf-8")
    (tmp_path / "m.toml").write_text('model = "rv_lost_motion"\n', encoding="utf-8")
    tolevo.simulate({"model": "rv_lost_motion"}, tmp_path / "t.csv", tell=lines.append)
    words = ["simulate", str(tmp_path / "m.toml"), str(tmp_path / "t.csv")]
    command = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "o.csv")])
    assert command.stderr.splitlines() == lines
    assert {line.partition(":")[0] for line in lines} == {"read", "note"}


def test_settings_change_dictionaries_and_files_but_nothing_complete() -> None:
    given = {"model": "rv_lost_motion", "seed": 1}
    assert tolevo.read(given, ["seed=7"]).seed == 7
    assert given["seed"] == 1
    assert "seed = 3" in tolevo.check(given, ["seed=3"])
    with pytest.raises(tolevo.ConfigurationError, match="complete"):
        tolevo.read(tolevo.read(given), ["seed=2"])


def test_processes_are_counted_whether_or_not_files_are_written() -> None:
    with pytest.raises(tolevo.ConfigurationError, match="must be at least 1, got 0"):
        tolevo.run(CLUTCH, workers=0)


def test_every_fault_is_in_the_exception(tmp_path: Path) -> None:
    with pytest.raises(tolevo.ConfigurationError) as caught:
        tolevo.run({"problem": "stack", "seed": -1}, tmp_path / "missing" / "o" / "p", workers=0)
    places = {fault.place for fault in caught.value.faults}
    assert {"seed", "--workers"} <= places
    with pytest.raises(tolevo.ConfigurationError, match="did you mean `stack`"):
        tolevo.read({"problem": "stak"})


def test_the_door_lists_what_is_public() -> None:
    assert set(dir(tolevo)) == set(tolevo.__all__)
    assert all(hasattr(tolevo, name) for name in tolevo.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        tolevo.nonsense  # type: ignore[attr-defined]  # noqa: B018


def test_importing_the_package_imports_nothing_else() -> None:
    code = "import sys, tolevo; print(*(m for m in sys.modules if m in ('numpy', 'pandas', 'pymoo')))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.parametrize("name", ["analyse", "ask", "certify", "evaluate", "run", "search", "simulate"])
def test_sums_of_every_function_are_those_of_one_thread(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    threads: list[int] = []

    def read(*_: Any, **__: Any) -> None:
        threads.extend(library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas")
        raise refuse("problem", "is read no further")

    monkeypatch.setattr(api, "read", read)
    monkeypatch.setattr(reader, "read", read)
    (tmp_path / "t.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    further = {"evaluate": tmp_path / "t.csv", "simulate": tmp_path / "t.csv", "ask": tmp_path / "s", "certify": None}
    with threadpool_limits(2), pytest.raises(tolevo.ConfigurationError, match="is read no further"):
        getattr(tolevo, name)({"problem": "stack"}, *[further[name]] if name in further else [])
    assert set(threads) == {1}
