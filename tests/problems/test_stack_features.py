"""`[[feature]]`: tolerances of position and size in a stack, against ASME Y14.5 and independent counts."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tomli_w

import tolevo
from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import closed_form, exact_vectors
from tolevo.commands.run.tolerances import allocation
from tolevo.configuration.reader import read
from tolevo.errors import Fault, InputError
from tolevo.files import csv_text
from tolevo.problems.stack import Stack

UNITS = 1_000_000
Parts = dict[str, np.ndarray]


def problem_of(text: str, folder: Path) -> Stack:
    path = folder / "c.toml"
    path.write_text('problem = "stack"\n' + text, encoding="utf-8")
    problem = read(path).problem
    assert isinstance(problem, Stack)
    return problem


def loosest(stack: Stack) -> dict[str, float]:
    outputs = stack.outputs_of(stack.corner(tight=False)[None, :])
    return {name: float(values[0]) for name, values in outputs.items()}


def requirement(formula: str, more: str = "") -> str:
    return f"[requirement]\nname = 'clearance'\nunit = 'mm'\nformula = '{formula}'\n{more}\n"


def part(name: str, nominal: float, zone: str) -> str:
    return f"[[part]]\nname = '{name}'\nunit = 'mm'\nnominal = {nominal}\n{zone}\n"


def feature(name: str, kind: str, more: str) -> str:
    return f"[[feature]]\nname = '{name}'\nkind = '{kind}'\n{more}\n"


def disc(rng: np.random.Generator, law: str = "uniform_disc") -> tuple[np.ndarray, np.ndarray]:
    """A place in the unit disc by its own formula: the radius by a root, or two normal numbers."""
    if law == "normal":
        return rng.normal(0.0, 1.0 / 3.0, UNITS), rng.normal(0.0, 1.0 / 3.0, UNITS)
    radius = np.sqrt(rng.uniform(size=UNITS)) if law == "uniform_disc" else np.ones(UNITS)
    angle = rng.uniform(0.0, 2.0 * np.pi, UNITS)
    return radius * np.cos(angle), radius * np.sin(angle)


def agrees(stack: Stack, counted: np.ndarray) -> None:
    """The yield of the loosest parts, within four standard errors of the count and its own."""
    outputs, fraction = loosest(stack), float(np.mean(counted))
    error = 100.0 * np.sqrt(fraction * (1.0 - fraction) / len(counted)) + outputs["yield_percent_error"]
    assert 1.0 < 100.0 * fraction < 99.99
    assert outputs["yield_percent"] == pytest.approx(100.0 * fraction, abs=4.0 * error)


# ---------------------------------------------------------------- ASME Y14.5-2009, appendix B

FLOATING = (
    requirement("(hole_1 + hole_2)/2 - bolt - sqrt((at_1_x - at_2_x)**2 + (at_1_y - at_2_y)**2)",
                "method = 'worst_case'")
    + part("hole", 6.52, "count = 2\ntolerance = 0.08")
    + part("bolt", 5.9, "tolerance = 0.1")
    + "".join(feature(f"at_{i}", "position", f"zone = 0.44\nsize = 'hole_{i}'\nmaterial = 'mmc'\ninternal = true")
              for i in (1, 2))
)  # fmt: skip
FIXED = (
    requirement("(hole - bolt)/2 - sqrt((at_1_x - at_2_x)**2 + (at_1_y - at_2_y)**2)", "method = 'worst_case'")
    + part("hole", 6.52, "tolerance = 0.08")
    + part("bolt", 5.9, "tolerance = 0.1")
    + feature("at_1", "position", "zone = 0.22\nof = 'hole'\nmaterial = 'mmc'\ninternal = true")
    + feature("at_2", "position", "zone = 0.22")
)


@pytest.mark.parametrize(("text", "greatest"), [(FLOATING, 0.8), (FIXED, 0.4)])
def test_fasteners_of_asme_y14_5_appendix_b_just_pass(text: str, greatest: float, tmp_path: Path) -> None:
    """B.3, floating: H = F + T, 6.44 = 6 + 0.44; B.4, fixed: H = F + 2 T, 6.44 = 6 + 2 0.22 [mm].

    Of holes from 6.44 to 6.60 mm and bolts up to 6 mm the tightest pass with no clearance left over, whatever
    the bonus; the most clearance has the largest hole, the thinnest bolt and both axes in one place.
    """
    stack = problem_of(text, tmp_path)
    mechanism = stack.definition.mechanism
    least = mechanism.centre - loosest(stack)["worst_case"]
    assert least == pytest.approx(0.0, abs=1e-12)
    (tmp_path / "c.toml").write_text('problem = "stack"\n' + text.replace("method =", "lower = 0.0\nmethod ="), "utf-8")
    row = tolevo.analyse(tmp_path / "c.toml").requirements.iloc[0]
    assert row["worst_case_least"] == 0.0
    assert row["worst_case_greatest"] == pytest.approx(greatest, abs=1e-9)
    assert row["worst_case_kind"] == "corners"
    assert row["kept_worst_case"]


@pytest.mark.parametrize(
    ("formula", "far", "kind"),
    [
        ("sqrt((a_x - 2*b_x)**2 + (a_y - 2*b_y)**2) + plate", (-0.05, 0.3), "corners"),  # of one length: on a line
        ("(a_x**2 + a_y**2)*plate + b_x + b_y", (-0.1 * 2.0**0.5 - 1.25e-4, 0.1 * 2.0**0.5 + 1.25e-4), "sample"),
        ("a_x*b_y - a_y*b_x + plate", (-0.055, 0.055), "sample"),  # at right angles
    ],
)
def test_places_stand_on_a_line_where_the_formula_has_one_length_of_them(
    formula: str, far: tuple[float, float], kind: str, tmp_path: Path
) -> None:
    text = requirement(formula) + part("plate", 0.0, "tolerance = 0.05")
    text += feature("a", "position", "zone = 0.1") + feature("b", "position", "zone = 0.2")
    (tmp_path / "c.toml").write_text('problem = "stack"\n' + text, encoding="utf-8")
    row = tolevo.analyse(tmp_path / "c.toml").requirements.iloc[0]
    assert row["worst_case_kind"] == kind
    assert (row["worst_case_least"], row["worst_case_greatest"]) == pytest.approx(far, abs=1e-9)


def test_a_projected_fixed_fastener_of_asme_y14_5_appendix_b_just_passes(tmp_path: Path) -> None:
    """B.5: H = F + T1 + T2 (1 + 2 P/D), a bolt that leans in a thread of depth D reaching to the height P."""
    t1, t2, p, d = 0.2, 0.1, 12.0, 10.0
    text = (
        requirement("(hole - bolt)/2 - sqrt((at_x - thread_x - lean_x)**2 + (at_y - thread_y - lean_y)**2)",
                    "method = 'worst_case'")
        + part("hole", 6.0 + t1 + t2 * (1.0 + 2.0 * p / d), "tolerance = 0.0")
        + part("bolt", 6.0, "limits = '0/-0.1'")
        + feature("at", "position", f"zone = {t1}") + feature("thread", "position", f"zone = {t2}")
        + feature("lean", "perpendicularity", f"zone = {t2}\nheight = {d}\narm = {p}")
    )  # fmt: skip
    stack = problem_of(text, tmp_path)
    least = stack.definition.mechanism.centre - loosest(stack)["worst_case"]
    assert least == pytest.approx(0.0, abs=1e-12)


# ---------------------------------------------------------------- bonus, shift and float against counts


@pytest.mark.parametrize("law", ["uniform_disc", "uniform_circle", "normal"])
@pytest.mark.parametrize(("material", "internal"), [("mmc", True), ("mmc", False), ("lmc", True), ("lmc", False)])
def test_the_zone_grows_with_the_size_as_made(law: str, material: str, internal: bool, tmp_path: Path) -> None:
    """True position: the distance of an axis from its nominal place, and a coordinate on a plate."""
    zone = (
        f"zone = 0.1\nof = 'size'\nmaterial = '{material}'\ndistribution = '{law}'\ninternal = {str(internal).lower()}"
    )
    parts = part("size", 12.0, "limits = '+0.05/-0.03'") + feature("at", "position", zone)
    rng = np.random.default_rng(3)
    size, (x, y) = 12.01 + rng.normal(0.0, 0.04 / 3.0, UNITS), disc(rng, law)
    limit = 11.97 if internal == (material == "mmc") else 12.05
    radius = 0.05 + np.abs(size - limit) / 2.0
    far = problem_of(requirement("sqrt(at_x**2 + at_y**2)", "upper = 0.0655\nmethod = 'monte_carlo'") + parts, tmp_path)
    agrees(far, radius * np.hypot(x, y) <= 0.0655)
    plate = part("plate", 50.0, "tolerance = 0.03")
    linear = requirement("plate + 0.8*at_x - at_y", "lower = 49.96\nupper = 50.07\nmethod = 'monte_carlo'")
    y_plate = 50.0 + rng.normal(0.0, 0.01, UNITS) + radius * (0.8 * x - y)
    agrees(problem_of(linear + plate + parts, tmp_path), (y_plate >= 49.96) & (y_plate <= 50.07))


def test_a_flange_on_two_dowels_has_the_yield_of_a_count(tmp_path: Path) -> None:
    """Position at MMC, datum shift and float in one direction; the letters of the fits say hole or pin."""
    searched = "t_min = 0.02\nt_max = 0.3\ncost = { model = 'reciprocal', a = 1.0, b = 0.05 }"
    text = (
        requirement("edge - hole_x + hole_at + shift + pin_float",
                    "lower = 19.55\nupper = 20.5\nmethod = 'monte_carlo'")
        + part("edge", 50.0, searched) + part("hole_x", 30.0, searched)
        + "".join(part(name, nominal, f"fit = '{fit}'") for name, nominal, fit in
                  [("hole", 10.0, "H9"), ("pin", 10.0, "f7"), ("bore", 40.0, "H7"), ("boss", 40.0, "g6")])
        + feature("hole_at", "position", "zone = 0.2\nof = 'hole'\nmaterial = 'mmc'\ndistribution = 'uniform'")
        + feature("shift", "float", "of = ['bore', 'boss']\ndistribution = 'uniform'")
        + feature("pin_float", "float", "of = ['hole', 'pin']\ndistribution = 'uniform'")
    )  # fmt: skip

    def normal(low: float, high: float) -> np.ndarray:
        return rng.normal(0.5 * (low + high), (high - low) / 6.0, UNITS)

    rng = np.random.default_rng(5)
    edge, hole_x = normal(49.7, 50.3), normal(29.7, 30.3)
    hole, pin, bore, boss = normal(10.0, 10.036), normal(9.972, 9.987), normal(40.0, 40.025), normal(39.975, 39.991)
    u, v, w = rng.uniform(-1.0, 1.0, (3, UNITS))
    gap = edge - hole_x + u * (0.1 + (hole - 10.0) / 2) + v * (bore - boss) / 2 + w * (hole - pin) / 2
    agrees(problem_of(text, tmp_path), (gap >= 19.55) & (gap <= 20.5))


def test_a_datum_shifts_by_its_departure_from_the_maximum_material_boundary(tmp_path: Path) -> None:
    """The boundary of a pin of 8 mm at most that is out of place by 0.02 mm: 8.02 mm."""
    text = (
        requirement("plate + shift_x", "lower = 19.975\nupper = 20.025\nmethod = 'monte_carlo'")
        + part("plate", 20.0, "tolerance = 0.02") + part("datum", 8.0, "limits = '0/-0.06'")
        + feature("shift", "datum_shift", "of = 'datum'\nzone = 0.02\ninternal = false")
    )  # fmt: skip
    rng = np.random.default_rng(6)
    plate, datum, (x, _) = 20.0 + rng.normal(0.0, 0.02 / 3, UNITS), 7.97 + rng.normal(0.0, 0.01, UNITS), disc(rng)
    y = plate + 0.5 * (8.02 - datum) * x
    agrees(problem_of(text, tmp_path), (y >= 19.975) & (y <= 20.025))


@pytest.mark.parametrize("law", ["uniform_disc", "uniform", "pushed"])
def test_a_pin_floats_in_its_hole_unless_it_is_pressed_in(law: str, tmp_path: Path) -> None:
    """A transition fit, whose interference leaves no float, in um; the formula is in mm."""
    text = (
        requirement("plate + seat", "lower = 19.99\nupper = 20.012\nmethod = 'monte_carlo'")
        + part("plate", 20.0, "tolerance = 0.012")
        + part("hole", 10000.0, "limits = '+15/0'").replace("'mm'", "'um'")
        + part("pin", 10.0, "limits = '+0.010/-0.005'")
        + feature("seat", "float", f"of = ['hole', 'pin']\ndistribution = '{law}'")
    )  # fmt: skip
    rng = np.random.default_rng(9)
    plate = 20.0 + rng.normal(0.0, 0.004, UNITS)
    room = 10.0075 + rng.normal(0.0, 0.0025, UNITS) - (10.0025 + rng.normal(0.0, 0.0025, UNITS))
    places = {"uniform_disc": disc(rng)[0], "uniform": rng.uniform(-1.0, 1.0, UNITS), "pushed": np.ones(UNITS)}
    y = plate + np.maximum(room, 0.0) / 2.0 * places[law]
    agrees(problem_of(text, tmp_path), (y >= 19.99) & (y <= 20.012))


def test_the_worst_case_has_the_whole_bonus(tmp_path: Path) -> None:
    """The plate at its limit and the hole at its least material, out of place by half of 0.1 + 0.08 mm."""
    text = (
        requirement("plate - at", "method = 'worst_case'") + part("plate", 50.0, "tolerance = 0.03")
        + part("hole", 12.0, "limits = '+0.06/-0.02'")
        + feature("at", "position", "zone = 0.1\nof = 'hole'\nmaterial = 'mmc'\ninternal = true")
    )  # fmt: skip
    assert loosest(problem_of(text, tmp_path))["worst_case"] == pytest.approx(0.03 + 0.09, rel=1e-12)


def test_the_variance_and_its_shares_have_the_closed_form_of_a_product(tmp_path: Path) -> None:
    """y = plate - R z: var = var(plate) + E[R^2] var(z), and E[R^2] = R0^2 + var(hole)/4 with R0 at the mid-limit."""
    text = (
        requirement("plate - at") + part("plate", 50.0, "tolerance = 0.03") + part("hole", 12.0, "limits = '+0.2/0'")
        + feature("at", "position", "zone = 0.1\nof = 'hole'\nmaterial = 'mmc'\ninternal = true")
    )  # fmt: skip
    found, plate, hole = loosest(problem_of(text, tmp_path)), 0.01**2, (0.1 / 3.0) ** 2 / 4.0
    own = 0.1**2 + hole
    assert found["rss"] == pytest.approx(3.0 * np.sqrt(plate + own / 4.0), rel=2e-4)
    growth = np.array([plate, hole / 4.0, own / 4.0])  # of the variance with each tolerance
    shares = [found[f"contribution_{name}_percent"] for name in ("plate", "hole", "at")]
    np.testing.assert_allclose(shares, 100.0 * growth / growth.sum(), rtol=5e-3)


def test_places_are_independent_of_parts_that_are_correlated(tmp_path: Path) -> None:
    text = (
        requirement("b - a + sqrt(at_x**2 + at_y**2)", "upper = 1.08\nmethod = 'monte_carlo'")
        + part("a", 9.0, "tolerance = 0.06") + part("b", 10.0, "tolerance = 0.03")
        + "[[correlation]]\nparts = ['a', 'b']\ncoefficient = 0.8\n" + feature("at", "position", "zone = 0.12")
    )  # fmt: skip
    rng = np.random.default_rng(11)
    first, second = rng.normal(size=(2, UNITS))
    gap = 1.0 + 0.01 * (0.8 * first + 0.6 * second) - 0.02 * first + 0.06 * np.sqrt(rng.uniform(size=UNITS))
    agrees(problem_of(text, tmp_path), gap <= 1.08)


# ---------------------------------------------------------------- features that keep a formula linear


def test_a_lever_of_a_tilt_is_the_zone_over_the_height_times_the_arm(tmp_path: Path) -> None:
    for arm, height, zone in ((60.0, 20.0, 0.03), (10.0, 25.0, 0.05)):
        text = requirement("stem + lean", "method = 'worst_case'") + part("stem", 5.0, "tolerance = 0.01")
        lean = feature("lean", "perpendicularity", f"zone = '{1000 * zone} um'\nheight = {height}\narm = {arm}")
        stack = problem_of(text + lean, tmp_path)
        assert loosest(stack)["worst_case"] == pytest.approx(0.01 + zone / height * arm, rel=1e-12)


def test_runout_and_profile_act_with_half_their_zone(tmp_path: Path) -> None:
    """A runout in all directions as far as its edge, P(|cos| <= c) = 1 - 2 acos(c)/pi; a profile between +-1/2."""
    more = "lower = -0.02\nupper = 0.02\nmethod = 'monte_carlo'"
    runout = requirement("turn_x", more) + feature("turn", "runout", "zone = 0.06\ndistribution = 'uniform_circle'")
    filler = "[[part]]\nname = 'a'\nunit = 'mm'\nnominal = 0.0\ntolerance = 1e-9\n"
    exact = 100.0 * (1.0 - 2.0 * np.arccos(0.02 / 0.03) / np.pi)
    found = loosest(problem_of(runout.replace("turn_x", "turn_x + a") + filler, tmp_path))
    assert found["yield_percent"] == pytest.approx(exact, abs=4.0 * found["yield_percent_error"] + 1e-3)
    profile = requirement("face + a", more) + feature("face", "profile", "zone = 0.05") + filler
    assert loosest(problem_of(profile, tmp_path))["yield_percent"] == pytest.approx(80.0, abs=1e-3)


def test_a_zone_of_position_is_searched_like_a_tolerance(tmp_path: Path) -> None:
    """Cost 1/t of each, rss of the slope: the optimum of Lagrange; a position's sigma is half its radius."""
    searched = "t_min = 0.001\nt_max = 1.0\ncost = { model = 'reciprocal', a = 0.0, b = 1.0 }"
    text = (
        "[objectives]\nminimise = ['cost']\n[limits]\nrss = 0.3\n" + requirement("plate + 0.6*at_x + 0.8*at_y")
        + part("plate", 20.0, searched) + feature("at", "position", searched)
    )  # fmt: skip
    stack = problem_of(text, tmp_path)
    form = closed_form(stack)
    assert form is not None
    x = exact_vectors(stack, form, 1)
    outputs = stack.outputs_of(stack.complete(x))
    weights = np.array([1.0, 1.5])  # 3 sigma per tolerance
    best = 0.3 / np.sqrt(np.sum(weights ** (2.0 / 3.0))) / weights ** (2.0 / 3.0)
    np.testing.assert_allclose(x[0], best, rtol=1e-6)
    assert outputs["contribution_at_percent"][0] == pytest.approx(100.0 * (weights[1] * best[1] / 0.3) ** 2)
    bound = proof(stack, {"cost": outputs["cost"]}, 1).bound
    assert bound[0] == pytest.approx(np.sum(1.0 / best), rel=1e-6)


