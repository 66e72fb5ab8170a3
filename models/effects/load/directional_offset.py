"""Friction that differs by direction."""

from __future__ import annotations

import numpy as np

from ...measurable import Role
from ..effect import Measurements, Target, Values, kind_of
from ..shapes import Columns, Shape, Weight


class DirectionalOffset(Shape):
    """Dry friction with different magnitudes in + and - motion.

    Where the zero of an output is free (angles) the half sum of both is friction and the half
    difference is that zero: the effect is then identical with `friction_hysteresis`, and does not
    apply. Reference: Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994,
    section 2.1 (friction that depends on the direction).
    """

    name = "directional_offset"
    family = "load"
    cause = "Friction of seals, flanks or preload is greater in one direction than in the other."
    formula = "a (d > 0) - b (d < 0)"
    needs = (Role.DIRECTION,)
    mistaken_for = ("friction_hysteresis", "gauge_bias")
    reference = "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994"

    def own_applies(self, target: Target) -> bool:
        angles = all(kind_of(output.unit) == "angle" for output in target.outputs)
        return not angles and not target.population and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        return "the zero of an angle is free, so that the effect is identical with friction_hysteresis"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("forward", "a, friction in + motion"), Weight("backward", "b, friction in - motion"))

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        direction = np.asarray(measurements[Role.DIRECTION], dtype=float)
        return {"forward": lambda: np.maximum(direction, 0.0), "backward": lambda: np.minimum(direction, 0.0)}
