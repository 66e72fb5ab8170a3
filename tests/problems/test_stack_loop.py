"""`[[loop]]`: closed loops against explicit formulas, another solver, and units that do not close."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from scipy.optimize import fsolve
from scipy.stats import norm

from tolevo.configuration.reader import read
from tolevo.errors import InputError
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


def stack(given: dict[str, Any], folder: Path) -> Stack:
    (folder / "c.toml").write_text(tomli_w.dumps(given), encoding="utf-8")
    problem = read(folder / "c.toml").problem
    assert isinstance(problem, Stack)
    return problem


def faults(given: dict[str, Any], folder: Path) -> str:
    with pytest.raises(InputError) as caught:
        stack(given, folder)
    return str(caught.value)


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
CRANK = loop({"s": 120.0, "phi": -0.1}, link("r", "theta"), link("l", "phi"), link("h", "-90 deg"), link("s", "pi"))
CRANK_PARTS = [part("r", 40.0, 0.1), part("l", 110.0, 0.1), part("h", 10.0, 0.2),
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
    return np.arctan2(-y, -x) - inside


def rssr(a: Array, c: Array, r: Array, f: Array, theta: Array) -> Array:
    """The rocker of a spatial four-bar with ball joints: |P - Q| = c with P = a (cos theta, sin theta, 0),
    the crank about z, and Q = (f, r cos psi, r sin psi), the rocker about x.
    """
    px, py = a * np.cos(theta), a * np.sin(theta)
    big = (f - px) ** 2 + py**2 + r**2 - c**2
    return np.arccos(big / (2.0 * r * py))


RSSR = loop({"psi": 1.2, "u": -0.2, "w": 0.6},
            link("a", ["cos(theta)", "sin(theta)", 0]), link("c", ["cos(w)*cos(u)", "cos(w)*sin(u)", "sin(w)"]),
            link("-r", [0, "cos(psi)", "sin(psi)"]), link("f", [-1, 0, 0]))  # fmt: skip
RSSR_PARTS = [part("a", 30.0, 0.1), part("c", 95.0, 0.2), part("r", 60.0, 0.2), part("f", 90.0, 0.3),
              part("theta", 60.0, 1.0, unit="deg")]  # fmt: skip

EXPLICIT: dict[str, tuple[str, list[Any], list[Any], Callable[..., Array]]] = {
    "clutch, angle": ("phi", [CLUTCH], CLUTCH_PARTS, lambda a, c, e: np.arccos((a + c) / (e - c))),
    "clutch, contact": ("b", [CLUTCH], CLUTCH_PARTS, lambda a, c, e: np.sqrt((e - c) ** 2 - (a + c) ** 2)),
    "slider crank": ("s", [CRANK], CRANK_PARTS, lambda r, l, h, theta: (
        r * np.cos(theta) + np.sqrt(l**2 - (r * np.sin(theta) - h) ** 2))),
    "four-bar": ("psi", [FOUR_BAR], FOUR_BAR_PARTS, rocker),
    "geneva, wheel": (
        "beta", [GENEVA], [part("c", 80.0, 0.1), part("r", 56.0, 0.1), part("alpha", 20.0, 1.0, unit="deg")],
        lambda c, r, alpha: np.arctan2(r * np.sin(alpha), c - r * np.cos(alpha))),
    "geneva, slot": (
        "d", [GENEVA], [part("c", 80.0, 0.1), part("r", 56.0, 0.1), part("alpha", 20.0, 1.0, unit="deg")],
        lambda c, r, alpha: np.sqrt(c**2 + r**2 - 2.0 * c * r * np.cos(alpha))),
    "spatial four-bar": ("psi", [RSSR], RSSR_PARTS, rssr),
}  # fmt: skip


@pytest.mark.parametrize("name", EXPLICIT)
def test_a_loop_is_the_explicit_formula(name: str, tmp_path: Path) -> None:
    """Every unit to 1e-9, those that cannot close included, and the slopes to central differences."""
    formula, loops, parts, explicit = EXPLICIT[name]
    problem = stack(tables(formula, loops, parts), tmp_path)
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
