"""1,500 checkpoints damaged in as many ways: each refused with its place, none gone on with."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.fuzzing import share
from tolevo.algorithms.checkpoint import Checkpoint
from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.errors import InputError
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import PropagationSetting, Settings

EACH = max(250, share(8, parts=6))
"""Files per way of damage: six ways make 1,500."""
Members = dict[str, bytes]
Damage = Callable[[bytes, np.random.Generator], bytes]


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A checkpoint with a search and two tables in it."""
    path = tmp_path_factory.mktemp("whole") / "checkpoint.npz"
    keeper = Checkpoint(path, '[algorithm]\nname = "nsga2"\n')
    problem = RvBacklash(Settings(propagation=PropagationSetting(method="moments")))
    search(problem, NSGA2(population=8), Budget(generations=3), 3, keeper=keeper)
    keeper.keep("one", pd.DataFrame({"a": [0.5, np.nan], "name": ["x", "y"]}))
    keeper.keep("none", pd.DataFrame(columns=["a"]))
    return path.read_bytes()


def flipped(whole: bytes, rng: np.random.Generator) -> bytes:
    """One to eight bytes changed, anywhere."""
    changed = bytearray(whole)
    for at in rng.integers(0, len(whole), rng.integers(1, 9)):
        changed[at] ^= int(rng.integers(1, 256))
    return bytes(changed)


def cut(whole: bytes, rng: np.random.Generator) -> bytes:
    """Cut short; one time in four by less than the digest is long."""
    most = 75 if rng.random() < 0.25 else len(whole)
    return whole[: len(whole) - int(rng.integers(1, most + 1))]


def shifted(whole: bytes, rng: np.random.Generator) -> bytes:
    """A stretch doubled, removed, or zeroed, as by a broken copy."""
    start, end = sorted(int(one) for one in rng.integers(0, len(whole) + 1, 2))
    end = max(end, start + 1)
    way = rng.integers(3)
    part = (whole[start:end] * 2, b"", b"\0" * (end - start))[way]
    changed = whole[:start] + part + whole[end:]
    return changed if changed != whole else b""


def members(whole: bytes) -> Members:
    with zipfile.ZipFile(io.BytesIO(whole)) as file:
        return {name: file.read(name) for name in file.namelist()}


def archive(found: Members, tail: bytes) -> bytes:
    """The archive anew, every checksum of it right, with the digest of the one before."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as opened:
        for name, part in found.items():
            opened.writestr(name, part)
    return file.getvalue() + tail


def without(whole: bytes, rng: np.random.Generator) -> bytes:
    """Some members missing."""
    found = members(whole)
    for name in rng.choice(sorted(found), int(rng.integers(1, 4)), replace=False):
        del found[str(name)]
    return archive(found, whole[-73:] if rng.random() < 0.5 else b"")


def swapped(whole: bytes, rng: np.random.Generator) -> bytes:
    """Two members with each other's content."""
    found = members(whole)
    one, other = (str(name) for name in rng.choice(sorted(found), 2, replace=False))
    while found[one] == found[other]:
        one, other = (str(name) for name in rng.choice(sorted(found), 2, replace=False))
    found[one], found[other] = found[other], found[one]
    return archive(found, whole[-73:] if rng.random() < 0.5 else b"")


def rewritten(whole: bytes, rng: np.random.Generator) -> bytes:
    """One member with another value, well formed."""
    found = members(whole)
    name = str(rng.choice(sorted(found)))
    values = np.load(io.BytesIO(found[name]), allow_pickle=False)
    kinds: dict[str, object] = {"f": values + 1.0 if values.dtype.kind == "f" else None,
                                "i": values + 1 if values.dtype.kind == "i" else None}  # fmt: skip
    other = kinds.get(values.dtype.kind)
    file = io.BytesIO()
    np.save(file, np.array("other") if other is None else np.asarray(other))
    found[name] = file.getvalue()
    return archive(found, whole[-73:] if rng.random() < 0.5 else b"")


WAYS: tuple[Damage, ...] = (flipped, cut, shifted, without, swapped, rewritten)


def test_the_whole_one_is_read(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    path.write_bytes(content)
    found = Checkpoint.read(path)
    assert list(found.tables) == ["one", "none"]
    assert found.saved() is not None
    with np.load(path, allow_pickle=False) as file:  # by numpy alone as well
        assert int(file["format"]) == 4


@pytest.mark.parametrize("damage", WAYS)
def test_damaged_checkpoints_are_refused(damage: Damage, content: bytes, tmp_path: Path) -> None:
    rng, path = np.random.default_rng(17), tmp_path / "checkpoint.npz"
    accepted = []
    for number in range(EACH):
        spoilt = damage(content, rng)
        assert spoilt != content
        path.write_bytes(spoilt)
        try:
            Checkpoint.read(path)
        except InputError as error:
            (fault,) = error.faults
            assert fault.place == str(path)
            assert fault.message.startswith("cannot be read: ")
            assert fault.message.endswith("start again with --overwrite")
        else:
            accepted.append(number)
    assert accepted == []
