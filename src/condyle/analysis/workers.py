"""Runs the parts of a job serially, in threads, in processes, or on a Dask cluster of yours.

Scheduling, queues and lost workers are handled by `concurrent.futures` and Dask; this module only
chooses between them. Results do not depend on the choice. It starts no cluster: each of Dask's
servers opens a port, for its pages at least, to everybody on the network.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
)
from contextlib import ExitStack, contextmanager
from typing import Any, TypeVar

from ..backends.threads import workers as processors
from ..errors import CondyleError, InputError, as_name, brief
from ..extras import require

Job = TypeVar("Job")
Result = TypeVar("Result")
Work = Callable[[Job, int], Result]

PROCESSES, THREADS = "processes", "threads"
TIMEOUT = 10.0  # of a scheduler's answer [s]


class LostWorkerError(CondyleError):
    """A worker process ended before it had finished its part of a job."""


def check_scheduler(workers: int | None, scheduler: str | None) -> None:
    """Raises InputError for an unknown scheduler, or one that does not answer."""
    if workers is not None and not (isinstance(workers, int) and workers >= 1):
        raise InputError(f"workers: expected a whole number of at least 1, got {brief(workers)}")
    if scheduler is None or as_name(scheduler, "scheduler") in (PROCESSES, THREADS):
        return
    if "://" not in scheduler:
        raise InputError(
            f'scheduler "{scheduler}": expected {PROCESSES}, {THREADS}, or the address of a Dask '
            "scheduler such as tls://10.0.0.1:8786"
        )
    if workers is not None:
        raise InputError("workers cannot be set for an existing scheduler")
    require("distributed", "cluster")
    with _client(scheduler):
        pass


def run_parts(
    job: Job,
    work: Work[Job, Result],
    parts: Sequence[int],
    workers: int | None,
    scheduler: str | None,
) -> Iterator[tuple[int, Result]]:
    """Parts and the result of `work(job, part)` for each, in the order in which they finish.

    Args:   workers: number of them; default: all processors.
            scheduler: processes, threads, or the address of a Dask scheduler; None: serially.
    Raises: InputError:      if the scheduler does not answer.
            LostWorkerError: if a worker ended; Dask retries on other workers first.
    """
    count = min(workers or processors(None), len(parts))
    if scheduler is None or not parts or (count == 1 and scheduler in (PROCESSES, THREADS)):
        for part in parts:
            yield part, work(job, part)
        return
    with _pool(job, count, scheduler) as (pool, shared):
        waiting = {pool.submit(_part, shared, work, part): part for part in parts}
        for future in as_completed(waiting):
            yield waiting.pop(future), future.result()


@contextmanager
def _pool(job: Any, count: int, scheduler: str) -> Iterator[tuple[Executor, Any]]:
    """An executor, and the job as its workers get it; at the end pending parts are cancelled."""
    lost: tuple[type[Exception], ...] = (BrokenExecutor, CancelledError)
    pool: Executor
    with ExitStack() as stack:
        if scheduler == PROCESSES:  # a fork needs nothing of the caller's script, nor to pickle
            start = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
            pool, shared = ProcessPoolExecutor(count, start, _begin, (job,)), None
        elif scheduler == THREADS:
            pool, shared = ThreadPoolExecutor(count), job
        else:
            from distributed import KilledWorker

            client = stack.enter_context(_client(scheduler))
            # What was submitted can be made again where it is lost.
            pool, shared = client.get_executor(pure=False), client.submit(_same, job, pure=False)
            lost = (*lost, KilledWorker)
        try:
            yield pool, shared
        except lost as error:
            what = f"the cluster gave up on a part: {error}."
            if isinstance(error, BrokenExecutor):
                what = "a worker process was killed or crashed (is there enough memory?)."
            raise LostWorkerError(what, "Finished parts are kept; --resume continues.") from error
        except BaseException:
            if isinstance(pool, ProcessPoolExecutor):
                _end(pool)  # a part may take long, and nobody would take it
            raise
        finally:
            if scheduler in (PROCESSES, THREADS):
                pool.shutdown(cancel_futures=True)
            else:
                pool.shutdown(wait=False)  # which cancels what is left


def _end(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool at once."""
    for process in list((pool._processes or {}).values()):
        process.terminate()


_job: Any = None  # of a worker process


def _part(shared: Any, work: Work[Any, Result], part: int) -> Result:
    return work(_job if shared is None else shared, part)


def _same(job: Any) -> Any:
    return job


def _begin(job: Any) -> None:
    """Begin a worker: Ctrl-C is left to the parent, and the worker ends with its parent."""
    global _job
    _job = job
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _client(scheduler: str) -> Any:
    """A client of the cluster at an address, to be closed."""
    from distributed import Client

    try:
        return Client(scheduler, timeout=TIMEOUT)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(
            f"no Dask scheduler answers at {scheduler} ({type(error).__name__}). Start one with "
            "`dask scheduler`, and workers with `dask worker ADDRESS`"
        ) from None
