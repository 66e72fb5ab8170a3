"""`[[condition]]`: a stack at other temperatures than that of its drawings, against closed forms."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

import tolevo
from tolevo.configuration.reader import read
from tolevo.errors import InputError

BORE, RING = 62.03, 62.0
ALPHA = {"bore": 23.0e-6, "ring": 12.5e-6}
"""Aluminium housing, bearing ring of steel."""
TEMPERATURES = {"cold": -30.0, "room": 20.0, "warm": 80.0}
COST = {"model": "reciprocal", "a": 1.0, "b": 0.1}


def configuration(**changed: Any) -> dict[str, Any]:
    return {
        "problem": "stack",
        "objectives": {"minimise": ["cost"]},
        "limits": {"yield_percent": 90.0},
        "requirement": {"name": "fit", "unit": "mm", "formula": "bore - ring", "lower": -0.005, "upper": 0.1},
        "part": [
            {
                "name": "bore",
                "unit": "mm",
                "nominal": BORE,
                "material": "aluminium",
                "t_min": 0.002,
                "t_max": 0.05,
                "cost": COST,
            },
            {
                "name": "ring",
                "unit": "um",
                "nominal": 1e3 * RING,
                "expansion": ALPHA["ring"],
                "limits": "+0/-13",
                "cp": 1.2,
            },
        ],
        "condition": [{"name": name, "temperature_C": t} for name, t in TEMPERATURES.items()],
    } | changed


def built(source: dict[str, Any], overrides: Sequence[str] = ()) -> Any:
    return read(source, overrides).problem


def faults(**changed: Any) -> list[str]:
    with pytest.raises(InputError) as caught:
        read(configuration(**changed))
    return [str(fault) for fault in caught.value.faults]


SENSITIVITIES = [part | {"sensitivity": s} for part, s in zip(configuration()["part"], (1.0, -1e-3), strict=True)]
WITHOUT_FORMULA: dict[str, Any] = {
    "requirement": {"name": "fit", "unit": "mm", "lower": -0.005, "upper": 0.1},
    "part": SENSITIVITIES,
}


@pytest.mark.parametrize("stated", [{}, WITHOUT_FORMULA], ids=["formula", "sensitivities"])
def test_a_thermal_fit_at_three_temperatures(stated: dict[str, Any]) -> None:
    """Each size is 1 + alpha (T - 20) times as large, with its deviations: ends, spread and yield by hand."""
    problem = built(configuration(**stated))
    t = np.array([[0.02, 6.5]])
    row = {name: float(value[0]) for name, value in problem.outputs_of(t).items()}
    yields, worst = [], []
    for name, temperature in TEMPERATURES.items():
        bore, ring = (1.0 + alpha * (temperature - 20.0) for alpha in ALPHA.values())
        mean = bore * BORE - ring * (RING - 0.0065)
        reach = bore * 0.02 + ring * 0.0065
        std = np.hypot(bore * 0.02 / 3.0, ring * 0.0065 / 3.6)
        kept = norm.cdf((0.1 - mean) / std) - norm.cdf((-0.005 - mean) / std)
        yields.append(100.0 * kept)
        worst.append(reach)
        expected = {
            "worst_case": reach,
            "worst_case_least": mean - reach,
            "worst_case_greatest": mean + reach,
            "rss": 3.0 * std,
            "std": std,
            "yield_percent": yields[-1],
        }
        for output, value in expected.items():
            assert row[f"{name}.{output}"] == pytest.approx(value, rel=1e-11, abs=1e-13), (name, output)
    assert row["worst_case"] == pytest.approx(max(worst), rel=1e-12)
    # by one sample in all conditions; no two of the three limits are broken by the same units
    expected_joint = 100.0 - sum(100.0 - one for one in yields)
    assert row["yield_percent"] == pytest.approx(expected_joint, abs=4.0 * row["yield_percent_error"] + 1e-3)
    assert np.ptp(yields) > 1.0


def test_a_formula_that_is_not_linear_at_a_temperature() -> None:
    """A wedge angle atan(h/l) of one material does not change; of two it does as by hand."""
    angle = {"name": "angle", "unit": "mrad", "formula": "atan(h/l)"}

    def problem(height: str) -> Any:
        parts = [
            {"name": name, "unit": "mm", "nominal": nominal, "material": material, "tolerance": 0.01}
            for name, nominal, material in (("h", 10.0, height), ("l", 80.0, "steel"))
        ]
        return built(configuration(requirement=angle, part=parts, limits={}))

    t = np.array([[0.01, 0.01]])
    same, other = problem("steel").outputs_of(t), problem("aluminium").outputs_of(t)
    np.testing.assert_allclose(same["warm.std"], same["room.std"], rtol=1e-12)
    h, length = 10.0 * (1.0 + 23.0e-6 * 60.0), 80.0 * (1.0 + 11.5e-6 * 60.0)
    slopes = np.array([length * (1.0 + 23.0e-6 * 60.0), -h * (1.0 + 11.5e-6 * 60.0)]) / (h**2 + length**2)
    np.testing.assert_allclose(other["warm.std"], 1e3 * np.linalg.norm(slopes) * 0.01 / 3.0, rtol=1e-10)
    corners = [1e3 * np.arctan2(h * (1 + s * 1e-3), length * (1 - s * 0.01 / 80.0)) for s in (-1.0, 1.0)]
    np.testing.assert_allclose(
        [other["warm.worst_case_least"][0], other["warm.worst_case_greatest"][0]], corners, rtol=1e-12
    )


def test_a_loop_closes_at_every_temperature() -> None:
    """Fortini's one-way clutch with an aluminium ring: cos phi = (a + c)/(e - c) of the sizes at 100 degC."""
    sizes = {"a": (27.645, "steel", 11.5e-6), "c": (11.43, "steel", 11.5e-6), "e": (50.8, "aluminium", 23.0e-6)}
    links = [("b", 0), ("a + c", "90 deg"), ("e - c", "-pi/2 - phi")]
    made = configuration(
        requirement={"name": "angle", "unit": "deg", "formula": "phi"},
        part=[
            {"name": name, "unit": "mm", "nominal": nominal, "tolerance": 0.05, "material": material}
            for name, (nominal, material, _) in sizes.items()
        ],
        loop=[
            {
                "name": "clutch",
                "link": [{"length": length, "angle": angle} for length, angle in links],
                "unknown": {"b": 4.8, "phi": "7 deg"},
            }
        ],
        condition=[{"name": "warm", "temperature_C": 100.0}],
        limits={},
    )
    problem = built(made)
    a, c, e = (nominal * (1.0 + 80.0 * alpha) for nominal, _, alpha in sizes.values())
    cosine = (a + c) / (e - c)
    assert problem.definition.mechanism.centre == pytest.approx(np.degrees(np.arccos(cosine)), rel=1e-12)
    growth = np.array([1.0 + 80.0 * alpha for *_, alpha in sizes.values()])
    by_size = np.array([1.0, 1.0 + cosine, -cosine]) / (e - c) / -np.sqrt(1.0 - cosine**2)
    std = np.degrees(np.linalg.norm(by_size * growth) * 0.05 / 3.0)
    assert problem.outputs_of(np.full((1, 3), 0.05))["warm.std"][0] == pytest.approx(std, rel=1e-9)


