"""Tolevo through its tools, greedy loosening by grade, and SLSQP, scored on the tasks.

`python -m benchmarks.tasks.rivals DIR` writes the answers of each and the table of scores (scores.csv).
Tolevo answers as an agent asks it: a client of the SDK of the Model Context Protocol speaks with
`tolevo mcp` over stdin and stdout. The rivals have the tasks as models; neither has a bound.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy

from .score import Raw, conforms, cost_of, score, tasks

minimize: Any = scipy.optimize.minimize  # its stubs know arrays of one fixed dimension only

STEP = 1.6
"""Ratio of the tolerances of neighbouring grades (ISO 286-1)."""
TRIED = 512
"""Choices of processes that SLSQP tries; of more, it takes grades as a continuous range."""


def by_tolevo(given: list[Raw]) -> dict[str, Raw]:
    """Answers of `tolevo mcp`: `run` for an allocation, `analyse` where all tolerances are fixed."""
    import mcp

    async def speak() -> list[Any]:
        server = mcp.StdioServerParameters(command=sys.executable, args=["-m", "tolevo", "mcp"])
        async with mcp.Client(server, read_timeout_seconds=600) as client:
            calls = [("run" if "model" in task else "analyse", task["configuration"]) for task in given]
            return [await client.call_tool(tool, {"configuration": text}) for tool, text in calls]

    with ThreadPoolExecutor(1) as thread:  # an event loop may run in this one
        told = thread.submit(lambda: asyncio.run(speak())).result()
    return {task["id"]: _answer(task, answer) for task, answer in zip(given, told, strict=True)}


def _answer(task: Raw, told: Any) -> Raw:
    """What a tool's result says of a task."""
    content = told.structured_content
    if told.is_error:
        return {"refused": True, "faults": content["faults"]}
    if "asked" in task:
        row = content["requirements"][0]
        return {"value": row[task["asked"]]}
    if not content["front"]:
        return {"refused": True, "words": content["words"]}
    best = min(content["front"], key=lambda point: point["cost"])
    t = {part["name"]: best.get(f"{part['name']}_t", part["ways"][0]["low"]) for part in task["model"]["parts"]}
    return {"cost": best["cost"], "t": t, "bound": best.get("bound")}


def by_grades(task: Raw) -> Raw:
    """Greedy: from the tightest tolerances, the step of one grade that saves most, as long as one keeps the limits."""
    if "model" not in task:
        return {"refused": True}
    model = task["model"]
    steps = {part["name"]: _steps(part) for part in model["parts"]}
    at = dict.fromkeys(steps, 0)

    def tolerances(at: dict[str, int]) -> dict[str, float]:
        return {name: steps[name][place] for name, place in at.items()}

    if not conforms(model, tolerances(at)):
        return {"refused": True}
    while True:
        now = cost_of(model, tolerances(at))
        following = [at | {name: place + 1} for name, place in at.items() if place + 1 < len(steps[name])]
        kept = [(now - cost_of(model, tolerances(one)), one) for one in following if conforms(model, tolerances(one))]
        if not kept or max(saved for saved, _ in kept) <= 0.0:
            return {"cost": now, "t": tolerances(at)}
        at = max(kept, key=lambda pair: pair[0])[1]


def _steps(part: Raw) -> list[float]:
    """The tolerances of a part, grade by grade."""
    ranges = []
    for way in part["ways"]:
        count = 1 + int(np.log(way["high"] / way["low"]) / np.log(STEP) + 1e-9)
        ranges += [way["low"] * STEP**k for k in range(count)]
    return sorted(set(ranges))


def by_slsqp(task: Raw) -> Raw:
    """SLSQP in the logarithms of t from the middle of the ranges, for each choice of processes; a grade is rounded down
    from the continuous range where there are too many choices.
    """
    if "model" not in task:
        return {"refused": True}
    model: Raw = task["model"]
    best: Raw = {"refused": True}
    parts = model["parts"]
    names = [part["name"] for part in parts]
    every = list(itertools.islice(itertools.product(*(range(len(part["ways"])) for part in parts)), TRIED))
    for choice in every:
        ways = [part["ways"][at] for part, at in zip(parts, choice, strict=True)]
        low, high = (np.log([way[key] for way in ways]) for key in ("low", "high"))
        x = low
        if (high > low).any():
            x = minimize(
                lambda x, ways=ways: float(sum(w["b"] * np.exp(-v) for w, v in zip(ways, x, strict=True))),
                0.5 * (low + high),
                bounds=list(zip(low, high, strict=True)),
                method="SLSQP",
                constraints=[{"type": "ineq", "fun": lambda x: _room(model, dict(zip(names, np.exp(x), strict=True)))}],
            ).x
        t = dict(zip(names, np.exp(x).tolist(), strict=True))
        if conforms(model, t) and (cost := cost_of(model, t)) < best.get("cost", np.inf):
            best = {"cost": cost, "t": t}
    return best


def _room(model: Raw, t: dict[str, float]) -> Any:
    """The room in each limit, in parts of it."""
    rooms = []
    for at, r in enumerate(model["requirements"]):
        sides = np.array([p["s"][at] if isinstance(p["s"], list) else p["s"] for p in model["parts"]])
        terms = sides * np.array(list(t.values()))
        if "limit" in r:
            size = np.sum(np.abs(terms)) if r["method"] == "worst_case" else np.sqrt(np.sum(terms**2))
            rooms.append(1.0 - size / r["limit"])
            continue
        ends = (np.array([r["lower"], r["upper"]]) - r["nominal"]) / (np.sqrt(np.sum(terms**2)) / 3.0)
        rooms.append(float(np.diff(scipy.special.ndtr(ends))[0]) - r["yield_percent"] / 100.0)
    return np.array(rooms)


RIVALS: dict[str, Callable[[Raw], Raw]] = {"greedy by grade": by_grades, "SLSQP": by_slsqp}


def main(folder: Path) -> pd.DataFrame:
    """The scores of all, with their answers written to a directory."""
    folder.mkdir(parents=True, exist_ok=True)
    given = tasks()
    answers = {"tolevo": by_tolevo(given)}
    answers |= {name: {task["id"]: rival(task) for task in given} for name, rival in RIVALS.items()}
    for name, of_rival in answers.items():
        (folder / f"{name.replace(' ', '_')}.json").write_text(json.dumps(of_rival, indent=1), encoding="utf-8")
    scores = pd.DataFrame({name: score(of_rival, given) for name, of_rival in answers.items()}).T
    least = {task["id"]: task["answer"]["cost"] for task in given if "cost" in task["answer"]}
    above = {
        n: [100.0 * (a[at]["cost"] / cost - 1.0) for at, cost in least.items() if "cost" in a[at]]
        for n, a in answers.items()
    }
    scores["cost above the least, median and most (%)"] = [f"{np.median(v):.2g}, {max(v):.2g}" for v in above.values()]
    scores.to_csv(folder / "scores.csv", index_label="contender")
    return scores


if __name__ == "__main__":
    print(main(Path(sys.argv[1])).to_string())
