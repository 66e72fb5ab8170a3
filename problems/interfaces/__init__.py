"""The optional interfaces of a problem: what it may provide in addition to its outputs."""

from .accuracy import Accuracy
from .base import Interface, refuse_lost_members
from .checks import Checks
from .comparison import Comparison, Variant
from .configuration import Stored, Written
from .derivatives import Differentiable
from .documents import Documented
from .drawing import Drawing
from .effects import WithEffects
from .page import Page
from .proof import Provable

__all__ = [
    "Accuracy",
    "Checks",
    "Comparison",
    "Differentiable",
    "Documented",
    "Drawing",
    "Interface",
    "Page",
    "Provable",
    "Stored",
    "Variant",
    "WithEffects",
    "Written",
    "refuse_lost_members",
]