def test_a_limit_without_a_condition_holds_in_all_and_a_condition_has_its_own() -> None:
    conditions = [
        {"name": "cold", "temperature_C": -30.0, "limits": {"worst_case_least": -0.03}},
        {"name": "warm", "temperature_C": 80.0, "limits": {"std": {"max": 0.004}}},
    ]
    made = configuration(condition=conditions, limits={"worst_case_greatest": 0.105, "std": 0.006})
    problem = built(made)
    limits = {limit.name: (limit.low, limit.high) for limit in problem.limits}
    inf = np.inf
    assert limits == {
        "cold.worst_case_least": (-0.03, inf),
        "warm.std": (-inf, 0.004),
        "cold.std": (-inf, 0.006),
        "cold.worst_case_greatest": (-inf, 0.105),
        "warm.worst_case_greatest": (-inf, 0.105),
    }
    result = tolevo.run(made)
    row = result.front.iloc[0]
    cold, warm = (1.0 + 23.0e-6 * change for change in (-50.0, 60.0))
    ring_cold, ring_warm = (1.0 + 12.5e-6 * change for change in (-50.0, 60.0))
    bounds = [
        (cold * BORE - ring_cold * RING + 0.03) / cold,
        (0.105 - warm * BORE + ring_warm * (RING - 0.013)) / warm,
        3.0 * np.sqrt(0.004**2 - (ring_warm * 0.0065 / 3.6) ** 2) / warm,
    ]
    assert row["bore_t"] == pytest.approx(min(bounds), rel=1e-6)
    assert row["gap_percent"] == pytest.approx(0.0, abs=1e-3)


