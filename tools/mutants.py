"""Mutants of the code that makes numbers, and whether the tests of its room notice them.

`python -m tools.mutants [ROOM ...]` or `make mutants`: of every room a seeded sample of mutations,
of the modules that prove every guard. Answers are kept in runs/mutants.jsonl, so that a stopped
run goes on; `--again` tries what survived once more. A mutant is tried in a process forked from
one that has imported all libraries, by the tests that execute its line, the shortest first. A table
says how many were killed, and every survivor is printed; status 1 where a guard of a proof
survives.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import os
import random
import re
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType

import coverage
import pytest

from tools.mutant_rooms import ROOMS, ROOT, Room
from tools.mutations import Mutation, mutations

ANSWERS = ROOT / "runs" / "mutants.jsonl"
SAMPLE, SEED = 60, 25
LONGEST = 10.0
"""Seconds of tests, the shortest first, that a mutant is tried by."""
TIMES, SPARE = 5, 20
"""A mutant may take so many times the CPU time of its tests, and so many seconds more."""
OURS = ("tolevo", "tests", "tools", "conftest")
OPTIONS = ("-q", "-x", "-p", "no:xdist", "-p", "no:cacheprovider", "-p", "no:randomly",
           "-m", "not slow and not timed", "-o", "timeout=300", "--hypothesis-seed=0",
           "-W", "ignore::pytest.PytestAssertRewriteWarning")  # fmt: skip
NOTHING = 5
"""Status of pytest where a file has no test that is asked."""
Place = tuple[str, Mutation]


# -------------------------------------------------------------------- one process per question


def asked(question: Callable[[], dict[str, object]], cpu: int = 0) -> tuple[dict[str, object], float]:
    """The answer of a question in a process of its own, and its CPU time; {} where it dies."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        child = os.fork()
        if not child:
            _in_child(question, answer, Path(folder), cpu)
        os.waitpid(child, 0)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return (json.loads(answer.read_text()) if answer.exists() else {}), spent


def _in_child(question: Callable[[], dict[str, object]], answer: Path, folder: Path, cpu: int) -> None:
    """Answer without a word, and leave without what the parent does at its end."""
    try:
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(folder / "hypothesis")
        tempfile.tempdir = str(folder)
        if cpu:
            resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu + 5))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        result = question()
        part = folder / "part.json"
        part.write_text(json.dumps(result))
        part.rename(answer)
    finally:
        os._exit(0)


