"""The contract of a rule of choice."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..workflows.choice.rule import COST, ChoiceRule, Points
from ..workflows.choice.rules import RULES


def front(objectives: int) -> Points:
    """Points on a part of a sphere: a front with the best of each objective at one end."""
    angles = np.random.default_rng(3).uniform(0.05, 0.95, (60, objectives)) * np.pi / 2.0
    values = np.abs(np.cos(angles)) / np.linalg.norm(np.cos(angles), axis=1, keepdims=True)
    values = 2.0 - values
    names = (COST, *(f"error_{at}" for at in range(1, objectives)))
    weights = np.arange(1.0, objectives + 1.0)
    kept = values[:, 1] <= np.median(values[:, 1])
    return Points(values, names, values[:, 0], weights / weights.sum(), kept, 1.4)


class RuleContract:
    """What every `ChoiceRule` must keep, on fronts of two and three objectives."""

    rule_type: ClassVar[type[ChoiceRule]]

    def test_is_registered_and_says_what_it_chooses(self) -> None:
        assert RULES[RULES.name_of(self.rule_type)] is self.rule_type
        assert self.rule_type.meaning.strip()

    def test_chooses_a_row_of_the_front_or_none(self) -> None:
        for count in (2, 3):
            points = front(count)
            row = self.rule_type().row(points)
            assert row is None or 0 <= int(row) < len(points.objectives)

    def test_applies_to_two_or_to_three_objectives(self) -> None:
        assert any(self.rule_type().row(front(count)) is not None for count in (2, 3))

    def test_same_front_same_choice_and_the_front_stays(self) -> None:
        points = front(3)
        before = points.objectives.copy()
        assert self.rule_type().row(points) == self.rule_type().row(points)
        np.testing.assert_array_equal(points.objectives, before)

    def test_two_points_and_equal_points_are_no_fault(self) -> None:
        whole = front(2)
        for rows in ([0, 1], [0, 0, 0]):
            points = Points(whole.objectives[rows], whole.names, whole.objectives[rows, 0], whole.weights)
            row = self.rule_type().row(points)
            assert row is None or 0 <= int(row) < len(rows)
