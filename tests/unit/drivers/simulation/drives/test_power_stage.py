"""The power side of one simulated drive, by controlwords and objects: what it does to its axis, and its statusword."""

from __future__ import annotations

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import VendorObject
from armload_drivers.cia402.state_machine import POWERED, State
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits, build_dictionary
from armload_drivers.simulation.drives.power_stage import PowerStage
from armload_drivers.simulation.drives.sdo_server import SdoAbort
from armload_drivers.simulation.plant_interface import PlantAxis

FOLLOWING_ERROR = 0x8611

pytestmark = pytest.mark.pure

SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, DISABLE_VOLTAGE, RESET = 0x06, 0x07, 0x0F, 0x02, 0x00, 0x80
CYCLE_S = 0.01
COUNTS_PER_RAD = 1000.0
FOLLOWS, LAGS, LIMITED = 0x1000, 0x2000, 0x0800


class NotedPlant:
    """A plant that notes its orders."""

    def __init__(self):
        self.orders = []

    def __getattr__(self, name):
        def note(axis, *values):
            assert axis == 1
            self.orders.append((name, *values))

        return note

    def hold_position(self, axis):
        return 0.25

    def since(self):
        """The orders since the last call."""
        orders, self.orders = self.orders, []
        return orders


class Stage:
    """A power stage of 1000 counts/rad and 0.2 N m per mille, in mode csp, switched on disabled."""

    def __init__(self, settings, **traits):
        self.traits = DriveTraits(**traits)
        self.plant = NotedPlant()
        dictionary = build_dictionary(settings, self.traits, CYCLE_S)
        self.values, self.vetoes = dictionary.values, dictionary.vetoes
        self.codes = []
        self.power = PowerStage(
            settings, self.traits, PlantAxis(self.plant, 1), dictionary=dictionary, report=self.codes.append
        )
        self.values[od.MODE.key] = settings.mode.value
        dictionary.reactions[od.MODE.key]()
        self.power.machine.initialised()

    def word(self, *words):
        for word in words:
            self.values[od.CONTROLWORD.key] = word
            self.power.obey()
        return self.power.machine.state

    def moves(self, velocity_rad_s, position_rad=0.0, demand_rad=0.0, torque_nm=0.0):
        self.power.measure(position_rad, velocity_rad_s, demand_rad, torque_nm)

    def enabled(self):
        assert self.word(SHUTDOWN, SWITCH_ON, ENABLE) is State.OPERATION_ENABLED
        self.plant.since()
        return self


@pytest.fixture
def stage(arm_settings):
    def stage(changes=None, **traits):
        return Stage(arm_settings(counts_per_rad=COUNTS_PER_RAD, **(changes or {})).drives[0], **traits)

    return stage


def test_torque_is_on_from_operation_enabled_and_setpoints_are_followed(stage):
    new = stage()
    assert new.word(SHUTDOWN, SWITCH_ON) is State.SWITCHED_ON
    assert new.plant.since() == []
    assert new.power.machine.state not in POWERED
    new.values[od.TARGET_POSITION.key] = 500
    new.word(ENABLE)
    assert new.plant.since() == [("set_powered", True), ("set_target", 0.5, CYCLE_S)]
    assert new.power.machine.state in POWERED
    assert new.power.statusword & FOLLOWS
    assert new.power.statusword & 0x10, "voltage enabled"


def test_a_drive_that_does_not_take_the_mode_follows_nothing(stage):
    idle = stage(takes_mode=False).enabled()
    idle.word(ENABLE)
    assert idle.plant.since() == []
    assert not idle.power.statusword & FOLLOWS


