"""The lines of a text file as rows of cells: by a delimiter, on which clevercsv and a rule of this
package must agree, by columns of fixed width, or all at once where the file is long.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv as arrow

from ..errors import refuse
from .header import Row
from .record import NAMES, Dialect, ReadOptions, empty_cells
from .signs import MISSING, PROBES, Evidence, Notation, is_date, is_missing, notation
from .text import decode_text

SAMPLE = 200
"""Lines that are looked at."""
DETECTED = 40
"""Lines that the detector looks at."""
CANDIDATES = (",", ";", "\t", "|")
SPACE = " "
STEADY, CLEAN = 0.8, 0.9
"""Least fraction of rows of one length, and of cells without any other delimiter."""
_SEP = re.compile(r'"?sep=(?P<sign>[^"\r\n])"?[;,\t]*\s*', re.IGNORECASE)
_UNIT = re.compile(r"\s*[\[(]?(?:mm|µm|um|arcmin|deg|Nm|N|rad|mrad|s|°C|%)[\])]?\s*")


@dataclass(frozen=True, slots=True)
class Separator:
    """The delimiter ("" of a single column), the quote, and lines before the table."""

    delimiter: str
    quote: str = '"'
    skipped: int = 0


def separator(lines: list[str], place: str, stated: str | None) -> Separator:
    """How the cells of the lines are separated. Raises InputError where it is ambiguous."""
    first = _SEP.fullmatch(lines[0]) if lines else None
    if first or stated is not None:
        return Separator(first["sign"] if first and stated is None else stated or "", '"', 1 if first else 0)
    sample = [line for line in lines[: 2 * SAMPLE] if line.strip()][:SAMPLE]
    scores = {sign: _clean_cell_fraction(sample, sign) for sign in CANDIDATES}
    fitting = [sign for sign, score in scores.items() if score >= CLEAN]
    if len(fitting) == 1:
        return _confirm_delimiter(sample, fitting[0], scores[fitting[0]], place)
    if fitting:
        raise _unknown_separator(place, fitting)
    if _is_single_column(sample):
        return Separator("")
    if _clean_cell_fraction(sample, SPACE) >= CLEAN:
        return Separator(SPACE)
    in_header = [sign for sign in CANDIDATES if sample and sign in sample[0]]
    if len(in_header) == 1:  # rows of many lengths: each is reported
        return Separator(in_header[0])
    raise _unknown_separator(place, list(CANDIDATES))


def _confirm_delimiter(sample: list[str], sign: str, score: float, place: str) -> Separator:
    """The delimiter where the detector agrees, or where nothing speaks against it."""
    detected, quote = sign, '"'
    if score < 1.0 or any("'" in line for line in sample[:DETECTED]):
        detected, quote = _detect_dialect(sample)
    if detected != sign and score < 1.0:
        raise _unknown_separator(place, [sign, detected])
    for candidate in CANDIDATES:
        if candidate != sign and _is_equally_frequent(sample, candidate):
            raise _unknown_separator(place, [sign, candidate])
    if sign == "," and _names_a_unit(sample):
        raise _unknown_separator(place, [",", ""])
    return Separator(sign, quote)


def _detect_dialect(sample: list[str]) -> tuple[str, str]:
    """Delimiter and quote in the detector's opinion; it takes long, and so does its import."""
    from clevercsv import Detector

    try:
        dialect = Detector().detect("\n".join(sample[:DETECTED]), delimiters=[*CANDIDATES, SPACE])
    except (ValueError, RuntimeError, IndexError):
        dialect = None
    if dialect is None:
        return "", '"'
    return dialect.delimiter or "", "'" if dialect.quotechar == "'" else '"'


def _is_equally_frequent(sample: list[str], sign: str) -> bool:
    """Whether a sign stands as often in the names as in every row, so that it can separate them."""
    if re.search(rf"\d{re.escape(sign)}\d", sample[0]):
        return False  # the first row is one of numbers
    counts = {line.count(sign) for line in sample}
    return len(sample) > 1 and len(counts) == 1 and min(counts) > 0


def _names_a_unit(sample: list[str]) -> bool:
    """Whether a comma stands between a name and its unit, and in decimals: "Laenge, mm"."""
    name, _, unit = sample[0].partition(",")
    rows = sample[1:]
    return bool(name and _UNIT.fullmatch(unit)) and all(re.fullmatch(r"-?\d+,\d+", row.strip()) for row in rows)


