"""Runs, claims and yardsticks of one study."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

from sqlalchemy import Connection, Select, delete, func, select

from ....algorithms.course import Box
from ....sealed import loads, sealed_record, unsealed_record
from ...store.backend import Backend
from ...store.store import Store
from ...store.tables import RUNS, YARDSTICKS
from ..trial import RunRecord
from ..yardstick import Yardstick
from .rows import COLUMNS, Row, is_intact, record_of, row_of

NAMES = ("number", *COLUMNS, "checksum")
ALL = select(*(RUNS.c[name] for name in NAMES))
WINDOW = 1000
"""Runs that are looked up at once."""


class Database(Store):
    """The open store of a study of `points` points.

    A run's number is replicate * points + point, so that more replicates change no number. A run
    is claimed before it is begun, so that no other process begins it; the claim ends with the
    process, or a while after its machine did. Raises RunError where nothing can be written; what
    is in it stays.
    """

    def __init__(
        self, backend: Backend, points: int, responses: tuple[str, ...], prefix: str = "", reading: bool = False
    ) -> None:
        super().__init__(backend, prefix, reading)
        self.points = points
        self.responses = responses

    # what has been done

    def count(self, total: int) -> tuple[int, int]:
        """Runs done and failed of the first `total` numbers."""
        failed = func.count().filter(RUNS.c.status == "failed")
        statement = select(func.count(), failed).where(RUNS.c.number < total)
        ended, wrong = self.read(lambda connection: connection.execute(statement).one())
        return ended - wrong, wrong

    def missing(self, total: int) -> list[int]:
        """Numbers of the runs that have not ended, by point and replicate."""
        ended = self.read(lambda connection: {n for (n,) in connection.execute(select(RUNS.c.number))})
        open_numbers = (number for number in range(total) if number not in ended)
        return sorted(open_numbers, key=lambda number: (number % self.points, number // self.points))

    def free(self, numbers: Sequence[int]) -> list[int]:
        """The numbers, from the first free one on, that no process has done or is at work on."""
        for at in range(0, len(numbers), WINDOW):
            some = numbers[at : at + WINDOW]
            taken = self.claimed(some) | self.read(partial(self.present, table=RUNS, numbers=some))
            unclaimed = [number for number in some if number not in taken]
            if unclaimed:
                return [*unclaimed, *numbers[at + WINDOW :]]
        return []

    def damaged(self) -> list[int]:
        """Numbers of the rows whose checksum is wrong. Raises DatabaseError where it is damaged."""

        def look(connection: Connection) -> list[int]:
            self.backend.check(connection, self.format)
            rows = connection.execute(ALL).yield_per(WINDOW)
            return [row[0] for row in map(tuple, rows) if not is_intact(row)]

        return self.read(look)

    def runs(self, total: int) -> list[RunRecord]:
        """The runs that have ended, by point and replicate."""
        return sorted(self._records(ALL.where(RUNS.c.number < total)), key=lambda run: (run.point, run.replicate))

    def of_point(self, point: int, total: int) -> list[RunRecord]:
        """The runs of one setting that have ended, by replicate."""
        numbers, records = range(point, total, self.points), list[RunRecord]()
        for at in range(0, len(numbers), WINDOW):
            some = RUNS.c.number.in_(list(numbers[at : at + WINDOW]))
            records += self._records(ALL.where(some))
        return sorted(records, key=lambda run: run.replicate)

    def _records(self, statement: Select[Any]) -> list[RunRecord]:
        rows = self.read(lambda connection: [tuple(row) for row in connection.execute(statement)])
        return [record_of(row) for row in rows]

    def row(self, number: int) -> Row | None:
        """The row of a run as it is, None where there is none."""
        statement = ALL.where(RUNS.c.number == number)
        stored = self.read(lambda connection: connection.execute(statement).one_or_none())
        return None if stored is None else tuple(stored)

    # what is to be done

    def claim_runs(self, numbers: Iterable[int]) -> list[int]:
        """Claim the runs that have not ended and that no living process has begun; returns them."""
        return self.claim(numbers, RUNS)

    def record(self, runs: Iterable[RunRecord]) -> int:
        """Write the runs that have ended; one that is there already stays as it is.

        Returns how many are new.
        """
        return self.insert([row_of(run.replicate * self.points + run.point, run, self.responses) for run in runs])

    def insert(self, rows: Sequence[Row]) -> int:
        """Write rows, those of another database as well; returns how many are new."""
        numbers = [row[0] for row in rows]
        values: list[dict[str, Any]] = [dict(zip(NAMES, row, strict=True)) for row in sorted(rows)]
        statement = self.backend.insert(RUNS).on_conflict_do_nothing()

        def work(connection: Connection) -> int:
            stored = self.present(connection, RUNS, numbers)
            if values:
                connection.execute(statement, values)
            self.finished(connection, numbers)
            return len(set(numbers) - stored)

        added = self.write(work)
        self.let_go(numbers)
        return added

    def forget(self, numbers: Iterable[int]) -> None:
        """Drop rows, so that the runs are done again."""
        statement = delete(RUNS).where(RUNS.c.number.in_(list(numbers)))
        self.write(lambda connection: connection.execute(statement))

    # yardsticks

    def yardsticks(self) -> dict[int, Yardstick]:
        """The yardsticks of the problems, by their number in the plan.

        One that is not as it was written is left out, and computed again.
        """
        statement = select(YARDSTICKS.c.problem, YARDSTICKS.c.value)
        rows = self.read(lambda connection: connection.execute(statement).all())
        measures = {number: _yardstick(value, number) for number, value in rows}
        return {number: measure for number, measure in measures.items() if measure is not None}

    def claim_yardstick(self, problem: int) -> bool:
        """Whether no other process computes the yardstick of a problem: then this one may."""
        return self.claim([_of(problem)], RUNS) != []

    def keep_yardstick(self, problem: int, yardstick: Yardstick) -> None:
        """Keep the yardstick of a problem."""
        record = asdict(yardstick.box) | {"value": yardstick.value, "bound": yardstick.bound}
        value = json.dumps(sealed_record(record, of=str(problem))).encode()
        row = self.backend.insert(YARDSTICKS).values(problem=problem, value=value)
        statement = row.on_conflict_do_update(index_elements=[YARDSTICKS.c.problem], set_={"value": row.excluded.value})

        def work(connection: Connection) -> None:
            connection.execute(statement)
            self.finished(connection, [_of(problem)])

        self.write(work)
        self.let_go([_of(problem)])


def _of(problem: int) -> int:
    """The number under which the yardstick of a problem is claimed."""
    return -1 - problem


def _yardstick(content: bytes | str, problem: int) -> Yardstick | None:
    try:
        record = unsealed_record(loads(content), of=str(problem))
    except (TypeError, ValueError):
        return None
    return Yardstick(Box(tuple(record["ideal"]), tuple(record["nadir"])), record["value"], record["bound"])
