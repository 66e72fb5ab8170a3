"""Claims as records: what a document prints, and how it is recomputed."""

from __future__ import annotations

from dataclasses import dataclass

from ...claim_records import Document
from .recipes.recipe import Recipe

RELATIONS = ("equal", "at_least", "at_most", "above", "below", "within")
"""How a computed value stands to the printed one where the claim holds; `within` [low, high]."""


@dataclass(frozen=True, slots=True)
class Interpretation:
    """A recipe for a claim; `states` is how it interprets the document (empty: literally)."""

    recipe: Recipe
    states: str = ""


@dataclass(frozen=True, slots=True)
class Claim:
    """A printed figure or statement.

    `printed` holds one number, as many as the interpretations compute, or the two ends of a range.
    Where data are lost, `lost` names them and there are no interpretations. `why` adds what the
    record knows of the cause. All values are in `unit`.
    """

    id: str
    place: str
    quantity: str
    unit: str
    printed: tuple[float, ...] = ()
    printed_as: str = ""
    """As the document writes it."""
    relation: str = "equal"
    tolerance: float = 0.0
    tolerance_reason: str = ""
    ambiguous: str = ""
    lost: str = ""
    why: str = ""
    interpretations: tuple[Interpretation, ...] = ()


@dataclass(frozen=True, slots=True)
class ClaimsFile:
    """The claims of one document; `seed` seeds all that is drawn for them."""

    document: Document
    seed: int
    claims: tuple[Claim, ...]
