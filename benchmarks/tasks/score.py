"""Scores of answers to the tasks of tasks.json: right, wrong, refused, and feasible as claimed.

`python -m benchmarks.tasks.score ANSWERS.json` scores any agent or tool. ANSWERS is an object by the
name of a task: {"T01": {"cost": 12.3, "t": {"p0": 0.05, ...}}, "T02": {"value": 94.9}, "T03": {"refused": true}};
the half-width of a grade or process lies in its range, and says which it is where only one has it at that cost.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy

Raw = dict[str, Any]
COST = 1e-3
"""Part of the least cost by which a right answer may be above it."""
ROOM = 1e-6
"""Part of a limit by which digits of an answer may break it."""


def tasks() -> list[Raw]:
    """The stored tasks."""
    return list(json.loads(Path(__file__).with_name("tasks.json").read_text(encoding="utf-8")))


def side_of(part: Raw, at: int) -> float:
    """The sensitivity of a requirement to a part."""
    return float(part["s"][at] if isinstance(part["s"], list) else part["s"])


def cost_of(model: Raw, t: Mapping[str, float]) -> float:
    """The cost of tolerances by the cheapest way that makes each; infinite where none does."""
    total = 0.0
    for part in model["parts"]:
        x = t[part["name"]]
        ways = [w for w in part["ways"] if w["low"] * (1.0 - ROOM) <= x <= w["high"] * (1.0 + ROOM)]
        total += min((w["a"] + w["b"] / x for w in ways), default=np.inf)
    return float(total)


def conforms(model: Raw, t: Mapping[str, float]) -> bool:
    """Whether tolerances keep every requirement, and lie in their ranges."""
    for at, r in enumerate(model["requirements"]):
        sides = np.array([side_of(part, at) * t[part["name"]] for part in model["parts"]])
        size, root = float(np.sum(np.abs(sides))), float(np.sqrt(np.sum(sides**2)))
        if "limit" in r:
            if (size if r["method"] == "worst_case" else root) > r["limit"] * (1.0 + ROOM):
                return False
            continue
        ends = (np.array([r["lower"], r["upper"]]) - r["nominal"]) / (root / 3.0)
        if 100.0 * float(np.diff(scipy.special.ndtr(ends))[0]) < r["yield_percent"] - 1e-4:
            return False
    return bool(np.isfinite(cost_of(model, t)))


def verdict(task: Raw, answer: Raw | None) -> tuple[str, bool | None]:
    """Right, wrong or refused; and whether an allocation is feasible and costs what it claims (None: none is given)."""
    right = task["answer"]
    if not answer or answer.get("refused"):
        return ("right" if right.get("refused") else "refused"), None
    if "value" in right:
        value = answer.get("value")
        return ("right" if value is not None and abs(value - right["value"]) <= task["within"] else "wrong"), None
    model, t = task["model"], answer.get("t") or {}
    if set(t) < {part["name"] for part in model["parts"]}:
        return "wrong", False
    real = cost_of(model, t)
    feasible = conforms(model, t) and abs(real - answer.get("cost", np.inf)) <= COST * real
    best = not right.get("refused") and real <= right["cost"] * (1.0 + COST)
    return ("right" if feasible and best else "wrong"), feasible


def score(answers: Mapping[str, Raw], given: list[Raw] | None = None) -> dict[str, int]:
    """Counts of right, wrong and refused answers, and of allocations that are not as claimed."""
    counts: Counter[str] = Counter({"right": 0, "wrong": 0, "refused": 0, "not as claimed": 0})
    for task in given or tasks():
        word, feasible = verdict(task, answers.get(task["id"]))
        counts[word] += 1
        counts["not as claimed"] += feasible is False
    return dict(counts)


if __name__ == "__main__":
    answered = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    for one in tasks():
        print(one["id"], one["kind"], *verdict(one, answered.get(one["id"])))
    print(score(answered))