class Watcher:
    """A plugin of pytest: picks and orders the tests, and notes what each took and what failed."""

    def __init__(self, picked: Mapping[str, float] | None, measured: coverage.Coverage | None) -> None:
        self.picked, self.measured = picked, measured
        self.seconds: dict[str, float] = {}
        self.failed: list[str] = []

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Only the picked tests, the shortest first."""
        if self.picked is not None:
            picked = self.picked
            items[:] = sorted((one for one in items if one.nodeid in picked), key=lambda one: picked[one.nodeid])

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """What is executed from here on belongs to this test."""
        if self.measured is not None:
            self.measured.switch_context(nodeid)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Adds up a test's seconds, and notes a failure."""
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self.failed.append(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """A module that cannot be imported is noticed as well."""
        if report.failed:
            self.failed.append(report.nodeid)


def _tested(files: Sequence[str], watcher: Watcher) -> int:
    os.chdir(ROOT)
    return int(pytest.main([*OPTIONS, *files], plugins=[watcher]))


# -------------------------------------------------------------------- what executes what


@dataclass(frozen=True, slots=True)
class Map:
    """Seconds of every test, and by file and line the tests that execute it."""

    seconds: dict[str, float]
    lines: dict[str, dict[int, list[str]]]

    def tests_of(self, place: Place) -> dict[str, float]:
        """The tests of a mutation, up to `LONGEST` seconds; all of what an import executes.

        Nothing is seen of compiled functions: they are tried by all tests of what imports them.
        """
        file, mutation = place
        own, first, last = self.lines.get(file, {}), *mutation.lines
        named = {test for line in range(first, last + 1) for test in own.get(line, ())}
        if not named and "numba" in (ROOT / file).read_text():
            named = self._callers(file)
        if "" in named or not named:
            named = set(self.seconds) if "" in named else named - {""}
        picked: dict[str, float] = {}
        total = 0.0
        for test in sorted(named - {""}, key=lambda one: self.seconds.get(one, 0.0)):
            total += self.seconds.get(test, 0.0)
            if picked and total > LONGEST:
                break
            picked[test] = self.seconds.get(test, 0.0)
        return picked

    def _callers(self, file: str) -> set[str]:
        """The tests that execute anything but an import of the modules that import this one."""
        name = re.compile(rf"^ *(from|import) .*\b{Path(file).stem}\b", re.MULTILINE)
        by = [one for one in self.lines if one != file and name.search((ROOT / one).read_text())]
        return {test for one in by for own in self.lines[one].values() for test in own} - {""}


def mapped(room: Room, tests: Sequence[str]) -> Map:
    """Seconds and lines of a room's tests, each file measured once for these modules."""
    files = room.sources()
    code = b"".join((ROOT / file).read_bytes() for file in files)
    known = Map({}, {file: {} for file in files})
    for test in tests:
        digest = hashlib.sha256(code + (ROOT / test).read_bytes()).hexdigest()
        stored = ANSWERS.parent / "mutants" / f"{digest[:20]}.json"
        answer = json.loads(stored.read_text()) if stored.exists() else asked(partial(_measured, files, test))[0]
        if answer.get("status") not in (0, NOTHING):
            sys.exit(f"{test} fails without any change: {answer.get('failed')}")
        stored.parent.mkdir(parents=True, exist_ok=True)
        stored.write_text(json.dumps(answer))
        seconds, lines = answer["seconds"], answer["lines"]
        assert isinstance(seconds, dict) and isinstance(lines, dict)
        known.seconds.update(seconds)
        for file, every in lines.items():
            for line, own in every.items():
                known.lines[file].setdefault(int(line), []).extend(own)
    return known


def _measured(files: Sequence[str], test: str) -> dict[str, object]:
    """What one file of tests executes, by line and test."""
    paths = [str(ROOT / file) for file in files]
    measured = coverage.Coverage(data_file=None, config_file=False, include=paths)
    watcher = Watcher(None, measured)
    measured.start()
    status = _tested([test], watcher)
    measured.stop()
    data = measured.get_data()
    lines = {
        file: {str(line): list(own) for line, own in data.contexts_by_lineno(path).items()}
        for file, path in zip(files, paths, strict=True)
    }
    return {"status": status, "seconds": watcher.seconds, "lines": lines, "failed": watcher.failed}


# -------------------------------------------------------------------- mutants


class Changed(MetaPathFinder):
    """Imports one module from another file."""

    def __init__(self, name: str, path: Path) -> None:
        self.name, self.path = name, path

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The file of the changed module, nothing for others."""
        return spec_from_file_location(fullname, self.path) if fullname == self.name else None


def module_of(file: str) -> str:
    """`algorithms/exact/combination.py` is `tolevo.algorithms.exact.combination`, and tolevo/ is tolevo itself."""
    parts = Path(file).with_suffix("").parts
    return ".".join(("tolevo", *(parts[1:] if parts[0] == "tolevo" else parts)))


def tried(place: Place, known: Map) -> dict[str, object]:
    """What came of a mutant: `killed` and by which test, or `survived`."""
    file, mutation = place
    tests = known.tests_of(place)
    text = mutation.applied((ROOT / file).read_text())
    files = list(dict.fromkeys(test.partition("::")[0] for test in tests))

    def question() -> dict[str, object]:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / Path(file).name
            path.write_text(text)
            if "numba" in text:  # compiled callers would keep the code of before
                os.environ["NUMBA_CACHE_DIR"] = folder
            sys.meta_path.insert(0, Changed(module_of(file), path))
            watcher = Watcher(tests, None)
            status = _tested(files, watcher)
        return {"status": status, "by": watcher.failed[:1]}

    cpu = int(TIMES * sum(tests.values()) + SPARE)
    answer, spent = asked(question, cpu) if tests else ({"status": 0, "by": []}, 0.0)
    by = answer.get("by")
    status = "survived" if answer.get("status") in (0, NOTHING) else "killed"
    first = by[0] if isinstance(by, list) and by else ("" if status == "survived" else "its time")
    return {"status": status, "by": first, "tests": len(tests), "cpu": round(spent, 2)}


def drawn(room: str, count: int) -> list[Place]:
    """Every guard of a room of proofs, and of others a seeded sample of all mutations."""
    own = ROOMS[room]
    every = [(file, one) for file in own.sources() for one in mutations((ROOT / file).read_text())]
    if own.guards:
        return [(file, one) for file, one in every if one.kind == "guard"]
    return random.Random(f"{SEED} {room}").sample(every, min(count, len(every)))  # noqa: S311


def key_of(place: Place) -> str:
    """What an answer is kept under: it holds for this text of the file only."""
    file, mutation = place
    text = (ROOT / file).read_text()
    what = (file, text, mutation.start, mutation.end, mutation.kind, mutation.after)
    return hashlib.sha256(repr(what).encode()).hexdigest()[:20]


def kept() -> dict[str, dict[str, object]]:
    """The answers so far, the last of a mutant counts."""
    lines = ANSWERS.read_text().splitlines() if ANSWERS.exists() else []
    found: dict[str, dict[str, object]] = {}
    for line in lines:
        if line.endswith("}"):  # the last one may be cut
            answer = json.loads(line)
            found[answer["key"]] = answer
    return found


def warmed(tests: Sequence[str]) -> None:
    """Import all libraries that the tests load, so that no mutant does it again; none of ours."""

    def question() -> dict[str, object]:
        os.chdir(ROOT)
        pytest.main(["--collect-only", *OPTIONS, *tests])
        return {"names": [name for name in sys.modules if name.partition(".")[0] not in OURS]}

    answer, _ = asked(question)
    names = answer.get("names", [])
    assert isinstance(names, list)
    for name in names:
        if name.isascii() and not name.startswith(("_", "test_", "numba")) and "<" not in name:
            try:
                importlib.import_module(name)
            except ImportError:
                continue  # a module that something made up while it ran


def answered(room: str, count: int, again: bool, file: str) -> Iterator[dict[str, object]]:
    """The answers of a room's mutants, from before or new; of one file only where it is named."""
    places = [place for place in drawn(room, count) if file in place[0]]
    before = kept()
    old = {key for key, answer in before.items() if not again or answer["status"] == "killed"}
    known: Map | None = None
    for place in places:
        key, (module, mutation) = key_of(place), place
        if key in old:
            yield before[key]
            continue
        if known is None:
            tests = ROOMS[room].tests_of()
            warmed(tests)
            known = mapped(ROOMS[room], tests)
        where = {"key": key, "room": room, "file": module, "line": mutation.lines[0]}
        what = {"kind": mutation.kind, "before": mutation.before, "after": mutation.after}
        answer: dict[str, object] = {**where, **what, **tried(place, known)}
        ANSWERS.parent.mkdir(exist_ok=True)
        with ANSWERS.open("a") as file_:
            file_.write(json.dumps(answer) + "\n")
        yield answer


def main(arguments: Sequence[str] | None = None) -> int:
    """0 where no guard of a proof survives."""
    parser = argparse.ArgumentParser(prog="python -m tools.mutants")
    parser.add_argument("rooms", nargs="*", help=f"of {', '.join(ROOMS)}; all if none is named")
    parser.add_argument("--sample", type=int, default=SAMPLE, help="mutants of a room")
    parser.add_argument("--again", action="store_true", help="try what survived once more")
    parser.add_argument("--file", default="", help="only files whose path has this in it")
    given = parser.parse_args(arguments)
    if missing := [room for room in given.rooms if room not in ROOMS]:
        parser.error(f"no rooms of these names: {', '.join(missing)}")
    survivors = 0
    for room in given.rooms or ROOMS:
        start, every = time.monotonic(), list(answered(room, given.sample, given.again, given.file))
        left = [one for one in every if one["status"] == "survived"]
        for one in left:
            what = " ".join(f"{one['before']}  ->  {one['after']}".split())
            print(f"  {one['file']}:{one['line']}  {what}")
        survivors += len(left) if ROOMS[room].guards else 0
        killed = len(every) - len(left)
        share = 100.0 * killed / max(len(every), 1)
        print(f"{room}: {killed} of {len(every)} killed, {share:.1f} %, in "
              f"{time.monotonic() - start:.0f} s", flush=True)  # fmt: skip
    return int(survivors > 0)


if __name__ == "__main__":
    sys.exit(main())