def _is_single_column(sample: list[str]) -> bool:
    """Whether lines are one column: each a value, none with a delimiter but a decimal comma."""
    if any(sign in sample[0] for sign in CANDIDATES):
        return False
    values = [line.strip().strip('"') for line in sample[1:]]
    if SPACE in sample[0].strip() and all(SPACE in value for value in values):
        return False
    return all(notation(value) or is_date(value) or not any(sign in value for sign in CANDIDATES) for value in values)


def _clean_cell_fraction(sample: list[str], sign: str) -> float:
    """The fraction of cells without another delimiter in rows that are separated by `sign`; 0 where
    the rows are of many lengths or have no names above them.
    """
    if not any(sign in line for line in sample):
        return 0.0
    try:
        rows = list(csv.reader(sample, delimiter=sign, skipinitialspace=True))
    except csv.Error:
        return 0.0
    rows = [[cell.strip() for cell in row] for row in rows]
    if sign == SPACE:
        rows = [[cell for cell in row if cell] for row in rows]
    lower = rows[len(rows) // 2 :]
    count = Counter(map(len, lower)).most_common(1)[0][0]
    tops = [at for at, row in enumerate(rows) if len(row) == count and all(row)]
    if count < 2 or not tops:
        return 0.0
    # Without names every row holds measurements, which is reported when the table is laid out.
    header = next((at for at in tops if not any(notation(cell) for cell in rows[at])), -1)
    if sign == "," and header < 0 and sign not in sample[0] and not notation(sample[0].strip()):
        return 0.0  # one column of decimal commas below its name
    below = rows[header + 1 :]
    whole = [row for row in below if len(row) == count or not any(row[count:])]
    if not below or len(whole) < STEADY * len(below):
        return 0.0
    cells = [cell for row in whole for cell in row]
    return sum(_is_value(cell, sign) for cell in cells) / len(cells)


def _is_value(cell: str, sign: str) -> bool:
    """Whether a cell is a value, or text without any other delimiter."""
    if notation(cell) or is_date(cell) or is_missing(cell):
        return True
    return not any(candidate in cell for candidate in CANDIDATES if candidate != sign)


def _unknown_separator(place: str, fitting: list[str]) -> Exception:
    names = " or ".join(dict.fromkeys(NAMES.get(sign, sign) for sign in fitting))
    remedy = "state --delimiter (comma, semicolon, tab, pipe, space)"
    return refuse(place, f"its columns can be separated by {names}, and the file does not show which: {remedy}")


# Long files: the layout comes from their first and last lines, the cells are read all at once.
#
# Whatever is not plain (quoted line breaks, empty lines, rows of many lengths) is read cell by cell
# instead, with the same result.


MIN_BULK_CHARACTERS = 300_000
"""Characters of a file that is long."""
ENDS = 400
"""Lines at each end that the layout comes from."""
NEAR = 20
"""Lines above and below repeated names that the layout comes from."""
_LABEL = r"^[+-]?0[0-9]+$|^[+-]?[0-9]{16,}$"
_MARKS = pa.array(
    sorted(
        {form for mark in MISSING for form in (mark, mark.upper(), mark.title())}
        | {"n.i.O.", "NaN", "n.i.O", "k.A.", "k. A."}
    )
)
"""Marks as they are mostly written; another spelling is read cell by cell."""


@dataclass(frozen=True)
class Bulk:
    """The lines of a long file, each a row, each cell between delimiters."""

    lines: list[str]
    form: Separator

    def repeated(self, line: int) -> list[int]:
        """The lines that are the same as a line, from that on."""
        text = self.lines[line - 1]
        if self.lines.count(text) == 1:
            return [line]
        return [at for at, other in enumerate(self.lines[line - 1 :], line) if other == text]

    def columns(self, lines: Sequence[int], count: int) -> list[pa.Array] | None:
        """The cells of lines, which are ascending, by column and trimmed; None where a row is not whole."""
        pieces = [slice(part[0] - 1, part[-1]) for part in _runs(lines)]
        text = "\n".join("\n".join(self.lines[piece]) for piece in pieces)
        body = text.encode()
        names = [str(at) for at in range(count)]
        try:
            table = arrow.read_csv(
                pa.BufferReader(body),
                arrow.ReadOptions(column_names=names, use_threads=False, block_size=len(body) + 1),
                arrow.ParseOptions(delimiter=self.form.delimiter, ignore_empty_lines=False),
                arrow.ConvertOptions(column_types=dict.fromkeys(names, pa.string()), strings_can_be_null=False),
            )
        except pa.ArrowInvalid:
            return None
        if table.num_rows != len(lines):
            return None
        trimmed = pc.ascii_trim_whitespace if text.isascii() else pc.utf8_trim_whitespace
        arrays = [trimmed(column.combine_chunks()) for column in table.columns]
        hollow = set(empty_cells(arrays[0]))
        whole = not (hollow and hollow.intersection(*map(empty_cells, arrays)))  # a row of delimiters alone
        return arrays if whole else None


def _runs(lines: Sequence[int]) -> Sequence[Sequence[int] | NDArray[np.int64]]:
    """Ascending numbers of lines, parted where some are left out."""
    if isinstance(lines, range):
        return [lines]
    numbers = np.asarray(lines)
    return np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)