def test_several_requirements_in_conditions_and_what_they_minimise() -> None:
    requirement = [
        {"name": "fit", "unit": "mm", "formula": "bore - ring", "lower": -0.005, "upper": 0.1},
        {"name": "size", "unit": "mm", "formula": "bore"},
    ]
    conditions = [
        {"name": "cold", "temperature_C": -30.0, "minimise": ["fit.variation"]},
        {"name": "warm", "temperature_C": 80.0, "limits": {"fit": {"yield_percent": 95.0}}},
    ]
    made = configuration(
        requirement=requirement, condition=conditions, limits={"size.std": 0.01, "fit": {"variation": 0.05}}
    )
    problem = built(made)
    assert problem.objectives == ("cost", "cold.fit.variation")
    assert {limit.name for limit in problem.limits} == {
        "warm.fit.yield_percent",
        "cold.size.std",
        "warm.size.std",
        "cold.fit.variation",
        "warm.fit.variation",
    }
    limits = {"warm.fit.yield_percent": 95.0, "cold.fit.variation": 0.05}
    again = built(problem.tables() | {"problem": "stack", "limits": limits})
    assert [requirement.key for requirement in again.definition.requirements] == [
        "cold.fit",
        "cold.size",
        "warm.fit",
        "warm.size",
    ]


def test_a_resolved_configuration_is_the_same_stack(tmp_path: Any) -> None:
    result = tolevo.run(configuration())
    result.write(tmp_path / "a")
    tolevo.run(tmp_path / "a" / "config.toml").write(tmp_path / "b")
    assert (tmp_path / "a" / "front.csv").read_bytes() == (tmp_path / "b" / "front.csv").read_bytes()
    assumptions = {one["name"]: one for one in result.summary["assumptions"]}
    assert assumptions["condition.reference_temperature"]["value"] == 20.0
    assert assumptions["part.bore.expansion"]["value"] == 23.0e-6
    assert result.front.columns[0] == "bore_t"


def test_a_temperature_is_set_by_name() -> None:
    problem = built(configuration(), ["condition.warm.temperature_C=100"])
    assert problem.definition.conditions[2].temperature_C == 100.0


def test_every_fault_of_conditions_is_placed() -> None:
    bore, ring = configuration()["part"]
    found = faults(
        part=[
            bore | {"material": "aluminum", "expansion": 1e-5},
            ring | {"expansion": 11.5},
            {"name": "turn", "unit": "mrad", "nominal": 1.0, "tolerance": 0.1, "material": "steel"},
        ],
        condition=[
            {"name": "2nd", "temperature_C": -300.0, "limits": {"variations": 1.0}},
            {"temperature_C": 20.0, "hot": True},
            {"name": "rss"},
            {"name": "warm", "temperature_C": 60.0},
            {"name": "warm", "temperature_C": 70.0},
        ],
    )
    assert [line.replace(" (did you mean `aluminium`?)", "") for line in found] == [
        "part[0].material: must be one of steel, stainless_steel, cast_iron, aluminium, copper, titanium, magnesium, "
        'got "aluminum" (part bore)',
        "part[0].expansion: is stated in addition to material: keep only one of the two (part bore)",
        "part[1].expansion: must lie in [-0.0001, 0.001], got 11.5 (part ring)",
        "part[2].material: applies to lengths, not to a part in mrad (part turn)",
        "condition[0].temperature_C: must be at least -273.15, got -300",
        'condition[0].name: must be letters, digits and _, and begin with a letter, got "2nd"',
        "condition[1].hot: is not a known key",
        "condition[1].name: is missing: outputs of conditions are distinguished by it",
        "condition[2].temperature_C: is missing: in degC",
        "condition[2].name: rss means something in [limits]; choose another name",
        "condition[4].name: warm is the name of a requirement or condition; choose another name",
    ]


