"""`[[loop]]`: closed loops against explicit formulas, another solver, and units that do not close."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.stats import norm

import tolevo
from tests.problems.test_stack_let import faults, stack
from tolevo.problems.stack import Stack

Array = np.ndarray
UNITS = 2000


def link(length: object, along: object) -> dict[str, object]:
    """A link along an angle in the plane, or along a direction (a list)."""
    return {"length": length, "direction" if isinstance(along, list) else "angle": along}


def loop(unknown: dict[str, object], *links: dict[str, object], name: str = "loop") -> dict[str, object]:
    return {"name": name, "link": list(links), "unknown": unknown}


def part(name: str, nominal: float, t: float, **more: object) -> dict[str, object]:
    return {"name": name, "nominal": nominal, "tolerance": t, "unit": "mm", **more}


def tables(formula: str, loops: list[Any], parts: list[Any], **more: object) -> dict[str, Any]:
    requirement = {"unit": "mm", "formula": formula} | dict(more.pop("requirement", {}))  # type: ignore[call-overload]
    return {"problem": "stack", "requirement": requirement, "loop": loops, "part": parts, **more}


def units_of(problem: Stack, seed: int = 0, spread: float = 1.0) -> tuple[dict[str, Array], Array]:
    """Random units of a stack within `spread` of its tolerances: each part, and the requirement."""
    mechanism = problem.measured[0].mechanism
    z = np.random.default_rng(seed).uniform(-spread, spread, (len(mechanism.names), UNITS))
    t = problem.tolerances(problem.corner(tight=False)[None])
    assert mechanism.mids is not None and mechanism.scale is not None
    reach = mechanism.scale * t[0][mechanism.owners]
    x = dict(zip(mechanism.names, mechanism.mids[:, None] + reach[:, None] * z, strict=True))
    return x, mechanism.values(t, z)[0]


CLUTCH = loop({"b": 4.0, "phi": "10 deg"}, link("b", 0), link("a + c", "pi/2"), link("e - c", "-pi/2 - phi"))
CLUTCH_PARTS = [part("a", 27.645, 0.05), part("c", 11.43, 0.01), part("e", 50.8, 0.05)]
CRANK_LINKS = link("r", "theta"), link("rod", "phi"), link("h", "-90 deg"), link("s", "pi")
CRANK = loop({"s": 120.0, "phi": -0.1}, *CRANK_LINKS)
CRANK_PARTS = [part("r", 40.0, 0.1), part("rod", 110.0, 0.1), part("h", 10.0, 0.2),
               part("theta", 50.0, 2.0, unit="deg")]  # fmt: skip
GENEVA = loop({"d": 60.0, "beta": 0.3}, link("c", 0.0), link("r", "pi - alpha"), link("d", "beta + pi"))
FOUR_BAR = loop(
    {"mu": 0.4, "psi": 1.5}, link("r1", "theta"), link("r2", "mu"), link("r3", "psi + pi"), link("r4", "pi")
)
FOUR_BAR_PARTS = [part("r1", 30.0, 0.1), part("r2", 90.0, 0.2), part("r3", 70.0, 0.2), part("r4", 100.0, 0.3),
                  part("theta", 60.0, 1.0, unit="deg")]  # fmt: skip


def rocker(r1: Array, r2: Array, r3: Array, r4: Array, theta: Array) -> Array:
    """Freudenstein: the angle of the rocker of the open four-bar."""
    x, y = r4 - r1 * np.cos(theta), -r1 * np.sin(theta)  # from the crank pin to the fixed pivot
    d = np.hypot(x, y)
    inside = np.arccos((r3**2 + d**2 - r2**2) / (2.0 * r3 * d))
    return np.asarray(np.arctan2(-y, -x) - inside)


STACKED = [
    loop({"s": 40.0, "beta": 0.4}, link("s", "beta"), link("h", "-90 deg"), link("w", "180 deg")),
    loop({"u": 60.0, "y": 50.0}, link("u", "beta"), link("r", "normal"), link("r", 0), link("y", "-pi/2"),
         link("wall", [-1, 0])),
]  # fmt: skip
STACKED_PARTS = [part("h", 20.0, 0.1), part("w", 50.0, 0.2), part("r", 12.0, 0.02), part("wall", 90.0, 0.3)]


def resting(h: Array, w: Array, r: Array, wall: Array) -> Array:
    """Height of a cylinder that lies on a plate, which leans on a block, and touches a wall."""
    beta = np.arctan2(h, w)
    return np.asarray((r + (wall - r) * np.sin(beta)) / np.cos(beta))


SHARED = [  # three unknowns in the first loop and one in the second: neither can be solved alone
    loop({"p": 0.5, "q": -0.4, "u": 90.0}, link("a", "p"), link("b", "q"), link("u", "pi")),
    loop({"v": 60.0}, link("c", "p"), link("d", "q"), link("h", "-pi/2"), link("v", "pi")),
]
SHARED_PARTS = [part("a", 50.0, 0.1), part("b", 60.0, 0.1), part("c", 45.0, 0.1), part("d", 20.0, 0.1),
                part("h", 14.0, 0.1)]  # fmt: skip


def shared(a: Array, b: Array, c: Array, d: Array, h: Array) -> Array:
    """u + v from a sin p + b sin q = 0 and c sin p + d sin q = h."""
    sin_p = -b * h / (a * d - b * c)
    sin_q = -a * sin_p / b
    cos_p, cos_q = np.sqrt(1.0 - sin_p**2), np.sqrt(1.0 - sin_q**2)
    return np.asarray((a + c) * cos_p + (b + d) * cos_q)


def rssr(a: Array, c: Array, r: Array, f: Array, theta: Array) -> Array:
    """The rocker of a spatial four-bar with ball joints: |P - Q| = c with P = a (cos theta, sin theta, 0),
    the crank about z, and Q = (f, r cos psi, r sin psi), the rocker about x.
    """
    px, py = a * np.cos(theta), a * np.sin(theta)
    big = (f - px) ** 2 + py**2 + r**2 - c**2
    return np.asarray(np.arccos(big / (2.0 * r * py)))


RSSR = loop({"psi": 1.2, "u": -0.2, "w": 0.6},
            link("a", ["cos(theta)", "sin(theta)", 0]), link("c", ["cos(w)*cos(u)", "cos(w)*sin(u)", "sin(w)"]),
            link("-r", [0, "cos(psi)", "sin(psi)"]), link("f", [-1, 0, 0]))  # fmt: skip
RSSR_PARTS = [part("a", 30.0, 0.1), part("c", 95.0, 0.2), part("r", 60.0, 0.2), part("f", 90.0, 0.3),
              part("theta", 60.0, 1.0, unit="deg")]  # fmt: skip

EXPLICIT: dict[str, tuple[str, list[Any], list[Any], Callable[..., Array]]] = {
    "clutch, angle": ("phi", [CLUTCH], CLUTCH_PARTS, lambda a, c, e: np.arccos((a + c) / (e - c))),
    "clutch, contact": ("b", [CLUTCH], CLUTCH_PARTS, lambda a, c, e: np.sqrt((e - c) ** 2 - (a + c) ** 2)),
    "slider crank": ("s", [CRANK], CRANK_PARTS, lambda r, rod, h, theta: (
        r * np.cos(theta) + np.sqrt(rod**2 - (r * np.sin(theta) - h) ** 2))),
    "four-bar": ("psi", [FOUR_BAR], FOUR_BAR_PARTS, rocker),
    "geneva, wheel": (
        "beta", [GENEVA], [part("c", 80.0, 0.1), part("r", 56.0, 0.1), part("alpha", 20.0, 1.0, unit="deg")],
        lambda c, r, alpha: np.arctan2(r * np.sin(alpha), c - r * np.cos(alpha))),
    "geneva, slot": (
        "d", [GENEVA], [part("c", 80.0, 0.1), part("r", 56.0, 0.1), part("alpha", 20.0, 1.0, unit="deg")],
        lambda c, r, alpha: np.sqrt(c**2 + r**2 - 2.0 * c * r * np.cos(alpha))),
    "stacked blocks": ("y", STACKED, STACKED_PARTS, resting),
    "shared unknowns": ("u + v", SHARED, SHARED_PARTS, shared),
    "spatial four-bar": ("psi", [RSSR], RSSR_PARTS, rssr),
}  # fmt: skip


@pytest.mark.parametrize("name", EXPLICIT)
def test_a_loop_is_the_explicit_formula(name: str, tmp_path: Path) -> None:
    """Every unit to 1e-9, those that cannot close included, and the slopes to central differences."""
    formula, loops, parts, explicit = EXPLICIT[name]
    lets = {"let": [{"name": "normal", "formula": "beta + pi/2"}]} if loops is STACKED else {}
    problem = stack(tables(formula, loops, parts, **lets), tmp_path)
    x, y = units_of(problem, spread=3.0)
    gain = problem.measured[0].mechanism.gain
    with np.errstate(invalid="ignore"):
        expected = explicit(**x)
    np.testing.assert_allclose(y / gain, expected, rtol=1e-9, atol=1e-9)
    assert name.startswith("clutch") == bool(np.any(np.isnan(y)))
    mechanism = problem.measured[0].mechanism
    assert mechanism.mids is not None and mechanism.scale is not None
    middle = dict(zip(mechanism.names, mechanism.mids, strict=True))
    for at, key in enumerate(mechanism.names):
        h = 1e-5 * max(abs(middle[key]), 1.0)
        ends = [float(explicit(**{**middle, key: middle[key] + side * h})) for side in (1.0, -1.0)]
        slope = gain * mechanism.scale[at] * (ends[0] - ends[1]) / (2.0 * h)
        assert mechanism.sensitivities[at] == pytest.approx(slope, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", ["slider crank", "four-bar", "geneva, wheel", "stacked blocks"])
def test_a_mechanism_has_the_ends_and_the_spread_of_its_explicit_formula(name: str, tmp_path: Path) -> None:
    """No printed figures of these mechanisms with all inputs are known: the worst case by all corners of the
    explicit formula, which rises or falls with every part, and mean and deviation by a count of 10^6 normal units.
    """
    formula, loops, parts, explicit = EXPLICIT[name]
    lets = {"let": [{"name": "normal", "formula": "beta + pi/2"}]} if loops is STACKED else {}
    row = tolevo.analyse(tables(formula, loops, parts, **lets)).requirements.iloc[0]
    in_base = [np.pi / 180.0 if one.get("unit") == "deg" else 1.0 for one in parts]
    mid, t = (np.array([one[key] for one in parts]) * in_base for key in ("nominal", "tolerance"))

    def of(z: Array) -> Array:
        return explicit(*(mid[:, None] + t[:, None] * z))

    corners = of(np.array(list(product((-1.0, 1.0), repeat=len(parts)))).T)
    assert row["nominal"] == pytest.approx(float(of(np.zeros((len(parts), 1)))[0]), rel=1e-9)
    assert (row["worst_case_least"], row["worst_case_greatest"]) == pytest.approx(
        (corners.min(), corners.max()), rel=1e-9
    )
    y = of(np.random.default_rng(4).normal(0.0, 1.0 / 3.0, (len(parts), 1_000_000)))
    error = float(np.std(y)) * np.sqrt(1.0 / 1_000_000 + 1.0 / 65536)
    assert row["mean"] == pytest.approx(float(np.mean(y)), abs=4.0 * error)
    assert row["std"] == pytest.approx(float(np.std(y)), abs=4.0 * error / np.sqrt(2.0))


def test_the_one_way_clutch_of_the_literature(tmp_path: Path) -> None:
    """Chase, Gao & Magleby (1995): the nominal pressure angle is 7.0184 deg, the contact at b = 4.8105 mm.

    Their linear sensitivities of the angle to hub, roller and ring, and its worst case and root sum square
    for tolerances of 0.05, 0.01 and 0.05 mm, follow in closed form: -1/b, -(1 + cos phi)/b, cos phi/b.
    """
    given = tables("phi", [CLUTCH], CLUTCH_PARTS, requirement={"unit": "deg"})
    mechanism = stack(given, tmp_path).measured[0].mechanism
    assert mechanism.centre == pytest.approx(7.0184, abs=5e-5)
    contact = stack(tables("b", [CLUTCH], CLUTCH_PARTS), tmp_path).measured[0].mechanism
    assert contact.centre == pytest.approx(4.8105, abs=5e-5)
    b, cos = np.sqrt(39.37**2 - 39.075**2), 39.075 / 39.37
    slopes = np.degrees([-1.0 / b, -(1.0 + cos) / b, cos / b])
    np.testing.assert_allclose(mechanism.sensitivities, slopes, rtol=1e-9)
    stack_ = stack(given, tmp_path)
    outputs = stack_.outputs_of(stack_.corner(tight=False)[None])
    t = np.array([0.05, 0.01, 0.05])
    assert outputs["worst_case"][0] == pytest.approx(np.abs(slopes) @ t, rel=1e-9)
    assert outputs["rss"][0] == pytest.approx(np.linalg.norm(slopes * t), rel=1e-9)


def test_the_unknowns_are_those_of_another_solver(tmp_path: Path) -> None:
    """The four-bar by scipy's fsolve on its own two equations, unit by unit."""
    problem = stack(tables("psi", [FOUR_BAR], FOUR_BAR_PARTS, requirement={"unit": "rad"}), tmp_path)
    x, y = units_of(problem)

    def gaps(u: Array, r1: float, r2: float, r3: float, r4: float, theta: float) -> list[float]:
        mu, psi = u
        return [r1 * np.cos(theta) + r2 * np.cos(mu) - r3 * np.cos(psi) - r4,
                r1 * np.sin(theta) + r2 * np.sin(mu) - r3 * np.sin(psi)]  # fmt: skip

    for at in range(50):
        own = [x[name][at] for name in ("r1", "r2", "r3", "r4", "theta")]
        assert y[at] == pytest.approx(fsolve(gaps, [0.4, 1.5], args=tuple(own), xtol=1e-12)[1], abs=1e-9)


