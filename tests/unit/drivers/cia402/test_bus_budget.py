"""The bus load compared with the published table of worst cases."""

import math
from dataclasses import replace

import numpy as np
import pytest

from armload_drivers.cia402.arm_settings import (
    ArmSettings,
    DriveSettings,
    EffortFeedback,
    FixedPdo,
    Identity,
    OperationMode,
)
from armload_drivers.cia402.bus_budget import (
    FRAME_BITS,
    USUAL_RATES_HZ,
    BusLoad,
    forecast,
    frame_bits,
    require_room,
    with_rate_for,
)
from armload_drivers.cia402.object_dictionary import PdoDirection
from armload_drivers.driver_errors import BusOverload

pytestmark = pytest.mark.pure


def arm(joints, cycle_hz, *, bitrate=1_000_000, heartbeat_s=0.1, **of_drives):
    drives = tuple(
        DriveSettings(
            joint=f"joint_{node}",
            node_id=node,
            mode=OperationMode.CYCLIC_SYNCHRONOUS_POSITION,
            feedback=EffortFeedback.TORQUE,
            counts_per_rad=1e5,
            rated_current_a=None,
            rated_torque_nm=100.0,
            max_torque_permille=3000,
            following_error_rad=0.1,
            position_min_rad=-3.0,
            position_max_rad=3.0,
            velocity_max_rad_s=2.0,
            acceleration_max_rad_s2=5.0,
            has_brake=True,
            identity=Identity(None, None),
            **of_drives,
        )
        for node in range(1, joints + 1)
    )
    return ArmSettings(drives, np.eye(joints), 1 / cycle_hz, bitrate, heartbeat_s, 3)


@pytest.mark.parametrize(("data_bytes", "bits"), [(0, 55), (1, 65), (6, 115), (8, 135)])
def test_frame_bits_of_the_table(data_bytes, bits):
    assert frame_bits(data_bytes) == bits


@pytest.mark.parametrize(
    ("joints", "worst_us", "percent"),
    [
        (3, 865, {125: 11, 250: 22, 500: 43, 1000: 87}),
        (6, 1675, {125: 21, 250: 42, 500: 84}),
        (7, 1945, {125: 24, 250: 49, 500: 97}),
    ],
)
def test_cycles_of_the_table(joints, worst_us, percent):
    for cycle_hz, share in percent.items():
        load = forecast(arm(joints, cycle_hz))
        assert load.cycle_share == pytest.approx(worst_us * 1e-6 * cycle_hz)
        # The published table rounds up 43.25, 24.3 and 97.25 %.
        assert math.floor(load.cycle_share * 100 + 0.5) == share


def test_half_the_bit_rate_doubles_everything():
    full, half = forecast(arm(6, 250)), forecast(arm(6, 250, bitrate=500_000))
    assert half.cycle_share == pytest.approx(2 * full.cycle_share)
    assert half.heartbeat_share == pytest.approx(2 * full.heartbeat_share)


def test_drives_without_a_torque_offset_take_less():
    assert forecast(arm(6, 250, torque_offset=False)).cycle_share == pytest.approx((1675 - 6 * (135 - 115)) * 250e-6)


def test_heartbeats_are_counted():
    load = forecast(arm(6, 250, heartbeat_s=0.1))
    assert load.heartbeat_share == pytest.approx(7 * 65e-6 / 0.1)
    assert load.share == pytest.approx(load.cycle_share + load.heartbeat_share + load.settings_share)


def test_reading_the_settings_again_is_counted():
    """22 settings of each drive, a request and an answer for each."""
    assert forecast(arm(6, 250)).settings_share == pytest.approx(6 * 22 * 2 * 135e-6 / 1.9)


def test_too_fast_a_cycle_is_refused_with_the_rate_that_fits():
    with pytest.raises(BusOverload) as refusal:
        require_room(arm(6, 500))
    fitting = forecast(arm(6, 500)).cycle_hz
    assert f"cycle_hz = {fitting}" in str(refusal.value)
    assert require_room(arm(6, fitting)).fits
    faster = USUAL_RATES_HZ[USUAL_RATES_HZ.index(fitting) - 1]
    with pytest.raises(BusOverload):
        require_room(arm(6, faster))


@pytest.mark.parametrize("rate", USUAL_RATES_HZ)
def test_a_rate_that_is_advised_is_a_number_of_milliseconds(rate):
    assert 1000 % rate == 0


def test_advice_that_needs_more_of_the_bus_names_the_rate_for_it():
    assert with_rate_for(arm(7, 250), torque_offset=False) == ""
    assert "cycle_hz = 200" in with_rate_for(arm(7, 250), effort_bits=32, torque_offset_bits=32)
    fixed = (FixedPdo(PdoDirection.TRANSMIT, 0, (0x60410010, 0x60640020, 0x60770010)),)
    assert with_rate_for(arm(7, 250, fixed_pdos=fixed), effort_bits=32) == "", "it fits no PDO"
    assert not forecast(arm(7, 250, effort_bits=32, torque_offset_bits=32)).fits
    assert forecast(arm(7, 200, effort_bits=32, torque_offset_bits=32)).fits


def test_where_nothing_fits_the_bit_rate_is_named():
    with pytest.raises(BusOverload, match="raise the bit rate"):
        require_room(arm(6, 100, bitrate=10_000, heartbeat_s=0.01))


def test_a_refusal_says_how_many_drives_load_the_bus_by_how_much():
    load = forecast(arm(6, 500))
    with pytest.raises(BusOverload) as refusal:
        require_room(arm(6, 500))
    said = f"6 drives at 500 Hz load the bus by up to {100.0 * load.share:.0f} %"
    assert str(refusal.value).startswith(said)
    assert "Or put some of the joints on a second bus" in str(refusal.value)
    halves = arm(8, 1000)
    on_two = replace(halves, drives=tuple(replace(drive, bus=drive.node_id % 2) for drive in halves.drives))
    with pytest.raises(BusOverload) as refusal:
        require_room(on_two)
    assert "4 + 4 drives on two buses at 1000 Hz" in str(refusal.value)
    assert "second bus" not in str(refusal.value)


def test_a_longer_frame_of_another_kind_counts_as_eight_bytes():
    assert FRAME_BITS[:3] == (55, 65, 75)
    assert set(FRAME_BITS[8:]) == {135}
    assert len(FRAME_BITS) == 65, "CAN FD has up to 64 bytes"


@pytest.mark.parametrize(("share", "fits"), [(0.4999, True), (0.5001, False)])
def test_seven_tenths_of_the_bus_may_be_used(share, fits):
    load = BusLoad(share, 0.15, 0.05, 250)
    assert load.share == pytest.approx(share + 0.2)
    assert load.fits is fits


def test_a_sync_counter_takes_a_byte():
    plain = arm(6, 250)
    counted = forecast(replace(plain, sync_counter=10)).cycle_share - forecast(plain).cycle_share
    assert counted == pytest.approx(10e-6 * 250.0), "ten bits at 1 Mbit/s"