def test_interpolated_mode_follows_its_own_setpoint_once_bit_4_is_set(stage):
    from armload_drivers.cia402.arm_settings import OperationMode

    drive = stage({"mode": OperationMode.INTERPOLATED_POSITION}).enabled()
    drive.values[od.TARGET_POSITION.key], drive.values[od.INTERPOLATION_SETPOINT.key] = 1, -250
    drive.word(ENABLE)
    assert drive.plant.since() == []
    assert not drive.power.statusword & FOLLOWS
    drive.word(ENABLE | 0x10)
    assert drive.plant.since() == [("set_target", -0.25, CYCLE_S)]
    assert drive.power.statusword & FOLLOWS


def test_setpoints_stay_within_the_software_limits_and_bit_11_says_so(stage):
    drive = stage().enabled()
    drive.values |= {od.POSITION_LIMIT_MIN.key: -100, od.POSITION_LIMIT_MAX.key: 200}
    for counts, taken_rad, limited in ((300, 0.2, True), (200, 0.2, False), (-101, -0.1, True), (0, 0.0, False)):
        drive.values[od.TARGET_POSITION.key] = counts
        drive.word(ENABLE)
        assert drive.plant.since() == [("set_target", taken_rad, CYCLE_S)]
        assert bool(drive.power.statusword & LIMITED) is limited
    drive.values |= {od.POSITION_LIMIT_MIN.key: 0, od.POSITION_LIMIT_MAX.key: 0, od.TARGET_POSITION.key: 5000}
    drive.word(ENABLE)
    assert drive.plant.since() == [("set_target", 5.0, CYCLE_S)], "equal limits are none"


def test_a_torque_offset_is_passed_on_when_it_changes_and_ends_with_the_torque(stage):
    drive = stage().enabled()
    drive.values[od.TORQUE_OFFSET.key] = -50
    drive.word(ENABLE, ENABLE)
    offsets = [order for order in drive.plant.since() if order[0] == "set_torque_offset"]
    assert offsets == [("set_torque_offset", pytest.approx(-50 * 0.2))]
    drive.word(DISABLE_VOLTAGE)
    assert drive.plant.since() == [("set_powered", False), ("set_torque_offset", 0.0)]


def test_a_quick_stop_brakes_at_6085_then_holds_by_the_brake_and_removes_torque(stage):
    drive = stage().enabled()
    drive.values[od.QUICK_STOP_DECELERATION.key] = 4000
    drive.moves(-2.0)
    drive.power.advance(10.0)
    assert drive.word(QUICK_STOP) is State.QUICK_STOP_ACTIVE
    assert drive.plant.since() == [("slow_down", 0.5)]
    drive.power.advance(10.49)
    assert drive.plant.since() == []
    drive.power.advance(10.5)
    assert drive.plant.since() == [("hold_by_brake",)]
    assert drive.power.machine.state is State.SWITCH_ON_DISABLED


def test_a_quick_stop_that_stays_is_left_to_the_brake_only_when_torque_is_withdrawn(stage):
    drive = stage().enabled()
    drive.values[od.QUICK_STOP_OPTION.key] = 6
    drive.word(QUICK_STOP)
    drive.power.advance(1.0)
    assert drive.plant.since() == [("slow_down", 1e-3)]
    assert drive.power.machine.state is State.QUICK_STOP_ACTIVE
    assert drive.word(DISABLE_VOLTAGE) is State.SWITCH_ON_DISABLED
    assert drive.plant.since() == [("hold_by_brake",)]


def test_torque_withdrawn_during_the_ramp_is_removed_at_once(stage):
    drive = stage().enabled()
    drive.moves(1.0)
    drive.word(QUICK_STOP, DISABLE_VOLTAGE)
    assert drive.plant.since()[1:] == [("set_powered", False)]


def test_operation_enabled_again_in_a_quick_stop_ends_its_ramp_and_keeps_the_torque(stage):
    drive = stage().enabled()
    drive.values[od.QUICK_STOP_OPTION.key] = 6
    drive.moves(1.0)
    drive.word(QUICK_STOP)
    drive.plant.since()
    assert drive.word(ENABLE) is State.OPERATION_ENABLED
    drive.power.advance(9.0)
    assert {order[0] for order in drive.plant.since()} == {"set_target"}
    assert drive.power.machine.state is State.OPERATION_ENABLED


