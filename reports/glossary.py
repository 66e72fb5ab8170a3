"""One sentence for every term that the pages use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

TERMS: Mapping[str, str] = {
    "front": "The allocations to which no other is superior in every objective at once.",
    "bound": "A cost that no allocation of equal or better other objectives can be below: proven, not searched.",
    "gap": "By how much the cost of a point lies above its proven bound.",
    "knee": "The point of the front that lies farthest from the line between its ends.",
    "share": (
        "t dy/dt of a tolerance t in a requirement y, over its sum for all tolerances; of a root "
        "sum of squares that is the fraction of the variance."
    ),
    "price": "What one unit less of a requirement (of a yield one more) adds to the least cost.",
    "multiplier": "The price of a requirement at a proven optimum (Karush, Kuhn and Tucker).",
    "relaxed": "Compared with a front whose broken limits are as loose as those of the reference.",
    "hypervolume": ("The fraction of the problem's box, from ideal to nadir, that the front dominates."),
    "rounding loss": "What changes where every value is rounded to what can be ordered.",
    "feasible": "Whether all limits of the run are kept.",
    "margin": "The distance of a value from its nearest limit, negative where it is broken.",
    "yield": "The fraction of units that keep the limits of the requirement.",
    "Cpk": "The distance of the mean from the nearer limit, in three standard deviations.",
    "coverage": "The fraction of units that a quantile is stated for.",
    "reference": "An allocation of a document or of another method, by the same model.",
    "half-width": "A tolerance t of the zone from mid - t to mid + t.",
    "held-out": "Of measurements that the fit did not use.",
    "verdict": "The result of comparing model and measurement, or a claim and its recomputation.",
    "interaction": "How much the effect of one setting depends on another.",
}
"""By term, in the order in which the list shows them."""


def link(text: str) -> str:
    """A heading, linked to the explanation of the first term that it contains."""
    lowered = text.lower()
    for term in TERMS:
        if term.lower() in lowered:
            return f'<a href="#{anchor(term)}">{escape(text)}</a>'
    return escape(text)


def anchor(term: str) -> str:
    """The identifier of an explanation."""
    return "term-" + term.lower().replace(" ", "-")


def terms(body: str) -> str:
    """The explanations of the terms that a page links to, or names in its texts."""
    used: Sequence[str] = [term for term in TERMS if f'"#{anchor(term)}"' in body or f" {term}" in body]
    if not used:
        return ""
    rows = "\n".join(f'<dt id="{anchor(term)}">{escape(term)}</dt><dd>{escape(TERMS[term])}</dd>' for term in used)
    return f'<section>\n<h2>Terms</h2>\n<dl class="terms">\n{rows}\n</dl>\n</section>'
