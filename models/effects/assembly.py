"""Effects of adjusting and installing the chains of an assembly."""

from .effect import Inside


class AdjustmentBacklash(Inside):
    """An adjustment with play."""

    name = "adjustment_backlash"
    family = "assembly"
    cause = "The adjuster has play, and the adjusted part follows only beyond the dead band."
    formula = "dead band of the adjuster"
    mistaken_for = ("adjustment_gain",)
    reference = "Nordin and Gutman, Automatica 38, 2002"


class AdjustmentGain(Inside):
    """An adjustment that differs from the command."""

    name = "adjustment_gain"
    family = "assembly"
    cause = "An adjustment achieves only a fraction of what was commanded."
    formula = "achieved = (1 + e) commanded"
    mistaken_for = ("springback",)
    reference = "Mantripragada and Whitney, IEEE Trans. Robot. Autom. 15, 1999"
    inside_bounds = (-1.0, 1.0)
    inside_name = "adjustment_gain_error"


class ChainCoupling(Inside):
    """Installing a chain moves another."""

    name = "chain_coupling"
    family = "assembly"
    cause = "Installing the second chain moves the first, which was adjusted before."
    formula = "a fraction of the displacement of chain 2 is added to chain 1"
    mistaken_for = ("springback", "adjustment_gain")
    reference = "Mantripragada and Whitney, IEEE Trans. Robot. Autom. 15, 1999"
    inside_bounds = (-1.0, 1.0)


class Springback(Inside):
    """Adjustments that return."""

    name = "springback"
    family = "assembly"
    cause = "A fraction of the total adjustment returns after the last step."
    formula = "-a fraction of the total adjustment, after the last step"
    mistaken_for = ("adjustment_gain", "chain_coupling")
    reference = "Mantripragada and Whitney, IEEE Trans. Robot. Autom. 15, 1999"
    inside_bounds = (0.0, 1.0)
