"""`python -m benchmarks.promise.ranking`: what to measure next, by price and by re-optimisation.

In random stacks of five measured parts the ranking by shadow prices is compared with the expected
least cost over what the next sample may say: Sobol points of the true variance, by its posterior,
and of the variance of the next twenty parts. The same part must come first in 11 of 12.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import stats
from scipy.stats import qmc

from tolevo.commands.run.promise import FURTHER_PARTS, shadow_gain, solved
from tolevo.configuration.reader import read_table
from tolevo.problems.stack import Stack
from tolevo.problems.stack.promises import with_knowledge

CASES, NEEDED, PARTS = 12, 11, 5


def main(arguments: Sequence[str] | None = None) -> None:
    """Rank by both, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--outcomes", type=int, default=256, help="outcomes of a next sample")
    parser.add_argument("--cases", type=int, default=CASES)
    given = parser.parse_args(arguments)
    same = 0
    print("| case | first by price | first by re-optimisation | rank correlation |\n|---|---|---|---:|")
    for seed in range(given.cases):
        stack = drawn(seed)
        names = [part.name for part in stack.definition.parts]
        prices = [shadow_gain(stack, name) for name in names]
        full = [gain(stack, name, given.outcomes) for name in names]
        first = names[int(np.argmax(prices))], names[int(np.argmax(full))]
        same += first[0] == first[1]
        rank = float(stats.spearmanr(prices, full).statistic)
        print(f"| {seed} | {first[0]} | {first[1]} | {rank:.2f} |", flush=True)
    print(f"\nThe same first in {same} of {given.cases}; promised: {NEEDED} of {CASES}.")


def drawn(seed: int) -> Stack:
    """A stack of five parts with samples of 8 to 40, prices and slopes a decade apart."""
    rng = np.random.default_rng([29, seed])
    parts = []
    for at in range(PARTS):
        n, b, slope = (int(rng.integers(8, 40)), 10.0 ** rng.uniform(-0.5, 0.5), rng.uniform(0.5, 2.0))
        values = (10.0 / 3.0 * rng.standard_normal(n)).round(4).tolist()
        parts.append({
            "name": f"p{at}", "unit": "um", "sensitivity": float(slope), "t_min": 0.01,
            "t_max": 500.0, "cost": {"model": "reciprocal", "a": 0.0, "b": float(b)},
            "measured": {"values": values, "made_to": 10.0, "mean": "corrected"},
        })  # fmt: skip
    table = {
        "problem": "stack", "objectives": {"minimise": ["cost"]}, "algorithm": {"name": "exact"},
        "promise": {"yield_percent": 99.73, "statement": "assured"},
        "requirement": {"unit": "um", "nominal": 0.0, "lower": -40.0, "upper": 40.0},
        "part": parts,
    }  # fmt: skip
    problem = read_table(table, []).problem
    assert isinstance(problem, Stack)
    return problem


def gain(stack: Stack, name: str, outcomes: int) -> float:
    """The expected fall of the least cost by the next sample of a part."""
    sample = next(part.sample for part in stack.definition.parts if part.name == name)
    start = solved(stack)
    assert sample is not None
    assert start is not None
    known = sample.knowledge
    power = int(np.log2(outcomes))
    with_next = qmc.Sobol(2, seed=np.random.default_rng(1)).random_base2(power)
    variance = known.std**2 * known.df / stats.chi2.ppf(with_next[:, 0], known.df)
    squares = variance * stats.chi2.ppf(with_next[:, 1], FURTHER_PARTS)
    df = known.df + FURTHER_PARTS
    costs = []
    for own in np.sqrt((known.df * known.std**2 + squares) / df).tolist():
        anew = replace(known, std=own, n=known.n + FURTHER_PARTS, df=df)
        found = solved(with_knowledge(stack, {name: anew}))
        assert found is not None
        costs.append(float(found[1].cost[0]))
    return float(start[1].cost[0]) - float(np.mean(costs))


if __name__ == "__main__":
    main()
