"""The same jobs on Dask: killed workers and coordinators, a scheduler with TLS, and access on loopback."""

import asyncio
import contextlib
import functools
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path
from types import SimpleNamespace

import fsspec
import pytest

from armload_controller.control_errors import CommissioningError, FleetError
from armload_controller.fleet.fleet_run import do_jobs, new_jobs
from armload_controller.fleet.job import Job
from armload_controller.fleet.job_processing import run_job
from armload_controller.fleet.row_store import RowStore, read_rows
from armload_controller.fleet.workforce import row_of, version_problem, workforce
from armload_controller.session.folder_claim import claimed_folder

IDENTIFY = (sys.executable, "-c", "from armload_controller.cli.entry import main; main()", "fleet", "identify")
PATIENCE_S = 120.0
LISTENING = "0A"


def wait_for(what, coordinator):
    """Wait until it is true; fails if the coordinator ends first."""
    until_s = time.monotonic() + PATIENCE_S
    while not what():
        assert coordinator.poll() is None, coordinator.stderr.read()
        assert time.monotonic() < until_s, "nothing happens"
        time.sleep(0.02)


def children_of(process_id):
    """Worker processes spawned by any thread of a process."""
    threads = Path(f"/proc/{process_id}/task").glob("*/children")
    listed = [child for thread in threads for child in thread.read_text().split()]
    return [int(child) for child in listed if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]


def listening_addresses(process_ids):
    """Addresses at which processes listen, hexadecimal as in /proc."""
    inodes, found = set(), set()
    for process_id in process_ids:
        for file in Path(f"/proc/{process_id}/fd").iterdir():
            with contextlib.suppress(FileNotFoundError):  # closed meanwhile
                inodes.add(str(file.readlink()).removeprefix("socket:[").removesuffix("]"))
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            _, address, _, state, *rest = line.split()
            if state == LISTENING and rest[5] in inodes:
                found.add(address.split(":")[0])
    return found


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs Linux' /proc")
@pytest.mark.long
def test_a_killed_worker_and_a_killed_coordinator_cost_what_they_were_doing(recorded_er50, tmp_path):
    today = recorded_er50 / "runs" / "today"
    for number in range(3):
        shutil.copy(today / "loaded_identification.mcap", tmp_path / f"{number}.mcap")
    table, rows = tmp_path / "jobs.csv", tmp_path / "rows"
    table.write_text(f"arm,robot,loaded,unloaded\none,er50,*.mcap,{today}/unloaded_identification.mcap\n")

    def kept():
        return sum(file.read_text().count("\n") for file in rows.glob("journal-*.jsonl"))

    command = [*IDENTIFY, str(table), "-o", str(rows), "--workers", "1"]
    coordinator = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        wait_for(lambda: kept() == 1, coordinator)
        (worker,) = children_of(coordinator.pid)
        assert listening_addresses([coordinator.pid, worker]) == {"0100007F"}
        os.kill(worker, signal.SIGKILL)
        with (
            pytest.raises(CommissioningError, match="another `armload fleet` run is using"),
            claimed_folder(rows, "`armload fleet` run"),
        ):
            pass
        wait_for(lambda: kept() == 2, coordinator)
        (other,) = children_of(coordinator.pid)
        assert other != worker
    finally:
        coordinator.kill()
        coordinator.communicate()
    with claimed_folder(rows), RowStore(rows) as store:
        listing, jobs = new_jobs(table, store)
        assert (len(listing.jobs), len(jobs)) == (3, 1)
        do_jobs(listing, jobs, store, functools.partial(map, run_job))
    found = read_rows(rows, ("loaded", "outcome", "worker"))
    assert sorted(row["loaded"] for row in found) == [str(tmp_path / f"{number}.mcap") for number in range(3)]
    assert {row["outcome"] for row in found} == {"identified"}
    assert len({row["worker"] for row in found}) == 3
    until_s = time.monotonic() + PATIENCE_S
    while Path(f"/proc/{other}").exists() and time.monotonic() < until_s:
        time.sleep(0.02)
    assert not Path(f"/proc/{other}").exists(), "a worker outlived its coordinator"


