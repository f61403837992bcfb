"""The cycle of the master, with drives of which a test writes every frame."""

import pytest

from armload_drivers.driver_errors import ForeignMaster, ServoError, ServoTimeout
from armload_drivers.simulation.lockstep_sync import LockstepSync
from tests.scripted_drives import MASTER_ID, UNDEFINED, ScriptedArm

NMT_STOP_ALL = b"\x02\x00"
OVERCURRENT = bytes.fromhex("1023010000000000")


class WatchedSync(LockstepSync):
    """Notes what the cycle does with it; it can suspend this process after the answers to a SYNC.

    Attributes:
        away_s: For so long, once.
        complete: Whether the feedback of the last SYNC was complete.
        ended: Whether SYNC was stopped.
    """

    away_s, complete, ended = 0.0, None, False

    def await_feedback(self, link, complete):
        super().await_feedback(link, complete)
        self.complete = complete()
        away_s, self.away_s = self.away_s, 0.0
        self._clock.advance(away_s)

    def end(self, link):
        self.ended = True


@pytest.fixture
def arm(arm_settings):
    """An enabled arm."""
    arm = ScriptedArm(arm_settings(), WatchedSync)
    arm.enable()
    return arm


def test_what_was_received_before_the_cycles_is_not_held_against_anyone(arm_settings):
    arm = ScriptedArm(arm_settings())
    arm.bus.add(0x000, NMT_STOP_ALL)
    arm.bus.add(0x083, OVERCURRENT)
    arm.cycle.begin()
    arm.check(2, must_follow=False)


@pytest.mark.parametrize(
    ("cob_id", "data", "kind", "text"),
    [
        (0x000, NMT_STOP_ALL, ForeignMaster, "NMT commands: stop to all nodes"),
        (0x083, OVERCURRENT, ServoError, r"joint_3 \(node 3\).*0x2310"),
    ],
)
def test_what_is_received_in_the_cycles_ends_them(arm, cob_id, data, kind, text):
    arm.bus.add(cob_id, data)
    with pytest.raises(kind, match=text):
        arm.check()


def test_a_request_of_a_wrong_length_is_nobodys(arm):
    arm.bus.add(0x603, b"\x40\x41\x60")
    arm.bus.add(0x000, b"\x02")
    arm.check()


def test_a_command_to_a_node_of_another_arm_is_no_rival(arm):
    arm.bus.add(0x000, b"\x02\x09")
    arm.check()


def test_an_undefined_statusword_ends_the_cycles_and_names_the_drive(arm):
    arm.words[3] = [UNDEFINED]
    with pytest.raises(ServoError, match=r"joint_3 \(node 3\), in the test: statusword 0x0001 matches no state"):
        arm.check()


def test_a_new_beginning_is_no_irregularity(arm):
    arm.run(3)
    for rhythm in arm.rhythms:
        rhythm.take()
    arm.cycle.end()
    arm.clock.advance(0.0137)
    arm.cycle.begin()
    arm.run(3)
    assert [rhythm.take() for rhythm in arm.rhythms] == ["", ""]


def test_feedback_that_comes_late_is_an_irregularity_if_frames_are_stamped(arm):
    arm.rhythms[1].take()
    arm.run(5)
    assert arm.rhythms[1].take() == "", "without stamps nothing is known"
    arm.bus.stamp = lambda: arm.clock() + 0.4 * arm.arm.cycle_s * (arm.cycle.number % 2)
    arm.run(5)
    assert "periods of feedback differ" in arm.rhythms[1].take()


def test_ending_the_cycles_ends_sync_and_leaves_no_drive_operational(arm):
    arm.bus.sent.clear()
    arm.cycle.end()
    assert arm.sync.ended
    assert arm.bus.sent == [(0x000, bytes([0x80, node_id])) for node_id in (2, 3, 5)]


def test_silence_during_a_time_in_which_this_process_did_not_run_is_excused(arm):
    """The drives' heartbeats may have been lost as well; they are waited for anew."""
    limit_s = arm.nodes[0].heartbeat_limit_s
    arm.check(5)
    arm.sync.away_s = limit_s
    arm.check(5)
    with pytest.raises(ServoTimeout, match="no heartbeat"):
        arm.check(round(limit_s / arm.arm.cycle_s))


def test_a_short_delay_excuses_no_silence(arm):
    def late_cycles(number):
        for _ in range(number):
            arm.sync.away_s = arm.arm.cycle_s
            arm.check()

    with pytest.raises(ServoTimeout, match="no heartbeat"):
        late_cycles(round(arm.nodes[0].heartbeat_limit_s / arm.arm.cycle_s))


def test_feedback_is_awaited_of_every_drive_that_is_not_lost(arm):
    arm.run()
    assert arm.sync.complete
    arm.words[3] = []
    arm.run(arm.arm.max_missing_cycles)
    assert not arm.sync.complete
    with pytest.raises(ServoTimeout, match="no feedback"):
        arm.check()
    arm.run()
    assert arm.sync.complete, "nobody waits for a lost drive"


def test_the_heartbeat_is_sent_at_its_own_rate(arm):
    arm.bus.sent.clear()
    cycles = round(1.0 / arm.arm.cycle_s)
    arm.run(cycles)
    beats = arm.bus.sent.count((0x700 + MASTER_ID, b"\x05"))
    assert beats == pytest.approx(1.0 / arm.arm.heartbeat_s, abs=1)


def test_torque_offsets_are_fading_until_they_are_zero(arm):
    for node in arm.nodes:
        node.offset_permille = 100
    assert not arm.cycle.fading
    arm.cycle.fade_offsets()
    assert arm.cycle.fading
    arm.run(arm.cycle.count(1.0))
    assert not arm.cycle.fading
    assert [node.offset_permille for node in arm.nodes] == [0, 0, 0]