@pytest.mark.parametrize(
    ("word", "option", "value", "orders"),
    [
        (SWITCH_ON, od.DISABLE_OPTION, 1, [("slow_down", 1e-3)]),
        (SWITCH_ON, od.DISABLE_OPTION, 0, [("set_powered", False), ("hold_by_brake",)]),
        (SHUTDOWN, od.SHUTDOWN_OPTION, 1, [("slow_down", 1e-3)]),
        (DISABLE_VOLTAGE, od.SHUTDOWN_OPTION, 1, [("set_powered", False)]),
    ],
)
def test_operation_is_left_as_its_option_says_but_voltage_disabled_at_once(stage, word, option, value, orders):
    drive = stage().enabled()
    drive.values[option.key] = value
    drive.word(word)
    assert drive.plant.since() == orders
    drive.power.advance(1.0)
    assert [order for order in drive.plant.since() if order[0] == "hold_by_brake"] == (
        [("hold_by_brake",)] if orders[0][0] == "slow_down" else []
    )


def test_the_interpolation_follows_the_period_of_sync_within_half_of_it(stage):
    drive = stage().enabled()
    times = [0.0]
    for step_s in [0.011] * 60 + [0.016, 0.004]:
        times.append(times[-1] + step_s)
    for time_s in times[:-2]:
        drive.power.lock_onto_sync(time_s)
    drive.word(ENABLE)
    ((_, _, over_s),) = drive.plant.since()
    assert over_s == pytest.approx(0.011, rel=1e-3)
    for time_s in times[-2:]:
        drive.power.lock_onto_sync(time_s)
    drive.word(ENABLE)
    assert drive.plant.since()[0][2] == over_s, "outside this range it is not followed"


def test_one_sync_changes_the_period_by_a_tenth_of_the_difference(stage):
    drive = stage().enabled()
    drive.power.lock_onto_sync(5.0)
    drive.power.lock_onto_sync(5.012)
    drive.word(ENABLE)
    assert drive.plant.since()[0][2] == pytest.approx(0.0102)


def test_actual_values_are_in_the_drives_units(stage):
    drive = stage()
    drive.moves(0.5, position_rad=-1.5, demand_rad=-1.4, torque_nm=30.0)
    values = drive.values
    assert values[od.POSITION_ACTUAL.key] == -1500
    assert values[od.VELOCITY_ACTUAL.key] == 500
    assert values[od.FOLLOWING_ERROR_ACTUAL.key] == 100
    assert values[od.TORQUE_ACTUAL.key] == values[od.CURRENT_ACTUAL.key] == 150
    drive.power.measure_at_rest()
    assert values[od.POSITION_ACTUAL.key] == 250


def test_a_lag_beyond_its_window_is_announced_and_after_its_time_a_fault(stage):
    drive = stage().enabled()
    drive.values |= {od.FOLLOWING_ERROR_WINDOW.key: 100, od.FOLLOWING_ERROR_TIMEOUT_MS.key: 20}

    def lags(now_s, counts):
        drive.power.advance(now_s)
        drive.moves(0.0, demand_rad=counts / COUNTS_PER_RAD)
        drive.power.supervise_lag()
        return bool(drive.power.statusword & LAGS)

    assert not lags(0.0, 100)
    assert lags(0.01, 101)
    assert lags(0.029, -101)
    assert not lags(0.03, 0), "within the window the time begins anew"
    assert lags(0.04, 101)
    assert lags(0.05, 101)
    assert drive.codes == []
    lags(0.0601, 101)
    assert drive.codes == [FOLLOWING_ERROR]
    assert drive.power.machine.state is State.FAULT_REACTION_ACTIVE


