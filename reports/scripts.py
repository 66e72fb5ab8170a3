"""The scripts of interactive pages, and the data that they show."""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

DIGITS = 6
"""Digits of a number on a page."""


@dataclass(frozen=True, slots=True)
class Script:
    """A script and the hash by which the page's policy allows it, and nothing else, to run."""

    text: str

    @property
    def hash(self) -> str:
        """The hash as a content security policy states it."""
        digest = hashlib.sha256(self.text.encode()).digest()
        return f"'sha256-{base64.b64encode(digest).decode()}'"

    @property
    def html(self) -> str:
        """The element."""
        return f"<script>{self.text}</script>"


def package_scripts(*names: str) -> Script:
    """The joined scripts of this package with these file names."""
    folder = files("tolevo.reports") / "assets"
    return Script("\n".join((folder / name).read_text(encoding="utf-8") for name in names))


def data(content: Mapping[str, Any]) -> str:
    """The element with the data that a page's script reads; no text in it can end it."""
    text = json.dumps(short(content), allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    for letter in "<>&\u2028\u2029":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return f'<script type="application/json" id="data">{text}</script>'


def short(value: Any) -> Any:
    """JSON with numbers of `DIGITS` digits; what is not finite is null."""
    if isinstance(value, Mapping):
        return {str(key): short(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [short(part) for part in value]
    if isinstance(value, np.ndarray):
        return short(value.tolist())
    if isinstance(value, np.generic):
        return short(value.item())
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        shown = float(f"{value:.{DIGITS}g}")
        return int(shown) if shown.is_integer() and abs(shown) < 1e15 else shown
    return value
