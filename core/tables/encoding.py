"""The encoding of a text file: how it is detected, and when the user must state it.

A byte order mark decides, then UTF-8, whose form does not come about by chance. Anything else fits
several encodings: a rule on the words of Western measuring rooms and the detector's opinion on East
Asian text decide only where nothing else fits; otherwise the user must state the encoding.
"""

from __future__ import annotations

import codecs
import re

from ..errors import refuse

BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
SAMPLE = 20_000
"""Bytes that the detector looks at."""
LATIN = {"fr", "es", "it", "pt", "da", "no", "nb", "nn", "sv", "nl", "de", "en", "fi"}
"""Languages whose letters are those of cp1252."""
WESTERN = {"windows-1252", "iso-8859-1", "iso-8859-15", "cp1252"}
GUESSES = ("cp1252", "cp1250", "cp850", "gbk", "big5", "cp932", "euc_kr", "mac_roman")
"""Encodings whose decoded text is shown where one must be stated."""
CHUNK = 1 << 16
"""Bytes that are looked through at once."""
_NOT_ISO = bytes(range(0x80, 0xA0))
_CONTROLS = bytes([*range(9), 0x0B, 0x0C, *range(0x0E, 0x20), 0x7F])
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")


def decoded(content: bytes, place: str, stated: str | None = None, allowed: str = "") -> tuple[str, str]:
    """The text of a file and its encoding. Raises InputError where it is ambiguous.

    Control characters are faults, except those `allowed`.
    """
    encoding = stated or _marked(content) or _utf_without_mark(content) or _legacy(content, place)
    try:
        text = content.decode(_quick(content, encoding))
    except (UnicodeDecodeError, UnicodeError) as error:
        at = f" (byte {error.start})" if isinstance(error, UnicodeDecodeError) else ""
        raise refuse(
            "--encoding" if stated else place, f"{place} is not {encoding}{at}; state another encoding"
        ) from error
    text = text.removeprefix("\ufeff")
    stray = _stray(content, text, allowed)
    if stray:
        what = "zero bytes" if stray == "\0" else f"the control character {stray!r}"
        raise refuse(place, f"is not text in {encoding} (it holds {what}); state --encoding if it is text")
    return text, "utf-8" if encoding == "utf-8-sig" and not _marked(content) else encoding


def _marked(content: bytes) -> str | None:
    """The encoding of a byte order mark."""
    return next((name for mark, name in BOMS if content.startswith(mark)), None)


def _utf_without_mark(content: bytes) -> str | None:
    """UTF-8, or UTF-16 without a mark: its digits and delimiters have a zero byte on one side."""
    if b"\0" in content:
        even, odd = content[::2].count(0), content[1::2].count(0)
        if len(content) % 2 == 0 and (even == 0) != (odd == 0):
            return "utf-16-le" if odd else "utf-16-be"
        return "utf-8"  # its zero bytes are reported
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return None
    return "utf-8"


def _legacy(content: bytes, place: str) -> str:
    """An encoding of one or two bytes per character."""
    # Few tables come so far: the detector takes longer to import than most take to be read.
    import chardet

    from .east_asian import east_asian
    from .western import SURE, UNSURE, western

    lines = _beyond_ascii(content)
    detected = chardet.detect(lines[:SAMPLE])
    name, language = str(detected["encoding"] or "").lower(), str(detected.get("language") or "")
    kind = western(lines)
    if kind == SURE:
        return "cp1252"
    if kind == UNSURE and name in WESTERN and language in LATIN and not east_asian(lines, ""):
        return "cp1252"
    candidates = east_asian(lines, name)
    if len(candidates) == 1 and kind != UNSURE:
        return candidates[0]
    raise refuse(place, f"the encoding cannot be determined: {_decodings(lines)}; state --encoding")


def _quick(content: bytes, encoding: str) -> str:
    """ISO 8859-1 for cp1252 where both are the same: it is decoded ten times as fast."""
    if encoding == "cp1252" and len(content.translate(None, _NOT_ISO)) == len(content):
        return "latin-1"
    return encoding


def _beyond_ascii(content: bytes) -> bytes:
    """The lines that hold more than ASCII."""
    lines = []
    start = 0
    while start < len(content):
        end = content.find(b"\n", start + CHUNK) + 1 or len(content)
        chunk = content[start:end]
        if not chunk.isascii():
            lines += [line for line in chunk.splitlines() if not line.isascii()]
        start = end
    return b"\n".join(lines)


def _stray(content: bytes, text: str, allowed: str) -> str | None:
    """The first control character that is not allowed."""
    if len(content.translate(None, _CONTROLS)) == len(content):
        return None
    return next((match[0] for match in _CONTROL.finditer(text) if match[0] not in allowed), None)


def _decodings(lines: bytes) -> str:
    """The first words that are not ASCII, as encodings read them."""
    line = re.search(rb"[^;,\t|]*[\x80-\xff][^;,\t|]*", lines.split(b"\n")[0])
    sample = line[0].strip() if line else lines[:20]
    shown: dict[str, str] = {}
    for name in GUESSES:
        try:
            shown[sample.decode(name)] = shown.get(sample.decode(name), name)
        except UnicodeDecodeError:
            continue
    return " or ".join(f'"{text}" ({name})' for text, name in shown.items()) or "no interpretation fits"