def bulk_of(text: str, form: Separator) -> Bulk | None:
    """A long file of plain rows; None of any other."""
    if len(text) < MIN_BULK_CHARACTERS or form.quote != '"':
        return None
    if form.delimiter in ("", " ") or not form.delimiter.isascii():
        return None
    if '"' in text and f'{form.delimiter} "' in text:  # Arrow takes that space for a part of the cell
        return None
    if "\r" in text and text.count("\r") != text.count("\r\n"):
        return None
    lines = text.removesuffix("\n").split("\n")
    return Bulk(lines, form) if len(lines) > 3 * ENDS else None


def rows_near(bulk: Bulk, heads: Sequence[int] = ()) -> list[Row]:
    """The rows of both ends, and of what stands near lines of names, by the number of their line."""
    count = len(bulk.lines)
    near = {at for head in heads for at in range(max(head - NEAR, 1), min(head + NEAR, count) + 1)}
    chosen = sorted({*range(1, ENDS + 1), *range(count - ENDS + 1, count + 1)} | near)
    lines = [(at, line) for at in chosen if (line := bulk.lines[at - 1]).strip() and at > bulk.form.skipped]
    reader = csv.reader((line for _, line in lines), delimiter=bulk.form.delimiter)
    rows = [(at, [*map(str.strip, row)]) for (at, _), row in zip(lines, reader, strict=False)]
    return [row for row in rows if any(row[1])]


def probed(cells: pa.Array) -> list[str]:
    """Cells of a column, evenly spread."""
    places = np.unique(np.linspace(0, len(cells) - 1, PROBES).astype(int)) if len(cells) else np.zeros(0, dtype=int)
    return [cells[at].as_py() for at in places.tolist()]


def prove_column(cells: pa.Array) -> tuple[Evidence, NDArray[np.float64] | None] | None:
    """What the cells of a column prove, and its numbers; None where they must be read one by one.

    The cells are then numbers or marks of missing values (NaN), with a sign that is decimal in at
    least one of them, or none of the probes is a number.
    """
    texts = probed(cells)
    if not (probes := [number for text in texts if (number := notation(text))]):
        return Evidence(values=len(cells)), None
    unmarked, count, numbers = cells, len(cells), None if any("," in text for text in texts) else _numbers_of(cells)
    if numbers is None:
        unmarked = pc.if_else(pc.is_in(cells, _MARKS), pa.scalar(None, pa.string()), cells)
        count -= unmarked.null_count
    signed = {sign: pc.match_substring(unmarked, sign) for sign in (".", ",") if numbers is None or sign == "."}
    signs = {sign for sign, matches in signed.items() if pc.any(matches).as_py()}
    bare = unmarked.filter(pc.invert(pc.or_(*signed.values()) if len(signed) > 1 else signed["."]))
    if len(signs) > 1 or _has_label(bare):
        return None
    evidence = Evidence(numbers=count, values=count)
    if signs:
        if not _decides(probes) and not _decides(filter(None, map(notation, filter(None, unmarked.to_pylist())))):
            return None  # each can group thousands as well
        evidence.proven |= signs
    if numbers is None:
        numbers = _numbers_of(pc.replace_substring(unmarked, ",", ".") if "," in signs else unmarked, count)
    return None if numbers is None else (evidence, numbers)