# ---------------------------------------------------------------- the sheet


def test_the_sheet_states_the_ends_and_shares_of_features_by_name(tmp_path: Path) -> None:
    """Linear: the ends by the length of the slope, the shares of the variance by the radius squared over 4."""
    text = (
        requirement("plate + 0.6*at_x + 0.8*at_y + face", "lower = 19.8\nupper = 20.2")
        + part("plate", 20.0, "tolerance = 0.03")
        + feature("at", "position", "zone = 0.1") + feature("face", "profile", "zone = 0.06")
    )  # fmt: skip
    (tmp_path / "c.toml").write_text('problem = "stack"\n' + text, encoding="utf-8")
    sheet = tolevo.analyse(tmp_path / "c.toml")
    row = sheet.requirements.iloc[0]
    assert (row["worst_case_least"], row["worst_case_greatest"]) == pytest.approx((19.89, 20.11), rel=1e-12)
    assert row["worst_case_kind"] == "corners"
    shares = sheet.contributions.set_index("part")
    variance = np.array([0.01**2, 0.05**2 / 4.0, 0.03**2 / 3.0])
    assert row["std"] == pytest.approx(np.sqrt(variance.sum()))
    found = shares.loc[["plate", "at", "face"]]
    np.testing.assert_allclose(found["variance_percent"], 100.0 * variance / variance.sum())
    np.testing.assert_allclose(found["worst_case_percent"], np.array([3.0, 5.0, 3.0]) / 0.11)


