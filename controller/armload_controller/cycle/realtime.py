"""The process tuned for the cycle, as far as it is permitted.

    SCHED_FIFO            nothing ordinary runs before the cycle's thread, nor before those that share its interpreter
    locked memory         no page of the process must be read from disk
    CPU affinity          the cycle's thread stays on one CPU
    garbage collection    none while the arm moves
    switch interval       a busy Python thread gives the interpreter back within 0.5 ms, instead of 5

Everything is set back afterwards. What is not permitted is reported once, in words, and the cycle runs without it.
Not for lockstep simulations, where nothing waits for a clock and a real-time thread would only starve others.
"""

from __future__ import annotations

import ctypes
import errno
import gc
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress

PRIORITY = 50
SWITCH_INTERVAL_S = 0.0005
_MCL_CURRENT, _MCL_FUTURE = 1, 2


@contextmanager
def tuned_for_cycles(report: Callable[[str], None]) -> Iterator[None]:
    """Tune this process and the calling thread for a while.

    Args:
        report: Called with what was not permitted, in one line, if anything.
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


def _real_time() -> Callable[[], None]:
    """SCHED_FIFO for the calling thread and the others of this interpreter, unless there is but one CPU.

    The others come one priority below. They share the interpreter's lock: one that holds it and is kept from running by
    other programs keeps the cycle from running as well, whatever the cycle's own priority is.
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
    """SCHED_FIFO for one thread; what sets it back."""
    try:
        policy, parameters = os.sched_getscheduler(thread), os.sched_getparam(thread)
        os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except ProcessLookupError:
        return lambda: None

    def restore() -> None:
        with suppress(ProcessLookupError):
            os.sched_setscheduler(thread, policy, parameters)

    return restore


def _locked_memory() -> Callable[[], None]:
    """Present and future memory locked."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return libc.munlockall


def _one_cpu() -> Callable[[], None]:
    """The last CPU of those allowed: interrupts are served by the first ones."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    return lambda: os.sched_setaffinity(0, allowed)


def _quiet_interpreter() -> Callable[[], None]:
    """No garbage collection, short switch interval."""
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
