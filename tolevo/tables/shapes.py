"""Shapes of tables: a row per characteristic (long), a column per part (transposed), a column per
characteristic (wide), with the nominal sizes and limits that stand beside the measurements.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import Fault, raise_all
from ..units import converted, fits
from .header import SAMPLE, UNIT_WORDS, Row, is_same_unit, known_unit, split_header
from .record import LONG, WIDE, Columns, Specification, Table, objects_of
from .signs import LIMITS, bare, is_date, is_missing, is_summary, number_in

_WORDS = {
    "characteristic": "id feature featurename characteristic characteristicname dimension dim dimensionname merkmal "
    "merkmalname merkmalsname merkmalsbezeichnung bezeichnung name element elementname prüfmerkmal messgröße label "
    "messpunkt char charid cote caractéristique quota caratteristica 特性 特征 特性名称 尺寸 项目 項目 測定項目",
    "property": "property axis ax achse eigenschaft item",
    "value": "actual act ist istwert istmaß istmass measured meas messwert value wert measuredvalue actualvalue "
    "measurement mesure mesuré misura misurato 测量值 实测值 实际值 測定値 実測値",
    **LIMITS,
    "deviation": "deviation dev abw abweichung",
    "part": "part partnb partno partnumber partid teil teilnr teilenr teilnummer teilenummer serial serialnumber "
    "serialno sn serialnr seriennr seriennummer werkstück werkstücknr piece sample stück stücknr bauteil probe "
    "pièce pezzo 零件 工件",
    "unit": UNIT_WORDS,
}
"""What columns and rows of measuring machines are called, by what they are, without blanks and points."""
_GROUP_WORDS = {
    "part": _WORDS["part"],
    "lot": "lot lotno batch batchno charge chargennr los serie series auftrag order",
    "cavity": "cavity cavityno nest nestnr kavität kavitaet kav formnest",
    "machine": "machine machineno maschine maschinennr",
    "operator": "operator prüfer pruefer bediener appraiser inspector",
    "gauge": "gauge gage prüfmittel messmittel",
    "block": "block",
}
_GROUPS = {word.casefold(): kind for kind, words in _GROUP_WORDS.items() for word in words.split()}
ROLES = {word.casefold(): role for role, words in _WORDS.items() for word in words.split()}
ROLES |= {"upper": "upper", "hi": "upper", "lower": "lower", "lo": "lower"}  # parts can be called so, columns not
SPECIFIED = tuple(LIMITS)
_NUMBERED = re.compile(r"(?P<stem>.*?)[ _#.\-]*(?P<number>\d+)")
_TITLE_WORD = re.compile(r"[^\W\d_]+")
_REPORT = re.compile(
    "messung|messprotokoll|protokoll|prüfung|bericht|lauf|measurement|inspection|report|run", re.I
).fullmatch
MAGNITUDE = "-"
"""How the name of a column of lower tolerances begins that hold no sign: "-TOL"."""


def role_of(name: str) -> str:
    """What a column or row of this name is, "" where the name says nothing."""
    return ROLES.get(bare(split_header(name)[0]), "")


def roles_of(names: Sequence[str]) -> list[str]:
    """What each of several columns or rows is: "UTol" is an upper tolerance beside "LTol", else a lower one beside an
    upper one ("OTol"), else it is not known.
    """
    roles, texts = [role_of(name) for name in names], [bare(split_header(name)[0]) for name in names]
    english = bool({"lt", "ltol"} & set(texts))
    doubtful = "upper" if english else "lower" if "upper" in roles else ""
    decided = {"ut": doubtful, "utol": doubtful} | ({"lt": "lower"} if "ut" in texts else {})
    return [decided.get(text, role) for text, role in zip(texts, roles, strict=True)]


def group_of(name: str) -> str:
    """What the labels of a column of this name group parts by, "" where they group none."""
    return _GROUPS.get(bare(name), "")


def transposed_rows(rows: Sequence[Row], shape: str | None, place: str) -> list[Row] | None:
    """The rows of a table with a column per part, turned; None where it has another shape.

    It is recognised where its first line names characteristics in the first column and numbered
    parts in the others, "Merkmal;Nennmaß;Teil 1;Teil 2". The line numbers are those of the columns.
    Raises InputError where lines have different numbers of cells.
    """
    at = next((at for at, (_, row) in enumerate(rows[:60]) if _heads_parts(row)), None)
    if shape in (LONG, WIDE) or (at is None and shape is None):
        return None
    body = [row for _, row in rows[at or 0 :]]
    while len(body) > 2 and is_summary(body[-1][0]):
        body.pop()
    wrong = [(line, len(row)) for line, row in rows[at or 0 :][: len(body)] if len(row) != len(body[0])]
    text = f"{len(body[0])} cells expected, as many as there are parts, got"
    raise_all(Fault(f"{place}: row {line}", f"{text} {count}") for line, count in wrong)
    turned = [list(cells) for cells in zip(*body, strict=True)]
    if (unit := next((row for row in turned if role_of(row[0]) == "unit"), None)) is not None:
        turned.remove(unit)
        names = zip(turned[0], unit, strict=True)
        turned[0] = [f"{name} [{stated}]" if known_unit(stated) else name for name, stated in names]
    turned[0][0] = "part"
    return [(number, row) for number, row in enumerate(turned, 1) if any(row)]


def _heads_parts(row: list[str]) -> bool:
    """Whether a line is one of names whose columns are parts."""
    if role_of(row[0]) not in ("characteristic", "property"):
        return False
    parts = [cell for cell in row[1:] if cell and not role_of(cell) and not is_summary(cell)]
    numbered = [match for cell in parts if (match := _NUMBERED.fullmatch(cell))]
    stems = {match["stem"].casefold().strip() for match in numbered}
    named = len(stems) == 1 and (stems == {""} or role_of(min(stems)) == "part")
    return named and len(numbered) == len(parts) > 1


# A row per characteristic, turned into a column per characteristic.


_Long: TypeAlias = dict[str, str]
"""The columns of a long table by what they are."""
_Names: TypeAlias = tuple[NDArray[np.int64], list[str]]
"""The characteristic of each row by its place in the list of them."""


def long_columns(table: Table, stated: bool) -> _Long | None:
    """The columns of a table that has a row per characteristic; None where it has none.

    A first column of any name can name them where limits stand beside the values, or the shape is `stated`.
    """
    roles: dict[str, str] = {}
    for name, role in zip(table.columns.names, roles_of(table.columns.names), strict=True):
        if role in ("characteristic", "value") and role in roles and role_of(roles[role]) == role:
            continue  # "id" before "name": the first counts
        if role:
            roles.setdefault(role, name)
    if "characteristic" not in roles and "property" in roles:
        roles["characteristic"] = roles.pop("property")
    first, sure = table.columns.names[0], stated or {"upper", "usl", "deviation"} & set(roles)
    if "characteristic" not in roles and {"value", "nominal"} <= set(roles) and sure and _can_name(table, first):
        roles["characteristic"] = first
    return roles if {"characteristic", "value"} <= set(roles) else None


def _can_name(table: Table, column: str) -> bool:
    """Whether a column can hold names of characteristics: different texts that are no dates, parts or lots."""
    if column in table.numeric or role_of(column) or group_of(column):
        return False
    texts = table.columns.factorised(column)[1]
    return len(texts) == len(table.columns) and not any(is_missing(text) or is_date(text) for text in texts)


def is_long(table: Table, long: _Long) -> bool:
    """Whether the columns are those of a row per characteristic for sure: with limits beside the
    values, or with characteristics that come again.
    """
    if long["value"] not in table.numeric or long["characteristic"] in table.values:
        return False
    if {"upper", "usl"} & set(long) or {"nominal", "deviation"} <= set(long):
        return True
    return "nominal" in long and len(table.columns.factorised(long["characteristic"])[1]) < len(table.columns)


def wide_of_long(table: Table, place: str, shape: str | None) -> tuple[Table, list[Fault]]:
    """The table with a column per characteristic; as it is where it has that shape already.

    Rows belong together by their part; without one, the k-th value of every characteristic is of
    the k-th part. Nominal sizes and limits are in `specifications`.
    """
    long = long_columns(table, shape == LONG) if shape in (None, LONG) else None
    if long is None or (shape is None and not is_long(table, long)):
        needed = "a column of characteristics (feature, Merkmal) and one of values (actual, Istwert)"
        if shape == LONG:
            return table, [Fault("shape", f"{place} is no long table: it needs {needed}")]
        return _with_unit_column(table, place)
    columns = table.columns
    names = columns.factorised(long["characteristic"])
    if "property" in long:
        of_property = columns.factorised(long["property"])
        codes, first = _numbered(names[0] * len(of_property[1]) + of_property[0])
        names = codes, [f"{names[1][names[0][at]]} {of_property[1][of_property[0][at]]}" for at in first]
    of_features, faults = names, list[Fault]()
    if "block" in columns.cells and "part" not in long and "nominal" in long:
        axes = role_of(long["characteristic"]) == "property"
        sizes = columns.numbers(long["nominal"], table.values)
        of_features, faults = _of_blocks(names, columns.factorised("block"), sizes, axes, place)
    by_block, names = names is of_features, of_features
    part = columns.factorised(long["part"]) if "part" in long else (np.zeros(len(columns), dtype=np.int64), [""])
    counts = np.bincount(names[0])
    if "part" not in long:
        block = columns.factorised("block") if "block" in columns.cells and by_block else part
        if block is not part and not _turns(names[0], block[0]).any():
            part = block
        elif counts.min() < counts.max():
            few, many = names[1][counts.argmin()], names[1][counts.argmax()]
            text = f"{few} has {counts.min()} values, {many} {counts.max()}, and no column names their parts"
            faults.append(Fault(place, f"{text}: add a column part"))
    turns = _turns(names[0], part[0])
    row_of, first = _numbered(part[0] * (turns.max() + 1) + turns)
    numbers = np.full((len(names[1]), len(first)), np.nan)
    numbers[names[0], row_of] = columns.numbers(long["value"], table.values)
    whole = ~np.isnan(numbers).any(axis=1)
    held: NDArray[Any] = numbers
    if long["value"] not in table.values or not whole.all():
        held = np.full(numbers.shape, "", dtype=object)
        held[names[0], row_of] = table.cells[long["value"]].to_numpy(dtype=object)
    wide: dict[str, Any] = {}
    unused = []
    if "part" in long:
        wide[long["part"]] = objects_of(part[1])[part[0][first]]
    for name in columns.names:
        if name in long.values():
            continue
        codes, texts = columns.factorised(name)
        if (codes == codes[first][row_of]).all():
            wide[name] = objects_of(texts)[codes[first]]
        else:
            unused.append(name)
    wide |= {label: row if held is numbers else row.tolist() for label, row in zip(names[1], held, strict=True)}
    units, of_units = _units_of(table, long, names, place)
    specifications, of_limits = _specifications(table, long, names, units, place)
    how = "" if role_of(long["characteristic"]) else f", which column {long['characteristic']} names"
    notes = [*table.notes, f"read as: a row per characteristic{how}"]
    notes += [f"not used: {', '.join(unused)}"] if unused else []
    if "part" not in long and len(part[1]) == 1:
        notes.append("no column names the parts: the k-th value of each characteristic is of the k-th part")
    turned = replace(
        table,
        columns=Columns(wide, [columns.lines[at] for at in first]),
        units=units,
        notes=tuple(notes),
        numeric=tuple(names[1]),
        headers={name: name for name in wide},
        values={name: row for name, row, good in zip(names[1], numbers, whole, strict=True) if good},
        specifications=specifications,
    )
    return turned, faults + of_units + of_limits


def _of_blocks(
    names: _Names, block: _Names, nominal: NDArray[np.float64], axes: bool, place: str
) -> tuple[_Names, list[Fault]]:
    """The characteristics with the titles of their blocks, where these are of features: where one name has
    other nominal sizes in other blocks, or where the names are axes and titles have different words.

    Numbered titles of one word above axes of one size are of features where they are names ("BORE1"), of parts where
    the word is that of parts, lots or reports ("Run 1"); others ("Shaft 1") may be either: a fault.
    """
    codes, first = _numbered(names[0] * len(block[1]) + block[0])
    sizes = pd.Series(nominal)
    one, one_each = ((sizes.groupby(keys).transform("first") == sizes).all() for keys in (names[0], codes))
    words = {match[0] if (match := _TITLE_WORD.match(title)) else "" for title in block[1]}
    if not one_each or (one and (not axes or "" in words or any(group_of(w) or _REPORT(w) for w in words))):
        return names, []
    if one and len(words) == 1 < len(block[1]) and not all(re.fullmatch(r"\w+", title) for title in block[1]):
        listed = ", ".join(f'"{title}"' for title in block[1][:2])
        text = f'its blocks {listed}, ... can be of features or of parts: call those of parts "Part 1", "Part 2"'
        return names, [Fault(place, f"{text}; write the name of a feature before its axis")]
    return (codes, [f"{block[1][block[0][at]]} {names[1][names[0][at]]}" for at in first]), []


def _with_unit_column(table: Table, place: str) -> tuple[Table, list[Fault]]:
    """A wide table with the unit that a column of units states of its only column of measurements."""
    names = table.columns.names
    column = next((name for name in names if role_of(name) == "unit" and name not in table.numeric), None)
    stated = {} if column is None else {text: known_unit(text) for text in table.columns.factorised(column)[1] if text}
    if not stated or None in stated.values():
        return table, []
    measured = [n for n in table.numeric if role_of(n) in ("", "value") and not group_of(n)]
    units = set(map(str, stated.values()))
    if len(measured) != 1:
        return replace(table, notes=(*table.notes, f"the units in column {column} are not used")), []
    of_name = table.units.get(measured[0], "")
    if len(units) > 1 or (of_name and not is_same_unit(of_name, min(units))):
        listed = " and ".join([*([of_name] if of_name else []), *stated])
        return table, [Fault(f"{place}: {measured[0]}", f"has several units: {listed}")]
    return replace(table, units={measured[0]: min(units)} | dict(table.units)), []


def _numbered(keys: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The places of keys among the different ones, in the order in which they come, and where each
    comes first.
    """
    places, different = pd.factorize(keys)
    codes = places.astype(np.int64)
    first = np.empty(len(different), dtype=np.int64)
    first[codes[::-1]] = np.arange(len(keys))[::-1]
    return codes, first