def test_the_sheet_of_a_fastener_states_the_worst_case_and_the_share_of_every_place(tmp_path: Path) -> None:
    """The distance of two places alike grows with both tolerances alike, var(D) = (S d)^2."""
    plain = requirement("sqrt((a_x - b_x)**2 + (a_y - b_y)**2) + plate", "upper = 0.2")
    plain += part("plate", 0.05, "tolerance = 0.001")
    text = plain + feature("a", "position", "zone = 0.1") + feature("b", "position", "zone = 0.1")
    (tmp_path / "c.toml").write_text('problem = "stack"\n' + text, encoding="utf-8")
    sheet = tolevo.analyse(tmp_path / "c.toml")
    row, shares = sheet.requirements.iloc[0], sheet.contributions.set_index("part")["variance_percent"]
    assert row["worst_case_greatest"] == pytest.approx(0.151, rel=1e-9)
    rng = np.random.default_rng(12)
    (a_x, a_y), (b_x, b_y) = disc(rng), disc(rng)
    distance, plate = 0.05**2 * np.var(np.hypot(a_x - b_x, a_y - b_y)), 0.001**2 / 9.0
    assert row["std"] == pytest.approx(np.sqrt(distance + plate), rel=5e-3)
    half = 50.0 * distance / (distance + plate)
    np.testing.assert_allclose(shares[["plate", "a", "b"]], [100.0 - 2.0 * half, half, half], atol=0.5)


