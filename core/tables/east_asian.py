"""Which East Asian encodings bytes can be, by the commonness of their characters.

Two bytes that are one character in GBK are mostly one in Big5, EUC-JP and EUC-KR as well. The
characters in use stand in the first level of each set, and the words of a measuring room are known;
the detector must agree, or a word must confirm one encoding alone.
"""

from __future__ import annotations

COMMON = 0.9
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
    return text if letters and common >= COMMON * len(letters) else None


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