def tls_of(folder):
    """Dask's configuration with a new key and certificate for 127.0.0.1."""
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("needs openssl to make a certificate")
    command = [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2"]
    command += ["-subj", "/CN=armload", "-addext", "subjectAltName=IP:127.0.0.1"]
    command += ["-keyout", "key.pem", "-out", "cert.pem"]
    subprocess.run(command, check=True, cwd=folder, capture_output=True)
    certificate = str(folder / "cert.pem")
    tls = {"distributed.comm.tls.ca-file": certificate, "distributed.comm.require-encryption": True}
    for party in ("scheduler", "worker", "client"):
        prefix = f"distributed.comm.tls.{party}"
        tls |= {f"{prefix}.cert": certificate, f"{prefix}.key": str(folder / "key.pem")}
    return tls


async def join(address, security):
    """Become a client of a scheduler, and leave: in a loop of its own, which ends also if the client is refused."""
    import distributed

    client = distributed.Client(address, security=security, timeout=3.0, asynchronous=True)
    try:
        await client
    finally:
        await client.close()


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """The address of a local cluster, what strangers get, its pages, and a row of its owner, as in `behind_tls`."""
    import distributed

    missing = str(tmp_path_factory.mktemp("local") / "none.mcap")
    with workforce(workers=1) as force:
        address = force._client.scheduler.address
        refusals = []
        for stranger in (distributed.Security(), distributed.Security.temporary()):
            for there in (address, address.replace("tls://", "tcp://")):
                try:
                    asyncio.run(join(there, stranger))
                    refusals.append(None)
                except (OSError, TypeError, RuntimeError, ValueError) as problem:
                    refusals.append(str(problem))
        known = force._client.scheduler_info()
        (worker,) = known["workers"].values()
        pages = []
        for server, page in ((known, "info/main/workers.html"), (known, "json/identity.json"), (worker, "health")):
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{server['services']['dashboard']}/{page}", timeout=3.0):
                    pages.append(200)
            except urllib.error.HTTPError as problem:
                pages.append(problem.code)
        (row,) = force.rows([Job("key", "arm", "er50", {"loaded": missing}, "", "", None, None)])
    return SimpleNamespace(address=address, refusals=refusals, pages=pages, row=row)


def test_another_user_of_the_machine_cannot_use_the_local_scheduler(local):
    """Neither without a certificate nor with one of their own, nor read its pages; the owner's jobs are done."""
    assert local.address.startswith("tls://127.0.0.1:")
    assert None not in local.refusals
    assert set(local.pages) == {404}
    assert "none.mcap" in local.row["error"]


@pytest.fixture(scope="module")
def behind_tls(recorded_er50, tmp_path_factory):
    """Results of a scheduler with TLS and one worker in this process, for its owner and for strangers.

    Collected while the fixture is made, because Dask's threads last as long as the process.
    """
    import dask
    from distributed import LocalCluster

    owner, stranger, jobs = (tmp_path_factory.mktemp(name) for name in ("owner", "stranger", "jobs"))
    today = recorded_er50 / "runs" / "today"
    table = jobs / "jobs.csv"
    table.write_text(
        "arm,robot,loaded,unloaded\n"
        f"one,er50,{today}/loaded_identification.mcap,{today}/unloaded_identification.mcap\n"
        f"two,er50,{today}/payload.toml,{today}/unloaded_identification.mcap\n"
    )
    with dask.config.set(tls_of(owner)):
        cluster = LocalCluster(
            n_workers=1,
            threads_per_worker=1,
            processes=False,
            host="127.0.0.1",
            protocol="tls://",
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
        )
        with cluster:
            address = cluster.scheduler_address
            with RowStore(jobs) as store, workforce(address) as force:
                listing, new = new_jobs(table, store)
                tally = do_jobs(listing, new, store, force.rows)
                copies = copied_for(force)
                (worker,) = cluster.workers.values()
                copied = [Path(copy).parent.parent == Path(worker.local_directory) for copy in copies]
                taken = taken_as_workers_join(cluster, force)
            with dask.config.set(tls_of(stranger)):
                refusals = [refusal(address), refusal("carrier-pigeon://roof")]
    return SimpleNamespace(address=address, tally=tally, refusals=refusals, taken=taken, copied=copied)


def copied_for(force):
    """Where a worker copies a recording from a store to."""
    copies = []

    class Store(fsspec.AbstractFileSystem):
        protocol = "noted"

        def info(self, path, **_options):
            return {"name": path, "size": 1, "type": "file"}

        def get(self, _path, copy, **_options):
            copies.append(copy)
            Path(copy).write_bytes(b"\0")

    fsspec.register_implementation("noted", Store, clobber=True)
    (row,) = force.rows([Job("k", "one", "er50", {"loaded": "noted://cell/a.mcap"}, "", "", None, None)])
    assert (row["outcome"], "noted://cell/a.mcap: " in row["error"]) == ("refused", True), row["error"]
    return copies


def taken_as_workers_join(cluster, force):
    """Numbers of jobs, of 20, that were taken for the first row with one worker, the next with three, and the last."""
    taken, counts = [], []

    def jobs():
        for number in range(20):
            taken.append(number)
            yield Job(f"{number}", "one", "er50", {"loaded": f"/{number}.mcap"}, "", "", None, None)

    rows = force.rows(jobs())
    next(rows)
    counts.append(len(taken))
    cluster.scale(3)
    until_s = time.monotonic() + PATIENCE_S
    while force.threads < 3 and time.monotonic() < until_s:
        time.sleep(0.01)
    next(rows)
    counts.append(len(taken))
    assert sum(row["outcome"] == "failed" for row in rows) == 18
    return [*counts, len(taken)]


def refusal(address):
    """What a stranger is told, who keeps no thread: it would be waited for, a minute, when the program ends."""
    loops = io_loops()
    with pytest.raises(FleetError) as refused:
        workforce(address).__enter__()
    assert io_loops() == loops
    return str(refused.value)


def io_loops():
    return {thread for thread in threading.enumerate() if thread.name == "IO loop"}


@pytest.mark.long
def test_a_scheduler_behind_tls_does_the_jobs_of_its_owner(behind_tls):
    assert behind_tls.address.startswith("tls://127.0.0.1:")
    assert behind_tls.tally.to_dict()["outcomes"] == {"identified": 1, "refused": 1, "failed": 0}


def test_workers_that_join_during_a_run_get_jobs(behind_tls):
    assert behind_tls.taken == [2, 7, 20]


def test_a_worker_copies_recordings_to_its_own_folder_which_dask_removes(behind_tls):
    assert behind_tls.copied == [True]


def test_a_certificate_that_the_scheduler_does_not_know_is_refused(behind_tls):
    assert f"no scheduler at {behind_tls.address}: " in behind_tls.refusals[0]
    assert "check `scheduler=` and its certificates" in behind_tls.refusals[0]
    assert "no scheduler at carrier-pigeon://roof: " in behind_tls.refusals[1]


def test_a_job_that_takes_its_worker_with_it_is_a_row_that_is_tried_again():
    from distributed import KilledWorker

    job = Job("k", "one", "er50", {"loaded": "huge.csv"}, "", "", None, None)
    for problem, said in (
        (
            KilledWorker("armload-k", None, 2),
            "the worker died at every attempt: more than 1024 MiB",
        ),
        (ConnectionError("gone"), "ConnectionError: gone"),
    ):
        row = row_of(SimpleNamespace(exception=lambda problem=problem: problem), job)
        assert (row["key"], row["outcome"]) == ("k", "failed")
        assert said in row["error"]


@pytest.mark.parametrize(
    ("there", "problem"),
    [
        ({"1.2"}, ""),
        ({"1.1", "1.2"}, "workers have armload 1.1, this is 1.2; install the same version everywhere"),
        (set(), "the scheduler at tls://host:8786 has no workers; start some: dask worker tls://host:8786"),
    ],
)
def test_workers_of_another_version_are_refused(there, problem):
    assert version_problem("1.2", there, "tls://host:8786") == problem
