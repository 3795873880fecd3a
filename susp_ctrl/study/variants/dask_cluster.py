"""Evaluating tasks on a Dask cluster, which needs the extra ``cluster``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import Any

from susp_ctrl.errors import InputError

_PATIENCE = 30.0  # s until scheduler and first worker must have answered
# Tasks under way per thread of the cluster: enough to hide the network, few enough for flat memory.
_AHEAD = 4


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
        Picklable; sent to each worker once. The workers need this package in the same version.
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

    Notes
    -----
    Dask's nanny, the default, holds BLAS to one thread in every worker; then the numbers are those of local processes.
    """
    try:
        from distributed import Client, as_completed  # of the extra: not everybody has it
    except ImportError:
        raise InputError(
            f"scheduler = {address!r} needs the extra cluster: pip install 'susp_ctrl[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as problem:
        said = " ".join(str(problem).split())
        raise InputError(f"scheduler = {address!r}: no Dask scheduler answers there ({said})") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError:
            raise InputError(f"scheduler = {address!r}: this Dask cluster has no worker") from None
        threads = sum(client.nthreads().values())
        shared = client.scatter(function, broadcast=True, hash=False)
        supply = iter(tasks)
        under_way: dict[Any, Any] = {}

        def submit(task: Any) -> Any:
            future = client.submit(_call, shared, task, pure=False)
            under_way[future.key] = task
            return future

        first = [submit(task) for task in islice(supply, _AHEAD * threads)]
        finished = as_completed(first, loop=client.loop)
        for future in finished:
            task = under_way.pop(future.key)
            given_up = future.exception()
            yield future.result() if given_up is None else lost(task, f"lost by the cluster: {given_up}")
            for following in islice(supply, 1):
                finished.add(submit(following))


def _call(function: Callable[[Any], Any], task: Any) -> Any:
    return function(task)