TRIANGLE = link("a", "p"), link("b", "q"), link("c", "pi")
TRIANGLE_PARTS = [part("a", 5.0, 0.15, distribution="normal"), part("b", 5.2, 0.15), part("c", 10.0, 0.3)]


@pytest.mark.parametrize(("start", "side"), [({"p": 0.3, "q": -0.3}, 1.0), ({"p": -0.3, "q": 0.3}, -1.0)])
def test_the_start_chooses_the_assembly_mode(start: dict[str, object], side: float, tmp_path: Path) -> None:
    """The apex of a triangle above or below its base; Newton from every unit keeps to it."""
    given = tables("a*sin(p)", [loop(start, *TRIANGLE)], TRIANGLE_PARTS)
    x, y = units_of(stack(given, tmp_path))
    along = (x["a"] ** 2 - x["b"] ** 2 + x["c"] ** 2) / (2.0 * x["c"])
    with np.errstate(invalid="ignore"):
        height = np.sqrt(x["a"] ** 2 - along**2)
    closed = x["a"] + x["b"] >= x["c"]
    np.testing.assert_array_equal(np.isfinite(y), closed)
    np.testing.assert_allclose(y[closed], side * height[closed], atol=1e-9)
    assert 0.01 < np.mean(~closed) < 0.3


