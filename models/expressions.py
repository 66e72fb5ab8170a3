"""Formulas: parsed to an expression tree, evaluated and differentiated over batches."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from types import MappingProxyType
from typing import Any

import numpy as np

from ..errors import nearest
from ..section import Array

__all__ = [
    "CONSTANTS",
    "FUNCTIONS",
    "Formula",
    "FormulaError",
    "Intermediate",
    "Let",
    "UnsettledError",
    "domain_margin",
]

# The functions that a formula may call: value, slopes, and where they are not defined.


def _no_domain_fault(*_: Array) -> str:
    return ""


@dataclass(frozen=True, slots=True)
class Function:
    """A function of `least` to `most` arguments.

    `value` and `slopes` (one partial derivative per argument) are vectorised. `trouble` returns
    why the function is not defined or jumps somewhere on a connected set that the arguments are
    sampled from; empty where it is defined and continuous.
    """

    value: Callable[..., Array]
    slopes: Callable[..., tuple[Array, ...]]
    trouble: Callable[..., str] = _no_domain_fault
    least: int = 1
    most: int = 1


def crosses_zero(x: Array) -> bool:
    """Whether values of a continuous function show that it is zero somewhere between them."""
    return bool(np.min(x) <= 0.0 <= np.max(x))


def span(x: Array) -> str:
    """The values as text: one number, or from the least to the largest."""
    low, high = float(np.min(x)), float(np.max(x))
    return f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"


def _domain(contains: Callable[[Array], Any], requirement: str) -> Callable[[Array], str]:
    return lambda x: "" if np.all(contains(x)) else f"{requirement}, its argument is {span(x)}"


_within_one = _domain(lambda x: np.abs(x) <= 1.0, "is defined on [-1, 1]")
_not_negative = _domain(lambda x: x >= 0.0, "needs a value of at least 0")
_positive = _domain(lambda x: x > 0.0, "needs a value above 0")


def _check_tangent_pole(x: Array) -> str:
    """A pole of the tangent lies between two samples in different periods."""
    period = np.floor(np.asarray(x) / np.pi + 0.5)
    return "" if np.all(period == np.ravel(period)[0]) else f"has a pole within {span(x)} rad"


def _check_arctangent_cut(y: Array, x: Array) -> str:
    """atan2 jumps by 2 pi where y changes its sign at negative x."""
    y, x = np.broadcast_arrays(y, x)
    y_left = y[x <= 0.0]
    jumps = y_left.size > 0 and crosses_zero(y_left)
    return "jumps by 2 pi: its first argument crosses 0 while the second is negative" if jumps else ""


def _of_all(extremum: Callable[..., Array]) -> Callable[..., Array]:
    return lambda *x: reduce(extremum, x)


def _extremum_slopes(before: Callable[..., Any], not_after: Callable[..., Any]) -> Callable[..., tuple[Array, ...]]:
    """Slope 1 for the first argument that is the extremum, 0 for the others."""

    def slope(at: int, x: tuple[Array, ...]) -> Array:
        own = (before(x[at], other) if k < at else not_after(x[at], other) for k, other in enumerate(x) if k != at)
        return reduce(np.multiply, own, np.asarray(1.0))

    return lambda *x: tuple(slope(at, x) for at in range(len(x)))


FUNCTIONS: Mapping[str, Function] = MappingProxyType(
    {
        "sin": Function(np.sin, lambda x: (np.cos(x),)),
        "cos": Function(np.cos, lambda x: (-np.sin(x),)),
        "tan": Function(np.tan, lambda x: (1.0 / np.cos(x) ** 2,), _check_tangent_pole),
        "asin": Function(np.arcsin, lambda x: (1.0 / np.sqrt(1.0 - x * x),), _within_one),
        "acos": Function(np.arccos, lambda x: (-1.0 / np.sqrt(1.0 - x * x),), _within_one),
        "atan": Function(np.arctan, lambda x: (1.0 / (1.0 + x * x),)),
        "atan2": Function(
            np.arctan2, lambda y, x: (x / (x * x + y * y), -y / (x * x + y * y)), _check_arctangent_cut, least=2, most=2
        ),
        "sqrt": Function(np.sqrt, lambda x: (0.5 / np.sqrt(x),), _not_negative),
        "exp": Function(np.exp, lambda x: (np.exp(x),)),
        "log": Function(np.log, lambda x: (1.0 / x,), _positive),
        "abs": Function(np.abs, lambda x: (np.sign(x),)),
        "min": Function(_of_all(np.minimum), _extremum_slopes(np.less, np.less_equal), least=2, most=16),
        "max": Function(_of_all(np.maximum), _extremum_slopes(np.greater, np.greater_equal), least=2, most=16),
    }
)
KINKED = ("abs", "min", "max")
"""Functions whose slopes jump somewhere."""
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": float(np.pi)})


# The nodes of an expression tree, each with its value, its slopes and its domain.


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

    def degree(self, below: Sequence[float]) -> float:
        """Degree as a polynomial of the names from those of the parts, inf where it may be none."""
        return np.inf if any(below) else 0.0

    def nodes(self) -> Iterator[Expression]:
        """Every node, each after those below it."""
        waiting: list[Expression] = [self]
        order: list[Expression] = []
        while waiting:
            order.append(node := waiting.pop())
            waiting += node.parts
        return reversed(order)


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

    def degree(self, below: Sequence[float]) -> float:
        return 1.0

    def value(self, below: Values, x: Mapping[str, Array]) -> Array:
        value: Any = x[self.name]
        return np.asarray(value) if isinstance(value, int | float) else value


@dataclass(frozen=True, slots=True)
class Negative(Expression):
    """-operand."""

    operand: Expression

    @property
    def parts(self) -> tuple[Expression, ...]:
        return (self.operand,)

    def degree(self, below: Sequence[float]) -> float:
        return below[0]

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

    def degree(self, below: Sequence[float]) -> float:
        left, right = below
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
        return a**b

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


# From the text of a formula to its tree. Nothing is ever executed.
#
# The grammar:
#
# sum     = product {("+" | "-") product}
# product = sign {("*" | "/") sign}
# sign    = ("-" | "+") sign | power
# power   = atom ["**" sign]
# atom    = number | name | function "(" sum {"," sum} ")" | "(" sum ")"


MAX_FORMULA_CHARACTERS = 4000
"""Characters of a formula."""
NESTED = 60
"""Levels of parentheses, signs and powers within each other."""
DEEPEST = 200
"""Nodes of the tree on its longest path (a sum of 200 terms)."""
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<sign>\*\*|[-+*/(),])|(?P<end>$)|(?P<other>\S))",
    re.ASCII,
)
_REMEDIES = {
    "^": "write a power as **",
    **dict.fromkeys("\u2212\u2013\u2014", "write minus as -"),  # as a text program sets it, or a dash
    **dict.fromkeys("\u00d7\u00b7\u22c5", "write times as *"),
    "\u00f7": "write a division as /",
    ".": "attributes are not part of a formula",
    "'": "text is not part of a formula",
    '"': "text is not part of a formula",
    "=": "a formula is the right-hand side alone",
    "[": "indices are not part of a formula",
}


class FormulaError(ValueError):
    """A text that is not a formula: the column (from 1) and what is wrong there."""

    def __init__(self, column: int, message: str) -> None:
        self.column = column
        super().__init__(f"column {column}: {message}")


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    at: int


def parse(text: str) -> Expression:
    """The tree of a formula. Raises FormulaError."""
    if len(text) > MAX_FORMULA_CHARACTERS:
        raise FormulaError(MAX_FORMULA_CHARACTERS + 1, f"a formula has at most {MAX_FORMULA_CHARACTERS} characters")
    parser = _Parser(_tokens(text))
    tree = parser.chain()
    if parser.now.kind != "end":
        raise FormulaError(parser.now.at, _unexpected_token(parser.now))
    depth: int = _fold_tree(tree, lambda _, below: 1 + max(below, default=0))
    if depth > DEEPEST:
        raise FormulaError(1, f"a formula has at most {DEEPEST} operations in a row")
    return tree


def _tokens(text: str) -> list[_Token]:
    tokens: list[_Token] = []
    position = 0
    while not tokens or tokens[-1].kind != "end":
        match = _TOKEN.match(text, position)
        assert match is not None  # "other" matches anything else
        kind = str(match.lastgroup)
        token = _Token(kind, match[kind], match.start(kind) + 1)
        if kind == "other":
            remedy = _REMEDIES.get(token.text, "it is not part of a formula")
            raise FormulaError(token.at, f"unexpected `{token.text}`: {remedy}")
        tokens.append(token)
        position = match.end()
    return tokens


def _unexpected_token(token: _Token) -> str:
    if token.kind == "end":
        return "ends too early"
    return f"unexpected `{token.text}`: an operator or the end is expected here"


_BINDING = {"+": 1, "-": 1, "*": 2, "/": 2}
"""How tightly an operator between two operands binds; a sign and a power belong to an operand."""


class _Parser:
    """Precedence climbing over a list of tokens; `chain` parses a whole formula."""

    def __init__(self, tokens: list[_Token]) -> None:
        self._tokens = tokens
        self._next = 0
        self._level = 0

    @property
    def now(self) -> _Token:
        """The next token."""
        return self._tokens[self._next]

    def _accepted(self, *signs: str) -> _Token | None:
        """The next token, which is consumed, if it is one of `signs`; else None."""
        token = self.now
        if token.kind != "sign" or token.text not in signs:
            return None
        self._next += 1
        return token

    def chain(self, loosest: int = 1) -> Expression:
        """Operands between which operators stand that bind at least as tightly as `loosest`."""
        expression = self._operand()
        lengths = dict.fromkeys(_BINDING.values(), 1)
        while token := self._accepted(*(sign for sign, binding in _BINDING.items() if binding >= loosest)):
            binding = _BINDING[token.text]
            lengths = {own: lengths[own] + (own == binding) if own <= binding else 1 for own in lengths}
            if lengths[binding] > DEEPEST:
                raise FormulaError(token.at, f"at most {DEEPEST} operations in a row")
            expression = Operation(token.at, token.text, expression, self.chain(binding + 1))
        return expression

    def _operand(self) -> Expression:
        """A number, name, call or parenthesis, with its signs and its power: -a**b is -(a**b)."""
        self._level += 1
        token = self._tokens[self._next]
        if self._level > NESTED:
            raise FormulaError(token.at, f"is nested too deeply: at most {NESTED} levels")
        expression: Expression
        if self._accepted("-", "+"):
            operand = self._operand()
            expression = Negative(token.at, operand) if token.text == "-" else operand
        else:
            if self._accepted("("):
                expression = self.chain()
                self._close(token)
            elif token.kind == "name":
                expression = self._name_or_call(token)
            else:
                expression = self._number(token)
            if power := self._accepted("**"):
                expression = Operation(power.at, "**", expression, self._operand())
        self._level -= 1
        return expression

    def _number(self, token: _Token) -> Expression:
        if token.kind != "number":
            problem = "ends too early" if token.kind == "end" else f"unexpected `{token.text}`"
            raise FormulaError(token.at, f"{problem}: a number, a name or ( is expected here")
        self._next += 1
        number = float(token.text)
        if not math.isfinite(number):
            raise FormulaError(token.at, f"{token.text} is too large")
        return Number(token.at, number)

    def _name_or_call(self, token: _Token) -> Expression:
        self._next += 1
        opening = self._tokens[self._next]
        if not self._accepted("("):
            if token.text in FUNCTIONS:
                raise FormulaError(token.at, f"{token.text} is a function: write {token.text}(...)")
            if token.text in CONSTANTS:
                return Number(token.at, CONSTANTS[token.text])
            return Name(token.at, token.text)
        if token.text not in FUNCTIONS:
            known = f"{nearest(token.text, FUNCTIONS)}; one of {', '.join(FUNCTIONS)}"
            raise FormulaError(token.at, f"`{token.text}` is not a function of formulas{known}")
        arguments = [self.chain()]
        while self._accepted(","):
            arguments.append(self.chain())
        self._close(opening)
        kind = FUNCTIONS[token.text]
        if not kind.least <= len(arguments) <= kind.most:
            count = str(kind.least) if kind.least == kind.most else f"{kind.least} to {kind.most}"
            raise FormulaError(token.at, f"{token.text} takes {count} arguments, got {len(arguments)}")
        return Call(token.at, token.text, tuple(arguments))

    def _close(self, opening: _Token) -> None:
        if not self._accepted(")"):
            if self.now.kind == "end":
                raise FormulaError(opening.at, "this parenthesis is never closed")
            raise FormulaError(self.now.at, f"unexpected `{self.now.text}`: ) is expected here")


# A formula: its text and its tree, evaluated over whole batches.


Slopes = dict[str, Array]
"""Partial derivatives by the name of a quantity."""


class UnsettledError(ValueError):
    """Intermediate quantities that have no value at the nominal sizes: the place of each, and why."""

    def __init__(self, *reasons: tuple[str, str]) -> None:
        self.reasons = reasons
        super().__init__("; ".join(f"{place} {why}" for place, why in reasons))


class Intermediate(ABC):
    """Quantities between the parts and a formula, each with a name that formulas can use.

    Its methods take all quantities that it depends
    on, those that other intermediate quantities define included, and but for `values` also those that
    it defines; arrays broadcast.
    """

    assembles: bool = False
    """Whether a unit without a value of it is one that cannot be assembled, as designs may have some."""
    inner: tuple[Intermediate, ...] = ()
    """Quantities that it computes by itself, where they depend on those that it defines."""

    @property
    @abstractmethod
    def place(self) -> str:
        """Where it stands in the configuration."""

    def settled(self, nominals: Mapping[str, Array], middle: Mapping[str, Array]) -> Intermediate:
        """The same at known nominals and mid-limits. Raises UnsettledError where it has no value there."""
        return self

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """The quantities that it defines."""

    @property
    @abstractmethod
    def inputs(self) -> Mapping[str, int]:
        """The quantities that it depends on, as keys."""

    @property
    @abstractmethod
    def kinked(self) -> bool:
        """Whether its slopes jump somewhere."""

    @abstractmethod
    def degree(self, of: Mapping[str, float]) -> float:
        """Degree as a polynomial where its inputs have the degrees `of` (1 where none is stated)."""

    @abstractmethod
    def values(self, x: Mapping[str, Array]) -> dict[str, Array]:
        """Each quantity that it defines; NaN or infinite where it has no value."""

    @abstractmethod
    def slopes(self, x: Mapping[str, Array]) -> dict[str, Slopes]:
        """Partial derivatives of each quantity that it defines by the inputs."""

    @abstractmethod
    def trouble(self, x: Mapping[str, Array]) -> str:
        """Why a quantity has no value at some of the points `x` (m,), empty where all have one."""

    @abstractmethod
    def margin(self, x: Mapping[str, Array], middle: Mapping[str, Array]) -> Array:
        """As `domain_margin`."""


@dataclass(frozen=True)
class Formula:
    """An expression in named quantities, parsed and never executed.

    It may hold + - * / **, parentheses, numbers, pi, names and the functions of `FUNCTIONS`. Names
    may be those of the intermediate quantities `given`, each of which stands after those that it
    depends on; only those that the formula needs are kept. Raises FormulaError (a ValueError) with
    the column where the text is something else.
    """

    text: str
    given: tuple[Intermediate, ...] = ()
    tree: Expression = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "tree", parse(self.text))
        needed: list[Intermediate] = []
        wanted = set(self.written)
        for step in reversed(self.given):
            if wanted.intersection(step.names):
                needed.insert(0, step)
                wanted.update(step.inputs)
        object.__setattr__(self, "given", tuple(needed))

    @cached_property
    def written(self) -> dict[str, int]:
        """The names in the text, each with the column of its first use."""
        positions: dict[str, int] = {}
        for node in self.tree.nodes():
            if isinstance(node, Name):
                positions[node.name] = min(node.at, positions.get(node.name, node.at))
        return positions

    @cached_property
    def names(self) -> dict[str, int]:
        """The quantities that the formula depends on, through intermediate ones as well, each with
        the column of its first use.
        """
        positions = dict(self.written)
        for step in reversed(self.given):
            column = min(positions.pop(name) for name in step.names if name in positions)
            for name in step.inputs:
                positions[name] = min(column, positions.get(name, column))
        return positions

    @property
    def kinked(self) -> bool:
        """Whether it calls a function that has a kink."""
        calls = (node.function for node in self.tree.nodes() if isinstance(node, Call))
        return any(function in KINKED for function in calls) or any(step.kinked for step in self.given)

    @property
    def assembles(self) -> bool:
        """Whether units without a value are units that cannot be assembled."""
        return any(step.assembles for step in self.given)

    @property
    def linear(self) -> bool:
        """Whether it is linear in its names as written: simplifications do not count."""
        return self.degree({}) <= 1.0

    def degree(self, of: Mapping[str, float]) -> float:
        """Degree as a polynomial where the names have the degrees `of` (1 where none is stated)."""
        degrees = dict(of)
        for step in self.given:
            degrees |= dict.fromkeys(step.names, step.degree(degrees))
        degree: float = _fold_tree(
            self.tree, lambda node, below: degrees.get(node.name, 1.0) if isinstance(node, Name) else node.degree(below)
        )
        return degree

    def value(self, x: Mapping[str, Array]) -> Array:
        """The value at quantities that broadcast; NaN or infinite where it is not defined."""
        with np.errstate(all="ignore"):
            x = self.completed(x)
            values: list[Array] = []
            for node, parts in self._steps:
                first = len(values) - parts
                values[first:] = [node.value(values[first:], x)]
        return values[0]

    @cached_property
    def _steps(self) -> tuple[tuple[Expression, int], ...]:
        """Every node after those below it, with the number of its parts: trees are deep."""
        return tuple((node, len(node.parts)) for node in self.tree.nodes())

    def completed(self, x: Mapping[str, Array]) -> Mapping[str, Array]:
        """The quantities with the intermediate ones that follow from them."""
        for step in self.given:
            x = {**x, **step.values(x)}
        return x

    def gradient(self, x: Mapping[str, Array], by: Container[str] | None = None) -> Slopes:
        """Partial derivatives by name, exact to rounding (forward mode), at one or many points.

        Those by the names `by` alone where these are stated.
        """
        value, slopes = self.dual(x, by)
        return {name: np.broadcast_to(slope, value.shape) for name, slope in slopes.items()}

    def dual(self, x: Mapping[str, Array], by: Container[str] | None = None) -> tuple[Array, Slopes]:
        """The value, and the partial derivatives as `gradient` gives them; all of them broadcast."""
        inner: dict[str, Slopes] = {}
        with np.errstate(all="ignore"):
            for step in self.given:
                x = {**x, **step.values(x)}
                inner |= {name: _chained(slopes, inner, by) for name, slopes in step.slopes(x).items()}
            value, slopes = _fold_tree(self.tree, lambda node, below: _dual(node, below, x, inner, by))
            return value, _chained(slopes, inner, by)

    def settled(self, nominals: Mapping[str, Array], middle: Mapping[str, Array]) -> Formula:
        """The same with intermediate quantities at known nominals and mid-limits.

        Raises UnsettledError with each of them that has no value there, but for those that follow from another.
        """
        steps: list[Intermediate] = []
        reasons: list[tuple[str, str]] = []
        unknown: set[str] = set()
        for step in self.given:
            try:
                if unknown.isdisjoint(step.inputs):
                    steps.append(step.settled(nominals, middle))
                    nominals, middle = ({**x, **steps[-1].values(x)} for x in (nominals, middle))
                    continue
            except UnsettledError as error:
                reasons += error.reasons
            unknown.update(step.names)
        if reasons:
            raise UnsettledError(*reasons)
        return replace(self, given=tuple(steps))

    def trouble(self, x: Mapping[str, Array]) -> str:
        """Where and why the formula has no value, empty where it has one everywhere.

        The quantities (m,) sample a connected set: between two samples of different sign a divisor
        is zero somewhere, even if no sample hits it.
        """
        with np.errstate(all="ignore"):
            for step in self.given:
                x = {**x, **step.values(x)}
                if why := step.trouble(x):
                    return f"{step.place}: {why}"
            found: str = _fold_tree(self.tree, lambda node, below: _value_and_fault(node, below, x))[1]
            return found


def _chained(slopes: Slopes, inner: Mapping[str, Slopes], by: Container[str] | None) -> Slopes:
    """Derivatives by the quantities that intermediate ones depend on, from those by the latter."""
    total: Slopes = {}
    for name, slope in slopes.items():
        parts = inner.get(name, {name: np.asarray(1.0)} if by is None or name in by else {})
        for origin, part in parts.items():
            total[origin] = total.get(origin, np.asarray(0.0)) + slope * part
    return total


@dataclass(frozen=True)
class Let(Intermediate):
    """A quantity with a name and a formula of its own, such as `[[let]]` states it."""

    name: str
    formula: Formula
    place: str = "let"

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name,)

    @property
    def inputs(self) -> Mapping[str, int]:
        return self.formula.names

    @property
    def kinked(self) -> bool:
        return self.formula.kinked

    def degree(self, of: Mapping[str, float]) -> float:
        return self.formula.degree(of)

    def values(self, x: Mapping[str, Array]) -> dict[str, Array]:
        return {self.name: self.formula.value(x)}

    def slopes(self, x: Mapping[str, Array]) -> dict[str, Slopes]:
        return {self.name: self.formula.dual(x)[1]}

    def trouble(self, x: Mapping[str, Array]) -> str:
        return self.formula.trouble(x)

    def margin(self, x: Mapping[str, Array], middle: Mapping[str, Array]) -> Array:
        return domain_margin(self.formula, x, middle)


def _fold_tree(tree: Expression, of: Callable[[Expression, list[Any]], Any]) -> Any:
    """What `of(node, results of its parts)` gives for the root; each node after those below it."""
    results: list[Any] = []
    for node in tree.nodes():
        first = len(results) - len(node.parts)
        below = results[first:]
        results[first:] = [of(node, below)]
    return results[0]


def _dual(
    node: Expression,
    below: list[tuple[Array, Slopes]],
    x: Mapping[str, Array],
    inner: Mapping[str, Slopes],
    by: Container[str] | None,
) -> tuple[Array, Slopes]:
    """Value and partial derivatives of a node; an omitted name has the derivative 0."""
    if isinstance(node, Name):
        counts = by is None or node.name in by or node.name in inner
        return node.value((), x), {node.name: np.asarray(1.0)} if counts else {}
    values = [value for value, _ in below]
    derivatives: Slopes = {}
    if any(slopes for _, slopes in below):
        for outer, (_, slopes) in zip(node.slopes(values), below, strict=True):
            for name, slope in slopes.items():
                derivatives[name] = derivatives.get(name, np.asarray(0.0)) + outer * slope
    return node.value(values, x), derivatives


def _value_and_fault(node: Expression, below: list[tuple[Array, str]], x: Mapping[str, Array]) -> tuple[Array, str]:
    """Value of a node, and why it or a node below it has no value; empty where all have one."""
    values = [value for value, _ in below]
    value = node.value(values, x)
    if first := next((reason for _, reason in below if reason), ""):
        return value, first
    reason = node.trouble(values)
    if not reason and not np.all(np.isfinite(value)):
        reason = "the value is not finite"
    return value, f"column {node.at}: {reason}" if reason else ""


# Distance of a formula from the edge of its domain.
#
# The margin of a function is the distance of its argument from the edge of its domain, above 0
# inside:
#
#     asin, acos   1 - |x|             sqrt, log   x
#     a/b          b, by its sign at the middle
#     a**b         a for a fractional b, a by its sign at the middle for a negative b
#     tan          distance from the nearest pole of the period of the middle
#     atan2        distance from the half line on which it jumps, by the side of the middle


ValuesWithDomain = list[Array]


def domain_margin(formula: Formula, x: Mapping[str, Array], middle: Mapping[str, Array]) -> Array:
    """The least margin at quantities `x` over all functions, each relative to that at the `middle`.

    1 at the middle, 0 at the edge of the domain, below 0 outside of it; infinite where
    the formula has a value everywhere. `x` broadcasts to the shape of the result, `middle` holds
    single numbers.
    """
    margin = np.asarray(np.inf)
    with np.errstate(all="ignore"):
        for step in formula.given:
            x, middle = {**x, **step.values(x)}, {**middle, **step.values(middle)}
            margin = np.fmin(margin, step.margin(x, middle))
        own: Array = _fold_tree(formula.tree, lambda node, below: _least_margin(node, below, x, middle))[2]
    return np.asarray(np.fmin(margin, own))


def _least_margin(
    node: Expression, below: list[tuple[Array, Array, Array]], x: Mapping[str, Array], middle: Mapping[str, Array]
) -> tuple[Array, Array, Array]:
    """Value and value at the middle of a node, and the least margin at or below it."""
    values, centres = [value for value, _, _ in below], [centre for _, centre, _ in below]
    margin = reduce(np.fmin, (margin for _, _, margin in below), np.asarray(np.inf))
    distance, at_middle = _distance(node, values, centres), _distance(node, centres, centres)
    if distance is not None and at_middle is not None:
        margin = np.fmin(margin, distance / np.where(at_middle > 0.0, at_middle, np.nan))
    return node.value(values, x), node.value(centres, middle), margin


def _distance(node: Expression, values: ValuesWithDomain, centres: ValuesWithDomain) -> Array | None:
    """Distance from the edge of the domain of a node; None where it is defined everywhere."""
    if isinstance(node, Operation):
        return _distance_of_operation(node.sign, values, centres)
    if not isinstance(node, Call):
        return None
    match node.function:
        case "asin" | "acos":
            return np.asarray(1.0 - np.abs(values[0]))
        case "sqrt" | "log":
            return values[0]
        case "tan":
            period = np.pi * np.floor(centres[0] / np.pi + 0.5)
            return np.asarray(0.5 * np.pi - np.abs(values[0] - period))
        case "atan2":
            y, x = np.broadcast_arrays(*values)
            return np.where(x > 0.0, np.hypot(y, x), y * np.where(centres[0] < 0.0, -1.0, 1.0))
    return None


def _distance_of_operation(sign: str, values: ValuesWithDomain, centres: ValuesWithDomain) -> Array | None:
    left, right = values
    if sign == "/":
        return np.asarray(right * np.sign(centres[1]))
    if sign == "**" and not np.all(centres[1] == np.rint(centres[1])):
        return left
    if sign == "**" and np.any(centres[1] < 0.0):
        return np.asarray(left * np.sign(centres[0]))
    return None
