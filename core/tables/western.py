"""Whether bytes are words of a Western measuring room in cp1252.

Nearly every byte is a letter in cp1252, so that Chinese, Czech or DOS text can be read as cp1252
without an error. They are distinguished by the position of the letters: umlauts stand alone between
ASCII letters, a superscript follows a unit, a degree sign does not stand within a word.
"""

from __future__ import annotations

import re

SURE, UNSURE, NO = "sure", "unsure", "no"

_UNITS = "m|s|A|V|N|g|l|W|F|H|Pa|rad|Nm|in|K|Ohm"
_SYMBOL = re.compile(
    r"[°±Ø×€–—…„“”‘’§·®©\u00a0]"  # a sign on its own
    r"|°[CFKcf]|Ø[dDiIaA]?|[dDiIaA]Ø"
    rf"|µ(?:{_UNITS})?[²³]?"
    r"|(?:[kcdm]?m|s|N|in|K)[²³]|[²³]"
    r"|N·c?m+"
    r"|[üÜ]"
)
_GERMAN = re.compile(r"(?:[A-ZÄÖÜ]?[a-zäöüß]+)+|[A-ZÄÖÜ]{2,}|[ÄÖÜ][A-Za-z]+")
_TWO_HIGH = re.compile(r"[^\x00-\x7f]{2}")
_SAFE = re.compile(r"[A-Za-zäöüßÄÖÜéíóúÉÍÓÚ]+")
"""Letters that Central European text (cp1250) has at the same bytes: both decode alike."""
_LATIN = re.compile(
    r"(?:[A-Za-zäöüßÄÖÜéíóúÉÍÓÚáñåæøÅÆØ]"
    r"|è(?=[b-df-hj-np-tv-xz])|ê(?=[a-z])|(?<=[A-Za-z])[âîôû]|ç(?=[aou])|(?<=[aeo])[ëï]"
    r"|(?<=[A-Za-z])[àùìò](?![A-Za-z])|(?<![A-Za-z])à(?![A-Za-z])|õ(?=e)|ã(?=o)|œ(?=[ui])|Ñ)+"
)
_TOKEN = re.compile(r"[A-Za-z]*[^\x00-\x7f][A-Za-z\x80-\U0010ffff]*")
_DOS = re.compile(r"æ[mA-Z]?|ø[CF]?|[A-Za-z]+á")
"""What a micrometre, a degree and a sharp s of DOS look like in cp1252."""


def western(content: bytes) -> str:
    """Whether cp1252 is sure, is unsure (the detector must agree), or cannot be."""
    try:
        text = content.decode("cp1252")
    except UnicodeDecodeError:
        return NO
    ratings = {_rated(token) for token in set(_TOKEN.findall(text))}
    return NO if NO in ratings else UNSURE if UNSURE in ratings else SURE


def _rated(token: str) -> str:
    """One word with a letter or sign that is not ASCII."""
    if _SYMBOL.fullmatch(token):
        return SURE
    pairs = [pair for pair in _TWO_HIGH.findall(token) if pair not in ("äß", "öß", "üß")]
    if len(token) < 2 or pairs or token.startswith("ß") or _DOS.fullmatch(token):
        return NO
    if _SAFE.fullmatch(token) and (_GERMAN.fullmatch(token) or re.search("[éíóúÉÍÓÚ]", token)):
        return SURE
    return UNSURE if _LATIN.fullmatch(token) else NO