def _turns(names: NDArray[np.int64], parts: NDArray[np.int64]) -> NDArray[np.int64]:
    """How many times the characteristic of each row came before for the same part."""
    pairs, first = _numbered(parts * (names.max() + 1) + names)
    if len(first) == len(pairs):
        return np.zeros(len(pairs), dtype=np.int64)
    return np.asarray(pd.Series(pairs).groupby(pairs).cumcount(), dtype=np.int64)


def _units_of(table: Table, long: _Long, names: _Names, place: str) -> tuple[dict[str, str], list[Fault]]:
    """The unit of each characteristic, from a column of units or the heading of the values."""
    of_values = table.units.get(long["value"], "")
    if "unit" not in long:
        return (dict.fromkeys(names[1], of_values) if of_values else {}), []
    codes, texts = table.columns.factorised(long["unit"])
    stated: dict[str, list[str]] = {name: [] for name in names[1]}
    for at in _numbered(names[0] * len(texts) + codes)[1]:
        if not is_missing(unit := texts[codes[at]]):
            stated[names[1][names[0][at]]].append(unit)
    units, faults = {}, []
    for name, spelt in stated.items():
        known = {known_unit(unit) for unit in spelt} - {None}
        if len(known) > 1 or (of_values and known and known != {of_values}):
            listed = " and ".join([*([of_values] if of_values else []), *spelt])
            faults.append(Fault(f"{place}: {name}", f"has several units: {listed}"))
        elif known:
            units[name] = str(known.pop())
    return units, faults


