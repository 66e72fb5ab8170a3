"""The page of a result that is not finished, as long as there is nothing to show of it."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from .document import bullets, document, remarked, section


def unfinished_page(
    title: str, command: str, facts: Sequence[str], remarks: Sequence[str] = ()
) -> str:
    """What a `tolevo <command>` has saved so far, in sentences."""
    words = f"This result of `tolevo {command}` is unfinished."
    body = (
        *remarked(remarks),
        section("Unfinished", f"<p>{escape(words)}</p>\n{bullets(facts)}"),
    )
    return document(title, "\n".join(body))
