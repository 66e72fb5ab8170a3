"""What the commands of promises share: repeats that go on, and the limit of a share."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import gettempdir
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from scipy import stats

from ..kept import keep, kept
from .cases import SIZES

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Result = TypeVar("Result", bound=DataclassInstance)
else:
    Result = TypeVar("Result")


class Named(Protocol):
    """A case, by the name that its results are kept by."""

    @property
    def key(self) -> str: ...


Case = TypeVar("Case", bound=Named)


def parser(description: str | None, name: str, count: int = 1000) -> argparse.ArgumentParser:
    """The options of a command: repeats of each case, sizes of samples, file of results."""
    made = argparse.ArgumentParser(description=description)
    made.add_argument("--count", type=int, default=count, help="repeats of each case")
    made.add_argument("--seed", type=int, default=0, help="seed of the first repeat")
    made.add_argument("--n", type=int, nargs="*", default=SIZES, help="sizes of the samples")
    made.add_argument("--kept", type=Path, default=Path(gettempdir(), f"tolevo_{name}.jsonl"),
                      help="file of results, by which an interrupted run goes on")  # fmt: skip
    return made


@dataclass(frozen=True, slots=True)
class Repeated(Generic[Case, Result]):
    """A repeat of a case by its seed; results are read from a file, and added to it."""

    path: Path
    repeat: Callable[[Case, int], Result]
    made: type[Result]

    def each(self, case: Case, seeds: Sequence[int]) -> list[Result]:
        """The repeats of a case, those that are kept included."""
        known, found = self.known(), []
        for seed in seeds:
            if (case.key, seed) not in known:
                known[case.key, seed] = one = self.repeat(case, seed)
                keep(self.path, {"case": case.key, "seed": seed} | asdict(one))
            found.append(known[case.key, seed])
        return found

    def known(self) -> dict[tuple[str, int], Result]:
        """Results that are kept, by case and seed."""
        return {(str(one.pop("case")), int(one.pop("seed"))): self.made(**one)
                for one in kept(self.path)}  # fmt: skip


def lowest(good: int, count: int) -> float:
    """Lower 95 % limit [percent] of a share, of `good` among `count` (Clopper & Pearson 1934)."""
    return 100.0 * float(stats.beta.ppf(0.05, good, count - good + 1)) if good else 0.0