# ---------------------------------------------------------------- several requirements, lets, tables

TWO = """
[objectives]
minimise = ["cost"]
[[requirement]]
name = "gap"
unit = "mm"
formula = "plate - reach"
lower = 7.9
upper = 8.15
method = "monte_carlo"
[[requirement]]
name = "lean"
unit = "mrad"
formula = "(at_y + (hole - 12000)/2)/plate"
lower = -3.0
upper = 4.5
method = "monte_carlo"
[[let]]
name = "reach"
formula = "hole + at"
[[part]]
name = "plate"
unit = "um"
nominal = 20000.0
tolerance = 60.0
[[part]]
name = "hole"
unit = "mm"
nominal = 12.0
limits = "+0.04/-0.02"
[[feature]]
name = "at"
kind = "position"
zone = 0.1
of = "hole"
material = "mmc"
internal = true
"""


def test_requirements_share_a_place_and_count_in_their_own_units(tmp_path: Path) -> None:
    """One in mm, one in mrad whose lengths are in um: `at` is `at_x`, and both depend on one hole."""
    rng = np.random.default_rng(10)
    plate, hole = 20.0 + rng.normal(0.0, 0.02, UNITS), 12.01 + rng.normal(0.0, 0.01, UNITS)
    x, y = (0.05 + (hole - 11.98) / 2.0) * disc(rng)
    gap, lean = plate - hole - x, 1000.0 * (y + (hole - 12.0) / 2.0) / plate
    agrees(problem_of(TWO, tmp_path), (gap >= 7.9) & (gap <= 8.15) & (lean >= -3.0) & (lean <= 4.5))


