"""Assemblies one of whose inputs was recorded wrongly. Units are assembled here, by document A."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.gap import record
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult

Array = np.ndarray
WEIGHTS = ((5, 1e3, 1e3, 1e3), (10, 5, 1e3, 1e3), (10, 5, 5, 1e3), (10, 5, 10, 5))
MOVES = np.array([[1, 0, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]], dtype=float)
NOISE = 0.05
"""[mrad]"""


def assembled(errors: Array, weight: Array, achieved: float = 1.0) -> Array:
    """Final angles (n, 4) [mrad] of part errors (n, 4): the printed recursion, step by step."""
    found = np.empty_like(errors)
    for q in np.unique(weight):
        ahead, gains = q * np.eye(4), list[Array]()
        for row in reversed(WEIGHTS):
            moves = MOVES * [float(r < 1e3) for r in row]
            cost = np.diag(row)
            gain = np.linalg.solve(cost + moves.T @ ahead @ moves, moves.T @ ahead)
            closed = np.eye(4) - moves @ gain
            ahead = closed.T @ ahead @ closed + gain.T @ cost @ gain
            gains.insert(0, moves @ gain)
        rows = weight == q
        state = np.zeros((int(rows.sum()), 4))
        for step, moved in enumerate(gains):
            arriving = np.zeros_like(state)
            arriving[:, step] = errors[rows, step]
            state = state - achieved * state @ moved.T + arriving @ MOVES.T
        found[rows] = state
    return found


def test_the_document_s_final_state() -> None:
    """At Q = 10, as printed in the physics of document A."""
    errors = np.array([[-1.6, 5.3, 5.8, 3.2]])
    found = assembled(errors, np.array([10.0]))
    np.testing.assert_allclose(found[0], [-0.985, 0.884, 2.486, 4.029], atol=6e-4)


def table(
    n: int = 100, seed: int = 1, part: int = 1, bias: float = 0.0, gain: float = 0.0,
    trend: float = 0.0, zero: float = 0.0, achieved: float = 1.0,
    weights: tuple[float, ...] = (0.0, 2.0, 5.0, 10.0),
) -> pd.DataFrame:  # fmt: skip
    """Units of random parts, the error of one of which was recorded wrongly."""
    rng = np.random.default_rng(seed)
    errors, weight = rng.normal(0.0, 3.0, (n, 4)), rng.choice(np.array(weights), n)
    measured = assembled(errors, weight, achieved) + NOISE * rng.standard_normal((n, 4))
    measured[:, 3] += zero
    recorded = errors.copy()
    recorded[:, part] = recorded[:, part] * (1.0 + gain) + bias + trend * np.arange(n) / (n - 1)
    columns = {f"dtheta_{k + 1}_mrad": recorded[:, k] for k in range(4)}
    outputs = {f"delta_{k + 1}_mrad": measured[:, k] for k in range(4)}
    return pd.DataFrame({"unit": np.arange(n), **columns, "precision_weight": weight, **outputs})


def analysed(folder: Path, frame: pd.DataFrame) -> GapResult:
    configuration, data = folder / "gap.toml", folder / "units.csv"
    configuration.write_text('model = "assembly"\n[settings]\nsimulations = 400\n', encoding="utf-8")
    frame.to_csv(data, index=False)
    plan = read_gap(configuration)
    return gap.analysis_result(plan, read_data(plan, data))


@pytest.mark.parametrize(("kind", "amount"), [("bias", 0.4), ("gain", -0.12), ("trend", 0.8)])
def test_an_input_recorded_wrongly_is_found(tmp_path: Path, kind: str, amount: float) -> None:
    result = analysed(tmp_path, table(**{kind: amount}))  # type: ignore[arg-type]
    (found,) = result.attribution
    assert (found.kind, found.inputs, found.verdict) == (kind, ("dtheta_2_mrad",), "attributed")
    best = found.candidates[0]
    assert best.amount == pytest.approx(amount, abs=4.0 * (best.high - best.low) / 3.29)
    assert all(one.excluded_because for one in found.candidates[1:])
    assert any(one.differs and one.output == "delta_2_mrad" for one in result.population)
    written = json.loads(json.dumps(record(result)["attribution"], default=str))
    assert written[0]["text"].startswith(f"{kind} of dtheta_2_mrad")


def test_the_last_part_and_its_gauge_are_twins(tmp_path: Path) -> None:
    """Part 4 is never adjusted: what its error leaves is a zero of delta_4."""
    result = analysed(tmp_path, table(part=3, bias=0.3))
    (found,) = result.attribution
    assert found.verdict == "cannot tell"
    assert set(found.inputs) == {"dtheta_4_mrad", "gauge of delta_4_mrad"}
    assert result.verdict == "no_gap"  # the zero of an angle is free


def test_clean_assemblies_are_as_simulated(tmp_path: Path) -> None:
    result = analysed(tmp_path, table(seed=2))
    assert (result.verdict, result.attribution) == ("no_gap", ())
    assert not any(one.differs for one in result.population)
    by = {(one.output, one.statistic): one for one in result.population}
    assert by["delta_1_mrad", "mean"].measured == pytest.approx(table(seed=2)["delta_1_mrad"].mean())


def test_an_adjuster_that_is_named_is_no_input(tmp_path: Path) -> None:
    """No recorded input does what a short adjustment does."""
    result = analysed(tmp_path, table(seed=3, achieved=0.85))
    assert result.names == ("adjustment_gain",)
    assert result.attribution == ()
    assert any(one.differs for one in result.population if one.model == "before")
    assert not any(one.differs for one in result.population if one.model == "after")


def test_parts_all_alike_cannot_tell_bias_from_gain(tmp_path: Path) -> None:
    """A part error that is the same in every unit: too large, or mis-scaled."""
    frame = table(seed=4, bias=0.0)
    errors = np.tile([-1.6, 5.3, 5.8, 3.2], (len(frame), 1))
    rng = np.random.default_rng(5)
    right = assembled(errors, frame["precision_weight"].to_numpy())
    for k in range(4):
        frame[f"dtheta_{k + 1}_mrad"] = errors[:, k] + (0.5 if k == 1 else 0.0)
        frame[f"delta_{k + 1}_mrad"] = right[:, k] + NOISE * rng.standard_normal(len(frame))
    result = analysed(tmp_path, frame)
    found = {one.kind: one for one in result.attribution}
    assert {one.verdict for one in result.attribution} == {"cannot tell"}
    assert found["bias"].inputs[0] == found["gain"].inputs[0] == "dtheta_2_mrad"


def test_exact_units_of_the_simulation_differ_in_nothing(tmp_path: Path) -> None:
    frame = table(seed=6)
    errors = frame[[f"dtheta_{k}_mrad" for k in range(1, 5)]].to_numpy()
    right = assembled(errors, frame["precision_weight"].to_numpy())
    for k in range(4):
        frame[f"delta_{k + 1}_mrad"] = right[:, k]
    result = analysed(tmp_path, frame)
    assert result.attribution == ()
    assert {one.verdict for one in result.population} == {"no difference detected: measured is as simulated"}
