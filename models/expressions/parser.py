"""From the text of a formula to its tree. Nothing is ever executed.

The grammar:

sum     = product {("+" | "-") product}
product = sign {("*" | "/") sign}
sign    = ("-" | "+") sign | power
power   = atom ["**" sign]
atom    = number | name | function "(" sum {"," sum} ")" | "(" sum ")"
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

from ...errors import nearest
from .functions import CONSTANTS, FUNCTIONS
from .tree import Call, Expression, Name, Negative, Number, Operation

LONGEST = 4000
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
    if len(text) > LONGEST:
        raise FormulaError(LONGEST + 1, f"a formula has at most {LONGEST} characters")
    parser = _Parser(_tokens(text))
    tree = parser.sum()
    if parser.now.kind != "end":
        raise FormulaError(parser.now.at, _unexpected(parser.now))
    if tree.depth > DEEPEST:
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


def _unexpected(token: _Token) -> str:
    if token.kind == "end":
        return "ends too early"
    return f"unexpected `{token.text}`: an operator or the end is expected here"


class _Parser:
    """Recursive descent over a list of tokens; `sum` parses a whole formula."""

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

    def _chain(self, read: Callable[[], Expression], *signs: str) -> Expression:
        expression, length = read(), 1
        while token := self._accepted(*signs):
            length += 1
            if length > DEEPEST:
                raise FormulaError(token.at, f"at most {DEEPEST} operations in a row")
            expression = Operation(token.at, token.text, expression, read())
        return expression

    def sum(self) -> Expression:
        return self._chain(self._product, "+", "-")

    def _product(self) -> Expression:
        return self._chain(self._sign, "*", "/")

    def _sign(self) -> Expression:
        self._level += 1
        if self._level > NESTED:
            raise FormulaError(self.now.at, f"is nested too deeply: at most {NESTED} levels")
        token = self._accepted("-", "+")
        if token is None:
            expression = self._power()
        else:
            operand = self._sign()
            expression = Negative(token.at, operand) if token.text == "-" else operand
        self._level -= 1
        return expression

    def _power(self) -> Expression:
        base = self._atom()
        token = self._accepted("**")
        return base if token is None else Operation(token.at, "**", base, self._sign())

    def _atom(self) -> Expression:
        token = self.now
        if self._accepted("("):
            expression = self.sum()
            self._close(token)
            return expression
        if token.kind not in ("number", "name"):
            problem = "ends too early" if token.kind == "end" else f"unexpected `{token.text}`"
            raise FormulaError(token.at, f"{problem}: a number, a name or ( is expected here")
        self._next += 1
        if token.kind == "name":
            return self._name_or_call(token)
        number = float(token.text)
        if not math.isfinite(number):
            raise FormulaError(token.at, f"{token.text} is too large")
        return Number(token.at, number)

    def _name_or_call(self, token: _Token) -> Expression:
        opening = self.now
        if self._accepted("("):
            if token.text not in FUNCTIONS:
                known = f"{nearest(token.text, FUNCTIONS)}; one of {', '.join(FUNCTIONS)}"
                raise FormulaError(token.at, f"`{token.text}` is not a function of formulas{known}")
            return self._call(token, opening)
        if token.text in FUNCTIONS:
            raise FormulaError(token.at, f"{token.text} is a function: write {token.text}(...)")
        if token.text in CONSTANTS:
            return Number(token.at, CONSTANTS[token.text])
        return Name(token.at, token.text)

    def _call(self, token: _Token, opening: _Token) -> Expression:
        arguments = [self.sum()]
        while self._accepted(","):
            arguments.append(self.sum())
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
