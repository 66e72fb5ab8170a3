"""`[[reading]]`: an interpretation of a figure, to be tested by a study."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ..errors import nearest
from ..section import Section, shown
from ..workflows.study.records import Factor, Hypothesis, Level

BETTER = "better"
EXPECT = (BETTER, "worse")


def read_hypotheses(top: Section, factors: tuple[Factor, ...], responses: tuple[str, ...]) -> tuple[Hypothesis, ...]:
    """The interpretations, each of two levels that the study compares."""
    parsed = [_read_hypothesis(section, factors, responses) for section in top.items("reading")]
    return tuple(hypothesis for hypothesis in parsed if hypothesis is not None)


def _read_hypothesis(section: Section, factors: tuple[Factor, ...], responses: tuple[str, ...]) -> Hypothesis | None:
    figure, says = section.text("figure"), section.text("says")
    key = section.text("key", [factor.key for factor in factors])
    response = section.text("response", responses)
    expect = section.text("expect", EXPECT) or BETTER
    a, b = section.take("a"), section.take("b")
    section.finish()
    for name in ("figure", "says", "key", "response", "a", "b"):
        if name not in section:
            section.fault(name, "is missing")
    factor = next((candidate for candidate in factors if candidate.key == key), None)
    if factor is None or figure is None or says is None or response is None:
        return None
    levels = [_level(section, name, value, factor) for name, value in (("a", a), ("b", b))]
    if levels[0] is None or levels[1] is None:
        return None
    if levels[0] == levels[1]:
        section.fault("b", "is the same level as a")
    return Hypothesis(figure, says, factor.key, levels[0], levels[1], response, expect == BETTER)


def _level(section: Section, name: str, value: Any, factor: Factor) -> Level | None:
    """The level of the factor that is meant; a fault where the study has no such level."""
    for level in factor.grid():
        if level == value and not isinstance(value, bool):
            return level
    if name in section:
        known = [shown(level) for level in factor.grid()]
        section.fault(name, f"is not a level of {factor.key}: {', '.join(known)}{nearest(shown(value), known)}")
    return None


def written(hypotheses: tuple[Hypothesis, ...]) -> list[dict[str, Any]]:
    """The tables that state these interpretations."""
    tables = [asdict(hypothesis) for hypothesis in hypotheses]
    return [table | {"expect": EXPECT[0] if table.pop("better") else EXPECT[1]} for table in tables]
