"""The page of a result that is not finished and has no front yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from types import MappingProxyType

import pandas as pd

from .document import bullets, document, remarked, section
from .tables import table


def unfinished_page(
    title: str,
    command: str,
    facts: Sequence[str],
    remarks: Sequence[str] = (),
    tables: Mapping[str, pd.DataFrame] = MappingProxyType({}),
) -> str:
    """What `tolevo <command>` has saved so far: `facts` in sentences, and `tables` by title."""
    message = f"This result of `tolevo {command}` is unfinished."
    body = (
        *remarked(remarks),
        section("Unfinished", f"<p>{escape(message)}</p>\n{bullets(facts)}"),
        *(section(name, table(frame)) for name, frame in tables.items()),
    )
    return document(title, body)
