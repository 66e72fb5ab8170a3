"""The nodes of an expression tree, each with its value, its slopes and its domain."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .functions import FUNCTIONS, crosses_zero, span

Values = Sequence[Array]
"""Values of the nodes below a node; arrays that broadcast."""


@dataclass(frozen=True, slots=True)
class Expression(ABC):
    """A node of the tree; `at` is the column of the formula (from 1) where it stands."""

    at: int

    @property
    def parts(self) -> tuple[Expression, ...]:
        """The nodes below this one."""
        return ()

    @abstractmethod
    def value(self, below: Values, x: Mapping[str, Array]) -> Array:
        """The value from those of the parts; a name looks it up in `x`."""

    def slopes(self, below: Values) -> Sequence[Array]:
        """Partial derivatives of the value with respect to those of the parts."""
        return ()

    def trouble(self, below: Values) -> str:
        """Why the node has no value somewhere, else empty."""
        return ""

    @property
    def depth(self) -> int:
        """Nodes on the longest path from here to a leaf."""
        return 1 + max((part.depth for part in self.parts), default=0)

    @property
    def degree(self) -> float:
        """Degree as a polynomial of the names, inf where it may be none."""
        return 0.0 if all(part.degree == 0.0 for part in self.parts) else np.inf

    def nodes(self) -> Iterator[Expression]:
        """Every node, each after those below it."""
        for part in self.parts:
            yield from part.nodes()
        yield self


@dataclass(frozen=True, slots=True)
class Number(Expression):
    """A constant."""

    number: float

    def value(self, below: Values, x: Mapping[str, Array]) -> Array:
        return np.asarray(self.number)


@dataclass(frozen=True, slots=True)
class Name(Expression):
    """A quantity that the formula depends on."""

    name: str

    @property
    def degree(self) -> float:
        return 1.0

    def value(self, below: Values, x: Mapping[str, Array]) -> Array:
        return np.asarray(x[self.name])


@dataclass(frozen=True, slots=True)
class Negative(Expression):
    """-operand."""

    operand: Expression

    @property
    def parts(self) -> tuple[Expression, ...]:
        return (self.operand,)

    @property
    def degree(self) -> float:
        return self.operand.degree

    def value(self, below: Values, x: Mapping[str, Array]) -> Array:
        return -below[0]

    def slopes(self, below: Values) -> Sequence[Array]:
        return (np.asarray(-1.0),)


@dataclass(frozen=True, slots=True)
class Operation(Expression):
    """left `sign` right, where the sign is +, -, *, / or **."""

    sign: str
    left: Expression
    right: Expression

    @property
    def parts(self) -> tuple[Expression, ...]:
        return self.left, self.right

    @property
    def degree(self) -> float:
        left, right = self.left.degree, self.right.degree
        match self.sign:
            case "+" | "-":
                return max(left, right)
            case "*":
                return left + right
            case "/" if right == 0.0:
                return left
        return 0.0 if left == right == 0.0 else np.inf

    def value(self, below: Values, x: Mapping[str, Array]) -> Array:
        a, b = below
        match self.sign:
            case "+":
                return a + b
            case "-":
                return a - b
            case "*":
                return a * b
            case "/":
                return a / b
        return np.asarray(a**b)

    def slopes(self, below: Values) -> Sequence[Array]:
        a, b = below
        match self.sign:
            case "+":
                return np.asarray(1.0), np.asarray(1.0)
            case "-":
                return np.asarray(1.0), np.asarray(-1.0)
            case "*":
                return b, a
            case "/":
                return 1.0 / b, -a / b**2
        return b * a ** (b - 1.0), a**b * np.log(a)

    def trouble(self, below: Values) -> str:
        a, b = below
        if self.sign == "/" and crosses_zero(b):
            return f"division by zero: the divisor is {span(b)}"
        if self.sign == "**":
            if np.any(a < 0.0) and not np.all(b == np.rint(b)):
                return f"a power with a fractional exponent needs a base of at least 0, it is {span(a)}"
            if np.any(b < 0.0) and crosses_zero(a):
                return f"division by zero: the base of a negative power is {span(a)}"
        return ""


@dataclass(frozen=True, slots=True)
class Call(Expression):
    """A function of arguments."""

    function: str
    arguments: tuple[Expression, ...]

    @property
    def parts(self) -> tuple[Expression, ...]:
        return self.arguments

    def value(self, below: Values, x: Mapping[str, Array]) -> Array:
        return FUNCTIONS[self.function].value(*below)

    def slopes(self, below: Values) -> Sequence[Array]:
        return FUNCTIONS[self.function].slopes(*below)

    def trouble(self, below: Values) -> str:
        reason = FUNCTIONS[self.function].trouble(*below)
        return f"{self.function} {reason}" if reason else ""
