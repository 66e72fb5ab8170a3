"""`tolevo ask` and `tolevo tell`: a search whose designs are evaluated elsewhere, by files.

The directory holds the configuration and every result that was told. Which designs are asked for
follows from these two alone, so that a command that is killed leaves nothing to mend: what a table
of results held is in `told.csv` whole, or not at all.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import tables
from ..algorithms.archive import nondominated
from ..algorithms.settings import Budget
from ..asking import DESIGN_TOLERANCE, FAILED, Search, askable, failed_rows, needed_outputs
from ..configuration.configuration import Configuration
from ..configuration.source import BUDGET_AND_ENGINE_KEYS
from ..directory import BUSY, CONFIGURATION, LOCK, OCCUPIED, TOLD, holds_search, is_occupied
from ..directory.lock import Held, acquire
from ..errors import Fault, raise_all, refuse
from ..files import clear_parts, csv_text, read_own_csv, write_text
from ..problems.tolerance_problem import designs_of

DESIGNS, FRONT = "designs.csv", "front.csv"
ID = "id"
MARKS = (FAILED, "nan", "na", "n/a", "error", "inf", "-inf")
"""Texts, in small letters, that mark an evaluation that failed."""


@dataclass(frozen=True, eq=False)
class Standing:
    """What a directory asks for: the open designs, and the results so far.

    `designs` has the column `id` and every variable, `told` the column `id` and every output that
    is needed (NaN where the evaluation failed); `front` are the feasible designs told that no other
    dominates. `done` states that the budget is used up.
    """

    configuration: Configuration
    designs: pd.DataFrame
    told: pd.DataFrame
    front: pd.DataFrame
    done: bool
    folder: Path

    @property
    def lines(self) -> tuple[str, ...]:
        """A short summary for the terminal."""
        failed = int(self.told.isna().any(axis=1).sum())
        results = f"{len(self.told)} results so far, {failed} of them failed; {len(self.front)} Pareto points"
        if self.done:
            return (f"done: {results} in {self.folder / FRONT}",)
        return (f"asked: {len(self.designs)} designs in {self.folder / DESIGNS}; {results}",)


def ask(configuration: Configuration, folder: Path) -> Standing:
    """Write the next designs of a search into `folder`, which continues the search that it holds.

    Raises InputError where the directory holds something else, or the search of another
    configuration; the budget alone may differ.
    """
    raise_all(askable(configuration.algorithm_name, configuration.algorithm))
    known = folder / CONFIGURATION
    if not holds_search(folder):
        if is_occupied(folder) and not _is_begun(folder, configuration):
            raise refuse("--out", OCCUPIED.format(folder).partition(";")[0] + "; name another directory")
    elif differing := _differences(configuration, known):
        raise refuse("--out", f"{folder} holds a search with another {', '.join(differing)}: name another directory")
    with _held(folder, "ask"):
        write_text(known, configuration.toml())
        told = _told(folder, configuration) if (folder / TOLD).is_file() else _none_told(configuration)
        found = standing(configuration, told, folder)
        write_text(folder / TOLD, csv_text(told))
        _write(found)
    return found


def no_search_faults(folder: Path) -> list[Fault]:
    """A fault of a directory that holds no search which was asked."""
    if holds_search(folder):
        return []
    return [Fault(str(folder), "holds no search that was asked: begin with `tolevo ask CONFIG --out DIR`")]


def tell(folder: Path, results: tables.Table, place: str) -> tuple[Standing, tuple[str, ...]]:
    """Take a table of results, in any order and of some of the designs alone; notes for the user.

    A row has the `id` of its design and every output that is needed; one without any of these is
    not answered yet, one that is marked as failed counts as infeasible. What was told before is
    left as it is. Raises InputError with every fault, and nothing is written then.
    """
    raise_all(no_search_faults(folder))
    from ..configuration.reader import read

    configuration = read(folder / CONFIGURATION)
    with _held(folder, "tell"):
        told = _told(folder, configuration)
        before = standing(configuration, told, folder)
        new, notes = _new_results(before, results, place)
        if len(new):
            told = pd.concat([told, new], ignore_index=True) if len(told) else new
            told = told.sort_values(ID, ignore_index=True)
            write_text(folder / TOLD, csv_text(told))
        found = standing(configuration, told, folder) if len(new) else before
        _write(found)
    return found, (f"results taken: {len(new)}", *notes)


def standing(configuration: Configuration, told: pd.DataFrame, folder: Path) -> Standing:
    """The search repeated with the results told (any order) up to the first design that lacks one."""
    plan = configuration.plan()
    search = Search(plan.problem, plan.algorithm, plan.seed, plan.engine, plan.start)
    known = told.set_index(ID)
    asked, generation, first = [], 0, 1
    while True:
        x = search.ask()
        left = _left(plan.budget, generation, first - 1)
        ids = np.arange(first, first + len(x))[:left]
        batch = x[:left].assign(**{ID: ids})[[ID, *x.columns]]
        asked.append(batch)
        if not len(ids) or len(ids) < len(x) or not np.isin(ids, known.index).all():
            break
        search.tell(x, known.loc[ids].reset_index(drop=True).set_index(x.index))
        generation, first = generation + 1, first + len(x)
    everything = pd.concat(asked, ignore_index=True)
    open_designs = batch[~batch[ID].isin(known.index)].reset_index(drop=True)
    front = _front(configuration, everything, told)
    return Standing(configuration, open_designs, told, front, not len(open_designs), folder)


def _left(budget: Budget, generation: int, evaluations: int) -> int | None:
    """Designs that a generation may still ask for, None for all of them."""
    if budget.generations is not None and generation >= budget.generations:
        return 0
    return None if budget.evaluations is None else max(0, budget.evaluations - evaluations)


def _front(configuration: Configuration, asked: pd.DataFrame, told: pd.DataFrame) -> pd.DataFrame:
    """The feasible designs told that no other dominates, by the first objective, with their outputs."""
    problem = configuration.problem
    assert problem is not None
    rows = asked.merge(told, on=ID, suffixes=("", " told"))
    values = {name: rows[name].to_numpy(dtype=float) for name in told.columns if name != ID}
    if not len(rows):
        return rows
    f, g = problem.objective_values(values), problem.violations(designs_of(problem, rows), values)
    kept = np.flatnonzero(np.isfinite(f).all(axis=1) & np.all(g <= 0.0, axis=1))
    kept = kept[nondominated(f[kept])] if len(kept) else kept
    return rows.iloc[kept].sort_values(problem.objectives[0], ignore_index=True, kind="stable")


def _none_told(configuration: Configuration) -> pd.DataFrame:
    needed = dict.fromkeys(needed_outputs(configuration.plan().problem), np.zeros(0))
    return pd.DataFrame({ID: np.zeros(0, dtype=np.int64)} | needed)


def _told(folder: Path, configuration: Configuration) -> pd.DataFrame:
    """The results on disk. Raises InputError where they are not as this command wrote them."""
    try:
        told = read_own_csv(folder / TOLD)
        if list(told.columns) != [ID, *needed_outputs(configuration.plan().problem)] or told[ID].duplicated().any():
            raise ValueError("its columns or ids are not those of this search")
        return told.astype({ID: np.int64} | dict.fromkeys(told.columns[1:], float))
    except (OSError, ValueError) as error:
        raise refuse(str(folder / TOLD), f"cannot be read: {error}; restore it, or ask into a new directory") from error


def _new_results(before: Standing, results: tables.Table, place: str) -> tuple[pd.DataFrame, list[str]]:
    """The results of a table that are not known yet. Raises InputError with every fault."""
    problem, needed = before.configuration.problem, list(before.told.columns[1:])
    assert problem is not None
    units = {v.name: v.unit for v in problem.variables} | {output.name: output.unit for output in problem.outputs}
    uses = {name: use for name, use in problem.settings.columns.items() if name in results.cells}
    fitted = tables.fit_columns(results, place, units, uses)
    cells = fitted.cells
    missing = [Fault(place, f"column {name} is missing") for name in (ID, *needed) if name not in cells]
    raise_all([*missing, *fitted.faults])
    faults, taken, again, empty = list[Fault](), dict[int, list[float]](), 0, 0
    open_designs = before.designs.set_index(ID)
    known = {at: values.tolist() for at, values in before.told.set_index(ID).iterrows()}
    variables = [name for name in open_designs.columns if name in cells]
    if FAILED in cells and FAILED not in needed:
        marked, word = failed_rows(cells[FAILED])
        if word is not None:
            raise refuse(f"{place}: column {FAILED}", f'must be true or false for each design, got "{word}"')
        cells = cells.assign(**{name: cells[name].astype(object).mask(marked, FAILED) for name in needed})
    for line, record in zip(cells.index, cells.to_dict("records"), strict=True):
        row = {str(name): value for name, value in record.items()}
        where = f"{place}: row {line}"
        texts = ["" if row[name] is None or row[name] != row[name] else str(row[name]).strip() for name in needed]
        number = tables.number_in(str(row[ID]).strip())
        if not np.isfinite(number) or number != round(number):
            faults.append(Fault(f"{where}, column {ID}", f"must be a whole number, got {row[ID]}"))
            continue
        at = int(number)
        if at not in open_designs.index and at not in known:
            text = f"{at} was never asked for: the designs that are open are in {before.folder / DESIGNS}"
            faults.append(Fault(f"{where}, column {ID}", text))
        elif at in open_designs.index and (other := _other_design(row, open_designs.loc[at], variables)):
            asked = open_designs[other].to_dict()[at]
            text = f"is not the design {at} that was asked for: it has {asked}, got {row[other]}"
            faults.append(Fault(f"{where}, column {other}", text))
        elif not any(texts):
            empty += 1
        elif wrong := [name for name, text in zip(needed, texts, strict=True) if not _is_result(text)]:
            text = 'must be a number, or "failed"'
            got = {name: str(row[name]).strip() for name in wrong}
            faults += [Fault(f"{where}, column {name}", f"{text}, got {got[name] or 'nothing'}") for name in wrong]
        else:
            values = [np.nan if text.casefold() in MARKS else tables.number_in(text) for text in texts]
            values = values if np.isfinite(values).all() else [np.nan] * len(values)
            earlier = known[at] if at in known else taken.get(at)
            if earlier is None:
                taken[at] = values
            elif np.array_equal(earlier, values, equal_nan=True):
                again += 1
            else:
                faults.append(Fault(where, f"contradicts the result of design {at} that was told before"))
    raise_all(faults)
    new = pd.DataFrame([[at, *values] for at, values in taken.items()], columns=[ID, *needed])
    notes = [*fitted.notes, *([f"results known already: {again}"] if again else [])]
    return new, notes + ([f'rows without a result yet ("{FAILED}" marks one that failed): {empty}'] if empty else [])


def _is_result(text: str) -> bool:
    """Whether a cell is a number or the mark of an evaluation that failed."""
    return bool(text) and (text.casefold() in MARKS or bool(np.isfinite(tables.number_in(text))))


def _other_design(row: dict[str, Any], design: Any, variables: list[str]) -> str:
    """The first variable of a row that is not that of its design, but for rounding; empty where there is none."""
    for name in variables:
        text = "" if row[name] is None or row[name] != row[name] else str(row[name]).strip()
        value, asked = tables.number_in(text), design[name]
        if not text or text == str(asked):
            continue
        if isinstance(asked, str) or not abs(value - asked) <= DESIGN_TOLERANCE * max(abs(asked), DESIGN_TOLERANCE):
            return name
    return ""


def _write(found: Standing) -> None:
    """The tables that follow from what was told."""
    write_text(found.folder / DESIGNS, csv_text(found.designs))
    write_text(found.folder / FRONT, csv_text(found.front))


def _is_begun(folder: Path, configuration: Configuration) -> bool:
    """Whether a directory holds what a killed `ask` of this configuration left, before it had written all."""
    for name in (CONFIGURATION, TOLD):
        if folder.is_dir():
            clear_parts(folder / name)
    names = {path.name for path in folder.iterdir()} - {LOCK} if folder.is_dir() else set()
    known = folder / CONFIGURATION
    return not names or (names == {CONFIGURATION} and not _differences(configuration, known))


def _differences(configuration: Configuration, known: Path) -> list[str]:
    """Tables in which the configuration of a file differs, the budget apart."""
    from ..configuration.reader import read

    here, there = configuration.tables(), read(known).tables()
    for table in (here, there):
        table["algorithm"] = {k: v for k, v in table["algorithm"].items() if k not in BUDGET_AND_ENGINE_KEYS[:-1]}
    return [name for name in {**here, **there} if here.get(name) != there.get(name)]


@contextmanager
def _held(folder: Path, command: str) -> Iterator[None]:
    """Hold the directory, made where there is none, against other processes."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        lock = acquire(folder, command)
    except Held as holder:
        raise refuse(str(folder), BUSY.format(holder)) from None
    try:
        for name in (CONFIGURATION, DESIGNS, TOLD, FRONT):
            clear_parts(folder / name)
        yield
    finally:
        lock.release()
