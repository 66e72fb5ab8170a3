"""Parts and requirements as people state them: per cent, a supplier's figures, one price, windows, spreads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import tolevo
from tolevo.configuration.reader import read
from tolevo.errors import InputError

COST = {"model": "reciprocal", "a": 1.0, "b": 0.1}
SPREAD = {"t_min": 0.001, "t_max": 0.5}


def part(name: str, nominal: float = 10.0, sensitivity: float = 1.0, **keys: Any) -> dict[str, Any]:
    table = {"name": name, "nominal": nominal, "unit": "mm", "sensitivity": sensitivity} | keys
    return table if {"tolerance", "process", "limits", "t_min"} & keys.keys() else table | SPREAD | {"cost": COST}


def stack(*parts: dict[str, Any], limits: dict[str, Any] | None = None, **requirement: Any) -> dict[str, Any]:
    return {
        "problem": "stack",
        "objectives": {"minimise": ["cost"]},
        "limits": limits or {"variation": 0.2},
        "requirement": {"name": "gap", "unit": "mm"} | requirement,
        "part": list(parts),
    }


def problem(*parts: dict[str, Any], **keys: Any) -> Any:
    return built(stack(*parts, **keys))


def built(source: dict[str, Any], overrides: Sequence[str] = ()) -> Any:
    return read(source, overrides).problem


def faults(*parts: dict[str, Any], **keys: Any) -> list[str]:
    with pytest.raises(InputError) as caught:
        read(stack(*parts, **keys))
    return [str(fault) for fault in caught.value.faults]


def optimum(configuration: dict[str, Any]) -> Any:
    result = tolevo.run(configuration)
    assert len(result.front) == 1
    return result.front.iloc[0]


# ---------------------------------------------------------------- per cent of the nominal


def test_per_cent_of_the_nominal_is_a_half_width() -> None:
    made = problem(
        part("a", -8.0, tolerance="1 %"),
        part("b", 12.0, t_min="0.1 %", t_max="2.5 percent", cost=COST),
        part("c", 6.0, process=[{"name": "turned", "tolerance": "0.2%", "price": 3.0}]),
    )
    np.testing.assert_allclose(made.ends_of_t, [[0.08, 0.012, 0.012], [0.08, 0.3, 0.012]], rtol=1e-12)
    again = built(made.tables() | {"problem": "stack"})
    np.testing.assert_array_equal(again.ends_of_t, made.ends_of_t)
    assert made.tables()["part"][0]["tolerance"] == "1 %"  # follows a change of the nominal


def test_per_cent_of_nothing_is_a_fault() -> None:
    missing = {key: value for key, value in part("b", tolerance="1 %").items() if key != "nominal"}
    zero = part("c", 0.0, t_min="x %", t_max="1 %", cost=COST)
    found = faults(part("a", 0.0, tolerance="1 %"), missing, zero, nominal=1.0)
    assert found == [
        "part[0].tolerance: is 1 % of the nominal, which is 0: state the half-width in mm (part a)",
        "part[1].tolerance: is 1 % of the nominal, which is missing: state the half-width in mm (part b)",
        'part[2].t_min: must be a percentage of the nominal, like "1 %", got "x %" (part c)',
        "part[2].t_max: is 1 % of the nominal, which is 0: state the half-width in mm (part c)",
    ]
    assert faults(part("a", tolerance="-1 %"))[0].startswith("part[0].tolerance: must be at least 0, got -0.1")


# ---------------------------------------------------------------- a process with one tolerance and one price


def test_the_cheapest_of_processes_with_a_price_each() -> None:
    """All nine choices by hand: worst case at most 0.1 mm."""
    offers = {"cast": (0.09, 1.0), "turned": (0.05, 2.5), "ground": (0.01, 6.0)}
    process = [{"name": name, "tolerance": t, "price": price} for name, (t, price) in offers.items()]
    row = optimum(stack(part("a", process=process), part("b", process=process), limits={"worst_case": 0.1}))
    pairs = [(p + q, t + u) for t, p in offers.values() for u, q in offers.values()]
    assert row["cost"] == min(cost for cost, worst in pairs if worst <= 0.1 + 1e-12) == 5.0
    assert (row["a_process"], row["a_t"], row["b_t"]) == ("turned", 0.05, 0.05)


def test_a_price_is_of_one_tolerance() -> None:
    both = {"name": "p", "t_min": 0.01, "t_max": 0.1, "price": 2.0}
    neither = {"name": "q", "tolerance": 0.01}
    assert faults(part("a", process=[both, neither])) == [
        "part[0].process[0].tolerance: is missing: a price is that of one tolerance; of a range state a cost (part a)",
        "part[0].process[0].t_min: is stated in addition to tolerance or price: state a range with a cost, or neither "
        "end (part a)",
        "part[0].process[0].t_max: is stated in addition to tolerance or price: state a range with a cost, or neither "
        "end (part a)",
        "part[0].process[1].price: give either a price, or a cost curve of t (part a)",
    ]


def test_a_price_includes_set_up_and_inspection() -> None:
    more = {"setup": {"price": 60.0, "lot": 20}, "inspection": {"price": 0.5}}
    made = problem(
        part(
            "a", process=[{"name": "p", "tolerance": 0.01, "price": 2.0} | more, {"name": "q", **SPREAD, "cost": COST}]
        )
    )
    assert made.cost_of(np.array([[0.01, 0.0]]))[0] == 5.5
    assert built(made.tables() | {"problem": "stack"}).cost_of(np.array([[0.01, 0.0]]))[0] == 5.5


# ---------------------------------------------------------------- names of ISO 1101


@pytest.mark.parametrize(
    ("stated", "symbol"),
    [
        ("coaxiality", "\u25ce coaxiality"),
        ("Circularity", "\u25cb circularity"),
        ("total run-out", "\u2330 total runout"),
        ("Circular Runout", "\u2197 circular runout"),
        ("run-out", "\u2197 runout"),
        ("profile of a surface", "\u2313 profile of a surface"),
        ("true position", "\u2316 true position"),
    ],
)
def test_names_that_drawings_write(stated: str, symbol: str) -> None:
    assert problem(part("a", geometry=stated)).drawn("a_t")["symbol"] == symbol


def test_a_general_tolerance_by_another_name_is_the_same() -> None:
    tables = [
        {"name": "a", "unit": "mm", "nominal": 10.0, "sensitivity": 1.0, "general": "K", "geometry": name}
        for name in ("squareness", "perpendicularity")
    ]
    assert len({problem(table).ends_of_t[0][0] for table in tables}) == 1


def test_a_misspelt_characteristic_names_the_nearest() -> None:
    (found,) = faults(part("a", geometry="coaxialty"))
    assert found.startswith("part[0].geometry: must be one of straightness, ")
    assert found.endswith('got "coaxialty" (did you mean `coaxiality`?) (part a)')


# ---------------------------------------------------------------- what a supplier states


def values_of(n: int, mean: float, s: float) -> list[float]:
    """Values whose mean and standard deviation are these."""
    z = stats.norm.ppf((np.arange(n) + 0.5) / n)
    return [float(value) for value in mean + s * (z - z.mean()) / z.std(ddof=1)]


@pytest.mark.parametrize("statement", ["plug_in", "predictive", "assured"])
def test_number_mean_and_deviation_are_worth_their_values(statement: str) -> None:
    """The same promise costs the same, whether the supplier sends the values or n, mean and s."""
    promise = {"yield_percent": 99.0, "statement": statement} | (
        {"confidence_percent": 90.0} if statement == "assured" else {}
    )
    measured = [
        {"n": 40, "mean": 10.004, "s": 0.01, "made_to": 0.05},
        {"values": values_of(40, 10.004, 0.01), "made_to": 0.05, "mean": "as_found"},
    ]
    costs = []
    for table in measured:
        made = stack(part("a", measured=table), part("b"), limits={"cost": 99.0}, lower=19.9, upper=20.1)
        costs.append(optimum(made | {"promise": promise})["cost"])
    np.testing.assert_allclose(costs[0], costs[1], rtol=1e-6)


@pytest.mark.parametrize(
    ("stated", "mean", "std"),
    [
        ({"mean": 10.01, "cpk": 1.2}, 0.01, (0.05 - 0.01) / 3.6),
        ({"mean": "-0.02 mm", "cpk": 1.0}, -0.02, 0.01),  # a deviation from the nominal
        ({"cp": 1.5, "cpk": 1.2}, 0.01, 0.05 / 4.5),
        ({"cpk": 1.2}, 0.0, 0.05 / 3.6),
        ({"mean": "corrected", "s": 0.01}, 0.0, 0.01),
    ],
)
def test_a_capability_states_mean_and_deviation(stated: dict[str, Any], mean: float, std: float) -> None:
    sample = problem(part("a", tolerance=0.05, measured={"n": 30} | stated)).definition.parts[0].sample
    np.testing.assert_allclose([sample.offset, sample.knowledge.std], [mean, std], atol=1e-12)
    assert (sample.knowledge.df, sample.parts, sample.type) == (29.0, 30, "")
    if "cpk" in stated:
        np.testing.assert_allclose(sample.indices["Cpk"].value, stated["cpk"], rtol=1e-12)


def test_what_a_supplier_cannot_state() -> None:
    found = faults(
        part("a", measured={"mean": 10.0, "s": 0.01, "cpk": 1.0, "made_to": 0.05}),
        part("b", measured={"n": 3, "s": 0.01, "made_to": 0.05}),
        part("c", measured={"n": 30, "cp": 1.0, "cpk": 1.2, "mean": 10.0, "made_to": 0.05}),
        part("d", measured={"n": 30, "s": 0.01}),
        part("e", measured={"n": 30, "mean": 10.06, "cpk": 1.0, "made_to": 0.05}),
    )
    assert [line.partition(" (part")[0] for line in found] == [
        "part[0].measured.n: is missing: the number of parts that were measured",
        "part[0].measured.s: give either s, the standard deviation, or cpk",
        "part[1].measured.n: must be at least 5, got 3",
        "part[2].measured.cp: is stated in addition to s or mean: keep only one of the two",
        "part[2].measured.cpk: must not be above cp (1), got 1.2",
        "part[3].measured.made_to: is missing: the half-width that the measured parts were made to, as their scatter "
        "is proportional to it",
        "part[4].measured.cpk: contradicts mean: it is 0.06 mm off, made_to is 0.05 mm",
    ]


# ---------------------------------------------------------------- spreads and windows as limits


def test_least_cost_at_a_standard_deviation() -> None:
    """Lagrange: t_i in proportion to b_i^(1/3), sum b/t = (sum b^(2/3))^(3/2) / (3 s)."""
    b, s = np.array([0.1, 0.4, 0.02]), 0.03
    parts = [
        part(name, cost={"model": "reciprocal", "a": 0.0, "b": one}, **SPREAD)
        for name, one in zip("abc", b, strict=True)
    ]
    row = optimum(stack(*parts, limits={"std": s}))
    assert row["cost"] == pytest.approx(np.sum(b ** (2 / 3)) ** 1.5 / (3.0 * s), rel=1e-6)
    assert row["std"] == pytest.approx(s, rel=1e-8)
    assert row["gap_percent"] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(("least", "greatest", "room"), [(19.9, 21.0, 0.1), (19.0, 20.15, 0.15), (19.95, 20.06, 0.05)])
def test_a_guaranteed_window_off_centre(least: float, greatest: float, room: float) -> None:
    """Whatever the parts within their zones: sum b/t at sum t = room is (sum sqrt b)^2 / room."""
    b = np.array([0.1, 0.4])
    parts = [
        part(name, cost={"model": "reciprocal", "a": 0.0, "b": one}, **SPREAD)
        for name, one in zip("ab", b, strict=True)
    ]
    row = optimum(stack(*parts, limits={"worst_case_least": least, "worst_case_greatest": greatest}))
    assert row["cost"] == pytest.approx(np.sum(np.sqrt(b)) ** 2 / room, rel=1e-6)
    assert row["gap_percent"] == pytest.approx(0.0, abs=1e-3)
    assert row["worst_case_least"] >= least - 1e-8 and row["worst_case_greatest"] <= greatest + 1e-8


@pytest.mark.parametrize(("middle", "greatest"), [(-0.15, 0.1), (-0.15, -0.02), (-40.0, -39.7), (0.0, 0.2), (0.1, 0.4)])
def test_a_window_about_a_middle_of_either_sign(middle: float, greatest: float) -> None:
    """Two like parts share what the greatest value lies above the middle; from below it is the same turned round."""
    parts = [
        part(name, nominal, sense, cost={"model": "reciprocal", "a": 1.0, "b": 0.05}, **SPREAD)
        for name, nominal, sense in (("a", 60.0, 1.0), ("b", 60.0 - middle, -1.0))
    ]
    row = optimum(stack(*parts, limits={"worst_case_greatest": greatest}))
    assert row["cost"] == pytest.approx(2.0 + 4.0 * 0.05 / (greatest - middle), rel=1e-6)
    assert row["worst_case_greatest"] == pytest.approx(greatest, abs=1e-8)
    assert 0.0 <= row["gap_percent"] < 1e-3
    turned = [one | {"sensitivity": -one["sensitivity"]} for one in parts]
    assert optimum(stack(*turned, limits={"worst_case_least": -greatest}))["cost"] == pytest.approx(
        row["cost"], rel=1e-6
    )


def test_the_window_is_about_the_middles_of_the_zones() -> None:
    """Neither a measured mean nor a shift moves what no part within its limits exceeds."""
    measured = {"n": 30, "mean": 10.02, "s": 0.01}
    made = problem(part("a", limits="+0.1/-0.02", measured=measured), part("b", -4.0, -1.0, tolerance=0.05, shift=0.4))
    row = made.outputs_of(np.array([[0.06, 0.05]]))
    np.testing.assert_allclose([row["worst_case_least"][0], row["worst_case_greatest"][0]], [13.93, 14.15], rtol=1e-12)


def test_the_window_of_a_formula_by_its_corners() -> None:
    made = built(_of_formula())
    t = np.array([[0.1, 0.2], [0.3, 0.05]])
    row = made.outputs_of(t)
    np.testing.assert_allclose(row["worst_case_greatest"], np.hypot(3.0 + t[:, 0], 4.0 + t[:, 1]), rtol=1e-14)
    np.testing.assert_allclose(row["worst_case_least"], np.hypot(3.0 - t[:, 0], 4.0 - t[:, 1]), rtol=1e-14)
    slopes = made.gradient(t)["worst_case_greatest"]
    wanted = np.stack([3.0 + t[:, 0], 4.0 + t[:, 1]], axis=1) / row["worst_case_greatest"][:, None]
    np.testing.assert_allclose(slopes, wanted, rtol=1e-5)
    found = optimum(_of_formula())
    assert found["worst_case_greatest"] == pytest.approx(5.1, abs=1e-4)
    machine = {"name": "lathe", "sigma": 0.02, "price": 2.0, "inspection": {"price": 0.5, "required": True}}
    made = built(_of_formula(machine=[machine]))  # derivatives by differences, where a machine makes a part
    design = np.array([[0.05 if name.endswith("_t") else 0.0 for name in made.names]])
    slopes = made.gradient(design)["worst_case_greatest"][0, [made.names.index("a_t"), made.names.index("b_t")]]
    np.testing.assert_allclose(slopes, np.array([3.05, 4.05]) / np.hypot(3.05, 4.05), rtol=1e-5)


def _of_formula(**made: Any) -> dict[str, Any]:
    """`made`: how the first part is made instead."""
    parts = [
        {key: value for key, value in part(name, nominal).items() if key != "sensitivity"}
        for name, nominal in (("a", 3.0), ("b", 4.0))
    ]
    if made:
        parts[0] = {key: parts[0][key] for key in ("name", "unit", "nominal")} | made
    return stack(*parts, formula="sqrt(a**2 + b**2)", limits={"worst_case_greatest": 5.1})


# ---------------------------------------------------------------- means that a method counts, or is said to leave out


def test_shifted_rss_counts_shifts_and_measured_means() -> None:
    measured = {"n": 30, "mean": 9.98, "s": 0.01, "made_to": 0.05}
    made = problem(part("a", measured=measured), part("b", 10.0, -2.0, shift=0.25), method="shifted_rss")
    t = np.array([[0.05, 0.1]])
    wanted = 0.02 + 2.0 * 0.25 * 0.1 + 3.0 * np.hypot(0.01, 2.0 * 0.1 / 3.0)
    np.testing.assert_allclose(made.outputs_of(t)["variation"], wanted, rtol=1e-12)
    assert not made.warnings()
    row = optimum(stack(part("a", measured=measured), part("b", 10.0, -2.0, shift=0.25), method="shifted_rss"))
    assert row["variation"] == pytest.approx(0.2, rel=1e-7)
    assert row["gap_percent"] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("method", ["rss", "worst_case", "monte_carlo"])
def test_a_method_that_leaves_out_means_is_said_to(method: str) -> None:
    measured = {"n": 30, "mean": 9.98, "s": 0.01, "made_to": 0.05}
    parts = part("a", measured=measured), part("b", 10.0, -2.0, shift=0.25), part("c")
    (note,) = problem(*parts, method=method).warnings()
    assert note.startswith(f"requirement.method: {method} is ")
    assert "leaves out that a, b are off the mid-limits on average (together -0.27 mm at" in note  # -0.02 - 2 x 0.125
    assert not problem(*parts, method=method, limits={"yield_percent": 99.0}, lower=-1.0, upper=1.0).warnings()


def test_rounding_of_the_mean_of_a_skewed_part_is_no_shift() -> None:
    """The mean of a skewed law is at the mid-limit, to the last digits of its moments."""
    skews = zip("abcd", (1.0, 3.0, -7.0, 40.0), strict=True)
    parts = [part(name, distribution="skew_normal", skew=skew) for name, skew in skews]
    assert not [text for text in problem(*parts).warnings() if "off the mid-limits" in text]
    shifted = part("e", distribution="skew_normal", skew=3.0, shift=1e-3)
    (note,) = (text for text in problem(*parts, shifted).warnings() if "off the mid-limits" in text)
    assert "leaves out that e is off the mid-limits" in note


# ---------------------------------------------------------------- sources, and keys by name


def test_the_source_of_a_tolerance_is_exported(tmp_path: Path) -> None:
    result = tolevo.run(stack(part("a", source="drawing 4711"), part("b", tolerance=0.02, source="guess"), part("c")))
    result.write(tmp_path / "run")
    text = (tmp_path / "run" / "allocation.csv").read_text(encoding="utf-8")
    assert result.allocation is not None
    assert result.allocation["source"].tolist()[:3] == ["drawing 4711", "guess", ""]
    assert "drawing 4711" in text
    assert "drawing 4711" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert 'source = "guess"' in (tmp_path / "run" / "config.toml").read_text(encoding="utf-8")


def test_keys_of_named_tables_are_set_by_name() -> None:
    process = [{"name": "turned", "tolerance": 0.05, "price": 2.0}, {"name": "ground", "tolerance": 0.01, "price": 5.0}]
    given = stack(part("a"), part("b", process=process))
    settings = [
        "part.a.tolerance=0.02",
        "part.b.process.ground.price=7",
        "requirement.gap.upper=20.5",
        "part.a.nominal = 11",
    ]
    made = built(given, settings)
    assert made.ends_of_t[0].tolist() == [0.02, 0.01]
    assert made.definition.parts[0].fixed and made.definition.parts[0].nominal == 11.0
    assert made.definition.parts[1].processes[1].curve.a == 7.0
    assert made.definition.requirement.upper == 20.5
    back = built(given, ["part.a.tolerance=0.02", "part.a.t_min=0.01", "part.a.t_max=0.1"])
    assert not back.definition.parts[0].fixed


def test_an_unknown_name_is_a_fault_with_the_nearest() -> None:
    settings = ["part.hubb.t_max=1", "part.hub.name.x=1", "part=3", "part.hub=1"]
    with pytest.raises(InputError) as caught:
        read(stack(part("hub"), part("shaft")), settings)
    assert [str(fault) for fault in caught.value.faults][:2] == [
        '--set part.hubb.t_max: "hubb" is not the name of a [[part]] (did you mean `hub`?); there are hub, shaft',
        "--set part.hub.name.x: leads through a value that is not a table",
    ]
