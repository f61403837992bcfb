"""The process is tuned as far as permitted, and restored afterwards."""

import json
import os
import subprocess
import sys

import pytest

from armload_controller.cycle.realtime import SWITCH_INTERVAL_S

PROGRAM = """
import gc, json, os, sys
from armload_controller.cycle.realtime import tuned_for_cycles

def state():
    return sys.getswitchinterval(), gc.isenabled(), os.sched_getscheduler(0), sorted(os.sched_getaffinity(0))

told, states = [], [state()]
with tuned_for_cycles(told.append):
    states.append(state())
print(json.dumps([*states, state(), told]))
"""
"""Run in a small process: locking the memory of the test process takes seconds of page faults."""


def test_everything_is_set_and_set_back():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, timeout=60)
    before, within, after, told = json.loads(done.stdout)
    switch_interval_s, collects, scheduler, cores = within
    assert switch_interval_s == SWITCH_INTERVAL_S != before[0]
    assert not collects
    assert before[1]
    assert (scheduler == os.SCHED_FIFO) == (not any("SCHED_FIFO" in line for line in told))
    assert (len(cores) == 1) == (not any("affinity" in line for line in told))
    assert after == before
    assert len(told) <= 1, "what is not permitted is said once"


THREADS = """
import json, os, threading
from armload_controller.cycle.realtime import tuned_for_cycles

stop = threading.Event()
other = threading.Thread(target=stop.wait)
other.start()

def scheduled():
    return [(os.sched_getscheduler(id), os.sched_getparam(id).sched_priority) for id in (0, other.native_id)]

told = []
with tuned_for_cycles(told.append):
    within = scheduled()
print(json.dumps([within, scheduled(), told]))
stop.set()
other.join()
"""


def test_threads_that_share_the_interpreter_come_next():
    """Such as simulated drives in this process: if they cannot run, neither can the cycle."""
    done = subprocess.run([sys.executable, "-c", THREADS], capture_output=True, text=True, check=True, timeout=60)
    within, after, told = json.loads(done.stdout)
    if any("SCHED_FIFO" in line for line in told):
        pytest.skip(told[0])
    own, other = within
    assert other == [os.SCHED_FIFO, own[1] - 1]
    assert after[1][0] == os.SCHED_OTHER


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
