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


def decode_text(content: bytes, place: str, stated: str | None = None, allowed: str = "") -> tuple[str, str]:
    """The text of a file and its encoding. Raises InputError where it is ambiguous.

    Control characters are faults, except those `allowed`.
    """
    encoding = stated or _marked_encoding(content) or _utf_without_mark(content) or _decode_legacy(content, place)
    try:
        text = content.decode(_fast_encoding(content, encoding))
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
        if len(content) % 2 == 0 and (even == 0) != (odd == 0):
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

    lines = _lines_beyond_ascii(content)
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


def _fast_encoding(content: bytes, encoding: str) -> str:
    """ISO 8859-1 for cp1252 where both are the same: it is decoded ten times as fast."""
    if encoding == "cp1252" and len(content.translate(None, _NOT_ISO)) == len(content):
        return "latin-1"
    return encoding


def _lines_beyond_ascii(content: bytes) -> bytes:
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
        try:
            shown[sample.decode(name)] = shown.get(sample.decode(name), name)
        except UnicodeDecodeError:
            continue
    return " or ".join(f'"{text}" ({name})' for text, name in shown.items()) or "no interpretation fits"


# Whether bytes are words of a Western measuring room in cp1252.
#
# Nearly every byte is a letter in cp1252, so that Chinese, Czech or DOS text can be read as cp1252
# without an error. They are distinguished by the position of the letters: umlauts stand alone between
# ASCII letters, a superscript follows a unit, a degree sign does not stand within a word.


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
_UNAMBIGUOUS_WORD = re.compile(r"[A-Za-zäöüßÄÖÜéíóúÉÍÓÚ]+")
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
    ratings = {_rate_word(token) for token in set(_TOKEN.findall(text))}
    return NO if NO in ratings else UNSURE if UNSURE in ratings else SURE


def _rate_word(token: str) -> str:
    """One word with a letter or sign that is not ASCII."""
    if _SYMBOL.fullmatch(token):
        return SURE
    pairs = [pair for pair in _TWO_HIGH.findall(token) if pair not in ("äß", "öß", "üß")]
    if len(token) < 2 or pairs or token.startswith("ß") or _DOS.fullmatch(token):
        return NO
    if _UNAMBIGUOUS_WORD.fullmatch(token) and (_GERMAN.fullmatch(token) or re.search("[éíóúÉÍÓÚ]", token)):
        return SURE
    return UNSURE if _LATIN.fullmatch(token) else NO


# Which East Asian encodings bytes can be, by the commonness of their characters.
#
# Two bytes that are one character in GBK are mostly one in Big5, EUC-JP and EUC-KR as well. The
# characters in use stand in the first level of each set, and the words of a measuring room are known;
# the detector must agree, or a word must confirm one encoding alone.


MIN_COMMON_FRACTION = 0.9
"""Least fraction of characters of the first level in a text."""
_SPELLINGS = {
    "gb18030": "gb18030 gbk gb2312 hz",
    "big5": "big5 big5hkscs big5-hkscs cp950",
    "cp932": "cp932 shift_jis shift-jis windows-31j shift_jis_2004 shift_jisx0213",
    "euc_jp": "euc_jp euc-jp euc-jis-2004",
    "euc_kr": "euc-kr cp949 uhc",
}
FAMILIES = {spelling: name for name, spellings in _SPELLINGS.items() for spelling in spellings.split()}
"""Names of encodings here by those of the detector."""
WORDS = {
    "gb18030": "间隙 温度 时间 角度 直径 孔径 零件 序号 编号 批次 长度 误差 扭矩 速度 测量 偏差 公差 厚度 宽度 高度 "
    "半径 转速 力矩 单位 工件 结果 合格 日期 名称 平均 备注 侧隙 转角 产品 型号 检验 尺寸",
    "big5": "間隙 溫度 時間 角度 直徑 孔徑 零件 序號 編號 批次 長度 誤差 扭矩 速度 測量 偏差 公差 厚度 寬度 高度 "
    "半徑 轉速 力矩 單位 工件 結果 合格 日期 名稱 平均 備註 產品 型號 檢驗 尺寸 量測",
    "cp932": "測定 温度 時間 直径 寸法 部品 番号 公差 角度 隙間 長さ 誤差 速度 回転 平均 半径 厚さ 荷重 名称 日付 "
    "結果 軸受 検査 最大 最小 単位 トルク ロット すきま 内径 外径 穴径 判定",
    "euc_kr": "온도 시간 직경 치수 부품 번호 공차 각도 길이 오차 속도 평균 반경 두께 결과 측정 단위",
}
WORDS["euc_jp"] = WORDS["cp932"]


def east_asian(content: bytes, detected: str) -> list[str]:
    """The encodings that `content` can be, one where the detector or its words decide."""
    texts = {name: text for name in WORDS if (text := _text(content, name)) is not None}
    confirmed = {name for name, text in texts.items() if any(w in text for w in WORDS[name].split())}
    family = FAMILIES.get(detected, "")
    if family in texts and (family in confirmed or not confirmed):
        return [family]
    if len(confirmed) == 1:
        return list(confirmed)
    return sorted(texts)


def _text(content: bytes, name: str) -> str | None:
    """The text in this encoding where it is one of common characters, else None."""
    try:
        text = content.decode(name)
    except UnicodeDecodeError:
        return None
    letters = [character for character in text if not character.isascii() and not _is_sign(character)]
    common = sum(_is_common(letter, name) for letter in letters)
    return text if letters and common >= MIN_COMMON_FRACTION * len(letters) else None


def _is_sign(character: str) -> bool:
    """Punctuation and signs, which say nothing of a language."""
    ranges = (("\u2000", "\u22ff"), ("\u3000", "\u303f"), ("\uff00", "\uff60"))
    return character in "°±×·µμΩφΦθ" or any(low <= character <= high for low, high in ranges)


def _is_common(character: str, name: str) -> bool:
    """Whether a character stands in the first level of its set."""
    if name in ("cp932", "euc_jp") and "\u3040" <= character <= "\u30ff":
        return True
    if name == "euc_kr":
        return "\uac00" <= character <= "\ud7a3"
    if not "\u4e00" <= character <= "\u9fff":
        return False
    table, last = {"gb18030": ("gb2312", 0xD7), "big5": ("big5", 0xC6)}.get(name, ("euc_jp", 0xCF))
    try:
        return 0xA0 < character.encode(table)[0] <= last
    except UnicodeEncodeError:
        return False
