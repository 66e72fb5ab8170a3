"""Assembly of two chains of two parts, step by step, and what hides in it [mrad]."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from benchmarks.gap.generator.mechanisms import Injected
from benchmarks.gap.generator.tables import Array

MOVES = np.array([[1.0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]])
"""What each part moves: itself, and the gear that hangs on its crankshaft."""
WEIGHTS = np.array([[5.0, 1000, 1000, 1000], [10, 5, 1000, 1000], [10, 5, 5, 1000],
                    [10, 5, 10, 5]])  # fmt: skip
"""The printed cost of adjusting each part at each step; 1000: it is not there yet."""


@dataclass(frozen=True)
class Builds:
    """Units (n,): part errors (n, 4) [mrad] and the precision weight Q of their adjustment."""

    errors: Array
    weight: Array

    def __len__(self) -> int:
        return len(self.errors)


@dataclass(frozen=True)
class Faults:
    """How an adjustment departs from what was commanded; all 0 is the process as printed."""

    gain: float = 0.0
    play: float = 0.0
    coupling: float = 0.0
    back: float = 0.0


def builds(rng: np.random.Generator, n: int, poor: str | None) -> Builds:
    """Part errors of independent parts; poor: the second chain is made like the first."""
    errors = rng.normal(0.0, rng.uniform(1.0, 4.0), (n, 4))
    if poor is not None:
        errors[:, 2:] = errors[:, :2] + 0.15 * errors[:, 2:]
    return Builds(errors, rng.choice([0.0, 2.0, 5.0, 10.0, 20.0], n))


@lru_cache(maxsize=32)
def gains(weight: float) -> tuple[Array, ...]:
    """Feedback of each step by the backward recursion from P = Q I."""
    to_go, found = weight * np.eye(4), []
    for costs in WEIGHTS[::-1]:
        gain = np.linalg.solve(np.diag(costs) + MOVES.T @ to_go @ MOVES, MOVES.T @ to_go)
        to_go = to_go - to_go @ MOVES @ gain
        found.append(gain)
    return tuple(found[::-1])


def achieved(commanded: Array, faults: Faults) -> Array:
    """What the adjusters do: they first cross their play, then move by their own measure."""
    beyond = np.sign(commanded) * np.maximum(np.abs(commanded) - faults.play, 0.0)
    return np.asarray((1.0 + faults.gain) * beyond)


def assembled(at: Builds, faults: Faults) -> Array:
    """Final errors (n, 4) [mrad]: adjust what is there, put the next part in, four times."""
    state, moved = np.zeros((len(at), 4)), np.zeros((len(at), 4))
    chosen = np.array([gains(float(one)) for one in np.unique(at.weight)])
    row = np.searchsorted(np.unique(at.weight), at.weight)
    for step in range(4):
        command = -np.einsum("nij,nj->ni", chosen[row, step], state)
        change = achieved(command, faults) @ MOVES.T
        moved += change
        arrived = np.zeros((len(at), 4))
        arrived[:, step] = at.errors[:, step]
        installed = arrived @ MOVES.T
        state = state + change + installed
        state[:, :2] += faults.coupling * installed[:, 2:]
    return state - faults.back * moved


def departure(at: Builds, faults: Faults) -> Array:
    """What faults add to the four outputs, one after the other (4 n,)."""
    return (assembled(at, faults) - assembled(at, Faults())).T.ravel()


def adjustment_gain(rng: np.random.Generator, at: Builds) -> Injected:
    return Injected(departure(at, Faults(gain=rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.3))))


def adjustment_backlash(rng: np.random.Generator, at: Builds) -> Injected:
    return Injected(departure(at, Faults(play=rng.uniform(0.05, 0.4))))


def chain_coupling(rng: np.random.Generator, at: Builds) -> Injected:
    return Injected(departure(at, Faults(coupling=rng.choice([-1, 1]) * rng.uniform(0.02, 0.3))))


def springback(rng: np.random.Generator, at: Builds) -> Injected:
    return Injected(departure(at, Faults(back=rng.uniform(0.05, 0.4))))


ASSEMBLY = {one.__name__: one for one in (adjustment_gain, adjustment_backlash, chain_coupling, springback)}