def test_the_tables_of_a_stack_state_its_features_again(tmp_path: Path) -> None:
    stack = problem_of(TWO, tmp_path)
    again = problem_of(tomli_w.dumps(stack.tables() | {"objectives": {"minimise": ["cost"]}}), tmp_path)
    assert again.tables() == stack.tables()
    assert again.tables()["feature"][0]["zone"] == 0.1
    assert loosest(again) == loosest(stack)
    assert [part["name"] for part in stack.tables()["part"]] == ["plate", "hole"]


READING = """
import sys
from pathlib import Path
from tolevo.configuration.reader import read
read(Path(sys.argv[1]))
print(sum(name.endswith(".features") for name in sys.modules))
"""


def test_a_plain_stack_does_not_load_features(tmp_path: Path) -> None:
    plain = requirement("a - b") + part("a", 9.0, "tolerance = 0.1") + part("b", 8.0, "tolerance = 0.1")
    with_feature = plain.replace("- b", "- b + c") + feature("c", "profile", "zone = 0.1")
    for text, modules in ((plain, "0"), (with_feature, "1")):
        (tmp_path / "c.toml").write_text('problem = "stack"\n' + text, encoding="utf-8")
        command = [sys.executable, "-c", READING, str(tmp_path / "c.toml")]
        assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == modules