def _specifications(
    table: Table, long: _Long, names: _Names, units: Mapping[str, str], place: str
) -> tuple[dict[str, Specification], list[Fault]]:
    """Nominal size and limits of each characteristic; one that has two of them is a fault."""
    numbers = {role: table.columns.numbers(long[role], table.values) for role in SPECIFIED if role in long}
    faults = _wrong_deviations(table, long, numbers, place)
    stated: dict[str, dict[str, float]] = {}
    doubted: set[str] = set()
    first = _numbered(names[0])[1]
    for role, column in numbers.items():
        lows = highs = column[first]
        if not (column == lows[names[0]]).all():
            ends = pd.Series(column).groupby(names[0]).agg(["min", "max"])
            lows, highs = ends["min"].to_numpy(), ends["max"].to_numpy()
        for name, low, high in zip(names[1], lows.tolist(), highs.tolist(), strict=True):
            if low != high and not np.isnan(low):
                doubted |= {name} if role == "nominal" else set()
                what = {"nominal": "nominal sizes", "lower": "lower limits", "lsl": "lower limits"}.get(role)
                text = f"has two {what or 'upper limits'}: {low:.10g} and {high:.10g}"
                text += "; give a file for each; or state --shape wide"
                faults.append(Fault(f"{place}: {name}", text))
            elif not np.isnan(low):
                stated.setdefault(name, {})[role] = low
    for name in doubted & set(stated):  # its tolerances are of either nominal size
        stated[name] = {role: limit for role, limit in stated[name].items() if role in ("usl", "lsl")}
    for name, limits in stated.items():
        own = units.get(name, "")
        for role in limits:
            if not own or not (unit := table.units.get(long[role], "")) or is_same_unit(unit, own):
                continue
            if fits(unit, own):
                limits[role] = round(float(converted(limits[role], unit, own)), 12)
            else:
                faults.append(Fault(f"{place}: column {long[role]}", f'is in "{unit}", {name} in "{own}"'))
    if not ({"upper", "usl"} & set(long) and {"lower", "lsl"} & set(long)):
        used = set(long.values())
        unclear = [n for n in table.numeric if n not in used and _LIMIT_LIKE.search(n) and not group_of(n)]
        faults += [Fault(f"{place}: column {table.headers.get(n, n)}", _NO_SIDE) for n in unclear]
    lower = long.get("lower", "")
    plus = bool(lower) and any(text.startswith("+") for text in table.columns.factorised(lower)[1])
    specifications, wrong = _of_stated(stated, table.headers.get(lower, lower), plus, place)
    return specifications, faults + wrong


