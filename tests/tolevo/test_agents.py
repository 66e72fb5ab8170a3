"""`tolevo mcp`: a client of the SDK speaks with the server over stdin and stdout."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

mcp = pytest.importorskip("mcp")

STACK = """
problem = "stack"
references = "none"
[requirement]
name = "gap"
unit = "mm"
lower = -0.3
upper = 0.3
[objectives]
minimise = ["cost", "variation"]
[algorithm]
name = "exact"
points = 5
[[part]]
name = "a"
nominal = 5.0
sensitivity = 1.0
t_min = 0.01
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
[[part]]
name = "b"
nominal = 5.0
sensitivity = -1.0
t_min = 0.01
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
"""


def calls(directory: Path | None, wanted: list[tuple[str, dict[str, Any]]]) -> tuple[list[str], list[Any]]:
    """The names of the tools, and the answers to calls, of one server."""
    arguments = ["-m", "tolevo", "mcp", *(("--directory", str(directory)) if directory else ())]

    async def speak() -> tuple[list[str], list[Any]]:
        server = mcp.StdioServerParameters(command=sys.executable, args=arguments)
        async with mcp.Client(server, read_timeout_seconds=600) as client:
            tools = [tool.name for tool in (await client.list_tools()).tools]
            return tools, [await client.call_tool(name, options) for name, options in wanted]

    with ThreadPoolExecutor(1) as thread:  # the tests of pages leave an event loop running in theirs
        return thread.submit(lambda: asyncio.run(speak())).result()


def test_tools_answer_with_units_bounds_and_assumptions() -> None:
    designs = [{"a_t": 0.1, "b_t": 0.1}]
    tools, (listed, checked, analysed, ran, evaluated, unknown, wrong, typed, written, short, deep, none) = calls(
        None,
        [
            ("list", {}),
            ("check", {"configuration": STACK}),
            ("analyse", {"configuration": STACK}),
            ("run", {"configuration": STACK, "rows": 3}),
            ("evaluate", {"configuration": STACK, "designs": designs}),
            ("run", {"configuration": STACK, "row": 3}),
            ("check", {"configuration": STACK.replace("t_min = 0.01", "t_min = -1.0")}),
            ("run", {"configuration": STACK, "rows": "many"}),
            ("run", {"configuration": STACK, "out": "here"}),
            ("evaluate", {"configuration": STACK, "designs": [{"a_t": 0.1}]}),
            ("check", {"configuration": "a = " + "[" * 5000}),
            ("chek", {}),
        ],
    )
    assert set(tools) == {"list", "check", "analyse", "run", "evaluate", "gap", "certify"}
    assert "stack" in [entry["name"] for entry in listed.structured_content["problems"]]
    assert checked.structured_content["valid"]
    assert analysed.structured_content["requirements"][0]["requirement"] == "gap"
    front = ran.structured_content["front"]
    assert len(front) == 3
    assert all(point["bound"] == pytest.approx(point["cost"], rel=1e-6) for point in front)
    assert ran.structured_content["units"]["a_t"] == "mm"
    assert ran.structured_content["assumptions"]
    assert evaluated.structured_content["designs"][0]["cost"] == pytest.approx(4.0)
    assert unknown.structured_content["faults"][0]["place"] == "row"
    assert "rows" in unknown.structured_content["faults"][0]["message"]
    assert any("t_min" in fault["place"] for fault in wrong.structured_content["faults"])
    assert typed.structured_content["faults"][0]["place"] == "rows"
    assert "--directory" in written.structured_content["faults"][0]["message"]
    assert short.structured_content["faults"] == [{"place": "designs", "message": "column b_t is missing"}]
    assert deep.structured_content["faults"][0]["place"] == "configuration"
    assert "`check`" in none.structured_content["faults"][0]["message"]
    assert all(answer.is_error for answer in (unknown, wrong, typed, written, short, deep, none))


def start(name: str) -> str:
    return STACK.replace('references = "none"', f'references = "none"\nstart = {name}')


ESCAPES: list[Callable[[Path], tuple[str, dict[str, Any]]]] = [
    lambda outside: ("check", {"file": "../secret.toml"}),
    lambda outside: ("check", {"file": str(outside / "secret.toml")}),
    lambda outside: ("check", {"file": "link.toml"}),
    lambda outside: ("check", {"file": "linked/secret.toml"}),
    lambda outside: ("check", {"file": "sub/../../secret.toml"}),
    lambda outside: ("run", {"configuration": STACK, "out": "../out"}),
    lambda outside: ("run", {"configuration": STACK, "out": str(outside / "out")}),
    lambda outside: ("run", {"configuration": STACK, "out": "linked/out"}),
    lambda outside: ("analyse", {"configuration": STACK, "out": "linked"}),
    lambda outside: ("analyse", {"configuration": STACK, "out": "a/../../out"}),
    lambda outside: ("run", {"configuration": start('"../secret.csv"')}),
    lambda outside: ("run", {"configuration": start(f'"{outside / "secret.csv"}"')}),
    lambda outside: ("run", {"configuration": start('"link.csv"')}),
    lambda outside: ("run", {"configuration": start('["linked"]')}),
    lambda outside: ("run", {"configuration": start('["linked/secret.csv"]')}),
    lambda outside: ("check", {"configuration": STACK + '[costs]\nfile = "../secret.csv"\n'}),
    lambda outside: ("check", {"configuration": STACK + '[costs]\nfile = "linked/secret.csv"\n'}),
    lambda outside: ("check", {"configuration": STACK + '[part.measured]\nfile = "link.csv"\n'}),
    lambda outside: ("gap", {"configuration": 'model = "rv_lost_motion"', "data": "../secret.csv"}),
    lambda outside: ("run", {"file": "sub/own.toml"}),
    lambda outside: ("check", {"configuration": STACK.replace('"stack"', f'"{outside}/own.py:Own"')}),
]


def test_nothing_outside_of_the_directory_is_read_or_written(tmp_path: Path) -> None:
    inside, outside = tmp_path / "inside", tmp_path
    (inside / "sub").mkdir(parents=True)
    (outside / "secret.toml").write_text(STACK)
    (outside / "secret.csv").write_text("a_t,b_t\n0.15,0.15\n")
    (inside / "own.toml").write_text(STACK)
    (inside / "sub" / "own.toml").write_text(start('"link.csv"'))
    (inside / "sub" / "link.csv").symlink_to(outside / "secret.csv")
    (inside / "link.toml").symlink_to(outside / "secret.toml")
    (inside / "link.csv").symlink_to(outside / "secret.csv")
    (inside / "linked").symlink_to(outside, target_is_directory=True)
    before = sorted(str(path) for path in tmp_path.rglob("*"))
    wanted = [escape(outside) for escape in ESCAPES]
    _, answers = calls(inside, [*wanted, ("check", {"file": "own.toml"})])
    for (name, options), answer in zip(wanted, answers[:-1], strict=True):
        assert answer.is_error, (name, options)
        text = answer.structured_content["faults"][0]["message"]
        assert "outside of the directory" in text or "registered names alone" in text, (name, options, text)
    assert sorted(str(path) for path in tmp_path.rglob("*")) == before
    assert answers[-1].structured_content["valid"]


def test_the_guard_refuses_files_connections_and_processes(tmp_path: Path) -> None:
    """What a path that nobody checked would do: the events of the interpreter themselves."""
    from tolevo.agents import Guard
    from tolevo.errors import InputError

    (tmp_path / "in").mkdir()
    (tmp_path / "scratch").mkdir()
    guard = Guard(tmp_path / "in", tmp_path / "scratch")
    guard.audit("open", (str(tmp_path / "in" / "a"), "w", 1))
    guard.audit("open", (sys.executable, "r", 0))
    with pytest.raises(InputError, match="must be the name of a file"):
        guard.path("a\0b", "file")
    for event, arguments in (
        ("open", (str(tmp_path / "a"), "r", 0)),
        ("open", (str(tmp_path / "in" / ".." / "a"), "w", 1)),
        ("open", (sys.executable, "w", 1)),
        ("os.rename", (str(tmp_path / "in" / "a"), str(tmp_path / "b"), -1, -1)),
        ("socket.connect", (None, ("127.0.0.1", 80))),
        ("subprocess.Popen", ("sh", [], None, None)),
    ):
        with pytest.raises(PermissionError):
            guard.audit(event, arguments)


def test_the_gap_is_answered_with_units_and_effects() -> None:
    """A lost motion with 1 arcmin more play than the model has: the answer holds what `gap.json` holds."""
    rows = ["torque_Nm,direction,output_angle_deg,twist_arcmin"]
    rng = np.random.default_rng(1)
    for angle in (0.0, 90.0, 180.0):
        for torque in np.linspace(-400.0, 400.0, 9):
            twist = 0.01 * torque + 0.8 * np.sign(torque) + 0.02 * rng.normal()
            rows.append(f"{torque},{1 if torque > 0 else -1},{angle},{twist}")
    configuration = 'model = "rv_lost_motion"'
    _, (found, late) = calls(
        None,
        [
            ("gap", {"configuration": configuration, "data": "\n".join(rows)}),
            (
                "certify",
                {
                    "configuration": STACK,
                    "designs": [{"a_t": 0.1, "b_t": 0.1}],
                    "time_limit_s": 1.0,
                    "seeds": 20,
                    "evaluations": 100_000,
                },
            ),
        ],
    )
    content = found.structured_content
    assert content["verdict"] in ("no_gap", "named", "ambiguous", "partial", "unnamed")
    assert content["units"]["twist_arcmin"] == "arcmin"
    assert content["gap_before"] >= content["gap_after"] > 0.0
    assert content["noise_floor"] > 0.0
    assert {"effects", "alternatives", "where", "next_measurement", "assumptions", "words"} <= set(content)
    for effect in content["effects"]:
        assert all({"value", "interval", "unit"} <= set(parameter) for parameter in effect["parameters"].values())
    assert late.is_error
    assert late.structured_content["faults"][0]["place"] == "time_limit_s"
    assert "within 1 s" in late.structured_content["faults"][0]["message"]


def test_faults_do_not_say_where_the_directory_is(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(start('"missing.csv"'))
    (tmp_path / "bad.toml").write_text("problem = ")
    wanted = [
        ("check", {"file": "own.toml"}),
        ("check", {"file": "bad.toml"}),
        ("check", {"file": "none.toml"}),
        ("run", {"configuration": STACK, "out": "own.toml"}),
        ("gap", {"configuration": 'model = "rv_lost_motion"', "data": "none.csv"}),
    ]
    for answer in calls(tmp_path, wanted)[1]:
        assert answer.is_error
        assert str(tmp_path) not in str(answer.structured_content)
