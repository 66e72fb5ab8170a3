"""Sixty tasks of allocation and of stacks with right answers, which nothing of tolevo computes: closed forms
(Lagrange), enumeration of every choice, roots of normal laws, corners, counts of 4 million units.

`python -m benchmarks.tasks.answers` writes them anew to tasks.json: the question in words and as a
model (parts, requirements), the same as a configuration of tolevo, and the answer with its source.

Reference: Chase, Greenwood, Loosli & Hauglund (1990), Least cost tolerance allocation for mechanical
assemblies with automated process selection, Manufacturing Review 3(1), 49-59; ISO 286-1:2010, table 1.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from .score import conforms, cost_of, side_of

minimize: Any = scipy.optimize.minimize  # its stubs know arrays of one fixed dimension only

Raw = dict[str, Any]
FILE = Path(__file__).with_name("tasks.json")
UNITS = 4_000_000
"""Units that are counted where there is no closed form: a standard error of 0.005 % at 99 %."""
IT_UM = {8: (6, 9, 15, 22, 36, 58), 25: (9, 13, 21, 33, 52, 84), 65: (13, 19, 30, 46, 74, 120)}
"""Widths [um] of IT5 to IT10 for sizes of over 6 to 10, 18 to 30, and 50 to 80 mm."""
PRICES = (9.0, 5.0, 3.0, 2.0, 1.4, 1.0)


def part(name: str, a: float, b: float, low: float, high: float, s: float = 1.0, size: float = 20.0) -> Raw:
    """A part whose cost is a + b/t."""
    return {"name": name, "s": s, "size": size, "ways": [{"a": a, "b": b, "low": low, "high": high}]}


def graded(name: str, size: int, s: float = 1.0, scale: float = 1.0) -> Raw:
    """A part of a grade IT5 to IT10."""
    widths = dict(zip(range(5, 11), IT_UM[size], strict=True))
    ways = [
        {"label": f"IT{grade}", "a": scale * price, "b": 0.0, "low": 5e-4 * width, "high": 5e-4 * width}
        for (grade, width), price in zip(widths.items(), PRICES, strict=True)
    ]
    return {"name": name, "s": s, "size": float(size), "ways": ways}


def chosen(name: str, *ways: tuple[str, float, float, float, float], s: float = 1.0) -> Raw:
    """A part that several processes can make, each with its costs and range."""
    keys = ("label", "a", "b", "low", "high")
    return {"name": name, "s": s, "size": 20.0, "ways": [dict(zip(keys, way, strict=True)) for way in ways]}


def least(parts: list[Raw], requirements: list[Raw]) -> Raw | None:
    """The allocation of least cost: every choice of processes and grades, with the best tolerances of each."""
    best: Raw | None = None
    for ways in itertools.product(*(p["ways"] for p in parts)):
        t = _tolerances(parts, ways, requirements)
        if t is None:
            continue
        cost = sum(w["a"] + w["b"] / x for w, x in zip(ways, t, strict=True))
        if best is None or cost < best["cost"] - 1e-12:
            best = {"cost": cost, "t": {p["name"]: x for p, x in zip(parts, t, strict=True)}}
    return best


def _tolerances(parts: list[Raw], ways: tuple[Raw, ...], requirements: list[Raw]) -> list[float] | None:
    """The best tolerances of chosen ways, None where even the tightest break a limit: by Lagrange's multiplier,
    t = (b/(m p |s|^p))^(1/(1 + p)) within its range, of a limit on sum |s t|^p (p = 1, 2); of several limits by
    their convex dual in the logarithms of the multipliers.
    """
    low, high, b = (np.array([w[key] for w in ways]) for key in ("low", "high", "b"))
    rows = [
        (np.array([abs(side_of(p, at)) for p in parts]), 1 if r["method"] == "worst_case" else 2, _budget(r))
        for at, r in enumerate(requirements)
    ]
    if any(budget <= 0.0 or np.sum((s * low) ** p) > budget * (1.0 + 1e-12) for s, p, budget in rows):
        return None
    if all(np.sum((s * high) ** p) <= budget * (1.0 + 1e-12) for s, p, budget in rows):
        return [float(t) for t in high]
    if len(rows) == 1:
        ((s, p, budget),) = rows

        def at(log_m: float) -> Any:
            with np.errstate(divide="ignore"):
                return np.clip((b / (np.exp(log_m) * p * np.maximum(s, 1e-12) ** p)) ** (1.0 / (1 + p)), low, high)

        ends = -80.0, 80.0
        root = scipy.optimize.brentq(lambda m: float(np.sum((s * at(m)) ** p)) / budget - 1.0, *ends, xtol=1e-13)
        return [float(t) for t in at(root)]
    limits = [
        {"type": "ineq", "fun": lambda x, s=s, p=p, c=budget: 1.0 - np.sum((s * np.exp(x)) ** p) / c}
        for s, p, budget in rows
    ]
    done = minimize(  # convex in the logarithms of t
        lambda x: float(np.sum(b * np.exp(-x))),
        np.log(low),
        jac=lambda x: -b * np.exp(-x),
        method="SLSQP",
        bounds=list(zip(np.log(low), np.log(high), strict=True)),
        constraints=limits,
        options={"ftol": 1e-14, "maxiter": 1000},
    )
    return [float(t) for t in np.exp(done.x)]


def _budget(requirement: Raw) -> float:
    """What sum |s t|^p may come to; of a yield, the variance of 3 sigma whose normal law has it."""
    if requirement["method"] == "worst_case":
        return float(requirement["limit"])
    if requirement["method"] == "rss":
        return float(requirement["limit"]) ** 2
    lower, upper, mean = (requirement[key] for key in ("lower", "upper", "nominal"))
    law, share = scipy.stats.norm, requirement["yield_percent"] / 100.0

    def short(sigma: float) -> float:
        return float(law.cdf((upper - mean) / sigma) - law.cdf((lower - mean) / sigma) - share)

    width = upper - lower
    return (3.0 * scipy.optimize.brentq(short, 1e-6 * width, 10.0 * width)) ** 2 if lower < mean < upper else -1.0


def allocation(kind: str, parts: list[Raw], *requirements: Raw) -> Raw:
    """A task of least cost; its right answer is a refusal where no allocation keeps the limits."""
    answer = least(parts, list(requirements))
    model = {"parts": parts, "requirements": list(requirements)}
    if answer is not None:
        assert conforms(model, answer["t"])
        assert abs(cost_of(model, answer["t"]) - answer["cost"]) < 1e-9 * answer["cost"]
    named = ", ".join(f"{p['name']} ({'; '.join(map(_way_text, p['ways']))})" for p in parts)
    wanted = "; ".join(_requirement_text(parts, at, r) for at, r in enumerate(requirements))
    question = f"Half-widths t [mm] of least total cost for the parts {named}, so that {wanted}."
    return {
        "kind": kind,
        "question": question,
        "model": model,
        "configuration": toml_of(parts, list(requirements)),
        "answer": {"refused": True} if answer is None else answer,
        "source": "enumeration and Lagrange",
    }


def _way_text(way: Raw) -> str:
    label = f"{way['label']}: " if "label" in way else ""
    if way["low"] == way["high"]:
        return f"{label}t = {way['low']:g} for {way['a']:g}"
    return f"{label}cost {way['a']:g} + {way['b']:g}/t, {way['low']:g} <= t <= {way['high']:g}"


def _formula(parts: list[Raw], at: int) -> str:
    return " + ".join(f"({side_of(p, at):g})*{p['name']}" for p in parts if side_of(p, at))


def _requirement_text(parts: list[Raw], at: int, r: Raw) -> str:
    words = {"worst_case": "the worst case", "rss": "the root sum of squares"}.get(r["method"])
    limit = f"{words} of {_formula(parts, at)} is at most {r['limit']:g}" if words else ""
    return limit or (
        f"{r['yield_percent']:g} % of the units keep {r['lower']:g} <= {_formula(parts, at)} <= {r['upper']:g}, whose "
        f"mean is {r['nominal']:g}, with normal parts of t = 3 sigma"
    )


def toml_of(parts: list[Raw], requirements: list[Raw]) -> str:
    """The task as a configuration of tolevo."""
    several, lines = len(requirements) > 1, ['problem = "stack"', "[objectives]", 'minimise = ["cost"]']
    for at, r in enumerate(requirements):
        keys = {"worst_case": "worst_case", "rss": "variation"}
        key, value = (keys[r["method"]], r["limit"]) if "limit" in r else ("yield_percent", r["yield_percent"])
        lines += [f"[limits.r{at}]" if several else "[limits]", f"{key} = {value!r}"]
    for at, r in enumerate(requirements):
        lines += ["[[requirement]]" if several else "[requirement]", f'name = "r{at}"', 'unit = "mm"']
        lines += [f'formula = "{_formula(parts, at)}"']
        lines += [f'method = "{r["method"]}"'] if "limit" in r else []
        total = sum(side_of(p, at) * p["size"] for p in parts)
        if "lower" in r:
            shift = total - r["nominal"]
            lines += [f"lower = {r['lower'] + shift!r}", f"upper = {r['upper'] + shift!r}"]
    for p in parts:
        lines += ["[[part]]", f'name = "{p["name"]}"', f"nominal = {p['size']!r}"]
        first = p["ways"][0]
        if "label" in first and first["low"] == first["high"]:
            prices = ", ".join(f"{w['label']} = {w['a']!r}" for w in p["ways"])
            lines += [f'grade = ["{first["label"]}", "{p["ways"][-1]["label"]}"]', f"price = {{ {prices} }}"]
            continue
        for w in p["ways"]:
            lines += ["[[part.process]]", f'name = "{w["label"]}"'] if "label" in w else []
            lines += [f"t_min = {w['low']!r}", f"t_max = {w['high']!r}"]
            lines += [f'cost = {{ model = "reciprocal", a = {w["a"]!r}, b = {w["b"]!r} }}']
    return "\n".join(lines) + "\n"


def analysis(kind: str, formula: str, parts: Raw, ends: tuple[float, float], asked: str, source: str) -> Raw:
    """A task on a stack whose tolerances are fixed: name -> (nominal, t, "normal" or "uniform")."""
    words = ", ".join(f"{n} = {v[0]:g} +- {v[1]:g} ({v[2]})" for n, v in parts.items())
    lines = ['problem = "stack"', "[requirement]", 'name = "r"', 'unit = "mm"', f'formula = "{formula}"']
    lines += ['method = "monte_carlo"'] * (asked == "yield_percent" and "count" in source)
    lines += [f"lower = {ends[0]!r}", f"upper = {ends[1]!r}"]
    for name, (nominal, t, law) in parts.items():
        unit = "" if name in PLAIN else "mm"
        lines += ["[[part]]", f'name = "{name}"', f'unit = "{unit}"', f"nominal = {nominal!r}", f"tolerance = {t!r}"]
        lines += [f'distribution = "{law}"']
    value, within = ANALYSED[asked](formula, parts, ends)
    wanted = f"{asked} (within {within:.2g}) of {formula}"
    question = f"{wanted} between {ends[0]:g} and {ends[1]:g}; {words}; normal laws have t = 3 sigma."
    return {
        "kind": kind,
        "question": question,
        "configuration": "\n".join(lines) + "\n",
        "asked": asked,
        "answer": {"value": value},
        "within": within,
        "source": source,
    }


PLAIN = ("rise", "first", "second")
"""Quantities without a length: a temperature rise [K], angles of joints [rad]."""
FUNCTIONS = {name: getattr(np, name) for name in ("sqrt", "sin", "cos", "arccos", "tan")}


def _valued(formula: str, values: Raw) -> Any:
    return eval(formula, {"__builtins__": {}}, FUNCTIONS | values)


def _corner(which: Callable[..., float]) -> Callable[..., tuple[float, float]]:
    def at(formula: str, parts: Raw, _: Any) -> tuple[float, float]:
        grids = [np.linspace(v[0] - v[1], v[0] + v[1], 3 if len(parts) > 6 else 9) for v in parts.values()]
        mesh = np.meshgrid(*grids)
        return float(which(_valued(formula, dict(zip(parts, mesh, strict=True))))), 1e-6

    return at


def _yield(formula: str, parts: Raw, ends: tuple[float, float]) -> tuple[float, float]:
    rng = np.random.default_rng(45)
    drawn = {
        name: rng.normal(m, t / 3.0, UNITS) if law == "normal" else rng.uniform(m - t, m + t, UNITS)
        for name, (m, t, law) in parts.items()
    }
    value = _valued(formula, drawn)
    share = float(np.mean((value >= ends[0]) & (value <= ends[1])))
    return 100.0 * share, max(500.0 * np.sqrt(share * (1.0 - share) / UNITS), 1e-4) + 0.02 * (1.0 - share) * 100.0


def _linear(formula: str, parts: Raw) -> tuple[float, float]:
    """Mean and standard deviation of a linear formula of normal parts."""
    mean = _valued(formula, {n: v[0] for n, v in parts.items()})
    slopes = [_valued(formula, {m: v[0] + (m == n) for m, v in parts.items()}) - mean for n in parts]
    return float(mean), float(np.sqrt(sum((s * v[1] / 3.0) ** 2 for s, v in zip(slopes, parts.values(), strict=True))))


def _cpk(formula: str, parts: Raw, ends: tuple[float, float]) -> tuple[float, float]:
    mean, sigma = _linear(formula, parts)
    return min(mean - ends[0], ends[1] - mean) / (3.0 * sigma), 1e-5


def _ppm(formula: str, parts: Raw, ends: tuple[float, float]) -> tuple[float, float]:
    (mean, sigma), law = _linear(formula, parts), scipy.stats.norm
    ppm = 1e6 * float(law.cdf((ends[0] - mean) / sigma) + law.sf((ends[1] - mean) / sigma))
    return ppm, 1e-3 * ppm + 1e-3


ANALYSED: dict[str, Callable[..., tuple[float, float]]] = {
    "worst_case_least": _corner(np.min),
    "worst_case_greatest": _corner(np.max),
    "yield_percent": _yield,
    "cpk": _cpk,
    "ppm": _ppm,
    "rss_least": lambda f, p, _: (_linear(f, p)[0] - 3.0 * _linear(f, p)[1], 1e-6),
}


def _made(rng: np.random.Generator, count: int) -> list[Raw]:
    """Parts of drawn costs and sensitivities."""
    parts = []
    for at in range(count):
        a, b = (float(value) for value in rng.uniform((0.2, 0.02), (2.0, 0.2)).round(3))
        s, size = float(rng.choice([-1.0, 1.0, 0.5, -2.0])), float(rng.choice([8.0, 20.0, 55.0]))
        parts.append(part(f"p{at}", a, b, 0.005, 0.3, s, size))
    return parts


def _bound(method: str, limit: float) -> Raw:
    return {"method": method, "limit": limit}


def _yielding(percent: float, half: float, off: float = 0.0) -> Raw:
    return {"method": "yield", "yield_percent": percent, "lower": -half, "upper": half, "nominal": off}


def made_tasks() -> list[Raw]:
    """The tasks."""
    rng, tasks = np.random.default_rng(4545), []
    for count in (2, 3, 5, 8, 12):
        tasks.append(allocation("worst case", _made(rng, count), _bound("worst_case", 0.06 * count)))
        tasks.append(allocation("root sum of squares", _made(rng, count), _bound("rss", round(0.08 * count**0.5, 3))))
    for percent, half, off in (
        (99.73, 0.2, 0.0),
        (99.0, 0.25, 0.05),
        (95.0, 0.15, -0.03),
        (99.99, 0.3, 0.0),
        (90, 0.2, 0.1),
    ):
        tasks.append(allocation("yield", _made(rng, 4), _yielding(percent, half, off)))
    for limit in (0.9, 0.04, 0.3):  # many ranges end it, or all
        tasks.append(allocation("ranges that end", _made(rng, 3), _bound("worst_case", limit)))
    grades = [graded("a", 8), graded("b", 25, -1.0), graded("c", 65, 1.0, 2.0)]
    for limit in (0.021, 0.04, 0.0505, 0.075):
        tasks.append(allocation("grades, worst case", grades, _bound("worst_case", limit)))
    for percent, half in ((99.73, 0.02), (99.0, 0.03), (95.0, 0.04), (99.9, 0.0305)):
        tasks.append(allocation("grades, yield", [*grades, graded("d", 25)], _yielding(percent, half)))
    for limit in (0.12, 0.2, 0.35, 0.6):
        parts = [
            chosen("a", ("ground", 1.5, 0.02, 0.005, 0.04), ("turned", 0.5, 0.05, 0.03, 0.3)),
            chosen("b", ("ground", 2.0, 0.01, 0.005, 0.05), ("milled", 0.4, 0.08, 0.05, 0.3), s=-1.0),
            chosen("c", ("milled", 0.6, 0.04, 0.02, 0.2), ("cast", 0.1, 0.1, 0.15, 0.5), s=0.5),
        ]
        tasks.append(allocation("processes", parts, _bound("worst_case" if limit < 0.3 else "rss", limit)))
    for method, limits in (
        ("worst_case", (0.2, 0.15)),
        ("rss", (0.1, 0.2)),
        ("worst_case", (0.3, 0.08)),
        ("rss", (0.15, 0.1)),
    ):
        parts = _made(rng, 4)
        for p, sides in zip(parts, ([1.0, 0.0], [1.0, 1.0], [-1.0, 1.0], [0.0, -1.0]), strict=True):
            p["s"] = sides
        tasks.append(allocation("several requirements", parts, *(_bound(method, limit) for limit in limits)))
    both = [{**p, "s": s} for p, s in zip(grades, ([1.0, 0.0], [-1.0, 1.0], [0.0, 1.0]), strict=True)]
    for limits in ((0.03, 0.05), (0.02, 0.045)):
        tasks.append(allocation("several requirements", both, *(_bound("worst_case", limit) for limit in limits)))
    for parts, requirement in (
        (_made(rng, 3), _bound("worst_case", 0.005)),
        (_made(rng, 4), _bound("rss", 0.003)),
        (grades, _bound("worst_case", 0.01)),
        (_made(rng, 3), _yielding(99.73, 0.2, 0.25)),
        (grades, _yielding(99.73, 0.008)),
    ):
        tasks.append(allocation("infeasible", parts, requirement))
    clip = {
        "housing": (20.2, 0.05, "normal"),
        "plate": (6.0, 0.1, "normal"),
        "spacer": (9.0, 0.12, "normal"),
        "cap": (5.0, 0.08, "normal"),
    }
    gap = "housing - plate - spacer - cap"
    for asked in ("worst_case_least", "rss_least", "yield_percent", "cpk"):
        tasks.append(analysis("fixed tolerances", gap, clip, (0.1, 0.5), asked, "corners, normal law, count"))
    uniform = {name: (m, t, "uniform") for name, (m, t, _) in clip.items()}
    for ends in ((0.1, 0.5), (0.05, 0.42)):
        tasks.append(analysis("fixed tolerances", gap, uniform, ends, "yield_percent", "count of 4 million units"))
    crank = {"r": (30.0, 0.05, "normal"), "l": (90.0, 0.08, "normal"), "e": (12.0, 0.1, "normal")}
    slider = "r*0.8 + sqrt(l**2 - (r*0.6 - e)**2)"
    for asked in ("worst_case_least", "worst_case_greatest", "yield_percent"):
        tasks.append(analysis("vector loop", slider, crank, (113.65, 113.9), asked, "corners, count"))
    warm = {"bore": (60.0, 0.015, "normal"), "shaft": (59.95, 0.01, "normal"), "rise": (60.0, 10.0, "uniform")}
    fit = "bore*(1 + 0.0000115*rise) - shaft*(1 + 0.0000235*rise)"
    for asked in ("worst_case_least", "worst_case_greatest", "yield_percent"):
        tasks.append(analysis("thermal fit", fit, warm, (0.0, 0.03), asked, "corners, count"))
    place = {"x": (0.0, 0.1, "normal"), "y": (0.0, 0.1, "normal")}
    tasks.append(analysis("true position", "sqrt(x**2 + y**2)", place, (0.0, 0.1), "yield_percent", "Rayleigh, count"))
    place = {"x": (0.03, 0.08, "normal"), "y": (-0.02, 0.05, "normal"), "z": (0.0, 0.06, "uniform")}
    away = "sqrt(x**2 + y**2 + z**2)"
    for asked in ("yield_percent",):
        tasks.append(analysis("true position", away, place, (0.0, 0.08), asked, "corners, count"))
    floating = {"hole": (10.5, 0.1, "normal"), "bolt": (9.9, 0.1, "normal"), "pitch": (0.0, 0.2, "normal")}
    clearance = "hole - bolt - sqrt(pitch**2 + 0.0001)"
    for asked in ("worst_case_least", "yield_percent"):
        tasks.append(analysis("fastener clearance", clearance, floating, (0.25, 1.0), asked, "corners, count"))
    # Document B: the cycloid stage of the RV-40E turns by A . delta/(e z_c), e = 1.3 mm, z_c = 39, and the
    # crank bearing by du/a_0, a_0 = 36 mm; 1 arcmin = 2.9089e-4 rad. In mm at a radius of 1000 mm.
    gear = {
        "circle": (-0.001, 0.002, "normal"),
        "hole": (0.0025, 0.002, "normal"),
        "pin": (-0.001, 0.001, "normal"),
        "equal": (-0.001, 0.001, "normal"),
        "move": (0.001, 0.001, "normal"),
        "crank": (0.001, 0.001, "uniform"),
    }
    turn = "1000*((1.166*circle + 2*hole - 2*pin + 2*equal - 1.166*move)/50.7 + crank/36)"
    for asked in ("worst_case_greatest", "yield_percent"):
        tasks.append(analysis("backlash of a gear", turn, gear, (0.0, 0.2909), asked, "corners, count"))
    arm = {
        "upper": (600.0, 0.05, "normal"),
        "fore": (400.0, 0.05, "normal"),
        "first": (0.5, 2e-4, "normal"),
        "second": (0.7, 3e-4, "normal"),
    }
    x0, y0 = 600 * np.cos(0.5) + 400 * np.cos(1.2), 600 * np.sin(0.5) + 400 * np.sin(1.2)
    reach = (
        f"sqrt((upper*cos(first) + fore*cos(first + second) - {x0:.9f})**2 + "
        f"(upper*sin(first) + fore*sin(first + second) - {y0:.9f})**2)"
    )
    tasks.append(analysis("pose of an arm", reach, arm, (0.0, 0.15), "yield_percent", "count of 4 million units"))
    return [{"id": f"T{at:02d}", **task} for at, task in enumerate(tasks, 1)]


if __name__ == "__main__":
    made = made_tasks()
    FILE.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    print(f"{len(made)} tasks")
