"""`read_aqdef`: characteristics of a Q-DAS file (AQDEF), in key and in compact form."""

from __future__ import annotations

import math
import re
from pathlib import Path

from ... import files
from ...errors import Fault, InputError, raise_all, refuse
from ...units import shortened
from ..encoding import decoded
from ..moments import moment
from .parsing import Content, Raw
from .records import Characteristic

SUFFIXES = (".dfq", ".dfd", ".dfx")
PARTNERS = {".dfd": ".dfx", ".dfx": ".dfd"}
INVALID = (255, 256)
"""Attributes (K0002) of values that are not valid."""
NEAR = 1e-9
"""Relative distance of two statements of one limit at most."""
_NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?")
LONGEST = 60
"""Characters of a number at most, and of a cell that a fault repeats."""


def read_aqdef(path: str | Path, encoding: str | None = None, times: bool = True) -> list[Characteristic]:
    """The characteristics of a .dfq file, or of a .dfd with its .dfx.

    Raises InputError with every fault; those of its times (K0004) only where `times` are needed.
    """
    measured, faults, of_times = characteristics(Path(path), Path(path).name, encoding)
    raise_all(faults + (of_times if times else []))
    return measured


def characteristics(
    path: Path, place: str, encoding: str | None = None
) -> tuple[list[Characteristic], list[Fault], list[Fault]]:
    """`read_aqdef` that returns the faults, and those of the times apart."""
    content = Content(place)
    try:
        for file in _files(path, place):
            content.place = place if file == path else file.name
            text, _ = decoded(_bytes(file, content.place), content.place, encoding, _SEPARATORS)
            content.read(text.split("\n"))
    except InputError as error:
        return [], list(error.faults), []
    content.place = place
    _check(content)
    measured = [_characteristic(content, index) for index in sorted(content.characteristics)]
    _twice(measured, content)
    return measured, content.faults, content.time_faults


_SEPARATORS = "\x0f\x14\x1a"


def _files(path: Path, place: str) -> list[Path]:
    """The descriptions, then the values."""
    partner = PARTNERS.get(path.suffix.lower())
    if partner is None:
        return [path]
    siblings = path.parent.iterdir() if path.parent.is_dir() else []
    second = next((p for p in siblings if p.stem == path.stem and p.suffix.lower() == partner), None)
    if second is None and path.exists():
        raise refuse(place, f"needs {path.stem}{partner} next to it")
    return sorted([path] if second is None else [path, second], key=lambda file: file.suffix.lower())


def _bytes(path: Path, place: str) -> bytes:
    try:
        content = files.content(path)
    except ValueError as error:
        raise refuse(place, str(error)) from None
    if not content.strip():
        raise refuse(place, "is empty")
    return content


def _check(content: Content) -> None:
    """Counts and parts that do not agree."""
    described = len(content.characteristics)
    if not described:
        content.faults.append(Fault(content.place, "describes no characteristic (keys K2...)"))
    if content.count is not None and content.count != described:
        text = f"K0100 announces {content.count} characteristics, {described} are described"
        content.faults.append(Fault(content.place, text))
    used = {raw.part for raw in content.characteristics.values()}
    for index in sorted(set(content.parts) - used) if len(content.parts) > 1 else ():
        text = f"part {index} has no characteristic: those of a part stand below its keys K1..., before the next part"
        content.faults.append(Fault(content.place, text))


def _characteristic(content: Content, index: int) -> Characteristic:
    raw = content.characteristics[index]
    keys = content.common | raw.keys
    part = content.common_parts | content.parts.get(raw.part, {})
    place = f"{content.place}: characteristic {index} ({keys.get('K2002', '')})"
    numbers = {
        key: _number(keys.get(key, ""), f"{place}: {key}", content.faults)
        for key in ("K2101", "K2110", "K2111", "K2112", "K2113")
    }
    characteristic = Characteristic(
        part=part.get("K1002") or part.get("K1001", ""),
        part_number=part.get("K1001", ""),
        name=keys.get("K2002", ""),
        number=keys.get("K2001", ""),
        nominal=numbers["K2101"],
        lower=_limit(numbers, "K2110", "K2112", keys.get("K2120"), place, content.faults),
        upper=_limit(numbers, "K2111", "K2113", keys.get("K2121"), place, content.faults),
        unit=keys.get("K2142", ""),
        attributive=raw.attributive or keys.get("K2004") in ("1", "5", "6"),
        keys=keys,
        part_keys=part,
    )
    low, high = characteristic.lower, characteristic.upper
    if low is not None and high is not None and low > high:
        content.faults.append(Fault(place, f"the lower limit {low:g} is above the upper limit {high:g}"))
    _fill(characteristic, raw, content, place)
    return characteristic