# ---------------------------------------------------------------- bad input

BAD = """
[requirement]
unit = "mm"
formula = "plate + a + b + c + d + e + f + g + h + k"
[[part]]
name = "plate"
nominal = 20.0
t_min = 0.01
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
[[part]]
name = "screw"
count = 2
nominal = 6.0
tolerance = 0.1
[[part]]
name = "bare"
tolerance = 0.1
[[feature]]
name = "a"
kind = "position"
zone = 0
[[feature]]
name = "a"
kind = "runout"
zone = -0.1
material = "mmc"
[[feature]]
name = "b"
kind = "float"
of = ["hole", "screw"]
[[feature]]
name = "plate"
kind = "position"
zone = 0.1
of = "bare"
material = "mmc"
[[feature]]
name = "c"
kind = "datum_shift"
of = "plate"
internal = true
[[feature]]
name = "d"
kind = "perpendicularity"
zone = 0.1
height = 0.0
[[feature]]
name = "e"
kind = "position"
t_min = 0.1
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
of = "screw_1"
material = "lmc"
[[feature]]
name = "f"
kind = "profile"
zone = 0.1
distribution = "uniform_disc"
cp = 1.3
[[feature]]
name = "g"
kind = "places"
[[feature]]
kind = "position"
zone = 0.1
unit = "deg"
[[feature]]
name = "h"
kind = "position"
zone = 0.1
material = "mmc"
length = 3.0
[[feature]]
name = "k"
kind = "float"
of = ["screw_1"]
zone = 0.1
[[feature]]
name = "l"
kind = "float"
of = ["screw_1", "plate"]
[[feature]]
name = "m"
kind = "runout"
zone = 0.1
t_min = 0.1
"""
FAULTS = [
    ("feature[0].zone", "must be above 0, got 0 (feature a)"),
    ("feature[1].name", '"a" is already a name of feature a; rename one of the two (feature a)'),
    ("feature[1].zone", "must be above 0, got -0.1"),
    ("feature[1].material", "does not apply to runout"),
    ("feature[2].of", '"hole" is not a part'),
    ("feature[2].of", "screw is built in 2 times: name screw_1, ..."),
    ("feature[3].name", '"plate" is already a name of part plate'),
    ("feature[3].of", "bare has no size: give it a nominal in a unit of length"),
    ("feature[4].of", "plate has no fixed limits, so that its MMC size is not known"),
    ("feature[5].height", "must be above 0, got 0"),
    ("feature[5].arm", "is missing: perpendicularity needs zone and height and arm"),
    ("feature[6].t_min", 'is not possible together with material = "lmc"'),
    ("feature[6].internal", "is missing: state true if screw_1 is a hole or a slot, false if it is a pin"),
    ("feature[7].distribution", "must be one of uniform, normal"),
    ("feature[7].cp", "is the capability of a normal place"),
    ("feature[8].kind", "must be one of position, datum_shift, float, perpendicularity, runout, profile"),
    ("feature[9].name", "is missing: formulas use the feature by its name"),
    ("feature[9].unit", 'must be a length: write "mm", "um", ...; got "deg"'),
    ("feature[10].size", "is missing: name the part whose size gives the bonus at MMC"),
    ("feature[10].length", "is not a known key"),
    ("feature[11].of", "must name two different parts, the hole first, got 1"),
    ("feature[11].zone", "does not apply to float"),
    ("feature[12].of", "screw_1 is never larger than plate: name the hole first"),
    ("feature[13].t_min", "is not possible together with zone: leave one of the two out"),
]