def _wrong_deviations(table: Table, long: _Long, numbers: Mapping[str, NDArray[Any]], place: str) -> list[Fault]:
    """A fault where deviations in the file are not values less nominal sizes: columns are misread."""
    if not {"nominal", "deviation"} <= set(long):
        return []
    value, deviation = (table.columns.numbers(long[role], table.values) for role in ("value", "deviation"))
    nominal = numbers["nominal"]
    wrong = np.abs(value - nominal - deviation) > 1e-3 * np.abs(nominal) + 2e-3 * np.abs(deviation) + 1e-3
    if not wrong.any():
        return []
    row = table.columns.lines[int(wrong.argmax())]
    text = f"{wrong.sum()} deviations are not {long['value']} less {long['nominal']}: the first in row {row}"
    return [Fault(place, text)]


def _of_stated(
    stated: Mapping[str, dict[str, float]], heading: str, plus: bool, place: str, kind: str = "column"
) -> tuple[dict[str, Specification], list[Fault]]:
    """Specifications from what is stated of each characteristic, by role.

    `heading` is what the row or column (`kind`) of lower tolerances is called, and `plus` whether one
    of them has its sign, "+0.01".
    """
    lowers = [(s["lower"], s.get("upper", np.nan)) for s in stated.values() if "lower" in s and "lsl" not in s]
    below = any(lower < 0.0 for lower, _ in lowers)
    magnitudes = heading.startswith(MAGNITUDE)
    doubt = magnitudes and below
    if doubt and any(lower < 0.0 and -lower >= upper for lower, upper in lowers):
        doubt = magnitudes = False  # without their signs, the lower limits of some would be above the upper ones
    if not (magnitudes or below or plus) and any(lower > 0.0 for lower, _ in lowers):
        # As signs, the limits of one would be the wrong way round.
        magnitudes = any(lower >= upper >= 0.0 < lower for lower, upper in lowers)
        doubt = not magnitudes
    specifications = {}
    faults = [Fault(f"{place}: {kind} {heading}", _UNSIGNED)] if doubt else []
    for name, values in stated.items():
        signed = {role: value for role, value in values.items() if not (doubt and role == "lower")}
        signed |= {"lower": -values["lower"]} if magnitudes and "lower" in values else {}
        specifications[name], wrong = specification(signed, f"{place}: {name}")
        faults += wrong
    return specifications, faults


