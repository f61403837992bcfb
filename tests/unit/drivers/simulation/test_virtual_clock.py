"""Simulated drives in real time measure at the arrival of SYNC, even if their thread handles it late."""

import threading
import time

import can
import pytest

from armload_drivers.driver_errors import SimulationError
from armload_drivers.simulation.drives import drives_on_bus
from armload_drivers.simulation.virtual_clock import VirtualClock
from tests.ideal_plant import IdealPlant

NOW_S = 100.0
"""A clock that does not advance by itself; the thread reaches this time."""
WALL_S = 1.8e9
"""The interface's clock, which does not advance either: a busy machine is not late."""


class Plant(IdealPlant):
    """Records the times of measurement."""

    def __init__(self, position_rad):
        super().__init__(position_rad)
        self.measured_s, self.measured = [], threading.Event()

    def sample(self, cycle_s):
        self.measured_s.append(self.time_s)
        self.measured.set()
        return super().sample(cycle_s)


class Bus:
    """Delivers one SYNC that arrived some time ago."""

    def __init__(self, age_s):
        self.frames = [can.Message(arbitration_id=0x080, is_extended_id=False, timestamp=WALL_S - age_s)]

    def recv(self, timeout=None):
        if self.frames:
            return self.frames.pop()
        time.sleep(0.001)
        return None

    def send(self, message, timeout=None):
        pass


@pytest.mark.parametrize(
    ("age_s", "measured_s"),
    [(0.1, NOW_S - 0.1), (0.0, NOW_S), (-5.0, NOW_S), (1e6, NOW_S)],
    ids=["late", "at once", "stamped by another clock, ahead", "behind"],
)
def test_what_sync_causes_happens_when_it_came(arm_settings, monkeypatch, age_s, measured_s):
    monkeypatch.setattr(drives_on_bus.time, "time", lambda: WALL_S)
    plant = Plant([0.1, -0.2, 0.3])
    with drives_on_bus.SimulatedDrives(arm_settings(), plant, Bus(age_s), lambda: NOW_S):
        assert plant.measured.wait(5.0)
    assert plant.measured_s == pytest.approx([measured_s])


def test_time_is_in_seconds_and_advances_by_nanoseconds():
    clock = VirtualClock()
    assert clock() == 0.0
    clock.advance(0.25)
    clock.advance(1.4e-9)
    assert clock() == 0.250_000_001


def test_a_clock_needs_a_follower_that_is_active():
    clock = VirtualClock()
    with pytest.raises(SimulationError, match="no longer act: none are running"):
        clock.require_follower()
    clock.follow(lambda: "")
    clock.require_follower()
