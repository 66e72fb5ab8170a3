"""Parts of a stack that are sorted into classes and matched: closed forms, and an assembly drawn part by part."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

import tolevo
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.problems.stack import Stack

COST = {"model": "reciprocal", "a": 1.0, "b": 0.01}
PLAY = {"name": "play", "unit": "mm", "formula": "bore - pin", "lower": 0.002, "upper": 0.018}
TABLE: dict[str, Any] = {
    "problem": "stack", "seed": 2, "requirement": PLAY, "objectives": {"minimise": ["cost"]},
    "limits": {"yield_percent": 99.0},
    "part": [{"name": "bore", "nominal": 10.01, "unit": "mm", "t_min": 0.002, "t_max": 0.02, "cost": COST},
             {"name": "pin", "nominal": 10.0, "unit": "mm", "t_min": 0.002, "t_max": 0.02, "cost": COST}],
}  # fmt: skip


def stack_of(matched: Any, **more: Any) -> Stack:
    problem = read({**TABLE, **more, "matched": matched}).problem
    assert isinstance(problem, Stack)
    return problem


def faults_of(matched: Any, **more: Any) -> list[str]:
    with pytest.raises(InputError) as raised:
        read({**TABLE, **more, "matched": matched})
    return [str(fault) for fault in raised.value.faults]


def values_at(stack: Stack, bore: float, pin: float) -> dict[str, float]:
    design = np.array([[{"bore_t": bore, "pin_t": pin}[name] for name in stack.names]])
    return {name: float(value[0]) for name, value in stack.outputs_of(design).items()}


def truncated(classes: int) -> tuple[Any, Any, Any]:
    """Probability, mean and variance of a standard normal in classes of equal width over +-3."""
    edges = np.concatenate([[-np.inf], np.linspace(-3.0, 3.0, classes + 1)[1:-1], [np.inf]])
    p, bell = np.diff(norm.cdf(edges)), norm.pdf(edges)
    mean = -np.diff(bell) / p
    moment = np.where(np.isfinite(edges), edges, 0.0) * bell
    return p, mean, 1.0 - np.diff(moment) / p - mean**2


@pytest.mark.parametrize("classes", [2, 3, 4, 5, 8])
@pytest.mark.parametrize("ratio", [1.0, 1.7])
def test_two_normal_parts_in_classes(classes: int, ratio: float) -> None:
    """Of class c both parts are independent normal deviates truncated to it: variances add, means differ."""
    sigma, other = 0.006 / 3.0, ratio * 0.006 / 3.0
    p, mean, within = truncated(classes)
    gap = (other - sigma) * mean
    variance = np.sum(p * (within * (sigma**2 + other**2) + gap**2)) - np.sum(p * gap) ** 2
    values = values_at(stack_of({"parts": ["pin", "bore"], "classes": classes}), ratio * 0.006, 0.006)
    assert values["std"] == pytest.approx(np.sqrt(variance), rel=0.005)
    assert values["left_over_percent"] == 0.0


def test_an_assembly_drawn_part_by_part() -> None:
    """Parts are drawn, measured with an error, put into boxes and paired; what finds no mate is counted."""
    rng, made, classes, u = np.random.default_rng(5), 400_000, 4, 0.0008
    laws = {"bore": 0.012, "pin": 0.006}
    uniform = [dict(part, distribution="uniform") if part["name"] == "bore" else part for part in TABLE["part"]]
    box, deviation = {}, {}
    for name, t in laws.items():
        deviation[name] = rng.uniform(-t, t, made) if name == "bore" else rng.normal(0.0, t / 3.0, made)
        measured = deviation[name] + rng.normal(0.0, u, made)
        box[name] = np.searchsorted(np.linspace(-t, t, classes + 1)[1:-1], measured)
    plays = []
    for number in range(classes):
        bores, pins = (deviation[name][box[name] == number] for name in laws)
        pairs = min(len(bores), len(pins))
        plays.append(0.01 + bores[:pairs] - pins[:pairs])
    play = np.concatenate(plays)
    values = values_at(
        stack_of({"parts": ["pin", "bore"], "classes": classes, "u_um": 0.8}, part=uniform), 0.012, 0.006
    )
    left_over = 1.0 - len(play) / made
    kept = 100.0 * np.mean((play >= 0.002) & (play <= 0.018))
    assert left_over > 0.2
    assert values["left_over_percent"] == pytest.approx(100.0 * left_over, abs=0.3)
    assert values["std"] == pytest.approx(play.std(), rel=0.005)
    assert values["yield_percent"] == pytest.approx(kept, abs=0.3)
    cost = (1.0 + 0.01 / 0.012 + 1.0 + 0.01 / 0.006) / (1.0 - left_over)
    assert values["cost"] == pytest.approx(cost, rel=0.005)
    assert values["cost_per_good_unit"] == pytest.approx(cost / (0.01 * kept), rel=0.005)


def test_parts_that_are_not_matched_keep_their_law() -> None:
    third = [*TABLE["part"], {"name": "shim", "nominal": 0.0, "unit": "mm", "tolerance": 0.003}]
    requirement = {**PLAY, "formula": "bore - pin + shim"}
    stack = stack_of({"parts": ["pin", "bore"], "classes": 3}, part=third, requirement=requirement)
    design = np.array([[{"bore_t": 0.006, "pin_t": 0.006, "shim_t": 0.003}[name] for name in stack.names]])
    p, mean, _ = truncated(3)
    variance = 2.0 * 0.002**2 * (1.0 - np.sum(p * mean**2)) + 0.001**2
    assert float(stack.outputs_of(design)["std"][0]) == pytest.approx(np.sqrt(variance), rel=0.005)


def test_classes_with_sensitivities_and_the_price_of_sorting() -> None:
    parts = [dict(TABLE["part"][0], sensitivity=1.0), dict(TABLE["part"][1], sensitivity=-1.0)]
    requirement = {key: value for key, value in PLAY.items() if key != "formula"}
    matched = {"parts": ["bore", "pin"], "classes": 4}
    free = stack_of(matched, part=parts, requirement=requirement)
    priced = stack_of({**matched, "price": 0.7}, part=parts, requirement=requirement)
    formula = values_at(stack_of(matched), 0.006, 0.006)
    values, dearer = values_at(free, 0.006, 0.006), values_at(priced, 0.006, 0.006)
    assert values["std"] == pytest.approx(formula["std"], rel=1e-12)
    assert dearer["cost"] == pytest.approx(values["cost"] + 0.7, rel=1e-12)
    assert values["worst_case"] == pytest.approx(0.012)  # whichever classes: no unit is worse


@pytest.mark.parametrize("objective", [pytest.param("cost", marks=pytest.mark.slow), "cost_per_good_unit"])
def test_exact_finds_what_a_grid_finds(objective: str) -> None:
    limits = {"yield_percent": 99.0} if objective == "cost" else {}
    table = {**TABLE, "objectives": {"minimise": [objective]}, "limits": limits, "algorithm": {"name": "exact"},
             "matched": [{"parts": ["pin", "bore"], "classes": 3, "u_um": 0.5}],
             "propagation": {"samples": 8192}, "references": "none"}  # fmt: skip
    reached = float(tolevo.run(table).front[objective].iloc[0])
    stack = read(table).problem
    assert isinstance(stack, Stack)
    t = np.linspace(0.006, 0.02, 15)
    grid = np.array(np.meshgrid(t, t)).reshape(2, -1).T
    values = stack.outputs_of(grid)
    kept = values["yield_percent"] >= limits.get("yield_percent", 0.0)
    assert reached <= float(values[objective][kept].min()) * 1.002


def test_an_analysis_is_of_the_matched_units() -> None:
    stack = stack_of({"parts": ["pin", "bore"], "classes": 4})
    design = np.array([[0.012, 0.012]])
    (row,) = stack.requirements_at(design[0]).to_dict("records")  # type: ignore[union-attr]
    values = values_at(stack, 0.012, 0.012)
    assert row["std"] == pytest.approx(values["std"], rel=1e-9)
    assert row["mean"] == pytest.approx(0.01, abs=1e-5)
    assert row["worst_case_greatest"] == pytest.approx(0.034)
    slopes = stack.gradient(design)
    assert slopes["worst_case_least"][0] == pytest.approx([-1.0, -1.0])


def test_the_resolved_configuration_is_the_same_stack() -> None:
    stack = stack_of([{"parts": ["pin", "bore"], "classes": 3, "price": 0.1}])
    again = read(
        {"problem": "stack", "seed": 2, "objectives": TABLE["objectives"], "limits": TABLE["limits"], **stack.tables()}
    )
    assert isinstance(again.problem, Stack)
    assert values_at(again.problem, 0.006, 0.008) == values_at(stack, 0.006, 0.008)
    assumed = {assumption.name for assumption in stack.assumptions()}
    assert assumed >= {"matched.pin+bore.u_um", "matched.pin+bore.left_over"}
    assert "matched.pin+bore.price" not in assumed


def test_every_fault_of_matching_is_placed() -> None:
    assert any('"bor" is not a part' in f for f in faults_of({"parts": ["pin", "bor"], "classes": 4}))
    wrong = faults_of({"parts": ["pin"], "classes": 9, "u_um": -1.0, "sorted": True})
    assert {f.split(":")[0] for f in wrong} >= {"matched.parts", "matched.classes", "matched.u_um", "matched.sorted"}
    narrow = faults_of([{"parts": ["pin", "bore"], "classes": 8, "u_um": 5.0}])
    assert any(f.startswith("matched[0].classes") and "take 4 classes at most" in f for f in narrow)
    alike = faults_of({"parts": ["pin", "bore"], "classes": 3}, requirement={**PLAY, "formula": "bore + pin - 20"})
    assert any("do not mate" in f for f in alike)
    twice = faults_of([{"parts": ["pin", "bore"], "classes": 3}, {"parts": ["bore", "pin"], "classes": 2}])
    assert any("already above" in f for f in twice)
    many = [dict(TABLE["part"][0]), dict(TABLE["part"][1], count=2)]
    repeated = faults_of({"parts": ["pin", "bore"], "classes": 3}, part=many,
                         requirement={**PLAY, "formula": "bore - (pin_1 + pin_2)/2"})  # fmt: skip
    assert any("built in 2 times" in f for f in repeated)
    promise = {"yield_percent": 99.0, "statement": "plug_in"}
    promised = faults_of({"parts": ["pin", "bore"], "classes": 3}, promise=promise, limits={})
    assert any(f.startswith("promise:") for f in promised), promised