def _limit(
    numbers: dict[str, float | None], absolute: str, deviation: str, kind: str | None, place: str, faults: list[Fault]
) -> float | None:
    """A limit from its value or its deviation from the nominal; both must agree."""
    stated, off, nominal = numbers[absolute], numbers[deviation], numbers["K2101"]
    if kind == "0":
        return None  # K2120, K2121: there is no such limit
    if off is None:
        return stated
    if nominal is None:
        if stated is None:
            faults.append(Fault(f"{place}: {deviation}", "needs the nominal K2101"))
        return stated
    # Decimals of the file, not of a sum of doubles: 25 - 0.004.
    by_deviation = round(nominal + off, 12)
    if stated is not None and not math.isclose(stated, by_deviation, rel_tol=NEAR, abs_tol=1e-12):
        text = (
            f"{absolute} is {stated:.10g}, but the nominal {nominal:.10g} with the deviation "
            f"{deviation} {off:.10g} is {by_deviation:.10g}"
        )
        faults.append(Fault(place, text))
    return by_deviation if stated is None else stated


def _fill(characteristic: Characteristic, raw: Raw, content: Content, place: str) -> None:
    """Fill in the values with their attributes, sizes, batches and times."""
    formats: dict[str, int] = {}
    for line, value in zip(raw.lines, raw.values, strict=True):
        where = f"{content.place}: row {line}"
        key = "K0021" if characteristic.attributive else "K0001"
        number = _number(value.get(key, ""), f"{where}: {key}", content.faults)
        attribute = _read_integer(value.get("K0002", ""), f"{where}: K0002", content.faults) or 0
        characteristic.values.append(None if attribute in INVALID else number)
        characteristic.attributes.append(attribute)
        characteristic.sizes.append(_read_integer(value.get("K0020", ""), f"{where}: K0020", content.faults))
        characteristic.batches.append(value.get("K0006", ""))
        characteristic.times.append(None)
        if text := value.get("K0004", ""):
            try:
                characteristic.times[-1], form = moment(text)
                formats.setdefault(form, line)
            except ValueError as error:
                content.time_faults.append(Fault(f"{where}: K0004", str(error)))
    if len(formats) > 1:
        listed = " and ".join(f"{form} (row {line})" for form, line in formats.items())
        content.time_faults.append(Fault(f"{place}: K0004", f"times in two formats: {listed}"))


def _twice(described: list[Characteristic], content: Content) -> None:
    """A characteristic of one part that is described twice."""
    first_index: dict[tuple[str, str, str, str], int] = {}
    for index, characteristic in zip(sorted(content.characteristics), described, strict=True):
        key = (characteristic.part_number, characteristic.part, characteristic.number, characteristic.name)
        if any(key[2:]) and key in first_index:
            text = f"characteristic {index} ({characteristic.label}) is described twice: as {first_index[key]} as well"
            content.faults.append(Fault(content.place, text))
        first_index.setdefault(key, index)


def _number(text: str, place: str, faults: list[Fault]) -> float | None:
    """A number of a Q-DAS file, whose comma or point is decimal: the format groups no thousands."""
    if not text:
        return None
    number = float(text.replace(",", ".")) if len(text) <= LONGEST and _NUMBER.fullmatch(text) else math.nan
    if math.isfinite(number):
        return number
    faults.append(Fault(place, f'must be a number, got "{shortened(text)}"'))
    return None


def _read_integer(text: str, place: str, faults: list[Fault]) -> int | None:
    if not text:
        return None
    if not text.isdecimal() or len(text) > LONGEST:
        faults.append(Fault(place, f'must be a whole number, got "{shortened(text)}"'))
        return None
    return int(text)
