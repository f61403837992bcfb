"""Bounded loops for tests: frames received from a bus, and waiting for a condition."""

import time

import pytest

MOST_FRAMES = 200_000
"""More than any test produces: half a minute of full load at 1 Mbit/s."""


def overheard(bus, patience_s=0.0):
    """All frames that a bus has received, in order.

    Args:
        bus: A python-can bus.
        patience_s: The list ends after this time without a frame.
    """
    frames = []
    while len(frames) < MOST_FRAMES:
        message = bus.recv(patience_s)
        if message is None:
            return frames
        frames.append(message)
    pytest.fail(f"more than {MOST_FRAMES} frames without a pause, the last one {frames[-1]}")


def await_that(condition, what, seconds=10.0, every_s=0.002):
    """Wait until a condition is true; returns its value.

    Args:
        condition: Called repeatedly.
        what: The condition in words, for the failure message.
        seconds: Longest wait.
        every_s: Pause between two calls.
    """
    end_s = time.monotonic() + seconds
    while not (value := condition()):
        if time.monotonic() > end_s:
            pytest.fail(f"not within {seconds} s: {what}")
        time.sleep(every_s)
    return value
