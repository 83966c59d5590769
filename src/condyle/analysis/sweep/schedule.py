"""Who does the parts of a study: this process, others of this machine, or a cluster of Dask's.

Scheduling, queues and what becomes of a lost worker are those of `concurrent.futures` and Dask;
here stands only which of them is asked. Results do not depend on it.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
)
from contextlib import contextmanager
from typing import Any, TypeVar

from ...backends.threads import workers as processors
from ...errors import CondyleError, InputError
from ...extras import require
from .job import Job

Result = TypeVar("Result")
Work = Callable[[Job, int], Result]

PROCESSES, THREADS, DASK = "processes", "threads", "dask"
PATIENCE = 10.0  # seconds that a scheduler has to answer


class LostWorkerError(CondyleError):
    """A process that did a part of a study ended before it was done."""


def check_scheduler(workers: int | None, scheduler: str) -> None:
    """Raises InputError for what cannot be a scheduler, or does not answer as one."""
    if workers is not None and workers < 1:
        raise InputError(f"workers: expected 1 or more, got {workers}")
    if scheduler in (PROCESSES, THREADS):
        return
    if scheduler != DASK and "://" not in scheduler:
        raise InputError(
            f'scheduler "{scheduler}": expected {PROCESSES}, {THREADS}, {DASK} (a cluster on this '
            "machine), or the address of a Dask scheduler such as tcp://10.0.0.1:8786"
        )
    if scheduler != DASK and workers is not None:
        raise InputError("workers: a cluster that runs already has its own; leave it out")
    require("distributed", "cluster")
    if scheduler != DASK:
        with _client(None, scheduler):
            pass


def done(
    job: Job, work: Work[Result], parts: Sequence[int], workers: int | None, scheduler: str
) -> Iterator[tuple[int, Result]]:
    """Parts and what `work(job, part)` made of each, in whatever order they get done.

    Args:   workers: default: the processors at hand.
            scheduler: processes, threads, dask, or the address of a Dask scheduler.
    Raises: InputError:      if the scheduler does not answer.
            LostWorkerError: if a worker ended; Dask tries elsewhere first.
    """
    if not parts:
        return
    if scheduler not in (PROCESSES, THREADS):
        yield from _by_dask(job, work, parts, workers, scheduler)
        return
    hands = min(workers or processors(None), len(parts))
    if hands == 1:
        for part in parts:
            yield part, work(job, part)
        return
    pool = _processes(job, hands) if scheduler == PROCESSES else ThreadPoolExecutor(hands)
    do: Callable[..., Any] = _part if scheduler == PROCESSES else _Bound(job, work)
    arguments = (work,) if scheduler == PROCESSES else ()
    with _ended_in_order(pool):
        waiting = {pool.submit(do, *arguments, part): part for part in parts}
        try:
            for future in as_completed(waiting):
                yield waiting.pop(future), future.result()
        except BrokenExecutor as error:
            raise LostWorkerError(
                "a worker process was killed or ended by itself (is there enough memory?).",
                "What was done is kept; --resume does the rest.",
            ) from error


@contextmanager
def _ended_in_order(pool: Executor) -> Iterator[None]:
    """On the way out parts that have not begun are forgotten."""
    try:
        yield
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


class _Bound:
    """Work on one job."""

    def __init__(self, job: Job, work: Work[Any]) -> None:
        self._job, self._work = job, work

    def __call__(self, part: int) -> Any:
        return self._work(self._job, part)


# -- processes of this machine -----------------------------------------------------------------

_job: Job | None = None  # of a worker process


def _processes(job: Job, hands: int) -> ProcessPoolExecutor:
    # A fork needs nothing of the caller's script; elsewhere it is not safe.
    start = "fork" if sys.platform == "linux" else "spawn"
    context = multiprocessing.get_context(start)
    return ProcessPoolExecutor(hands, context, _begin, (job,))


def _begin(job: Job) -> None:
    """In a worker: Ctrl-C is the parent's to hear, and without a parent there is no work."""
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


def _part(work: Work[Result], part: int) -> Result:
    assert _job is not None
    return work(_job, part)


# -- Dask --------------------------------------------------------------------------------------


def _by_dask(
    job: Job, work: Work[Result], parts: Sequence[int], workers: int | None, scheduler: str
) -> Iterator[tuple[int, Result]]:
    from distributed import CancelledError, KilledWorker, as_completed

    with _client(workers, scheduler) as client:
        shared = client.submit(_same, job, pure=False)  # can be made again where it is lost
        futures = client.map(_with_part(work), list(parts), job=shared, pure=False)
        try:
            for _, found in as_completed(futures, with_results=True):
                yield found
        except (KilledWorker, CancelledError) as error:
            raise LostWorkerError(
                f"the cluster gave up on a part: {error}.",
                "What was done is kept; --resume does the rest.",
            ) from error
        finally:
            client.cancel(futures)


def _same(job: Job) -> Job:
    return job


def _with_part(work: Work[Result]) -> Callable[..., tuple[int, Result]]:
    def do(part: int, job: Job) -> tuple[int, Result]:
        return part, work(job, part)

    return do


@contextmanager
def _client(workers: int | None, scheduler: str) -> Iterator[Any]:
    """A client of the cluster at an address, or of one on this machine for as long as it takes."""
    from distributed import Client, LocalCluster

    if scheduler == DASK:
        hands = workers or processors(None)
        with (
            LocalCluster(
                n_workers=hands,
                threads_per_worker=1,
                dashboard_address=None,
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = Client(scheduler, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {scheduler} ({type(error).__name__}). Start one with "
            "`dask scheduler`, and workers with `dask worker ADDRESS`"
        ) from None
    with client:
        yield client