def test_units_that_cannot_be_closed_do_not_conform(tmp_path: Path) -> None:
    """a + b < c of normal parts: one normal probability, with no other limit."""
    given = tables("a*sin(p)", [loop({"p": 0.3, "q": -0.3}, *TRIANGLE)], TRIANGLE_PARTS,
                   requirement={"lower": -1.0, "method": "monte_carlo"}, propagation={"samples": 65536})  # fmt: skip
    problem = stack(given, tmp_path)
    outputs = problem.outputs_of(problem.corner(tight=False)[None])
    lost = norm.sf(0.2 / (np.linalg.norm([0.15, 0.15, 0.3]) / 3.0))
    assert 100.0 * lost > 5.0
    error = outputs["yield_percent_error"][0]
    assert outputs["yield_percent"][0] == pytest.approx(100.0 * (1.0 - lost), abs=4.0 * error)
    assert outputs["domain_margin"][0] < 0.0
    assert "loop[0]: the loop cannot be closed for some units" in problem.warnings()[0]


def test_the_margin_of_a_loop_is_zero_where_it_just_closes(tmp_path: Path) -> None:
    """Isosceles 5, 5, c: det(dr/du) ~ sin(p - q), whose square relative to that at c = 9 is the margin."""
    parts = [part("a", 5.0, 0.0), part("b", 5.0, 0.0), part("c", 9.0, 2.0)]
    given = tables("a*sin(p)", [loop({"p": 0.5, "q": -0.5}, *TRIANGLE)], parts, requirement={"method": "worst_case"})
    formula = stack(given, tmp_path).measured[0].mechanism.formula
    assert formula is not None
    (loops,) = formula.given
    middle = {"a": np.asarray(5.0), "b": np.asarray(5.0), "c": np.asarray(9.0)}
    c = np.array([9.0, 9.5, 9.9, 9.999, 10.001, 11.0])
    x: dict[str, Array] = {**middle, "c": c}
    found = loops.margin(x | loops.values(x), middle | loops.values(middle))
    p = np.arccos(np.minimum(c, 10.0) / 10.0)
    expected = (np.sin(2.0 * p) / np.sin(2.0 * np.arccos(0.9))) ** 2
    expected[4:] = (10.0 - 9.0) / (c[4:] - 9.0) - 1.0  # opens at c = 10
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-7)


