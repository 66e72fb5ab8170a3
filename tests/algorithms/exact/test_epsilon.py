"""Epsilon-constraints by SLSQP, on stacks that hide their closed form."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.errors import InputError
from tolevo.problems.settings import Bound, Settings
from tolevo.problems.stack import Stack
from tolevo.section import Section
from tolevo.testing import AlgorithmContract

Array = NDArray[np.float64]
S = np.array([1.0, 2.0, 0.5, 1.0, 1.5, 0.7, 1.2, 0.9, 1.1])
A = np.linspace(0.5, 2.0, 9)
B = np.array([0.04, 0.09, 0.01, 0.16, 0.05, 0.08, 0.03, 0.12, 0.06])
LOW, HIGH = 0.02, 0.4


class Hidden(Stack):
    """A stack without its convex form: derivatives are all that is left."""

    def form(self) -> None:
        return None


class Opaque(Hidden):
    """A stack without derivatives either."""

    def gradient(self, designs: Array) -> dict[str, Array]:
        return {}


def written(parts: int) -> str:
    text = '[requirement]\nunit = "mm"\n'
    for s, a, b in zip(S[:parts], A, B, strict=False):
        text += (f'[[part]]\nname = "p{round(1000 * a)}"\nsensitivity = {s}\n'
                 f"t_min = {LOW}\nt_max = {HIGH}\n"
                 f'cost = {{ model = "reciprocal", a = {a}, b = {b} }}\n')  # fmt: skip
    return text


def choosing(parts: int, ways: int) -> str:
    """Parts that are made coarsely and cheaply or finely and dearly."""
    text = '[requirement]\nunit = "mm"\n'
    for at in range(parts):
        text += f'[[part]]\nname = "p{at}"\nsensitivity = {S[at]}\n'
        for way in range(ways):
            text += (f'[[part.process]]\nname = "w{way}"\n'
                     f"t_min = {0.1 / 3**way}\nt_max = {0.4 / 3**way}\n"
                     f'cost = {{ model = "reciprocal", a = {A[at] + way}, '
                     f"b = {B[at] / 2**way} }}\n")  # fmt: skip
    return text


def stack(text: str, kind: type[Stack] = Hidden, **settings: Any) -> Stack:
    made = Stack.configured(Section(tomllib.loads(text), "", []))
    assert made is not None
    return kind(Settings(definition=made.read["definition"], **settings))


def by_lagrange(price: float, s: Array = S, b: Array = B) -> Array:
    """b / t^2 = 2 nu s^2 t at every tolerance between its ends."""
    return np.asarray(np.clip((b / (2.0 * price * s**2)) ** (1.0 / 3.0), LOW, HIGH))


def exact_area(box: tuple[Array, Array], parts: int = 9) -> float:
    """Normalised hypervolume up to 1.1 of the front, by trapezoids over 20,000 prices."""
    s, b = S[:parts], B[:parts]
    t = np.array([by_lagrange(nu, s, b) for nu in np.geomspace(1e-5, 1e6, 20_000)])
    values = np.stack([np.sum(A[:parts] + b / t, axis=1), np.sqrt(np.sum((s * t) ** 2, axis=1))])
    f = (values - box[0][:, None]) / (box[1] - box[0])[:, None]
    cost, variation = np.append(f[0], 1.1), np.append(f[1], f[1, -1])
    heights = 1.1 - 0.5 * (variation[1:] + variation[:-1])
    return float(np.sum(np.diff(cost) * heights))


class TestContract(AlgorithmContract):
    settings = Exact(points=60)

    def problem(self) -> Stack:
        return stack(written(4))


@pytest.mark.parametrize("kind", [Hidden, Opaque])
def test_front_of_nine_parts_within_3000_evaluations(kind: type[Stack]) -> None:
    problem = stack(written(9), kind)
    budget = 3000 if kind is Hidden else 12_000  # a difference costs nine evaluations
    found = search(problem, Exact(), Budget(evaluations=budget), seed=0)
    assert found.evaluations <= budget
    whole = exact_area(problem.box())
    reached = found.history[-1].hypervolume
    assert 0.999 * whole <= reached <= whole * (1.0 + 1e-6)


def test_least_cost_within_a_limit() -> None:
    problem = stack(written(9), objectives=("cost",), limits={"variation": Bound(high=0.35)})
    found = search(problem, Exact(), Budget(evaluations=3000), seed=0)

    def excess(log_price: float) -> float:
        return float(np.linalg.norm(S * by_lagrange(np.exp(log_price)))) - 0.35

    t = by_lagrange(float(np.exp(brentq(excess, -10.0, 10.0, xtol=1e-14))))
    best = float(np.sum(A + B / t))
    np.testing.assert_allclose(found.f.min(), best, rtol=1e-6)
    assert found.f.min() >= best * (1.0 - 1e-9)


def test_sets_of_integers_are_enumerated() -> None:
    problem = stack(choosing(3, 2), objectives=("cost",), limits={"variation": Bound(high=0.25)})
    found = search(problem, Exact(), Budget(evaluations=20_000), seed=0)
    best = np.inf
    for chosen in np.ndindex(2, 2, 2):
        way = np.array(chosen)
        a, b, low, high = A[:3] + way, B[:3] / 2**way, 0.1 / 3**way, 0.4 / 3**way
        if np.linalg.norm(S[:3] * low) > 0.25:
            continue

        def of(log: float, b: Array = b, low: Array = low, high: Array = high) -> Array:
            return np.asarray(np.clip((b / (2.0 * np.exp(log) * S[:3] ** 2)) ** (1.0 / 3.0), low, high))

        def excess(log: float, of: Any = of) -> float:
            return float(np.linalg.norm(S[:3] * of(log))) - 0.25

        t = of(-30.0) if excess(-30.0) <= 0.0 else of(brentq(excess, -30.0, 30.0, xtol=1e-13))
        best = min(best, float(np.sum(a + b / t)))
    np.testing.assert_allclose(found.f.min(), best, rtol=1e-5)
    assert found.f.min() >= best * (1.0 - 1e-9)


def test_more_than_64_sets_of_integers_are_refused() -> None:
    with pytest.raises(InputError, match=r"64 sets of integers.*81: use hybrid"):
        search(stack(choosing(4, 3)), Exact(), Budget(evaluations=500), seed=0)


def test_a_problem_without_a_feasible_design_ends() -> None:
    limits = {"variation": Bound(high=0.9 * LOW * float(np.linalg.norm(S[:4])))}
    problem = stack(written(4), objectives=("cost",), limits=limits)
    found = search(problem, Exact(), Budget(), seed=0)
    assert not len(found.x)
    assert not found.interrupted
    np.testing.assert_allclose(found.miss[0], LOW, rtol=0.2)


@pytest.mark.parametrize("evaluations", [1, 5, 34, 200])
def test_evaluations_are_those_of_the_budget(evaluations: int) -> None:
    found = search(stack(written(4)), Exact(), Budget(evaluations=evaluations), seed=0)
    assert found.evaluations == evaluations
