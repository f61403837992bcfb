"""The process is tuned as far as permitted, and restored afterwards."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import armload_controller

SWITCH_INTERVAL_S = 0.0005

PROGRAM = """
import gc, json, os, sys
from armload_controller.cycle.realtime import tuned_for_cycles

def state():
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    return sys.getswitchinterval(), gc.isenabled(), policy, sorted(os.sched_getaffinity(0))

reported, states = [], [state()]
with tuned_for_cycles(reported.append):
    states.append(state())
print(json.dumps([*states, state(), reported]))
"""
"""Run in a small process: locking the memory of the test process takes seconds of page faults."""


def test_everything_is_set_and_set_back():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, timeout=60)
    before, within, after, reported = json.loads(done.stdout)
    switch_interval_s, collects, scheduler, cores = within
    assert switch_interval_s == SWITCH_INTERVAL_S != before[0]
    assert not collects
    assert before[1]
    assert (scheduler == os.SCHED_FIFO) == (not any("SCHED_FIFO" in line for line in reported))
    assert (len(cores) == 1) == (not any("affinity" in line for line in reported))
    assert after == before
    assert len(reported) <= 1, "what is not permitted is said once"


ONE_CPU = """
import os
from armload_controller.cycle.realtime import tuned_for_cycles
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
with tuned_for_cycles(print):
    print(os.sched_getscheduler(0))
"""


def test_on_a_single_cpu_the_rest_of_the_computer_is_not_locked_out():
    done = subprocess.run([sys.executable, "-c", ONE_CPU], capture_output=True, text=True, check=True, timeout=60)
    *said, policy = done.stdout.splitlines()
    assert "there is only one CPU" in "".join(said)
    assert int(policy) == os.SCHED_OTHER


THREADS = """
import json, os, threading
from concurrent.futures import ThreadPoolExecutor
from armload_controller.cycle.realtime import running_worker, tuned_for_cycles

stop = threading.Event()
other = threading.Thread(target=stop.wait)
other.start()

def scheduled(id=0):
    policy = os.sched_getscheduler(id) & ~os.SCHED_RESET_ON_FORK
    return policy, os.sched_getparam(id).sched_priority, sorted(os.sched_getaffinity(id))

before, reported = scheduled(), []
with running_worker("beside") as worker, ThreadPoolExecutor(1) as later:
    with tuned_for_cycles(reported.append):
        within = {
            "own": scheduled(),
            "other": scheduled(other.native_id),
            "worker": worker.submit(scheduled).result(),
            "later": later.submit(scheduled).result(),
        }
print(json.dumps([before, within, [scheduled(), scheduled(other.native_id)], reported]))
stop.set()
other.join()
"""


@pytest.fixture(scope="module")
def threads():
    """Policy, priority and CPUs before; of each kind of thread within the block; after; and what was not permitted."""
    done = subprocess.run([sys.executable, "-c", THREADS], capture_output=True, text=True, check=True, timeout=60)
    return json.loads(done.stdout)


def test_threads_that_share_the_interpreter_come_next(threads):
    """Such as simulated drives in this process: if they cannot run, neither can the cycle."""
    before, within, after, reported = threads
    if any("SCHED_FIFO" in line for line in reported):
        pytest.skip(reported[0])
    assert within["other"] == [os.SCHED_FIFO, within["own"][1] - 1, before[2]]
    assert after == [before, before]


def test_no_thread_beside_the_cycle_keeps_it_waiting_for_the_cpu(threads):
    """A thread inherits priority and CPU: 40 ms of computing at the cycle's own made the cycle late."""
    before, within, _, reported = threads
    cpus = within["own"][2]
    assert within["worker"][2] == before[2], "not tied to the cycle's CPU"
    assert within["later"] == [before[0], before[1], cpus], "below the cycle, whatever it starts"
    if not any("SCHED_FIFO" in line for line in reported):
        assert within["worker"][:2] == [os.SCHED_FIFO, within["own"][1] - 1]


def test_every_executor_runs_before_the_cycle_does():
    package = Path(armload_controller.__file__).parent
    found = {path.name for path in package.rglob("*.py") if "ThreadPoolExecutor(" in path.read_text("utf-8")}
    assert found == {"realtime.py"}


DROPPED = """
import os
from armload_controller.cycle.realtime import tuned_for_cycles
with tuned_for_cycles(print):
    raised = os.sched_getscheduler(0)
    os.setuid(65534)
print(raised, os.sched_getscheduler(0))
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="only root has privileges to lose")
def test_the_policy_is_restored_without_the_privilege_to_clear_the_flag():
    """As for a user who may use real-time priorities by limits.conf, without CAP_SYS_NICE."""
    done = subprocess.run([sys.executable, "-c", DROPPED], capture_output=True, text=True, check=True, timeout=60)
    raised, restored = map(int, done.stdout.splitlines()[-1].split())
    if not raised & os.SCHED_RESET_ON_FORK:
        pytest.skip("real-time priority is not permitted here")
    assert restored == os.SCHED_OTHER | os.SCHED_RESET_ON_FORK


def test_what_is_not_permitted_is_said_with_what_to_do():
    """A child without privileges: every failed step is reported, and none raises."""
    code = (
        "import resource\n"
        "resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))\n"
        "resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))\n"
        "import os\n"
        "os.geteuid() or os.setuid(65534)\n"
        "from armload_controller.cycle.realtime import tuned_for_cycles\n"
        "with tuned_for_cycles(print):\n"
        "    pass\n"
    )
    # The package is imported before privileges are dropped: an unprivileged user may not be able to read this checkout.
    code = "import armload_controller.cycle.realtime\n" + code
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1
    assert "SCHED_FIFO (" in done.stdout
    assert "locked memory" in done.stdout
    assert "limits.conf" in done.stdout
