"""What a mutant is: each change by hand of a few lines, and that those of a module compile."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("tools.mutations", reason="the tools are not shipped")
pytestmark = pytest.mark.source_tree

from tools.mutations import mutations  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
TEXT = """\
def f(a: float = 2) -> float | None:
    if a < 0 and not done(a):
        return max(a, -b)
    return g[(a >= b)] * 3
"""
CHANGES = {
    ("value", "2", "(2 + 1)"), ("value", "2", "(2 - 1)"),
    ("guard", "a < 0", "True"), ("guard", "a < 0", "False"),
    ("value", "a < 0", "(a <= 0)"), ("value", "a < 0", "(a >= 0)"),
    ("value", "0", "(0 + 1)"), ("value", "0", "(0 - 1)"),
    ("guard", "done(a)", "True"), ("guard", "done(a)", "False"),
    ("value", "not done(a)", "(done(a))"),
    ("value", "a < 0 and not done(a)", "(a < 0 or not done(a))"),
    ("guard", "max(a, -b)", "(a)"), ("guard", "max(a, -b)", "(-b)"), ("value", "-b", "(b)"),
    ("guard", "a >= b", "((a >= b) | True)"), ("guard", "a >= b", "((a >= b) & False)"),
    ("value", "a >= b", "(a > b)"), ("value", "a >= b", "(a < b)"),
    ("value", "g[(a >= b)] * 3", "(g[a >= b] / 3)"),
    ("value", "3", "(3 + 1)"), ("value", "3", "(3 - 1)"),
}  # fmt: skip


def test_changes_of_a_function_by_hand() -> None:
    found = mutations(TEXT)
    assert {(one.kind, one.before, one.after) for one in found} == CHANGES
    assert len(found) == len(CHANGES)
    turned = next(one for one in found if one.after == "(a >= 0)")
    assert turned.applied(TEXT) == TEXT.replace("a < 0", "(a >= 0)")
    assert turned.lines == (2, 2)


def test_mutants_of_a_module_are_modules() -> None:
    text = (ROOT / "algorithms" / "exact" / "bounds.py").read_text(encoding="utf-8")
    found = mutations(text)
    assert sum(one.kind == "guard" for one in found) > 10
    for one in found:
        changed = one.applied(text)
        assert changed != text
        compile(changed, "mutant", "exec", dont_inherit=True)
