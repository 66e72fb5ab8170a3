"""Generated stacks: many requirements on shared parts, some made by one of several processes."""

from __future__ import annotations

from typing import Any

import numpy as np

METHODS = ("rss", "shifted_rss", "worst_case", "monte_carlo")
LAWS = ("uniform", "triangular", "trapezoid", "normal", "truncated_normal")
"""Distributions of the parts where a requirement is a quantile (`monte_carlo`)."""
PRICE = 1.0
ROOM = 0.15, 0.45
REACH = 0.35
"""Share of the parts that a requirement depends on."""


def stack_table(
    parts: int,
    requirements: int,
    alternatives: int = 0,
    processes: int = 3,
    seed: int = 0,
    methods: tuple[str, ...] = ("rss",),
) -> dict[str, Any]:
    """The tables of a configuration: least cost of a stack, each requirement limited.

    Limits lie between the variation of the tightest and the loosest tolerances, so that several of
    them bind at the optimum.
    """
    rng = np.random.default_rng(seed)
    slopes = rng.uniform(0.3, 2.0, (requirements, parts)) * rng.choice([-1.0, 1.0], (requirements, parts))
    slopes *= rng.random((requirements, parts)) < REACH
    for part in range(parts):
        if not slopes[:, part].any():
            slopes[rng.integers(requirements), part] = 1.0
    tables = [_part(at, slopes[:, at], at < alternatives, processes, rng) for at in range(parts)]
    names = [f"r{at}" for at in range(requirements)]
    kinds = [methods[at % len(methods)] for at in range(requirements)]
    wide = np.array([_reach(table) for table in tables])
    limits = {}
    for at, name in enumerate(names):
        low, high = (_variation(slopes[at] * t, kinds[at]) for t in wide.T)
        limits[name] = {"variation": float(low + rng.uniform(*ROOM) * (high - low))}
    if "monte_carlo" in kinds:
        for table in tables:
            table["distribution"] = str(rng.choice(LAWS))
    return {
        "problem": "stack",
        "seed": seed,
        "objectives": {"minimise": ["cost"]},
        "limits": limits,
        "requirement": [{"name": name, "unit": "mm", "method": kind}
                        for name, kind in zip(names, kinds, strict=True)],
        "part": tables,
        "algorithm": {"name": "exact"},
    }  # fmt: skip


def _variation(wide: Any, method: str) -> float:
    return float(np.sum(np.abs(wide)) if method == "worst_case" else np.linalg.norm(wide))


def _reach(table: dict[str, Any]) -> tuple[float, float]:
    ways = table.get("process", [table])
    return min(way["t_min"] for way in ways), max(way["t_max"] for way in ways)


def _part(at: int, slopes: Any, several: bool, processes: int, rng: np.random.Generator) -> dict[str, Any]:
    found: dict[str, Any] = {
        "name": f"p{at}",
        "unit": "mm",
        "sensitivity": {f"r{i}": float(s) for i, s in enumerate(slopes) if s != 0.0},
    }
    fine = 0.01 * rng.uniform(0.5, 2.0)
    if not several:
        cost = {"model": "reciprocal", "a": float(rng.uniform(0.5, 2.0)),
                "b": float(fine * rng.uniform(0.5, 3.0))}  # fmt: skip
        return found | {"t_min": fine, "t_max": 20.0 * fine, "cost": cost}
    return found | {"process": _processes(fine, processes, rng)}


def _processes(fine: float, processes: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Processes of one part: each holds twice the tolerance of the one before, for less.

    Their ranges overlap and their prices lie close, so that which is best depends on the limits.
    """
    ways, price = [], PRICE * (1.0 + rng.uniform(0.5, 1.5))
    for way in range(processes):
        scale = fine * 2.0**way
        curve = {"model": "reciprocal", "a": float(price), "b": float(scale * rng.uniform(0.6, 1.4))}
        ways.append({"name": f"w{way}", "t_min": scale, "t_max": 8.0 * scale, "cost": curve})
        price *= rng.uniform(0.55, 0.9)
    return ways
