"""Tasks on the workers of an existing Dask scheduler."""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from importlib.metadata import version
from typing import Any

import distributed
from distributed.comm.core import connect
from distributed.core import send_recv

from .errors import Fault, InputError, RunError, refuse
from .execution import ATTEMPTS, Executor, Lost, Result, TaskT

PATIENCE = 8.0
"""Seconds that a scheduler has to answer."""
LOOK = 1.0
"""Seconds between two checks whether the scheduler is still there."""
AHEAD = 2
"""Tasks per worker that are handed over, so that none waits for the next."""
GONE = "the Dask scheduler {address} was lost"


class DaskCluster(Executor):
    """The workers of the scheduler at `address` (`tcp://...`, or `tls://...` with Dask's own
    configuration of the certificates).

    Raises InputError, which names `place`, where no scheduler answers, or where workers have
    another version. Dask runs the task of a lost worker on another as often as its
    `allowed-failures` say, and this class asks again after that.
    """

    def __init__(self, address: str, place: str = "--dask") -> None:
        _check(address, place)
        self.address = address
        self._threads, self._counted = 0, -math.inf
        self._logger = logging.getLogger("distributed.client")
        self._quiet = self._logger.disabled
        self._logger.disabled = True  # a lost scheduler is reported here, without a traceback
        self._client: Any = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        if faults := _version_faults(self._client, place):
            self.close()
            raise InputError(faults)

    @property
    def workers(self) -> int:  # type: ignore[override]
        """Threads of the workers, `LOOK` seconds ago at most; 0 where there is none."""
        if time.monotonic() >= self._counted + LOOK:
            try:
                self._threads = sum(self._client.nthreads().values())
            except (CancelledError, OSError) as error:
                raise RunError(GONE.format(address=self.address)) from error
            self._counted = time.monotonic()
        return self._threads

    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        busy: dict[Any, tuple[TaskT, int]] = {}
        while True:
            room = AHEAD * max(1, self.workers) - len(busy)
            while room > 0 and (task := source()) is not None:
                busy[self._submit(function, task, 1)] = task, 1
                room -= 1
            if not busy:
                return
            for future in self._ended(list(busy)):
                task, attempt = busy.pop(future)
                result = self._result(future)
                if isinstance(result, Lost) and attempt < ATTEMPTS:
                    busy[self._submit(function, task, attempt + 1)] = task, attempt + 1
                    continue
                yield task, result

    def _submit(self, function: Callable[[TaskT], Result], task: TaskT, attempt: int) -> Any:
        """A keyed task; another attempt has another key, or the stored failure would come back."""
        return self._client.submit(function, task, key=f"tolevo-{task.key}-{attempt}", pure=True)

    def _ended(self, futures: list[Any]) -> list[Any]:
        """The futures that have ended; waits for one at least."""
        while True:
            try:
                with self._client.as_current():
                    waited: Any = distributed.wait(futures, LOOK, "FIRST_COMPLETED")
                done = waited.done
                return [future for future in futures if future in done]
            except TimeoutError:
                if self._client.status != "running":
                    raise RunError(GONE.format(address=self.address)) from None
            except (CancelledError, OSError) as error:
                raise RunError(GONE.format(address=self.address)) from error

    def _result(self, future: Any) -> Any:
        if future.status not in ("finished", "error"):
            raise RunError(GONE.format(address=self.address))
        try:
            failure = future.exception(timeout=PATIENCE)
            result = future.result(timeout=PATIENCE) if failure is None else None
        except (CancelledError, OSError) as error:
            raise RunError(GONE.format(address=self.address)) from error
        if isinstance(failure, distributed.KilledWorker):
            return Lost("every Dask worker that tried it was lost (killed, or out of memory)")
        if isinstance(failure, ImportError):
            text = f"a Dask worker cannot run tolevo ({failure}): install the same version there"
            raise RunError(text) from failure
        if failure is not None:
            raise failure
        return result

    def close(self) -> None:
        self._client.close(timeout=PATIENCE)
        self._logger.disabled = self._quiet


def _check(address: str, place: str) -> None:
    """Raises InputError where no scheduler answers.

    Dask's client waits for ever for a peer that accepts the connection and sends nothing, and
    trusts the length of the first message of whatever answers.
    """
    try:
        with ThreadPoolExecutor(1) as apart:  # a notebook has an event loop running in its thread
            kind = apart.submit(asyncio.run, _answering_kind(address)).result()
    except (OSError, ValueError, TypeError, MemoryError, EOFError, RuntimeError) as error:
        reason = str(error).splitlines()[0] if str(error) else "no answer"
        text = f"no Dask scheduler answers at {address} ({reason}); start one: dask scheduler"
        raise refuse(place, text) from error
    if kind != "Scheduler":
        raise refuse(place, f"at {address} there is a {kind}: give the address of the scheduler")


async def _answering_kind(address: str) -> str:
    """The type of Dask's process at an address, if it answers in time."""
    return await asyncio.wait_for(_kind(address), PATIENCE)


async def _kind(address: str) -> str:
    """The type of Dask's process at an address."""
    arguments: Any = distributed.Security().get_connection_args("client")
    if address.startswith("tls://") and arguments.get("ssl_context") is None:
        raise ValueError("TLS needs certificates in Dask's configuration, see docs/study.md")
    comm: Any = await connect(address, timeout=PATIENCE, **arguments)
    try:
        identity: Any = await send_recv(comm, op="identity", reply=True)
        return str(identity["type"])
    finally:
        comm.abort()


def _version_faults(client: Any, place: str) -> list[Fault]:
    """A fault per version of the package, other than that of this process, that workers have."""
    installed, names_by_version = version("tolevo"), dict[str, list[str]]()
    try:
        workers = client.get_versions(packages=["tolevo"])["workers"]
    except (CancelledError, OSError) as error:
        return [Fault(place, f"the scheduler was lost while it was asked ({error})")]
    for name, known in workers.items():
        other = (known or {}).get("packages", {}).get("tolevo") or "none"
        if other != installed:
            names_by_version.setdefault(str(other), []).append(name)
    return [
        Fault(
            place,
            f"{len(names)} workers (the first is {names[0]}) have tolevo {other}, this is "
            f"tolevo {installed}: install the same everywhere",
        )
        for other, names in names_by_version.items()
    ]
