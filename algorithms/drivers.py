"""One interface to all population searches: ask for designs, tell their values, save and resume."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.population import Population
from pymoo.core.termination import NoTermination

from ..arrays import Array
from ..problems.tolerance_problem import ToleranceProblem
from .engine import Space
from .settings import AlgorithmSettings
from .states import SavedState, State

VALUES = ("X", "F", "G", "H")


class Unsavable(Exception):
    """The state of an algorithm does not consist of arrays and numbers."""


class Driver(ABC):
    """A population search in progress."""

    @abstractmethod
    def ask(self) -> Array:
        """Designs (n, variables) to be evaluated."""

    @abstractmethod
    def begin_with(self, x: Array) -> Array:
        """Replace the first of the designs that are asked for by `x`; all designs (n, variables) that
        are asked for after that.
        """

    @abstractmethod
    def tell(self, f: Array, g: Array) -> None:
        """Take in objectives and constraints of all designs that were asked for."""

    @abstractmethod
    def state(self) -> State:
        """Everything that the next `ask` depends on. Raises Unsavable."""

    @abstractmethod
    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`. Raises Unsavable where it does not fit."""


def driver(problem: ToleranceProblem, settings: AlgorithmSettings, seed: int, engine: str) -> Driver:
    """The search that `settings` describe, by the engine "array" or "pymoo"."""
    if engine == "array":
        return ArrayDriver(problem, settings, seed)
    return PymooDriver(problem, settings, seed)


class ArrayDriver(Driver):
    """A search by an array engine."""

    def __init__(self, problem: ToleranceProblem, settings: AlgorithmSettings, seed: int) -> None:
        self.engine = settings.engine(Space.of(problem), np.random.default_rng(seed))
        self.asked = np.empty((0, problem.n_var))

    def ask(self) -> Array:
        self.asked = self.engine.ask()
        return self.asked

    def begin_with(self, x: Array) -> Array:
        self.asked = np.concatenate([x, self.asked[len(x) :]])
        return self.asked

    def tell(self, f: Array, g: Array) -> None:
        self.engine.tell(self.asked, f, g)

    def state(self) -> State:
        return self.engine.state()

    def restore(self, state: SavedState) -> None:
        self.engine.restore(state)


class PymooDriver(Driver):
    """A search by a pymoo algorithm.

    Its state is the population and the optimum with all that is stored with each individual, the
    generator, and the attributes that the settings name in `state`.
    """

    def __init__(self, problem: ToleranceProblem, settings: AlgorithmSettings, seed: int) -> None:
        self.names = settings.state
        self.algorithm = settings.build(problem)
        self.algorithm.setup(problem, seed=seed, termination=NoTermination())
        self.asked = Population.empty()

    def ask(self) -> Array:
        self.asked = self.algorithm.ask()
        return np.asarray(self.asked.get("X"), dtype=float)

    def begin_with(self, x: Array) -> Array:
        self.asked[: len(x)].set("X", x)
        return np.asarray(self.asked.get("X"), dtype=float)

    def tell(self, f: Array, g: Array) -> None:
        self.asked.set("F", f, "G", g, "H", np.zeros((len(f), 0)))
        self.asked.apply(lambda individual: individual.evaluated.update(("F", "G", "H")))
        self.algorithm.tell(infills=self.asked)

    def state(self) -> State:
        algorithm = self.algorithm
        saved: State = {"begun": np.array(algorithm.is_initialized)}
        saved["rng"] = np.array(json.dumps(algorithm.random_state.bit_generator.state))
        if not algorithm.is_initialized:
            return saved
        saved["iteration"] = np.array(algorithm.n_iter)
        population, optimum = list(algorithm.pop), list(() if algorithm.opt is None else algorithm.opt)
        everyone = list({id(individual): individual for individual in (*population, *optimum)}.values())
        place = {id(individual): at for at, individual in enumerate(everyone)}
        saved["population"] = np.array([place[id(individual)] for individual in population], dtype=np.int64)
        saved["optimum"] = np.array([place[id(individual)] for individual in optimum], dtype=np.int64)
        for key in VALUES:
            saved[key] = _numeric_array([getattr(individual, key) for individual in everyone])
        for key in sorted({key for individual in everyone for key in individual.data}):
            known = np.array([individual.data.get(key) is not None for individual in everyone])
            values = [individual.data[key] for individual, has in zip(everyone, known, strict=True) if has]
            saved[f"has.{key}"], saved[f"data.{key}"] = known, _numeric_array(values)
        for name in self.names:
            value = _attribute(algorithm, name)
            saved[f"set.{name}"] = np.array(value is not None)
            if value is not None:
                saved[f"attribute.{name}"] = _numeric_array(value)
        return saved

    def restore(self, state: SavedState) -> None:
        algorithm = self.algorithm
        if bool(state["begun"]):
            everyone = Population.new(**{key: state[key] for key in VALUES})
            for individual in everyone:
                individual.evaluated.update(("F", "G", "H"))
            _restore_data(everyone, state)
            algorithm._initialize()
            algorithm.pop = everyone[state["population"]]
            algorithm.opt = everyone[state["optimum"]]
            algorithm.n_iter = int(state["iteration"])
            algorithm.is_initialized = True
            for name in self.names:
                self._set(name, state)
        algorithm.random_state.bit_generator.state = json.loads(str(state["rng"]))

    def _set(self, name: str, state: SavedState) -> None:
        if f"set.{name}" not in state:
            raise Unsavable(name)
        owner, _, last = name.rpartition(".")
        value = state[f"attribute.{name}"] if bool(state[f"set.{name}"]) else None
        target = _attribute(self.algorithm, owner) if owner else self.algorithm
        setattr(target, last, value.item() if value is not None and not value.shape else value)


def _numeric_array(value: Any) -> NDArray[Any]:
    """The value as an array of numbers. Raises Unsavable where it cannot be one."""
    try:
        array = np.array(value)
    except ValueError as error:  # ragged
        raise Unsavable(str(error)) from error
    if array.dtype.kind not in "biuf":
        raise Unsavable(f"{array.dtype} is not numeric")
    return array


def _attribute(owner: Any, name: str) -> Any:
    """A dotted attribute. Raises Unsavable where there is none."""
    try:
        return attrgetter(name)(owner)
    except AttributeError as error:
        raise Unsavable(str(error)) from error


def _restore_data(everyone: Any, state: SavedState) -> None:
    """Restore the data that are stored with every individual."""
    for key in state:
        if key.startswith("data."):
            name = key.removeprefix("data.")
            rows = np.flatnonzero(state[f"has.{name}"])
            for row, value in zip(rows, state[key], strict=True):
                everyone[row].data[name] = value
