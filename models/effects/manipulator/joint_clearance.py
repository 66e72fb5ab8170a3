"""Joints with play."""

from ...measurable import Role
from ..inside import Inside


class JointClearance(Inside):
    """Joints with play."""

    name = "joint_clearance"
    family = "manipulator"
    cause = "The joints have play, and the weight of the platform determines the side of contact."
    formula = "each rod longer by c in tension, shorter by c in compression"
    needs = (Role.POSITION,)
    mistaken_for = ("gravity_sag", "arm_length_error")
    reference = "Innocenti, J. Mech. Des. 124, 2002"
