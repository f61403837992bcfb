"""Real-time tuning of the process for the cycle, as far as permitted.

    SCHED_FIFO            the cycle's thread, and those that share its interpreter, precede all ordinary processes
    locked memory         no page of the process is swapped out
    CPU affinity          the cycle's thread stays on one CPU
    garbage collection    none while the arm moves
    switch interval       a busy Python thread releases the interpreter within 0.5 ms instead of 5

Everything is restored afterwards. What is not permitted is reported once, and the cycle runs without it. Not for
lockstep simulations, where nothing waits for a clock and a real-time thread would only starve other processes.

A new thread inherits policy, priority and CPU of the thread that starts it. One that is started by the cycle would
compute at the cycle's priority on the cycle's only CPU, and the cycle would wait for it. So work beside the cycle is
done by a `running_worker`, created beforehand. A thread or process that is started later has the ordinary policy
(SCHED_RESET_ON_FORK), so that it cannot keep the cycle waiting for the CPU, but it stays on that CPU.
"""

from __future__ import annotations

import ctypes
import errno
import gc
import os
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress

PRIORITY = 50
SWITCH_INTERVAL_S = 0.0005
_MCL_CURRENT, _MCL_FUTURE = 1, 2


@contextmanager
def tuned_for_cycles(report: Callable[[str], None]) -> Iterator[None]:
    """Tune this process and the calling thread within a `with` block.

    Args:
        report: Called with one line that lists what was not permitted, if anything.
    """
    refused: list[str] = []
    with ExitStack() as stack:
        for name, setter in (
            ("SCHED_FIFO", _real_time),
            ("locked memory", _locked_memory),
            ("CPU affinity", _one_cpu),
        ):
            try:
                stack.callback(setter())
            except OSError as error:
                refused.append(f"{name} ({error.strerror})")
        stack.callback(_quiet_interpreter())
        if refused:
            report(
                f"not permitted: {', '.join(refused)}. The cycle runs without this and may be late more often; give "
                "the process CAP_SYS_NICE and CAP_IPC_LOCK, or raise rtprio and memlock in limits.conf"
            )
        yield


def running_worker(name: str) -> ThreadPoolExecutor:
    """An executor with one running thread, for work beside the cycle; create it before `tuned_for_cycles`.

    An executor starts its thread at the first task, which is submitted by the cycle: see above.

    Args:
        name: Prefix of the thread's name.
    """
    executor = ThreadPoolExecutor(1, thread_name_prefix=name)
    executor.submit(lambda: None).result()
    return executor


def _real_time() -> Callable[[], None]:
    """SCHED_FIFO for the calling thread and the others of this interpreter, unless there is only one CPU.

    The others run one priority lower. They share the interpreter's lock: a thread that holds it and is preempted by
    another program delays the cycle too, whatever the cycle's own priority is.
    """
    if len(os.sched_getaffinity(0)) == 1:
        raise OSError(errno.EBUSY, "there is only one CPU")
    own = threading.get_native_id()
    with ExitStack() as raised:
        raised.callback(_raise(own, PRIORITY))
        for thread in threading.enumerate():
            if thread.native_id is not None and thread.native_id != own:
                raised.callback(_raise(thread.native_id, PRIORITY - 1))
        return raised.pop_all().close


def _raise(thread: int, priority: int) -> Callable[[], None]:
    """Set SCHED_FIFO for one thread, not for those that it starts; returns the function that restores its policy."""
    try:
        policy, parameters = os.sched_getscheduler(thread), os.sched_getparam(thread)
        os.sched_setscheduler(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except ProcessLookupError:
        return lambda: None

    def restore() -> None:
        with suppress(ProcessLookupError):
            try:
                os.sched_setscheduler(thread, policy, parameters)
            except PermissionError:  # rtprio in limits.conf permits SCHED_FIFO; only CAP_SYS_NICE clears this flag
                os.sched_setscheduler(thread, policy | os.SCHED_RESET_ON_FORK, parameters)

    return restore


def _locked_memory() -> Callable[[], None]:
    """Lock present and future memory."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return libc.munlockall


def _one_cpu() -> Callable[[], None]:
    """Pin the thread to the last allowed CPU: interrupts are usually served by the first ones."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    return lambda: os.sched_setaffinity(0, allowed)


def _quiet_interpreter() -> Callable[[], None]:
    """Disable garbage collection and shorten the switch interval."""
    interval, collecting = sys.getswitchinterval(), gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(SWITCH_INTERVAL_S)

    def restore() -> None:
        sys.setswitchinterval(interval)
        gc.unfreeze()
        if collecting:
            gc.enable()

    return restore