def test_conditions_that_change_nothing_or_cannot_be_computed() -> None:
    plain = [
        {key: value for key, value in part.items() if key not in ("material", "expansion")}
        for part in configuration()["part"]
    ]
    assert faults(part=plain) == [
        "condition: changes nothing: no part has an expansion; state expansion or material of the parts"
    ]
    sizeless = [{key: value for key, value in part.items() if key != "nominal"} for part in SENSITIVITIES]
    requirement = WITHOUT_FORMULA["requirement"] | {"nominal": 0.03}
    assert faults(part=sizeless, requirement=requirement) == [
        "part[0].nominal: is missing: the part expands with the temperature (part bore)",
        "part[1].nominal: is missing: the part expands with the temperature (part ring)",
    ]
    tight = {"name": "root", "unit": "", "formula": "sqrt(log(bore/ring - 0.0004))"}
    assert any("root" not in line and "formula" in line for line in faults(requirement=tight, limits={}))


def test_conditions_limits_and_parts_that_do_not_mate_are_refused_at_once() -> None:
    bore, ring = configuration()["part"]
    lid = {"name": "lid", "unit": "mm", "nominal": 0.01, "tolerance": 0.001}
    found = faults(
        requirement=configuration()["requirement"] | {"formula": "bore - ring - lid"},
        part=[bore, ring, lid],
        matched=[{"parts": ["ring", "lid"], "classes": 1}],
        limits={"variation": {"min": 0.06}},
        condition=[
            {"name": "cold", "temperature_C": -300.0, "limits": {"variation": 0.05}},
            {"name": "cold", "temperature_C": 20.0},
            {"name": "warm", "temperature_C": 60.0, "limits": {"std": {"min": 2.0, "max": 1.0}}},
        ],
    )
    assert [line.split(": ")[0] for line in found] == [
        "condition[0].temperature_C",
        "condition[1].name",
        "matched[0].classes",
        "matched[0].parts",
        "condition[2].limits.std.min",
        "condition[0].limits.variation",
    ]
    assert "do not mate" in found[3]
    assert faults(limits={"cold": {"std": 0.01}, "room": {"std": 0.01}}) == [
        "condition[2]: warm has no limit and no objective: state limits or minimise in it, or a limit that holds in "
        "all conditions"
    ]


@pytest.mark.parametrize("limits", [{}, {"cost": 100.0}, {"bore_t": 0.04}])
def test_a_stack_whose_conditions_are_listed_alone_is_valid(limits: dict[str, float]) -> None:
    assert "cold.yield_percent" in built(configuration(limits=limits)).outputs_of(np.array([[0.02, 6.5]]))


def test_an_output_without_its_condition_cannot_be_minimised() -> None:
    requirement = [configuration()["requirement"], {"name": "size", "unit": "mm", "formula": "bore"}]
    assert faults(requirement=requirement, objectives={"minimise": ["cost", "fit.variation"]}) == [
        "objectives.minimise: fit.variation has a value in each condition: name one, like cold.fit.variation"
    ]
    conditions = [{"name": "warm", "temperature_C": 60.0, "limits": {"std": 0.01}}]
    assert faults(condition=conditions, limits={"warm": {"std": 0.02}}) == [
        "condition[0].limits.std: is given twice: here and as limits.warm.std"
    ]


def test_a_sheet_needs_no_limit_in_conditions_where_others_have_some(tmp_path: Path) -> None:
    """`run` refuses an idle condition; `analyse` shows it beside those that are limited."""
    table = configuration(limits={"cold": {"std": 0.01}, "room": {"std": 0.01}})
    rows = tolevo.analyse(table, tmp_path / "sheet").requirements
    assert rows["requirement"].str.contains("warm").any()
    with pytest.raises(InputError, match="warm has no limit"):
        tolevo.run(table, tmp_path / "run")