_LIMIT_LIKE = re.compile(r"(?<!out)(?<!in)(?<!out )(?<!in )tol|limit|grenz|abma|spec|^(?:max|min)\.?$", re.IGNORECASE)
_COUNTS = ("", "#", "n", "nr", "no", "lfdnr", "number", "nummer")
"""What a column that numbers its rows is called, without blanks and points."""
_NO_SIDE = (
    "seems to hold tolerances or limits, and its name does not say of which side: call it upper tol, lower tol, USL or "
    "LSL, or remove it"
)


def unclear_rows(table: Table, place: str) -> list[Fault]:
    """A fault for every row of a table whose name is like that of a limit, or no number where parts have numbers."""
    name, cells = next(iter(table.columns.cells.items()))
    if name in table.values or role_of(name) in ("characteristic", "property"):
        return []
    ends = max(len(cells) - SAMPLE, SAMPLE)
    shown = [(at, str(cells[at])) for at in (*range(min(SAMPLE, len(cells))), *range(ends, len(cells)))]
    counts = [int(text) for _, text in shown if text.isdecimal()]
    rising = len(counts) > 2 and all(after > before for before, after in pairwise(counts))
    numbered = name in table.numeric and (role_of(name) == "part" or (rising and bare(name) in _COUNTS))
    texts = [(at, text) for at, text in shown if not is_missing(text) and np.isnan(number_in(text))]
    unclear = [(at, text) for at, text in texts if _LIMIT_LIKE.search(text) or (numbered and not text[:1].isdecimal())]
    what = "names no part, as most rows do: if it holds limits, call it USL or LSL, upper or lower tol, else remove it"
    few = unclear if 2 * len(unclear) < min(len(cells), 2 * SAMPLE) else []
    return [Fault(f"{place}: row {table.columns.lines[at]}", f'"{text}" {what}') for at, text in few]