def _has_label(cells: pa.Array) -> bool:
    """Whether digits are a label: with a zero in front, or too many for a number."""
    if not pc.any(pc.or_kleene(pc.greater(pc.binary_length(cells), 15), pc.less(cells, "1"))).as_py():
        return False  # zeros and signs stand before "1"
    return bool(pc.any(pc.match_substring_regex(cells, _LABEL)).as_py())


def _numbers_of(cells: pa.Array, count: int | None = None) -> NDArray[np.float64] | None:
    """The numbers in cells with decimal points; None where fewer than `count`, or than all, are finite."""
    try:
        numbers: NDArray[np.float64] = cells.cast(pa.float64()).to_numpy(zero_copy_only=False)
    except pa.ArrowInvalid:
        return None
    return numbers if np.isfinite(numbers).sum() == (len(cells) if count is None else count) else None


def _decides(numbers: Iterable[Notation]) -> bool:
    """Whether one of the numbers has a sign that can only be decimal."""
    return any(number.proven in number.signs for number in numbers)


# Rows of a text file.


_SPACES = re.compile(r"[ \t]+")


def rows_of_text(content: bytes, place: str, options: ReadOptions) -> tuple[list[Row], Dialect, Bulk | None, list[str]]:
    """The rows of a file that are not empty, by the number of their line, its dialect, and notes.

    For a long file, the rows at both ends and the bulk of it. Raises InputError where the file ends
    within a number for sure.
    """
    text, encoding = decode_text(content, place, options.encoding)
    bulk = None
    if options.delimiter is None and (fixed := rows_of_fixed_width(text)) is not None:
        rows, dialect = fixed, Dialect("fixed width", encoding)
    else:
        form = separator(text[:100_000].splitlines(), place, options.separator)
        dialect = Dialect("csv", encoding, form.delimiter, quote=form.quote)
        bulk = bulk_of(text, form)
        rows = rows_of(text, form, place) if bulk is None else rows_near(bulk)
    last = next((cell for cell in reversed(rows[-1][1]) if cell), "") if rows else ""
    if text.endswith(("\n", "\r")) or not notation(last):
        return rows, dialect, bulk, []
    if _is_cut_off(rows, last):
        cut = f'ends within its last number, "{last}": export it again, or end its last line with a line break'
        raise refuse(place, cut)
    note = f'no line break ends the last line: its last number, "{last}", is complete only if the file is'
    return rows, dialect, bulk, [note]


def _is_cut_off(rows: list[Row], last: str) -> bool:
    """Whether the last cell has fewer decimals than all others of its column, which have equally many."""
    at = rows[-1][1].index(last)
    cells = [row[at] for _, row in rows[-SAMPLE:-1] if len(row) == len(rows[-1][1]) and notation(row[at])]
    decimals = {_decimals(cell) for cell in cells}
    return len(cells) >= 3 and len(decimals) == 1 and _decimals(last) < min(decimals)


def _decimals(number: str) -> int:
    return len(re.sub(r".*[.,]|^[^.,]*$", "", number))


_WORDS = re.compile(r"\S+(?: \S+)*")
"""Words with single spaces between them: a heading of a table of fixed width."""
_WORD = re.compile(r"\S+")
_NUMBER_IN_LINE = re.compile(r"(?<!\S)(?:[+-]?[\d.,:]*\d\S*|[-.*#?]+)(?!\S)").search
"""Finds a number, a date or a mark in a line; the title of a block has none."""
Span = tuple[int, int]


