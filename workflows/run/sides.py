"""The side searches of a run, in other processes where there are some."""

from __future__ import annotations

import signal
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from types import TracebackType

import pandas as pd

from ...algorithms.checkpoint import Checkpoint
from .references import SideSearch

Fronts = dict[SideSearch, pd.DataFrame | None]


class Sides:
    """Runs side searches beside the main one; each finished front is kept in the checkpoint.

    On leaving the context processes that still work are ended at once.
    """

    def __init__(
        self, searches: tuple[SideSearch, ...], workers: int, checkpoint: Checkpoint
    ) -> None:
        self.searches = searches
        self.checkpoint = checkpoint
        self.futures: dict[SideSearch, Future[pd.DataFrame | None]] = {}
        checkpoint.keep_only([side.key for side in searches])
        open_ = [side for side in searches if side.key not in checkpoint.tables]
        if workers > 1 and open_:
            others = set(active_children())
            self._pool = ProcessPoolExecutor(
                min(workers - 1, len(open_)),
                mp_context=get_context("spawn"),
                initializer=signal.signal,  # an interrupt is handled here, not in the workers
                initargs=(signal.SIGINT, signal.SIG_IGN),
            )
            self.futures = {side: self._pool.submit(side.front) for side in open_}
            self._processes = set(active_children()) - others

    def __enter__(self) -> Sides:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if not self.futures:
            return
        if not all(future.done() for future in self.futures.values()):
            for process in self._processes:
                process.terminate()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def collect(self) -> None:
        """Keep the fronts that have been finished since."""
        for side, future in self.futures.items():
            done = future.done() and not future.cancelled() and future.exception() is None
            if done and side.key not in self.checkpoint.tables:
                self._keep(side, future.result())

    def finish(self) -> None:
        """Make or wait for all fronts; an interrupt leaves out what has not been made.

        Those not begun elsewhere, or whose process was lost, are made here.
        """
        try:
            for side in reversed(self.searches):
                if side.key not in self.checkpoint.tables and self._not_begun(side):
                    self._keep(side, side.front())
            for side, future in self.futures.items():
                if side.key not in self.checkpoint.tables:
                    self._keep(side, _result(side, future))
        except KeyboardInterrupt:
            self.collect()

    def fronts(self) -> Fronts:
        """The front of each side search, None where it has not been made."""
        return {side: self.checkpoint.tables.get(side.key) for side in self.searches}

    def _not_begun(self, side: SideSearch) -> bool:
        return side not in self.futures or self.futures[side].cancel()

    def _keep(self, side: SideSearch, front: pd.DataFrame | None) -> None:
        if front is None:  # it was interrupted
            raise KeyboardInterrupt
        self.checkpoint.keep(side.key, front)


def _result(side: SideSearch, future: Future[pd.DataFrame | None]) -> pd.DataFrame | None:
    try:
        return future.result()
    except BrokenProcessPool:
        return side.front()
