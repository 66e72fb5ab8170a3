"""Records asked in processes: what the commands of this benchmark have in common."""

from __future__ import annotations

import argparse
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any, TypeVar

Answer = TypeVar("Answer")


def count(text: str) -> int:
    """At least one; argparse says so where it is not."""
    if int(text) < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return int(text)


def asked(question: Callable[..., Answer], todo: Sequence[tuple[Any, ...]], workers: int) -> Iterator[Answer]:
    """The answers to a question about each record, which ends in group and number, as they come;
    what is not begun when it stops is left.
    """
    if workers == 1:
        yield from (question(*one) for one in todo)
        return
    ignored = (signal.SIGINT, signal.SIG_IGN)
    with ProcessPoolExecutor(workers, initializer=signal.signal, initargs=ignored) as pool:
        futures = {pool.submit(question, *one): one for one in todo}
        try:
            for done in as_completed(futures):
                if error := done.exception():
                    error.add_note(f"in record {futures[done][-2:]}")
                yield done.result()
        finally:
            pool.shutdown(cancel_futures=True)