def rows_of_fixed_width(text: str) -> list[Row] | None:
    """The rows of a table whose columns stand below each other; None where it is none, or where a
    heading can be that of two columns.
    """
    lines = [(at, line.rstrip()) for at, line in enumerate(text.split("\n", 3 * SAMPLE)[: 3 * SAMPLE], 1)]
    sample = [(at, line) for at, line in lines if line.strip()]
    signs = any(sign in line for _, line in sample for sign in ";\t|")
    if len(sample) < 3 or signs or not any("  " in line for _, line in sample):
        return None
    filled = [at for at, (_, line) in enumerate(sample) if _is_data(line)]
    lengths = Counter(len(sample[at][1].split()) for at in filled if 2 * at >= len(sample))
    usual = max(lengths, key=lambda count: lengths[count], default=0)
    data = [at for at in filled if len(sample[at][1].split()) == usual]
    if len(data) < 2 or data[0] == 0 or not any("  " in sample[at][1] for at in [data[0] - 1, *data]):
        return None
    fields = _occupied([sample[at][1] for at in data])
    first = data[0] - 1
    spans = _headed_fields([match.span() for match in _WORDS.finditer(sample[first][1])], fields)
    if spans is None or len(spans) < 2:
        return None
    every = [(at, line.rstrip()) for at, line in enumerate(text.split("\n"), 1) if line.strip()]
    heads, below = every[: first + 1], every[first + 1 :]
    rows = [(at, [token[0] for token in _WORDS.finditer(line)]) for at, line in heads]
    rows[-1][1][:0] = [""] * (len(spans) - len(rows[-1][1]))
    names, titles = rows[-1][1], {at for at, line in below if not _NUMBER_IN_LINE(line)}
    cells = iter(_cells_between([line for at, line in below if at not in titles], spans))
    for at, line in below:
        if at not in titles:
            rows.append((at, [*next(cells)]))
        else:
            rows.append((at, [*names] if line.split() == heads[-1][1].split() else [" ".join(line.split())]))
    return rows


def _cells_between(lines: list[str], spans: list[Span]) -> Iterable[Sequence[str]]:
    """The cells of each line: cut in the gaps between the stretches where every line is blank there,
    or else word by word, each to the stretch that is nearest.
    """
    cuts = [(end + start) // 2 for (_, end), (start, _) in pairwise(spans)]
    if all(line[cut : cut + 1] in ("", " ") for cut in cuts for line in lines):
        pieces = pairwise([0, *cuts, None])
        return zip(*([" ".join(line[start:end].split()) for line in lines] for start, end in pieces), strict=True)
    rows = []
    for line in lines:
        cells = [""] * len(spans)
        for token in _WORD.finditer(line):
            place = _nearest_span(token.span(), spans)
            cells[place] = f"{cells[place]} {token[0]}".strip()
        rows.append(cells)
    return rows


def _is_data(line: str) -> bool:
    """Whether a line has several words, half of which are numbers or dates."""
    words = line.split()
    return len(words) > 1 and 2 * sum(notation(w) is not None or is_date(w) for w in words) >= len(words)


def _occupied(lines: list[str]) -> list[Span]:
    """The stretches that no line leaves empty."""
    width = max(map(len, lines)) + 1
    filled = np.array([list(f" {line.ljust(width)}") for line in lines]) != " "
    edges = np.flatnonzero(np.diff(filled.any(axis=0)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _headed_fields(headings: list[Span], fields: list[Span]) -> list[Span] | None:
    """The stretch of each heading: that of the fields below it; None where that is not clear."""
    if headings and fields and fields[0][1] <= headings[0][0]:
        headings = [fields[0], *headings]  # a first column without a name
    below: list[list[Span]] = [[] for _ in headings]
    for field in fields:
        below[_nearest_span(field, headings)].append(field)
    if not headings or not all(below):
        return None
    return [(found[0][0], found[-1][1]) for found in below]


def _nearest_span(span: Span, among: list[Span]) -> int:
    """The stretch that overlaps a span most, or is the nearest."""
    overlap = [min(span[1], end) - max(span[0], start) for start, end in among]
    return int(np.argmax(overlap))


def rows_of(text: str, form: Separator, place: str) -> list[Row]:
    """The rows of a text that are not empty."""
    stream = io.StringIO(text, newline="")
    for _ in range(form.skipped):
        stream.readline()
    if form.delimiter in ("", " "):
        return _rows_by_spaces(stream, form.skipped, form.delimiter)
    reader = csv.reader(stream, delimiter=form.delimiter, quotechar=form.quote, skipinitialspace=True, strict=True)
    try:
        rows = [(reader.line_num + form.skipped, [*map(str.strip, row)]) for row in reader]
    except csv.Error as error:
        raise refuse(f"{place}: row {reader.line_num + form.skipped}", f"is not CSV ({error})") from error
    return [row for row in rows if any(row[1])]


def _rows_by_spaces(stream: io.StringIO, skipped: int, delimiter: str) -> list[Row]:
    """Rows whose cells are separated by runs of spaces, or that are one cell each."""
    rows = []
    for at, line in enumerate(stream, skipped + 1):
        stripped = line.strip()
        if stripped:
            cells = _SPACES.split(stripped) if delimiter else [stripped]
            rows.append((at, [cell.strip('"') for cell in cells]))
    return rows
