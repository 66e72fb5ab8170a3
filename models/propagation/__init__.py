"""From the spread of the inputs to the spread of the output, for batches of designs."""

from .convolution import Convolution
from .moments import Moments
from .monte_carlo import MonteCarlo
from .sums import ClippedSum, Estimate, Propagated, Propagation, Term

__all__ = ["ClippedSum", "Convolution", "Estimate", "Moments", "MonteCarlo", "Propagated", "Propagation", "Term"]
