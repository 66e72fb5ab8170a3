"""From the spread of the inputs to the spread of the output, for batches of designs."""

from .convolution import Convolution
from .method import Propagation
from .moments import Moments
from .monte_carlo import MonteCarlo
from .result import Estimate, Propagated
from .sums import ClippedSum, Term

__all__ = ["ClippedSum", "Convolution", "Estimate", "Moments", "MonteCarlo", "Propagated", "Propagation", "Term"]
