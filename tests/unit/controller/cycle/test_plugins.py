"""Plug-ins are called, timed and added up, and one that fails is named."""

import numpy as np
import pytest

from armload_controller.control_errors import CommissioningError
from armload_controller.cycle.plugins import PluginFailed, PluginHost, PluginTiming, PluginTooSlow

BUDGET_SHARE, OVERRUNS_IN_A_ROW = 0.5, 5

CYCLE_S = 0.01


class Plugin:
    """Takes some time, and returns or raises what it is given."""

    def __init__(self, clock, name, *answers, seconds=0.0):
        self.name, self._clock, self._answers, self.seconds, self.calls = name, clock, list(answers), seconds, 0

    def on_cycle(self, step):
        self.calls += 1
        self._clock[0] += self.seconds
        answer = self._answers.pop(0) if len(self._answers) > 1 else (self._answers or [None])[0]
        if isinstance(answer, Exception):
            raise answer
        return answer


@pytest.fixture
def clock():
    return [0.0]


@pytest.fixture
def host(clock):
    return lambda *plugins: PluginHost(plugins, 2, CYCLE_S, lambda: clock[0])


def test_torques_of_a_cycle_are_added_and_those_of_the_last_are_gone(host, clock):
    first = Plugin(clock, "a", np.array([1.0, 2.0]), None)
    called = host(first, Plugin(clock, "b", [0.5, -0.5]), Plugin(clock, "c"))
    np.testing.assert_array_equal(called.call(None), [1.5, 1.5])
    np.testing.assert_array_equal(called.call(None), [0.5, -0.5])
    assert (called.calling, called.failed) == ("c", "")
    called.detach("b")
    np.testing.assert_array_equal(called.call(None), [0.0, 0.0])
    assert first.calls == 3
    assert host().call(None).shape == (2,)


@pytest.mark.parametrize(
    ("answer", "error", "text"),
    [
        (ValueError("no"), PluginFailed, "plug-in 'b' raised ValueError: no"),
        (CommissioningError("stop"), CommissioningError, "stop"),
        (np.zeros(3), PluginFailed, "expected 2 finite joint torques in N m"),
        (np.array([0.0, np.nan]), PluginFailed, "expected 2 finite joint torques in N m"),
        (np.array([np.inf, 0.0]), PluginFailed, "plug-in 'b' returned array([inf,  0.])"),
        (1.0, PluginFailed, "plug-in 'b' returned 1.0, expected 2"),
    ],
)
def test_one_that_fails_is_named(host, clock, answer, error, text):
    called = host(Plugin(clock, "a"), Plugin(clock, "b", answer), Plugin(clock, "c"))
    with pytest.raises(error) as caught:
        called.call(None)
    assert text in str(caught.value)
    assert called.failed == called.calling == "b"
    if error is PluginFailed:
        assert caught.value.plugin == "b"


@pytest.mark.parametrize(("share", "calls"), [(1.02, OVERRUNS_IN_A_ROW), (0.98, None)])
def test_one_that_is_over_its_budget_five_times_in_a_row_is_too_slow(host, clock, share, calls):
    slow = Plugin(clock, "slow", seconds=share * BUDGET_SHARE * CYCLE_S)
    called = host(Plugin(clock, "a"), slow)
    for _ in range(OVERRUNS_IN_A_ROW - 1):
        called.call(None)
    if calls is None:
        for _ in range(20):
            called.call(None)
        return
    with pytest.raises(PluginTooSlow, match=r"plug-in 'slow' took 5\.10 ms, its budget is 5\.00 ms a cycle"):
        called.call(None)
    assert slow.calls == calls


def test_one_quick_call_is_forgiveness():
    timing = PluginTiming("a")
    for seconds, overruns in ((2.0, 1), (2.0, 2), (1.0, 0), (1.1, 1)):
        timing.add(seconds, 1.0)
        assert (timing.overruns, timing.last_s) == (overruns, seconds)


@pytest.mark.parametrize(("of_a", "of_b", "name"), [(1.01, 2.0, "b"), (3.0, 2.0, "a"), (1.0, 0.5, None)])
def test_the_slowest_is_one_that_took_more_than_a_cycle(host, clock, of_a, of_b, name):
    called = host(Plugin(clock, "a", seconds=of_a * CYCLE_S), Plugin(clock, "b", seconds=of_b * CYCLE_S))
    assert called.slowest() is None
    called.call(None)
    found = called.slowest()
    assert (found and found.name) == name