def faults(text: str, folder: Path) -> list[Fault]:
    with pytest.raises(InputError) as caught:
        problem_of(text, folder)
    return list(caught.value.faults)


def test_every_fault_of_features_is_reported_at_once(tmp_path: Path) -> None:
    found = faults(BAD, tmp_path)
    for place, message in FAULTS:
        assert any(fault.place == place and message in fault.message for fault in found), (place, message)
    assert len([fault for fault in found if fault.place.startswith("feature")]) == len(FAULTS)


def test_features_that_do_not_act_are_faults(tmp_path: Path) -> None:
    parts = part("hole", 10.0, "fit = 'H7'") + part("pin", 10.0, "fit = 'k6'")
    pushed = feature("seat", "float", "of = ['hole', 'pin']\ndistribution = 'pushed'")
    (fault,) = faults(requirement("hole - pin") + parts + pushed, tmp_path)
    assert fault.place == "feature[0].name"
    assert "seat does not appear in the formula" in fault.message
    several = requirement("hole - pin").replace("[requirement]\nname = 'clearance'", "[[requirement]]\nname = 'room'")
    (fault,) = faults(several + parts + pushed, tmp_path)
    assert fault.message == "no requirement depends on it: remove it (feature seat)"
    given = "[requirement]\nunit = 'mm'\n" + part("hole", 10.0, "tolerance = 0.1\nsensitivity = 1.0")
    (fault,) = faults(given + feature("at", "position", "zone = 0.1"), tmp_path)
    assert "acts by its name in a formula, and no requirement has one" in fault.message
    at = feature("at", "position", "zone = 0.1\nof = 'hole'\nmaterial = 'mmc'")
    hidden = requirement("hole - pin + at_x_in_zone") + parts + at
    assert any('"at_x_in_zone" is not a part' in fault.message for fault in faults(hidden, tmp_path))


