"""The process tuned for the cycle, as far as it is permitted.

    SCHED_FIFO            nothing ordinary runs before the cycle's thread
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
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

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
                f"not permitted: {', '.join(refused)}. The cycle runs without and may be late more often; give the "
                "process CAP_SYS_NICE and CAP_IPC_LOCK, or raise rtprio and memlock in limits.conf"
            )
        yield


def _real_time() -> Callable[[], None]:
    """SCHED_FIFO for the calling thread, unless there is but one CPU, which others need as well."""
    if len(os.sched_getaffinity(0)) == 1:
        raise OSError(errno.EBUSY, "there is only one CPU")
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    return lambda: os.sched_setscheduler(0, policy, parameters)


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