_UNSIGNED = "its lower tolerances can be above the nominal size or below it: write their signs, +0.01 or -0.01"


def specification(
    values: Mapping[str, float], place: str, deviations: bool = False
) -> tuple[Specification, list[Fault]]:
    """The nominal size and limits of a characteristic from what is stated of them, NaN or left out
    where it is not; a limit and its deviation from the nominal must agree.

    Unless they are `deviations` for sure, tolerances of the size of the nominal are limits: a fault.
    """
    nominal, upper, lower, usl, lsl = (values.get(role, np.nan) for role in SPECIFIED)
    faults, ends = [], []
    for what, limit, off in (("lower", lsl, lower), ("upper", usl, upper)):
        by_deviation = round(nominal + off, 12) if np.isfinite(nominal + off) else np.nan  # decimals of the file
        if np.isfinite(off) and np.isnan(nominal) and np.isnan(limit):
            faults.append(Fault(place, f"its {what} tolerance {off:.10g} needs a nominal size"))
        elif not deviations and nominal and abs(off) > 0.5 * abs(nominal):
            text = f"its {what} tolerance {off:.10g} is no deviation from {nominal:.10g}: name it a limit (USL, LSL)"
            faults.append(Fault(place, text))
        if abs(limit - by_deviation) > 1e-9 * abs(limit) + 1e-12:
            text = f"its {what} limit is {limit:.10g}, but the nominal {nominal:.10g} with the deviation {off:.10g}"
            faults.append(Fault(place, f"{text} is {by_deviation:.10g}"))
        end = by_deviation if np.isnan(limit) else limit
        ends.append(None if np.isnan(end) else float(end))
    if not deviations and 2.0 * max(abs(usl), 0.0 if np.isnan(lsl) else abs(lsl)) < abs(nominal):
        text = f"its upper limit {usl:.10g} is no size near {nominal:.10g}: name it a tolerance where it is a deviation"
        faults.append(Fault(place, f"{text}, or leave the nominal size of a deviation of position away"))
    if ends[0] is not None and ends[1] is not None and ends[0] > ends[1]:
        faults.append(Fault(place, f"the lower limit {ends[0]:g} is above the upper limit {ends[1]:g}"))
    return Specification(None if np.isnan(nominal) else float(nominal), ends[0], ends[1]), faults


def specifications_of_rows(
    rows: Sequence[list[str]], names: Sequence[str], number: Callable[[int, str], float], place: str
) -> tuple[dict[str, Specification], list[Fault]]:
    """Nominal sizes and limits that stand in rows of a wide table, "Nennmaß;25,0", by column.

    `number(at, cell)` is the number in a cell of the column at that place, NaN where there is none.
    """
    roles = roles_of([next((cell for cell in row if cell), "") for row in rows])
    by_role = {role: row for role, row in zip(roles, rows, strict=True) if role in SPECIFIED}
    stated: dict[str, dict[str, float]] = {}
    for at, name in enumerate(names):
        for role, row in by_role.items():
            if at < len(row) and not np.isnan(value := number(at, row[at])):
                stated.setdefault(name, {})[role] = value
    lower = by_role.get("lower", [])
    heading = next((cell for cell in lower if cell), "")
    return _of_stated(stated, heading, any(cell.startswith("+") for cell in lower), place, "row")
