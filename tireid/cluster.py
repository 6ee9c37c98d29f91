"""Work spread over a Dask cluster: the same functions, on as many machines as have workers.

Every worker must have this very version of tireid, which is checked. Results come in any order. A
worker that is lost is made good for by the scheduler; what several workers died of is reported. Of
the threads of a worker one works: CasADi's graphs must not be built by two at once. Which workers
have more is said, and how to start processes instead.
"""

import importlib
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from codegen.errors import TireidError
from codegen.package import source_digest
from identifier.compare.work import Map
from models.extras import needs
from tireid.progress import say

PATIENCE = 30.0  # s that the scheduler and the first worker may take to answer
_ONE_AT_A_TIME = threading.Lock()  # CasADi's graphs must not be built by two threads of a worker


class ClusterError(TireidError, OSError):
    """The cluster cannot be reached or cannot be used; one line that names its address."""


@contextmanager
def cluster(address: str) -> Iterator[Map]:
    """Yield a `map` whose work is done by the workers of a Dask scheduler; its order is any.

    address : of the scheduler, as in "tcp://host:8786".
    """
    try:
        dask: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise ImportError(needs("--scheduler", "Dask", "cluster")) from error
    try:
        client = dask.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"{address}: no Dask scheduler answers there") from error
    try:
        _require_workers(client, address)
        yield partial(_map, dask, client)
    finally:
        client.close()


def _require_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise ClusterError(f"{address}: the scheduler has no workers") from error
    try:
        versions = client.run(_digest)
    except Exception as error:
        raise ClusterError(f"{address}: a worker cannot load tireid: {error}") from error
    other = sorted(worker for worker, digest in versions.items() if digest != source_digest())
    if other:
        raise ClusterError(f"{address}: worker {other[0]} has another version of tireid")
    threads = {worker: count for worker, count in client.nthreads().items() if count > 1}
    if threads:
        worker, count = next(iter(threads.items()))
        say(
            f"worker {worker} has {count} threads, of which one works; start it as processes: "
            f"dask worker {address} --nworkers -1 --nthreads 1"
        )


def _digest() -> str:
    """Return the digest by a function of tireid, which finds its own packages on a worker."""
    return source_digest()


def _map(
    dask: Any,
    client: Any,
    work: Callable[[Any], Any],
    items: Iterable[Any],
    lost: Callable[[Any], None],
) -> Iterator[Any]:
    """Yield results; `lost` gets items that several workers died of."""
    shared = client.scatter(work, broadcast=True, hash=False)  # once to each worker
    futures = {client.submit(_work_alone, shared, item, pure=False): item for item in items}
    try:
        for future in dask.as_completed(list(futures), loop=client.loop):
            try:
                result = future.result()
            except dask.KilledWorker:
                lost(futures[future])
                continue
            yield result
            future.release()
    finally:
        client.cancel(list(futures))


def _work_alone(work: Callable[[Any], Any], item: Any) -> Any:
    with _ONE_AT_A_TIME:
        return work(item)
