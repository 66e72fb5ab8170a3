"""Where the blocks of a table are stored until all have ended."""

from __future__ import annotations

import io
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

IDENTITY = {
    "command": "another command",
    "configuration": "another configuration",
    "table": "another table",
    "version": "another version of tolevo",
    "quality": "another quality",
    "rows": "a table of another length",
}
"""The properties by which tables differ, and how messages call a table that differs in them."""


@dataclass(frozen=True)
class About:
    """The identity of a table: digests of the configuration and of the rows, the version of the
    package, the quality, rows in all and in a block.
    """

    command: str
    configuration: str
    table: str
    version: str
    quality: str
    rows: int
    block_rows: int

    @property
    def total(self) -> int:
        """Number of blocks."""
        return max(1, -(-self.rows // self.block_rows))

    def differences(self, stored: Mapping[str, Any]) -> list[str]:
        """What a stored identity is that of, where it is not that of this table."""
        return [text for name, text in IDENTITY.items() if stored.get(name) != getattr(self, name)]

    def with_blocks_of(self, stored: Mapping[str, Any]) -> About:
        """The identity of this table in blocks of the stored length."""
        return replace(self, block_rows=int(stored["block_rows"]))


class BlockStore(ABC):
    """The blocks of one table: `completed` are the numbers of those that have ended."""

    about: About
    completed: set[int]

    @abstractmethod
    def keep(self, number: int, content: bytes) -> None:
        """Keep a block, a Parquet file."""

    @abstractmethod
    def block(self, number: int) -> Path | io.BytesIO:
        """A block that has ended, to be read."""

    def claim(self, number: int) -> bool:
        """Whether a block is ours to be computed; others may be at work on the same table."""
        return True

    def refresh(self) -> None:  # noqa: B027 - nobody else is at work
        """Read which blocks others have computed."""

    @abstractmethod
    def saved(self) -> str:
        """What is saved where a table cannot be finished, and how to continue."""

    def _count(self, place: str) -> str:
        return f"{len(self.completed)} of {self.about.total} blocks are saved in {place}"

    def close(self) -> None:  # noqa: B027 - nothing is held in memory alone
        """Release it for others."""

    def remove(self) -> None:  # noqa: B027
        """Remove all of it, once the table is written elsewhere."""


class InMemory(BlockStore):
    """Blocks that no other process needs: of a table that is returned, or of only one block."""

    def __init__(self, about: About) -> None:
        self.about = about
        self.completed = set()
        self._held: dict[int, bytes] = {}

    def keep(self, number: int, content: bytes) -> None:
        self._held[number] = content
        self.completed.add(number)

    def block(self, number: int) -> io.BytesIO:
        return io.BytesIO(self._held[number])

    def saved(self) -> str:
        return "nothing is saved"
