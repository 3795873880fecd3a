"""Evaluating tasks on a Dask cluster, which needs the extra ``cluster``."""

from __future__ import annotations

import asyncio
import logging
import queue
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent import futures
from contextlib import suppress
from itertools import islice
from typing import Any

from susp_ctrl.errors import InputError

_PATIENCE = 30.0  # s until scheduler and first worker must have answered, and without any worker afterwards
_GLANCE = 2.0  # s between looks at what the cluster has left
# Tasks under way per thread of the cluster: enough to hide the network, few enough for flat memory.
_AHEAD = 4


class ClusterLostError(OSError):
    """A Dask cluster ended in the middle of the work."""


def evaluate_on_cluster(
    function: Callable[[Any], Any],
    tasks: Iterable[Any],
    address: str,
    lost: Callable[[Any, str], Any],
) -> Iterator[Any]:
    """Yield the answers of ``function(task)`` from a Dask cluster, in the order in which they are finished.

    Parameters
    ----------
    function : callable
        Picklable; sent with every task, so that no death of a worker loses it. The workers need this package in
        the same version.
    tasks : iterable
        Taken one by one, as the cluster is free.
    address : str
        Of the scheduler, such as ``"tcp://10.0.0.1:8786"``.
    lost : callable
        ``lost(task, reason)`` is the answer for a task that the cluster gave up.

    Raises
    ------
    InputError
        The extra is not installed, no scheduler answers there, or it has no worker.
    ClusterLostError
        Scheduler or last worker died on the way.

    Notes
    -----
    Dask's nanny, the default, holds BLAS to one thread in every worker; then the numbers are those of local processes.
    """
    try:
        from distributed import Client  # of the extra: not everybody has it
    except ImportError:
        raise InputError(
            f"scheduler = {address!r} needs the extra cluster: pip install 'susp_ctrl[cluster]'"
        ) from None
    log = logging.getLogger("distributed.client")
    level = log.level
    log.setLevel(
        logging.CRITICAL
    )  # it would print the trace of every attempt to reach a scheduler that is gone
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as problem:
        log.setLevel(level)
        said = " ".join(str(problem).split())
        raise InputError(f"scheduler = {address!r}: no Dask scheduler answers there ({said})") from None
    try:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError:
            raise InputError(f"scheduler = {address!r}: this Dask cluster has no worker") from None
        try:
            yield from _evaluated(client, function, tasks, address, lost)
        except ClusterLostError:
            raise
        except (asyncio.CancelledError, futures.CancelledError, OSError, TimeoutError):
            raise ClusterLostError(f"scheduler = {address!r}: the Dask scheduler is gone") from None
    finally:
        with suppress(Exception):  # of a scheduler that is gone
            client.close(timeout=_GLANCE)
        log.setLevel(level)


def _evaluated(
    client: Any,
    function: Callable[[Any], Any],
    tasks: Iterable[Any],
    address: str,
    lost: Callable[[Any, str], Any],
) -> Iterator[Any]:
    threads = sum(client.nthreads().values())
    supply = iter(tasks)
    under_way: dict[Any, Any] = {}
    finished: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def submit(number: int) -> None:
        for task in islice(supply, number):
            future = client.submit(function, task, pure=False)
            under_way[future] = task
            future.add_done_callback(finished.put)

    submit(_AHEAD * threads)
    seen = time.monotonic()
    while under_way:
        try:
            future = finished.get(timeout=_GLANCE)
        except queue.Empty:
            if client.status != "running":
                raise ClusterLostError(f"scheduler = {address!r}: the Dask scheduler is gone") from None
            if client.nthreads():
                seen = time.monotonic()
            elif time.monotonic() > seen + _PATIENCE:
                raise ClusterLostError(f"scheduler = {address!r}: the last Dask worker is gone") from None
            continue
        seen = time.monotonic()
        task = under_way.pop(future)
        given_up = future.exception(timeout=_PATIENCE)
        yield future.result() if given_up is None else lost(task, f"lost by the cluster: {given_up}")
        submit(1)