def test_what_is_written_back_reads_the_same(tmp_path: Path) -> None:
    own = stack(tables("psi", [RSSR], RSSR_PARTS, requirement={"unit": "deg"}), tmp_path)
    again = stack({"problem": "stack"} | own.tables(), tmp_path)
    assert again.definition.intermediate == own.definition.intermediate == {"loop": [RSSR]}
    np.testing.assert_array_equal(again.measured[0].mechanism.sensitivities, own.measured[0].mechanism.sensitivities)


def test_a_search_with_a_loop_is_that_with_its_formula(tmp_path: Path) -> None:
    """Least cost of the clutch by its loop and by acos."""
    cost = {"cost": {"model": "reciprocal", "a": 1.0, "b": 0.1}, "t_min": 0.01, "t_max": 0.1}
    parts = [{key: value for key, value in row.items() if key != "tolerance"} | cost for row in CLUTCH_PARTS]
    more = {"objectives": {"minimise": ["cost"]}, "limits": {"yield_percent": 99.0},
            "requirement": {"unit": "deg", "lower": 6.0, "upper": 8.0}}  # fmt: skip
    by_loop = stack(tables("phi", [CLUTCH], parts, **more), tmp_path)
    explicit = tables("acos((a + c)/(e - c))", [], parts, **more)
    del explicit["loop"]
    by_formula = stack(explicit, tmp_path)
    x = np.random.default_rng(0).uniform(by_loop.xl, by_loop.xu, (6, by_loop.n_var))
    found, expected = (problem.outputs_of(problem.complete(x)) for problem in (by_loop, by_formula))
    for name in ("yield_percent", "rss", "worst_case", "cost"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("loops", "messages"),
    [
        ([loop({"s": 120.0, "phi": -0.1}, link("r", "theta"), link("rod/30", "phi"), link("h + 30", "-90 deg"),
               link("s", "pi"))], ["loop[0]: cannot be closed at the nominal sizes: the joint of",
                                   "link[3] and link[0] stays open by 5.692 (x", "y -5.692) at s = "]),
        ([loop({"s": 120.0}, *CRANK_LINKS)], ["loop[0].link[1].angle: column 1: \"phi\" is not a part"]),
        ([loop({"s": 120.0, "phi": 0.0, "d": 1.0}, *CRANK_LINKS)], ["loop[0].unknown: no link depends on d"]),
        ([loop({"s": 120.0, "phi": 0.0, "d": 1.0}, *CRANK_LINKS, link("d", 0.3))],
         ["has 3 unknowns (s, phi, d) and 2 equations (2 for each loop in the plane)"]),
        ([loop({"s": 120.0, "r": 0.0}, *CRANK_LINKS)], ['loop[0].unknown: "r" is already a name of part r']),
        ([loop({"s": 120.0, "2": 0.0}, *CRANK_LINKS)], ['loop[0].unknown.2: must be letters, digits and _']),
        ([loop({"s": "120 mm", "phi": "x"}, *CRANK_LINKS)], ["loop[0].unknown.s:", "loop[0].unknown.phi:"]),
        ([{"link": list(CRANK_LINKS), "unknown": {"s": 120.0, "phi": 0.0}}], ["loop[0].name: is missing"]),
        ([loop({"s": 120.0, "phi": 0.0}, *CRANK_LINKS[:3], link("s + " + " + ".join(["r*1"] * 700), "pi"))],
         ["loop[0].link[3].length: column"]),
        ([loop({"s": 120.0, "phi": 0.0}, *CRANK_LINKS[:3], link("s*sqrt(r - 50)", "pi"))],
         ["loop[0].link[3].length: has no value at the nominal sizes and the start: column 3: sqrt needs"]),
        ([3], ["loop: must be a list of tables"]),
        ([{"name": 3, "link": 3, "unknown": 3}], ["loop[0].name: must be a string", "loop[0].link: must be a list of",
                                                 "loop[0].unknown: must be a table"]),
        ([loop({"s": 120.0, "phi": 0.0}, link("r", "theta"))], ["loop[0].link: must list at least two"]),
        ([loop({"s": 1.0, "phi": 0.0}, {"angle": 0.0}, {"length": "r"}, link("rod +", "phi"), link("rod", "phi +"),
               link("s", [0, 0]), link("s", [1]), link("s", ["a +", 1]), {"length": True, "angle": 0, "colour": 1})],
         ["loop[0].link[0].length: is missing", "loop[0].link[1].angle: state either the angle",
          "loop[0].link[2].length: column 6: ends too early", "loop[0].link[3].angle: column 6",
          "loop[0].link[4].direction: must not be 0", "loop[0].link[5].direction: must list two or three",
          "loop[0].link[6].direction[0]: column 4", "loop[0].link[7].length: must be a number",
          "loop[0].link[7].colour: is not a known key"]),
        ([CRANK, loop({"p": 0.3, "q": 1.0}, link("rod", "p"), link("q", "pi/2"), link("r", 0))],
         ["loop[1]: no requirement depends on p, q"]),
        ([CRANK, CRANK], ['loop[1].unknown: "s" is already a name of loop[0].unknown']),
        ([loop({"s": 140.0, "phi": 0.0}, link("r", "s/140"), link("rod", "phi"), link(150, "pi"))],
         ["loop[0]: is at a dead centre"]),
    ],
)  # fmt: skip
def test_faults_of_a_loop_say_where_and_why(loops: list[Any], messages: list[str], tmp_path: Path) -> None:
    found = faults(tables("s + r + rod + h + theta", loops, CRANK_PARTS), tmp_path)
    for message in messages:
        assert message in found


