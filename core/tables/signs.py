"""The decimal sign of every column of a file: what its numbers prove, and what must be stated.

A column is read by its own evidence; a column without evidence is read by that of the file: its other
columns, or the delimiter (who separates columns by semicolons needs the comma for decimals). Where
numbers fit two interpretations still, the one near the nominal size is meant; without a nominal the
fault names `--decimal`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..errors import Fault
from .marks import is_missing
from .notation import DECIMAL, EITHER, OTHER, THOUSANDS, Notation, canonical_number, notation

PROBES = 64
"""Cells of a column, evenly spread, that say whether it holds numbers at all."""


class Exact(str):
    """A number that a file stores as a number, not as text: its sign need not be decided."""

    __slots__ = ()


@dataclass(slots=True)
class Evidence:
    """Cells of one column by what they prove, each with its place in the column: the first.

    `point` and `comma` map a role (decimal, thousands, either) to the first cell that has it.
    """

    point: dict[str, int] = field(default_factory=dict)
    comma: dict[str, int] = field(default_factory=dict)
    group: str = ""
    doubt: str = ""
    numbers: int = 0
    values: int = 0

    @property
    def numeric(self) -> bool:
        """Whether at least half of its values are numbers."""
        return self.numbers > 0 and 2 * self.numbers >= self.values

    def votes(self) -> set[str]:
        """The decimal signs that its cells prove."""
        signs = set()
        if DECIMAL in self.point or THOUSANDS in self.comma:
            signs.add(".")
        if DECIMAL in self.comma or THOUSANDS in self.point:
            signs.add(",")
        return signs

    def doubtful(self, decimal: str) -> bool:
        """Whether a cell can be another number where `decimal` is the decimal sign."""
        grouping = self.comma if decimal == "." else self.point
        return EITHER in grouping and THOUSANDS not in grouping

    def any_doubt(self) -> bool:
        """Whether a cell has a sign that can be either."""
        return EITHER in self.point or EITHER in self.comma

    def add(self, at: int, cell: str, number: Notation) -> None:
        """Take note of the number in cell `at`."""
        self.numbers += 1
        if not self.doubt and EITHER in (number.point, number.comma):
            self.doubt = cell
        if number.point:
            self.point.setdefault(number.point, at)
        if number.comma:
            self.comma.setdefault(number.comma, at)
        self.group = self.group or number.group


def evidence(cells: Sequence[str]) -> Evidence:
    """What the cells of a column prove; for a column of text only that it holds no number."""
    proof = Evidence()
    places: list[int] = np.linspace(0, len(cells) - 1, PROBES).astype(int).tolist()
    if len(cells) > 2 * PROBES and not any(notation(cells[at]) for at in places):
        proof.values = len(cells)
        return proof
    missing = 0
    for at, cell in enumerate(cells):
        if isinstance(cell, Exact):
            proof.numbers += 1
            continue
        number = notation(cell)
        if number is not None:
            proof.add(at, cell, number)
        elif is_missing(cell):
            missing += 1
    proof.values = len(cells) - missing
    return proof


def decide(
    columns: Mapping[str, Evidence],
    stated: str | None,
    delimiter: str,
    place: str,
    near: Callable[[str, float], bool] = lambda _column, _value: False,
) -> tuple[dict[str, str], list[Fault]]:
    """The decimal sign by column ("" where none is used), and what must be stated instead.

    `near` says whether a value of a column is near its nominal size, where that is known.
    """
    numeric = {name: proof for name, proof in columns.items() if proof.numeric}
    if stated is not None:
        return _signs_as_stated(numeric, stated, place)
    of_file = {vote for proof in numeric.values() for vote in proof.votes()}
    if not of_file and delimiter == "," and not any(EITHER in o.comma for o in numeric.values()):
        of_file = {"."}  # a comma between the columns leaves the point for decimals
    if not of_file and delimiter == ";" and not any(EITHER in o.point for o in numeric.values()):
        of_file = {","}
    signs, faults, doubted = {}, [], []
    for name, proof in numeric.items():
        votes = proof.votes()
        if len(votes) > 1:
            faults.append(Fault(f"{place}: column {name}", _MIXED))
        elif not votes and not proof.any_doubt():
            signs[name] = ""
        else:
            possible = votes or of_file
            if len(possible) == 1 and not proof.doubtful(min(possible)):
                signs[name] = min(possible)
            elif (sign := _by_size(name, proof.doubt, near)) and sign in (votes or sign):
                signs[name] = sign
            else:
                doubted.append(name)
    return signs, faults + [_doubt(name, numeric[name].doubt, place) for name in doubted]


def _by_size(column: str, cell: str, near: Callable[[str, float], bool]) -> str:
    """The decimal sign by which a cell in doubt is near the nominal size, empty where none or both are."""
    fitting = [sign for sign in OTHER if (text := canonical_number(cell, sign)) and near(column, float(text))]
    return fitting[0] if len(fitting) == 1 else ""


_MIXED = (
    "has decimal points in some cells and decimal commas in others; state --decimal where one of "
    "them groups thousands, or correct the cells"
)


def _signs_as_stated(numeric: Mapping[str, Evidence], stated: str, place: str) -> tuple[dict[str, str], list[Fault]]:
    """Every column by the stated sign; a column whose numbers all contradict it is a fault."""
    faults = [
        Fault(
            f"{place}: column {name}",
            f'its numbers have decimal signs that are not "{stated}": state another --decimal',
        )
        for name, proof in numeric.items()
        if proof.votes() == {OTHER[stated]}
    ]
    return dict.fromkeys(numeric, stated), faults


def _doubt(name: str, cell: str, place: str) -> Fault:
    decimal, grouped = cell.replace(",", "."), cell.replace(",", "").replace(".", "")
    text = f'"{cell}" can be {decimal} or {grouped}, and nothing in the file decides'
    return Fault(f"{place}: column {name}", f"{text}: state --decimal . or --decimal ,")


def canonical(cells: Sequence[str], decimal: str) -> list[str]:
    """The cells with their numbers in plain notation."""
    return [cell if isinstance(cell, Exact) else canonical_number(cell, decimal) or cell for cell in cells]
