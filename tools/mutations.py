"""Small changes of a module's text: what a test of it must notice.

A mutation replaces one span of the text. Two kinds: `guard`, where a condition, a mask or one side
of a minimum, maximum or clip is taken out of effect in either direction, and `value`, where an
operator, a comparison or a number is another one. Annotations, decorators and formatted strings
are left alone.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.Mod: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
ENDS = ("min", "max", "minimum", "maximum")
Positioned = ast.expr | ast.stmt


@dataclass(frozen=True, slots=True)
class Mutation:
    """The bytes from `start` to `end`, on `lines`, become `after`; `before` is their text."""

    kind: str
    start: int
    end: int
    lines: tuple[int, int]
    before: str
    after: str

    def applied(self, text: str) -> str:
        """The text with the change."""
        raw = text.encode()
        return (raw[: self.start] + self.after.encode() + raw[self.end :]).decode()


def mutations(text: str) -> list[Mutation]:
    """All mutations of a module, in the order of its text."""
    found = _Module(text).found
    found.sort(key=lambda one: (one.start, one.end, one.kind, one.after))
    return found


class _Module(ast.NodeVisitor):
    """Walks the tree and collects what can be changed."""

    def __init__(self, text: str) -> None:
        self.found: list[Mutation] = []
        self._raw = text.encode()
        self._starts = [0]
        for line in text.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line.encode()))
        self._guarded: set[int] = set()
        self.visit(ast.parse(text))

    def _put(self, kind: str, node: Positioned, after: str) -> None:
        last, column = node.end_lineno or node.lineno, node.end_col_offset or 0
        start = self._starts[node.lineno - 1] + node.col_offset
        end = self._starts[last - 1] + column
        before = self._raw[start:end].decode()
        self.found.append(Mutation(kind, start, end, (node.lineno, last), before, after))

    # ---------------------------------------------------------------- what is left alone

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Positions in formatted strings are not those of the text."""

    def visit_MatchValue(self, node: ast.MatchValue) -> None:
        """A pattern is no expression."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for one in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
            self.visit(one)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for one in node.body:
            self.visit(one)

    # ---------------------------------------------------------------- guards

    def _condition(self, node: ast.expr) -> None:
        for leaf in _leaves(node):
            self._guarded.add(id(leaf))
            self._put("guard", leaf, "True")
            self._put("guard", leaf, "False")

    def visit_If(self, node: ast.If) -> None:
        if ast.unparse(node.test) != "TYPE_CHECKING":
            self._condition(node.test)
            self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        if not isinstance(node.test, ast.Constant):
            self._condition(node.test)
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._condition(node.test)
        self.generic_visit(node)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for one in node.ifs:
            self._condition(one)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        if not self._guarded.intersection(id(leaf) for leaf in _leaves(node)):
            self._condition(node)
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        self._put("value", node, f"({ast.unparse(ast.BoolOp(other, node.values))})")
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        plain = not any(isinstance(one, ast.Starred) for one in node.args)
        if plain and name in ENDS and len(node.args) == 2 and not node.keywords:
            for one in node.args:
                self._put("guard", node, f"({ast.unparse(one)})")
        if plain and name == "clip" and len(node.args) == 3:
            self._put("guard", node, f"({ast.unparse(node.args[0])})")
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        if id(node) not in self._guarded:
            self._put("guard", node, f"(({ast.unparse(node)}) | True)")
            self._put("guard", node, f"(({ast.unparse(node)}) & False)")
        for at, own in enumerate(node.ops):
            for other in COMPARISONS[type(own)]:
                ops = [*node.ops[:at], other(), *node.ops[at + 1 :]]
                changed = ast.Compare(node.left, ops, node.comparators)
                self._put("value", node, f"({ast.unparse(changed)})")
        self.generic_visit(node)

    # ---------------------------------------------------------------- values

    def visit_BinOp(self, node: ast.BinOp) -> None:
        other = ARITHMETIC.get(type(node.op))
        if other is not None:
            changed = ast.BinOp(node.left, other(), node.right)
            self._put("value", node, f"({ast.unparse(changed)})")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        other = ARITHMETIC.get(type(node.op))
        if other is not None:
            self._put("value", node, ast.unparse(ast.AugAssign(node.target, other(), node.value)))
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub | ast.Not | ast.Invert):
            self._put("value", node, f"({ast.unparse(node.operand)})")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, bool):
            self._put("value", node, str(not node.value))
        elif isinstance(node.value, int | float):
            self._put("value", node, f"({node.value!r} + 1)")
            self._put("value", node, f"({node.value!r} - 1)")

    def visit_Break(self, node: ast.Break) -> None:
        self._put("value", node, "continue")

    def visit_Continue(self, node: ast.Continue) -> None:
        self._put("value", node, "break")


def _leaves(node: ast.expr) -> Iterator[ast.expr]:
    """What a condition is made of by `and`, `or` and `not`."""
    if isinstance(node, ast.BoolOp):
        for one in node.values:
            yield from _leaves(one)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield from _leaves(node.operand)
    else:
        yield node