def test_every_loop_that_is_open_is_a_fault(tmp_path: Path) -> None:
    """Two triangles with a base longer than both sides, each by 2 and by 3; a third one is closed."""
    triangles = [
        loop({x: 0.3, y: -0.3}, link("a", x), link("b", y), link(base, "pi"))
        for x, y, base in (("p", "q", 12.2), ("r", "s", "c"), ("u", "v", 13.2))
    ]
    found = faults(tables("a*sin(p) + b*sin(r) + c*sin(u)", triangles, TRIANGLE_PARTS), tmp_path)
    for at, gap in ((0, 2), (2, 3)):
        text = f"loop[{at}]: cannot be closed at the nominal sizes: the joint of link[2] and link[0] stays open"
        assert f"{text} by {gap} (x" in found
    assert "loop[1]" not in found
    joined = [loop({"p": 0.3, "q": -0.3}, *TRIANGLE[:2], link(12.2, "pi"))]
    joined += [loop({"r": 0.3, "s": -0.3}, link("a", "r"), link("b", "s"), link("13 + 0*p", "pi"))]
    found = faults(tables("a*sin(p) + b*sin(r) + c*sin(s)", joined, TRIANGLE_PARTS), tmp_path)
    assert "loop[0]: cannot be closed" in found
    assert "loop[1]: cannot be closed" in found
