"""Installing a chain moves another."""

from ..inside import Inside


class ChainCoupling(Inside):
    """Installing a chain moves another."""

    name = "chain_coupling"
    family = "assembly"
    cause = "Installing the second chain moves the first, which was adjusted before."
    formula = "a fraction of the displacement of chain 2 is added to chain 1"
    mistaken_for = ("springback", "adjustment_gain")
    reference = "Mantripragada and Whitney, IEEE Trans. Robot. Autom. 15, 1999"
    inside_bounds = (-1.0, 1.0)
