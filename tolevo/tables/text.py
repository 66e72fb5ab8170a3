"""The encoding of a text file: how it is detected, and when the user must state it.

A byte order mark decides, then UTF-8, whose form does not come about by chance. Anything else fits
several encodings: chardet chooses among those of measuring rooms, and its choice is taken where the
bytes allow no other; otherwise the user must state the encoding.
"""

from __future__ import annotations

import codecs
import re
from pathlib import Path

from .. import files
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
WESTERN, CENTRAL = "cp1252", "cp1250"
EAST_ASIAN = {
    "gb18030": "gb18030",
    "big5": "big5",
    "big5hkscs": "big5",
    "cp932": "cp932",
    "shift_jis": "cp932",
    "euc-kr": "euc_kr",
    "cp949": "euc_kr",
}
"""Encodings of two bytes a character, by the detector's names for them."""
FEWEST_SIGNS = 4
"""Different signs from which the detector tells encodings of two bytes from each other."""
CHOICES = (WESTERN, CENTRAL, "cp850", "cp1251", "cp1253", "cp1254", "mac-roman", *EAST_ASIAN)
"""Encodings that the detector chooses from: among all that it knows, short names of columns look
like any of twenty.
"""
GUESSES = ("cp1252", "cp1250", "cp850", "gbk", "big5", "cp932", "euc_kr", "mac_roman")
"""Encodings whose decoded text is shown where one must be stated."""
_LATIN_1 = bytes([*range(0x80), *range(0xA0, 0x100)])
_CONTROLS = bytes([*range(9), 0x0B, 0x0C, *range(0x0E, 0x20), 0x7F])
_SIGN_IN_WORD = re.compile(r"[\xa0-\xff](?<!\w)[a-z\xdf-\xff](?<=\w)|(?<=[a-z])[\xa1-\xaf\xb1-\xb6\xb8-\xbf](?<!\w)")
"""A sign within a word, as no Western text has it."""
_SIGNS_ALONE = re.compile(
    r"(?![\xa0°±²³µ·½×Øø§]{2})(?:[\xa0-\xff](?<!\w)[\xa1-\xff](?<!\w)|[\xa1-\xff]{3}|(?<![A-Za-z])[\xa1-\xff]{2}(?![A-Za-z]))"
)
"""What a Western text without letters with accents in words hardly has, units and tolerances such as "Ø±" aside: two
signs, three letters with accents in a row, two without any other.
"""
_LETTER_IN_WORD = re.compile(rb"[A-Za-z][\xb5-\xff]{1,2}[a-z]|(?<![\x80-\xff])[\xb5-\xff](?:[\x80-\xff]{2})*(?=[a-z])")
"""One or two letters with accents between others, or an odd number before one, as in "Länge" and "µm": a word of two
bytes a character has an even number of bytes, and no other letters around it.
"""
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")


def content_of(path: Path, place: str, empty: str = "is empty") -> bytes:
    """The bytes of a file. Raises InputError where it cannot be read or is `empty`."""
    try:
        content = files.content(path)
    except ValueError as error:
        raise refuse(place, str(error)) from None
    if not content or content.isspace():
        raise refuse(place, empty)
    return content


def decode_text(content: bytes, place: str, stated: str | None = None, allowed: str = "") -> tuple[str, str]:
    """The text of a file and its encoding. Raises InputError where it is ambiguous.

    Control characters are faults, except those `allowed`.
    """
    encoding = stated or _marked_encoding(content) or _utf_without_mark(content) or _decode_legacy(content, place)
    try:
        # What is detected as cp1252 is ISO 8859-1 as well, which is decoded ten times as fast.
        text = content.decode("latin-1" if encoding == WESTERN and not stated else encoding)
    except (UnicodeDecodeError, UnicodeError) as error:
        at = f" (byte {error.start})" if isinstance(error, UnicodeDecodeError) else ""
        raise refuse(
            "--encoding" if stated else place, f"{place} is not {encoding}{at}; state another encoding"
        ) from error
    text = text.removeprefix("\ufeff")
    stray = _stray_control_character(content, text, allowed)
    if stray:
        what = "zero bytes" if stray == "\0" else f"the control character {stray!r}"
        raise refuse(place, f"is not text in {encoding} (it holds {what}); state --encoding if it is text")
    return text, "utf-8" if encoding == "utf-8-sig" and not _marked_encoding(content) else encoding


def _marked_encoding(content: bytes) -> str | None:
    """The encoding of a byte order mark."""
    return next((name for mark, name in BOMS if content.startswith(mark)), None)


def _utf_without_mark(content: bytes) -> str | None:
    """UTF-8, or UTF-16 without a mark: its digits and delimiters have a zero byte on one side."""
    if b"\0" in content:
        even, odd = content[::2].count(0), content[1::2].count(0)
        if len(content) % 2 == 0 and (even == 0) != (odd == 0) and 4 * (even + odd) > len(content):
            return "utf-16-le" if odd else "utf-16-be"
        return "utf-8"  # its zero bytes are reported
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return None
    return "utf-8"


def _decode_legacy(content: bytes, place: str) -> str:
    """An encoding of one or two bytes per character."""
    # Few tables come so far: the detector takes longer to import than most take to be read.
    import chardet

    lines = b"\n".join(line for line in content.splitlines() if not line.isascii())
    sample = lines[:SAMPLE].replace(b"\t", b";")
    western = not lines.translate(None, _LATIN_1)
    # Umlauts of DOS and Macintosh are signs of cp1252 (0x80 to 0x9f); no sign stands within a word.
    latin = lines.decode("latin-1")
    unbroken = western and not _SIGN_IN_WORD.search(latin)
    words = unbroken and bool(_LETTER_IN_WORD.search(lines))
    choices = [name for name in CHOICES if not (western and name == "mac-roman") and not (words and name in EAST_ASIAN)]
    name = str(chardet.detect(sample, include_encodings=choices)["encoding"] or "").lower()
    signs = {sign for sign in _decodes(lines, EAST_ASIAN.get(name, "ascii")) or "" if not sign.isascii()}
    if len(signs) >= FEWEST_SIGNS:
        return EAST_ASIAN[name]
    if (
        unbroken
        and (words or not _SIGNS_ALONE.search(latin))
        and (name == "windows-1252" or (name == "windows-1250" and latin == _decodes(lines, CENTRAL)))
    ):
        return WESTERN
    raise refuse(place, f"the encoding cannot be determined: {_decodings(lines)}; state --encoding")


def _decodes(content: bytes, encoding: str) -> str | None:
    """The text of bytes, None where they are none in an encoding."""
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:
        return None


def _stray_control_character(content: bytes, text: str, allowed: str) -> str | None:
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
        if (text := _decodes(sample, name)) is not None:
            shown.setdefault(text, name)
    return " or ".join(f'"{text}" ({name})' for text, name in shown.items()) or "no interpretation fits"