def test_a_lag_counts_neither_with_the_window_off_nor_without_torque(stage):
    for window, enable in ((0xFFFF_FFFF, True), (100, False)):
        drive = stage()
        if enable:
            drive.enabled()
        drive.values |= {od.FOLLOWING_ERROR_WINDOW.key: window, od.FOLLOWING_ERROR_TIMEOUT_MS.key: 0}
        drive.moves(0.0, demand_rad=5.0)
        drive.power.supervise_lag()
        assert drive.codes == []


def test_a_fault_stops_the_axis_and_only_its_reset_with_the_cause_gone_ends_it(stage):
    drive = stage().enabled()
    drive.power.fail(0x7300, persistent=True)
    drive.power.fail(0x7500)
    assert drive.codes == [0x7300], "the first fault is the one reported"
    assert drive.plant.since() == [("slow_down", 1e-3)]
    drive.power.advance(1.0)
    assert drive.plant.since() == [("hold_by_brake",)]
    assert drive.power.machine.state is State.FAULT
    assert drive.word(DISABLE_VOLTAGE, RESET) is State.FAULT
    again = stage().enabled()
    again.power.fail(0x7300)
    again.power.advance(1.0)
    assert again.word(DISABLE_VOLTAGE, RESET) is State.SWITCH_ON_DISABLED
    assert again.codes == [0x7300, 0]


def test_a_fault_without_torque_needs_no_ramp(stage):
    drive = stage()
    drive.power.fail(0x3220)
    assert drive.power.machine.state is State.FAULT
    assert drive.plant.since() == [("hold_by_brake",)]


@pytest.mark.parametrize(
    ("option", "state", "fault"),
    [
        (0, State.OPERATION_ENABLED, False),
        (1, State.FAULT_REACTION_ACTIVE, True),
        (2, State.SWITCH_ON_DISABLED, False),
        (3, State.QUICK_STOP_ACTIVE, False),
    ],
)
def test_the_loss_of_the_master_has_the_effect_of_6007(stage, option, state, fault):
    drive = stage().enabled()
    drive.values[od.ABORT_CONNECTION_OPTION.key] = option
    assert drive.power.lose_master(0x8130) is fault
    assert drive.power.machine.state is state
    assert drive.codes == ([0x8130] if fault else [])


def test_frames_that_return_do_not_end_the_stop_of_a_lost_master(stage):
    drive = stage().enabled()
    drive.values[od.QUICK_STOP_OPTION.key] = 6
    drive.values[od.ABORT_CONNECTION_OPTION.key] = 3
    drive.power.lose_master(0x8130)
    assert drive.word(ENABLE) is State.QUICK_STOP_ACTIVE
    assert drive.word(SWITCH_ON, ENABLE) is not State.QUICK_STOP_ACTIVE, "enable operation was withdrawn before"


def test_without_operation_there_is_no_master_to_lose(stage):
    drive = stage()
    assert not drive.power.lose_master(0x8130)
    assert drive.codes == []


def test_the_direction_of_the_axis_may_not_change_under_torque(stage):
    drive = stage()
    veto = drive.vetoes[od.POLARITY.key]
    veto(0x80)
    drive.enabled()
    with pytest.raises(SdoAbort, match="DEVICE_STATE"):
        veto(0x80)


def test_a_stuck_drive_stays_where_it_is(stage):
    assert stage(stuck_in=State.READY_TO_SWITCH_ON).word(SHUTDOWN, SWITCH_ON, ENABLE) is State.READY_TO_SWITCH_ON


def test_effort_is_also_in_the_vendors_object_where_the_drive_has_one(stage):
    vendor = VendorObject(0x30D1, 2, od.DataType.I32, 1e-3)
    plain, makers = stage(), stage({"vendor_effort": vendor})
    for one in (plain, makers):
        one.moves(0.0, torque_nm=20.0)
        assert one.values[od.TORQUE_ACTUAL.key] == 100
    key = od.Entry(0x30D1, 2, "effort", od.DataType.I32).key
    assert key not in plain.values
    assert makers.values[key] != 0
