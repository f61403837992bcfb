"""What is CANopen's own in a drive's bring-up: identification before a reset, SYNC, heartbeats, and advice on PDOs."""

from dataclasses import replace

import pytest

from armload_drivers.canopen.canopen_setup import CanopenSetup
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import EffortFeedback, Identity
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.object_dictionary import PdoDirection
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import SdoRefused, ServoError, ServoTimeout
from tests.scripted_sdo import GENERAL, ScriptedSdo

LIMITS = Timeouts(probe_s=0.03, sdo_s=0.5, boot_s=4.0)
REAL = Identity(0x1AB, 7)


@pytest.fixture
def setup(arm_settings):
    """Bring-up of a drive with these objects, and the drive's side; `arm` changes the arm's settings."""

    def setup(values=(), refusals=None, arm=(), **changes):
        settings = replace(arm_settings(**changes), **dict(arm))
        sdo = ScriptedSdo(values or {}, refusals)
        return CanopenSetup(settings.drives[1], settings, sdo, LIMITS), sdo

    return setup


def test_a_node_that_is_not_there_yet_may_be_reset_unless_only_simulations_are_allowed(setup):
    real, sdo = setup(identity=REAL)
    sdo.silent = True
    assert not real.identify_before_reset()
    assert sdo.limits_s == [LIMITS.probe_s]
    simulated, sdo = setup()
    sdo.silent = True
    with pytest.raises(ServoTimeout, match="only simulated drives are allowed, so no node is reset"):
        simulated.identify_before_reset()
    assert sdo.limits_s == [LIMITS.sdo_s]


def test_a_node_that_answers_is_identified(setup):
    real, sdo = setup({od.DEVICE_TYPE: 0x0002_0192, od.VENDOR_ID: 0x1AB, od.PRODUCT_CODE: 8}, identity=REAL)
    with pytest.raises(ServoError, match="product code"):
        real.identify_before_reset()
    sdo.values[od.PRODUCT_CODE] = 7
    assert real.identify_before_reset()
    assert not sdo.written


def test_after_a_reset_an_answer_is_enough(setup):
    real, sdo = setup()
    real.require_alive()
    sdo.silent = True
    with pytest.raises(ServoTimeout, match=r"no boot-up message within 4.0 s"):
        real.require_alive()


# The master's heartbeat ------------------------------------------------------------------------------------------


def test_the_watch_on_the_master_is_its_node_and_a_multiple_of_its_heartbeat(setup):
    real, sdo = setup({od.HEARTBEAT_CONSUMER: 0})
    real.watch_master(on=True)
    (value,) = sdo.numbers(od.HEARTBEAT_CONSUMER)
    assert value >> 16 == 127
    assert value & 0xFFFF == 250, "2.5 times 100 ms"
    assert real.objects.held[od.HEARTBEAT_CONSUMER] == value
    real.watch_master(on=False)
    assert sdo.numbers(od.HEARTBEAT_CONSUMER)[-1] == 0
    assert od.HEARTBEAT_CONSUMER not in real.objects.held


def test_a_drive_without_it_is_not_held_to_it(setup):
    real, _ = setup()
    real.watch_master(on=True)
    assert od.HEARTBEAT_CONSUMER not in real.objects.held


def test_a_drive_that_refuses_it_must_be_accepted_without(setup):
    refusals = {("write", od.HEARTBEAT_CONSUMER): GENERAL}
    real, _ = setup({od.HEARTBEAT_CONSUMER: 0}, refusals)
    with pytest.raises(SdoRefused):
        real.watch_master(on=True)
    accepted, _ = setup({od.HEARTBEAT_CONSUMER: 0}, refusals, accept_missing=frozenset({Safety.MASTER_LOST.key}))
    accepted.watch_master(on=True)
    assert od.HEARTBEAT_CONSUMER not in accepted.objects.held


# SYNC ------------------------------------------------------------------------------------------------------------

CYCLE = {od.CYCLE_PERIOD_US: 0, od.INTERPOLATION_TIME: 0, od.INTERPOLATION_EXPONENT: 0}


def test_the_cycle_is_written_in_both_places(setup):
    real, sdo = setup(CYCLE)
    real._write_cycle()
    assert sdo.numbers(od.CYCLE_PERIOD_US) == [10_000]
    assert sdo.numbers(od.INTERPOLATION_TIME) + sdo.numbers(od.INTERPOLATION_EXPONENT) in ([1, -2], [10, -3])


