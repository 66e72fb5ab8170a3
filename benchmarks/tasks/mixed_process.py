"""Cost against the root sum of squares of 4 parts, each by one of 2 or 3 processes: 36 sets.

A design is 4 tolerances and 4 process numbers, rounded to whole ones: cost = sum_j a_jp + b_jp/t_j,
variation = sqrt(sum_j S_j^2 t_j^2). The front is the lower envelope of the 36 fronts by Lagrange.
"""

from __future__ import annotations

from itertools import product

import moocore
import numpy as np

from tolevo.section import Array

from ..parts import Parts, WatchedParts
from ..task import Task
from .cost_rss import HIGH, LOW, optima

POINTS = 10_000
PROCESSES = np.array([3, 3, 2, 2])
S = np.array([1.0, 2.0, 0.5, 1.0])
A = np.array([[0.4, 1.3, 3.1], [0.6, 1.8, 3.9], [0.3, 1.7, np.nan], [0.5, 2.2, np.nan]])
B = np.array([[0.11, 0.058, 0.027], [0.16, 0.081, 0.040], [0.068, 0.021, np.nan], [0.19, 0.074, np.nan]])
"""A cheap rough process (a low, b high) first; nan where a part has no third one."""
PART = np.arange(4)
PARTS = Parts(A, B, S, LOW, HIGH)


def evaluate(x: Array) -> Array:
    t, process = x[:, :4], np.rint(x[:, 4:]).astype(int)
    cost = A[PART, process].sum(axis=1) + (B[PART, process] / t).sum(axis=1)
    return np.stack([cost, np.sqrt(((S * t) ** 2).sum(axis=1))], axis=1)


def mixed_process() -> Task:
    low = np.concatenate([np.full(4, LOW), np.zeros(4)])
    high = np.concatenate([np.full(4, HIGH), PROCESSES - 1.0])
    note = "4 parts, 36 process sets; front: lower envelope of 36 fronts by Lagrange"
    return Task("mixed process", low, high, evaluate, front(), note, problem, PARTS)


def problem() -> WatchedParts:
    return WatchedParts(PARTS, evaluate)


def front() -> Array:
    each = []
    for chosen in product(*(range(count) for count in PROCESSES)):
        t = optima(B[PART, chosen], S, POINTS)
        each.append(evaluate(np.hstack([t, np.tile(chosen, (len(t), 1))])))
    points = np.vstack(each)
    best: Array = points[moocore.is_nondominated(points)]
    return best
