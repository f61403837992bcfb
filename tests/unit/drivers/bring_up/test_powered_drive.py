"""Whether the torque of a drive may be removed before bring-up: only of an abandoned axis at rest with a brake."""

from dataclasses import replace

import pytest

from armload_drivers.bring_up.powered_drive import judged, powered_drives
from armload_drivers.cia402.state_machine import State

STANDSTILL_RAD_S = 0.005

COUNTS_PER_RAD = 1e5
ENABLED, QUICK_STOP = State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE


class Setup:
    """A drive whose position counts backwards."""

    counts_per_rad = -COUNTS_PER_RAD

    def __init__(self, settings):
        self.settings = settings

    def read_units(self):
        return self


@pytest.mark.parametrize(
    ("state", "commands", "speed_rad_s", "has_brake", "what"),
    [
        (QUICK_STOP, "", 0.0, True, ""),
        (State.FAULT_REACTION_ACTIVE, "", -0.0, True, ""),
        (QUICK_STOP, "", 0.9 * STANDSTILL_RAD_S, True, ""),
        (QUICK_STOP, "", 2.0 * STANDSTILL_RAD_S, True, "moves at 0.010 rad/s"),
        (QUICK_STOP, "", 0.0, False, "no brake and falls without torque"),
        (ENABLED, "", 0.0, True, "may be moving it"),
        (QUICK_STOP, "another node sends NMT", 0.0, True, "and another node sends NMT"),
        (ENABLED, "another node sends NMT", 0.0, True, "and another node sends NMT"),
    ],
)
def test_torque_is_removed_only_from_an_abandoned_axis_at_rest_with_a_brake(
    arm_settings, state, commands, speed_rad_s, has_brake, what
):
    setup = Setup(replace(arm_settings().drives[1], has_brake=has_brake))
    drive = judged(setup, state, commands, speed_rad_s * COUNTS_PER_RAD)
    assert drive.abandoned is (not what)
    assert what in drive.what
    refusal = drive.refusal()
    assert (refusal.node_id, refusal.joint) == (3, "joint_3")
    assert drive.remedy in str(refusal)


def test_axes_with_torque_are_watched_for_some_time(arm_settings):
    """The second moves 0.02 rad in 2 s, the third carries no torque and is not asked for its position."""
    waited, states = [], [QUICK_STOP, QUICK_STOP, None]

    class Watched(Setup):
        def __init__(self, number, state):
            super().__init__(replace(arm_settings().drives[1], has_brake=True))
            self.number, self.state = number, state

        def read_powered_state(self):
            return self.state

        def read_position(self):
            assert self.state is not None
            return 5000 - round(0.01 * COUNTS_PER_RAD * self.number * sum(waited))

    def found(states):
        setups = [Watched(number, state) for number, state in enumerate(states)]
        return powered_drives(setups, watch_s=2.0, wait=waited.append, commands=lambda: "")

    at_rest, moving = found(states)
    assert waited == [2.0]
    assert (at_rest.abandoned, moving.abandoned) == (True, False)
    assert "moves at 0.010 rad/s" in moving.what
    assert found([None]) == []
    assert waited == [2.0], "nothing to watch"
