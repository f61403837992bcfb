"""Processes that run the jobs: a Dask cluster on this machine, or an existing scheduler.

At most two jobs per thread are submitted at a time, one running and one waiting, so a killed worker loses little and
memory does not grow with the table. Workers that join during a run get their share. Dask restarts a killed worker and
repeats its job; a job that kills its worker three times becomes a row with the outcome "failed".

Anyone who can connect to a scheduler can run programs as its user. A local cluster listens only on loopback, and
accepts only connections with a key that is made for this run and that only this user can read, so that other users of
the machine are refused; it serves no status pages, which would show them recordings' paths, or whatever the user's
Dask configuration adds. A scheduler on a network must use `tls://` with certificates, which Dask reads from its own
configuration; if that demands encryption, it applies to a local cluster, too.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from importlib.metadata import version
from itertools import islice
from typing import Any, Final

from armload_controller.control_errors import FleetError
from armload_controller.fleet.job import Job
from armload_controller.fleet.recording_row import Row, empty_row

MEMORY_BYTES: Final = 2**30
"""Memory of a local worker: one that exceeds it is killed together with its job."""
LOOPBACK: Final = "127.0.0.1"
_CONFIGURATION: Final = {
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.scheduler.allowed-failures": 2,
    "distributed.worker.preload": ["armload_controller.fleet.worker_start"],
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # By default each process monitors itself 50 times a second: with two workers 8 % of a core, with this 3 %.
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    # With Dask's setting every array gets new pages: 300,000 page faults per pair of recordings, twice the CPU time.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
    # A heap of huge pages, with glibc 2.35 or newer: 10 page faults per pair instead of 1,000 to 3,000.
    "distributed.nanny.pre-spawn-environ.GLIBC_TUNABLES": "glibc.malloc.hugetlb=1",
}
_CONNECT_TIMEOUT_S: Final = 30.0


@contextmanager
def workforce(scheduler: str | None = None, workers: int | None = None) -> Iterator[Workforce]:
    """Workers with all modules loaded before the first job, until the end of the block.

    Args:
        scheduler: Address of an existing scheduler, such as tls://host:8786; if not given, a cluster is started on
            this machine.
        workers: Number of processes of that cluster; if not given, the number of cores available to this program.

    Raises:
        FleetError: the scheduler does not answer, or a worker has another version of armload.
    """
    import dask
    import distributed
    from distributed.utils import LoopRunner

    with ExitStack() as stack:
        stack.enter_context(dask.config.set(_CONFIGURATION))
        address, security = scheduler, None
        try:
            if address is None:
                security = _own_security()
                address = stack.enter_context(_cluster(workers or len(os.sched_getaffinity(0)), security))
            else:
                LoopRunner().run_sync(_connect_once, address)
            client = stack.enter_context(distributed.Client(address, timeout=_CONNECT_TIMEOUT_S, security=security))
        except (OSError, ValueError, TypeError, RuntimeError) as problem:
            raise FleetError(
                f"no scheduler at {address}: {problem}; check `scheduler=` and its certificates "
                "(controller/FLEET.md, Where it runs)"
            ) from problem
        _require_same_version(client, scheduler)
        yield Workforce(client, scheduler)


async def _connect_once(address: str) -> None:
    """Connect to a scheduler without a client: one that is refused keeps its thread, and is waited for at the end."""
    from distributed import Security
    from distributed.comm import connect

    options = Security().get_connection_args("client")
    await (await connect(address, timeout=_CONNECT_TIMEOUT_S, **options)).close()


class Workforce:
    """Workers that run jobs.

    Args:
        client: Dask's client of their scheduler.
        scheduler: Its address, for messages; None for a cluster on this machine.
    """

    def __init__(self, client: Any, scheduler: str | None) -> None:
        self._client, self._scheduler = client, scheduler

    @property
    def threads(self) -> int:
        """Number of jobs that run at the same time, at present."""
        threads: dict[str, int] = self._client.nthreads()
        return max(sum(threads.values()), 1)

    def rows(self, jobs: Iterable[Job]) -> Iterator[Row]:
        """Run jobs.

        Args:
            jobs: Jobs; consumed as needed.

        Yields:
            A row for each, in the order of completion.

        Raises:
            FleetError: the scheduler was lost.
        """
        from distributed import as_completed

        from armload_controller.fleet.job_processing import run_on_worker

        own = version("armload")
        waiting = iter(jobs)
        given: dict[str, Job] = {}
        under_way = as_completed(with_results=False)

        def hand_out() -> int:
            threads = self.threads
            for job in islice(waiting, max(2 * threads - len(given), 0)):
                given[job.key] = job
                task = self._client.submit(run_on_worker, job, own, key=f"armload-{job.key}", pure=False)
                under_way.add(task)
            return threads

        threads = hand_out()
        while given:
            future = next(under_way)
            job = given.pop(future.key.removeprefix("armload-"))
            if future.cancelled():
                raise FleetError(f"the scheduler at {self._scheduler} was lost; run again to process the rest")
            yield row_of(future, job)
            future.release()
            if 2 * len(given) <= 3 * threads:  # half of those that waited are running: asked for each job is too often
                threads = hand_out()


def _require_same_version(client: Any, scheduler: str | None) -> None:
    """Load the modules in every worker, and compare versions."""
    own = _loaded_version()
    try:
        there: dict[str, str] = client.run(_loaded_version)
    except Exception as trouble:
        raise FleetError(
            f"the workers cannot run armload ({trouble}); install armload {own} in their environment"
        ) from trouble
    if problem := version_problem(own, set(there.values()), scheduler):
        raise FleetError(problem)


def version_problem(own: str, there: set[str], scheduler: str | None) -> str:
    """The problem with the workers' versions `there`; empty if they can be used with this process's `own`."""
    if not there:
        return f"the scheduler at {scheduler} has no workers; start some: dask worker {scheduler}"
    if others := there - {own}:
        return f"workers have armload {', '.join(sorted(others))}, this is {own}; install the same version everywhere"
    return ""


def _loaded_version() -> str:
    """Load a job's modules in a worker, and return its version of armload."""
    import armload_controller.fleet.job_processing  # noqa: F401 - imported for its loading time

    return version("armload")


def _own_security() -> Any:
    """A key and certificate for one run; the user's own configuration if that demands encryption."""
    import dask
    from distributed import Security

    if dask.config.get("distributed.comm.require-encryption", None):
        return Security()
    return Security.temporary()


def _cluster(workers: int, security: Any) -> Any:
    """A cluster on this machine, reachable only from this machine and with its key."""
    from distributed import LocalCluster

    return LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host=LOOPBACK,
        protocol="tls://",
        security=security,
        dashboard_address=f"{LOOPBACK}:0",
        worker_dashboard_address=f"{LOOPBACK}:0",
        scheduler_kwargs={"dashboard": False},
        memory_limit=MEMORY_BYTES,
        silence_logs=50,
    )


def row_of(future: Any, job: Job) -> Row:
    """The row of a job, also if its worker died."""
    from distributed import KilledWorker

    problem = future.exception()
    if problem is None:
        row: Row = future.result()
        return row
    if isinstance(problem, KilledWorker):
        text = (
            f"the worker died at every attempt: more than {MEMORY_BYTES // 2**20} MiB of memory, or killed from outside"
        )
    else:
        text = str(problem) if isinstance(problem, FleetError) else f"{type(problem).__name__}: {problem}"
    return empty_row(job, version("armload")) | {"error": text}
