"""Cycles over all drives of an arm: which problem is the cause, what the others become, and offsets that fade."""

import numpy as np
import pytest

from armload_drivers.cia402.arm_settings import EffortFeedback
from armload_drivers.cia402.state_machine import State
from armload_drivers.cyclic.arm_cycle import ArmCycle
from armload_drivers.driver_errors import BusError, ForeignMaster, LoopLost, ServoError, ServoFault, ServoTimeout
from tests.scripted_drives import ENABLED, FAULT, SWITCHED_ON, UNDEFINED, ScriptedArm

OFFSET_FADE_S = 0.15

pytestmark = pytest.mark.pure


@pytest.fixture
def on_bus(arm_settings):
    on_bus = ScriptedArm(arm_settings())
    on_bus.enable()
    assert isinstance(on_bus.cycle, ArmCycle)
    return on_bus


def test_feedback_is_numbered_stamped_and_read_only(on_bus):
    feedback = on_bus.check()
    assert feedback.cycle == on_bus.cycle.number
    assert on_bus.check().cycle == feedback.cycle + 1
    assert feedback.time_s == pytest.approx(on_bus.clock() - on_bus.arm.cycle_s)
    np.testing.assert_array_equal(feedback.statusword, [ENABLED] * 3)
    assert not feedback.missing.any()
    for array in (feedback.statusword, feedback.missing):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize("kind", EffortFeedback)
def test_effort_is_a_current_or_a_torque_as_the_drives_report_it(arm_settings, kind):
    on_bus = ScriptedArm(arm_settings(feedback=kind))
    on_bus.enable()
    feedback = on_bus.run()
    current = kind is EffortFeedback.CURRENT
    assert (feedback.current_a is not None) is current
    assert (feedback.torque_nm is None) is current


def test_missing_feedback_is_marked_at_its_joint_and_statuswords_follow(on_bus):
    on_bus.words[3] = []
    on_bus.words[5] = [SWITCHED_ON]
    feedback = on_bus.run()
    np.testing.assert_array_equal(feedback.missing, [False, True, False])
    np.testing.assert_array_equal(feedback.statusword, [ENABLED, ENABLED, SWITCHED_ON])


def test_positions_are_joint_angles(on_bus):
    on_bus.counts[3] = round(0.5 * on_bus.arm.drives[1].counts_per_rad)
    axis_rad = np.array([0.0, 0.5, 0.0])
    np.testing.assert_allclose(on_bus.run().position_rad, on_bus.arm.coupling @ axis_rad, atol=1e-5)


def test_the_cause_is_raised_with_the_others_as_notes(on_bus):
    on_bus.words |= {2: [UNDEFINED], 3: [FAULT], 5: [SWITCHED_ON]}
    with pytest.raises(ServoFault, match="joint_3") as raised:
        on_bus.check()
    assert [note.split(" (")[0] for note in raised.value.__notes__] == [
        "At the same time: joint_2",
        "At the same time: joint_5",
    ]
    on_bus.nodes[2].course.leave("it flew")
    with pytest.raises(LoopLost, match="joint_5") as raised:
        on_bus.check()
    assert len(raised.value.__notes__) == 2


def test_what_is_wrong_with_the_bus_itself_comes_first_of_its_rank(on_bus):
    on_bus.cycle._line_problems = lambda: [BusError("the cable")]
    with pytest.raises(BusError, match="the cable"):
        on_bus.check()
    on_bus.words[5] = [SWITCHED_ON]
    with pytest.raises(BusError, match="the cable") as raised:
        on_bus.check()
    assert len(raised.value.__notes__) == 1


def test_a_drive_that_need_not_follow_may_be_switched_off(on_bus):
    on_bus.words[5] = [SWITCHED_ON]
    on_bus.check(must_follow=False)
    with pytest.raises(ServoError, match="left OPERATION ENABLED"):
        on_bus.check()


def test_another_master_that_commands_is_an_error_and_one_that_asks_a_note(on_bus, monkeypatch):
    monkeypatch.setattr(type(on_bus.cycle), "rivals", ("", "another master asks"))
    on_bus.check()
    on_bus.words[5] = [SWITCHED_ON]
    with pytest.raises(ServoError, match="left OPERATION ENABLED") as raised:
        on_bus.check()
    assert raised.value.__notes__ == ["another master asks"]
    on_bus.words[5] = [ENABLED]
    monkeypatch.setattr(type(on_bus.cycle), "rivals", ("it sends SYNC", ""))
    with pytest.raises(ForeignMaster, match="it sends SYNC"):
        on_bus.check(must_follow=False)


def test_offsets_fade_linearly_to_zero_and_stay_there(on_bus):
    for node, permille in zip(on_bus.nodes, (100, -40, 0), strict=True):
        node.offset_permille = permille
    assert not on_bus.cycle.fading
    on_bus.run()
    assert [node.offset_permille for node in on_bus.nodes] == [100, -40, 0]
    on_bus.cycle.fade_offsets()
    assert on_bus.cycle.fading
    seen = []
    for _ in range(on_bus.cycle.count(OFFSET_FADE_S)):
        on_bus.cycle.fade_offsets()  # a second request does not begin again
        on_bus.run()
        seen.append([node.offset_permille for node in on_bus.nodes])
    share = 1.0 - np.arange(1, len(seen) + 1) / len(seen)
    np.testing.assert_allclose(seen, np.outer(share, (100, -40, 0)), atol=1.0)
    assert seen[-1] == [0, 0, 0]
    assert not on_bus.cycle.fading
    on_bus.cycle.begin()
    on_bus.nodes[0].offset_permille = 7
    on_bus.run()
    assert on_bus.nodes[0].offset_permille == 7, "a new start does not fade"


@pytest.mark.parametrize(("limit_s", "cycles"), [(0.0, 1), (0.01, 1), (0.011, 2), (0.095, 10)])
def test_limits_are_whole_cycles_and_at_least_one(on_bus, limit_s, cycles):
    assert on_bus.cycle.count(limit_s) == cycles


def test_a_state_is_asked_of_those_that_are_meant_and_not_in_fault(on_bus):
    on_bus.words[2] = [FAULT]
    on_bus.run()
    on_bus.cycle.ask(State.QUICK_STOP_ACTIVE, "quick stop", lambda node: node is not on_bus.nodes[1])
    goals = [node.machine.goal for node in on_bus.nodes]
    assert goals == [None, State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE]


def test_what_waits_for_a_drive_is_done_and_may_fail(on_bus):
    done = []
    on_bus.cycle.meanwhile(lambda: done.append(1))
    assert done == [1]

    def fails():
        raise ServoTimeout(3, "joint_3", "", "", "")

    with pytest.raises(ServoTimeout):
        on_bus.cycle.meanwhile(fails)