@pytest.mark.parametrize(
    ("present", "written"),
    [(0x80, []), (0x8000_0080, []), (0x4000_0080, [0x80]), (0x81, [0x80]), (0x4000_0081, [0x80])],
)
def test_a_drive_that_produces_sync_no_longer_does(setup, present, written):
    real, sdo = setup(CYCLE | {od.SYNC_COB_ID: present})
    real._write_cycle()
    assert sdo.numbers(od.SYNC_COB_ID) == written


def test_a_counter_in_sync_is_set_while_the_cycle_is_none(setup):
    counted = {"sync_counter": 10}
    real, sdo = setup(CYCLE | {od.SYNC_COUNTER_OVERFLOW: 0}, arm=counted)
    real._write_cycle()
    order = [(entry, data[0]) for entry, data in sdo.written if entry in (od.CYCLE_PERIOD_US, od.SYNC_COUNTER_OVERFLOW)]
    assert order[:2] == [(od.CYCLE_PERIOD_US, 0), (od.SYNC_COUNTER_OVERFLOW, 10)]
    again, sdo = setup(CYCLE | {od.SYNC_COUNTER_OVERFLOW: 10}, arm=counted)
    again._write_cycle()
    assert sdo.numbers(od.SYNC_COUNTER_OVERFLOW) == []
    with pytest.raises(ServoError, match=r"does not support a SYNC counter \(1019\).*sync_counter = 0"):
        setup(CYCLE, arm=counted)[0]._write_cycle()
    none, sdo = setup(CYCLE | {od.SYNC_COUNTER_OVERFLOW: 10})
    none._write_cycle()
    assert sdo.numbers(od.SYNC_COUNTER_OVERFLOW) == [0]


# Advice ----------------------------------------------------------------------------------------------------------

SECOND_TPDO, SECOND_RPDO = PdoDirection.TRANSMIT.cob_id_entry(1), PdoDirection.RECEIVE.cob_id_entry(1)


def test_fewer_objects_in_a_pdo_need_a_second_one(setup):
    assert setup()[0].fewer_objects(2).startswith("It has no second TPDO (1801)")
    both = setup({SECOND_TPDO: 0, SECOND_RPDO: 0})[0].fewer_objects(2)
    assert both.startswith("Set pdo_objects_max = 2: the rest")
    without = setup({SECOND_TPDO: 0})[0].fewer_objects(2)
    assert "torque_offset = false" in without
    assert "torque_offset" not in setup({SECOND_TPDO: 0}, torque_offset=False)[0].fewer_objects(2)


@pytest.mark.parametrize(
    ("entry", "second", "name"),
    [(od.TORQUE_OFFSET, SECOND_RPDO, "receive"), (od.CURRENT_ACTUAL, SECOND_TPDO, "transmit")],
)
def test_32_bits_need_a_second_pdo_in_their_direction(setup, entry, second, name):
    assert f"no second {name} PDO" in setup()[0]._room_for_32_bits(entry)
    assert setup({second: 0})[0]._room_for_32_bits(entry) == ""


def test_a_mapping_that_cannot_be_used_needs_the_makers_tool(setup):
    assert "manufacturer's tool" in setup()[0].fixed_mapping(())


@pytest.mark.parametrize("feedback", EffortFeedback)
def test_the_advice_for_a_fixed_mapping_is_a_configuration_that_works(setup, feedback):
    from armload_drivers.cia402.arm_settings import FixedPdo
    from armload_drivers.cia402.process_data.process_image import effort_entry

    effort = od.CURRENT_ACTUAL if feedback is EffortFeedback.CURRENT else od.TORQUE_ACTUAL
    pdos = (
        FixedPdo(PdoDirection.RECEIVE, 0, (od.CONTROLWORD.mapping, od.TARGET_POSITION.mapping)),
        FixedPdo(PdoDirection.TRANSMIT, 0, (od.STATUSWORD.mapping, od.POSITION_ACTUAL.mapping, effort.mapping)),
    )
    real, _ = setup({effort: b"\0\0"})
    advice = real.fixed_mapping(pdos)
    assert advice.startswith("Set fixed_pdos = { ")
    assert all(f"0x{word:08X}" in advice for pdo in pdos for word in pdo.mapping)
    assert ('feedback = "torque"' in advice) is (feedback is EffortFeedback.TORQUE)
    assert "torque_offset = false" in advice, "it maps none"
    assert effort_entry(real.settings) == od.CURRENT_ACTUAL
    wide, _ = setup({effort: b"\0\0\0\0"})
    assert "manufacturer's tool" in wide.fixed_mapping(pdos), "its effort is not as mapped"