@pytest.mark.parametrize(
    ("more", "written"),
    [
        ("zone = 0.44", "⌖ ⌀0.44 mm"),
        ("zone = 0.44\nsize = 'hole'\nmaterial = 'mmc'\ninternal = true", "⌖ ⌀0.44 mm Ⓜ"),
        ("zone = 0\nsize = 'hole'\nmaterial = 'lmc'\ninternal = true", "⌖ ⌀0 Ⓛ"),
        ("zone = 0.44\ndistribution = 'uniform'", "⌖ 0.44 mm"),
        ("zone = 300\nunit = 'um'", "⌖ ⌀0.3 mm"),
    ],
)
def test_a_position_is_on_the_drawing_with_its_whole_zone(more: str, written: str, tmp_path: Path) -> None:
    text = 'problem = "stack"\n' + requirement("hole - bolt + at", "lower = 0.0") + part("hole", 6.5, "tolerance = 0.1")
    text += part("bolt", 6.0, "tolerance = 0.1") + feature("at", "position", more)
    (tmp_path / "c.toml").write_text(text, encoding="utf-8")
    table = tolevo.analyse(tmp_path / "c.toml").record.tolerances.set_index("part")
    assert table["on_the_drawing"].to_dict() == {"hole": "6.5 ±0.1 mm", "bolt": "6 ±0.1 mm", "at": written}


@pytest.mark.parametrize("law", ["uniform", "normal"])
def test_a_profile_has_a_width_whatever_its_distribution(law: str, tmp_path: Path) -> None:
    text = requirement("a + face", "lower = 0.0") + part("a", 6.5, "tolerance = 0.1")
    text += feature("face", "profile", f"zone = 0.2\ndistribution = '{law}'")
    (tmp_path / "c.toml").write_text(f"problem = 'stack'\n{text}", encoding="utf-8")
    table = tolevo.analyse(tmp_path / "c.toml").record.tolerances.set_index("part")
    assert table["on_the_drawing"]["face"] == "⌓ 0.2 mm"


def test_features_have_no_deviations_and_start_no_formula_of_a_spreadsheet(tmp_path: Path) -> None:
    """A zone of 0.3 mm has no limits of +-0.15 mm, and a shift without a zone has nothing to inspect."""
    text = requirement("hole - bolt + at_x + shift_x", "lower = 0.0") + part("hole", 6.5, "tolerance = 0.1")
    text += part("bolt", 6.0, "tolerance = 0.1")
    text += feature("at", "position", "zone = 0.3\nof = 'hole'\nmaterial = 'mmc'\ninternal = true")
    text += feature("shift", "datum_shift", "of = 'hole'\nmaterial = 'mmc'\ninternal = true")
    stack = problem_of(text, tmp_path)
    design = stack.complete(stack.xl[None])[0]
    rows = allocation(stack, {0: "only"}, {0: (design, design)}, {}, {}).set_index("variable")
    ends = ["mid", "lower_limit", "upper_limit", "lower_deviation", "upper_deviation"]
    assert rows.loc[["at_t", "shift_t"], ends].isna().all(axis=None)
    assert [rows[end]["bolt_t"] for end in ends[1:]] == pytest.approx([5.9, 6.1, -0.1, 0.1])
    assert rows["notation"][["at_t", "shift_t"]].tolist() == ["⌖ ⌀0.3 mm Ⓜ", "\N{EN DASH}"]
    assert rows["inspection"]["shift_t"] == "" != rows["inspection"]["at_t"]
    assert ",'" not in csv_text(rows)


def test_an_assumption_on_a_feature_is_named_as_one(tmp_path: Path) -> None:
    promise = "[promise]\nstatement = 'assured'\nyield_percent = 99.0\n"
    text = requirement("a + face", "lower = 6.0") + part("a", 6.5, "tolerance = 0.1")
    text += feature("face", "profile", "zone = 0.2\ndistribution = 'uniform'")
    names = [assumption.name for assumption in problem_of(promise + text, tmp_path).assumptions()]
    assert "feature.face.process" in names
    assert not [name for name in names if name.startswith("part.face")]
