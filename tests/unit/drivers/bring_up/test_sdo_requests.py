"""What is read and written of one drive by SDO: nothing energises it, and its state decides."""

import struct

import pytest

from armload_drivers.bring_up.sdo_requests import SdoRequests
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import OperationMode, VendorObject
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import ServoError, ServoFault
from tests.scripted_sdo import GENERAL, ScriptedSdo

pytestmark = pytest.mark.pure

SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED = 0x0250, 0x0231, 0x0233, 0x0237
QUICK_STOP, REACTION, FAULT = 0x0217, 0x021F, 0x0218
LIMITS = Timeouts(probe_s=0.03, store_s=7.0, fault_reset_s=0.2)


@pytest.fixture
def talk(arm_settings):
    """Requests to a drive that has these objects, and the drive's side."""

    def talk(values, refusals=None, **changes):
        arm, sdo = arm_settings(**changes), ScriptedSdo(values, refusals)
        return SdoRequests(arm.drives[1], arm, sdo, LIMITS), sdo

    return talk


def test_a_short_time_tells_whether_a_node_is_there(talk):
    requests, sdo = talk({})
    assert requests.is_up()
    sdo.silent = True
    assert not requests.is_up()
    assert sdo.limits_s == [0.03, 0.03]


@pytest.mark.parametrize(
    ("word", "state", "powered"),
    [
        (SWITCH_ON_DISABLED, State.SWITCH_ON_DISABLED, False),
        (SWITCHED_ON, State.SWITCHED_ON, False),
        (ENABLED, State.OPERATION_ENABLED, True),
        (QUICK_STOP, State.QUICK_STOP_ACTIVE, True),
        (REACTION, State.FAULT_REACTION_ACTIVE, True),
        (FAULT, State.FAULT, False),
    ],
)
def test_states_with_torque(talk, word, state, powered):
    requests, sdo = talk({od.STATUSWORD: word})
    assert requests.read_state() is state
    assert requests.read_powered_state() is (state if powered else None)
    if powered:
        with pytest.raises(ServoError, match="the drive keeps its torque"):
            requests.remove_torque(0.02)
    else:
        requests.remove_torque(0.02)
    assert sdo.numbers(od.CONTROLWORD) == []


def test_torque_is_removed_by_a_controlword_without_voltage(talk):
    requests, sdo = talk({od.STATUSWORD: SWITCH_ON_DISABLED, od.CONTROLWORD: 0x0F})
    requests.remove_torque(0.02)
    assert sdo.numbers(od.CONTROLWORD) == [0]
    assert sdo.limits_s == [0.02, 0.02]


def test_an_undefined_statusword_is_an_error(talk):
    with pytest.raises(ServoError, match=r"joint_4.*0x0001.*Does this drive follow CiA 402"):
        talk({od.STATUSWORD: 1})[0].read_state()


def test_values_of_what_the_drive_has(talk):
    requests, _ = talk({od.POSITION_ACTUAL: -9, od.STATUSWORD: 3})
    assert requests.read_values((od.STATUSWORD, od.POLARITY, od.POSITION_ACTUAL)) == [3, None, -9]
    assert requests.read_position() == -9
    assert requests.answered_position() is None
    requests.ask_position()
    assert requests.answered_position() == -9


def test_a_temperature_is_in_the_configured_unit(talk):
    requests, sdo = talk({}, temperature=VendorObject(0x3210, 2, od.DataType.I16, 0.1))
    assert requests.read_temperature_celsius() is None
    sdo.values = {requests.settings.temperature.entry("temperature"): struct.pack("<h", -55)}
    assert requests.read_temperature_celsius() == pytest.approx(-5.5)
    assert talk({})[0].read_temperature_celsius() is None


def test_a_drive_that_is_not_in_fault_has_no_cause(talk):
    with pytest.raises(ServoError, match=r"the drive is in SWITCHED ON.*No reset is required"):
        talk({od.STATUSWORD: SWITCHED_ON})[0].read_fault()
    assert "0x2310" in talk({od.STATUSWORD: FAULT, od.ERROR_CODE: 0x2310})[0].read_fault()
    assert talk({od.STATUSWORD: FAULT})[0].read_fault() == "603F does not give a cause"


@pytest.mark.parametrize("word", [FAULT, REACTION])
def test_nothing_continues_with_a_drive_in_fault(talk, word):
    with pytest.raises(ServoFault, match="0x3210") as raised:
        talk({od.STATUSWORD: word, od.ERROR_CODE: 0x3210})[0].require_disabled()
    assert (raised.value.node_id, raised.value.joint) == (3, "joint_3")


@pytest.mark.parametrize("word", [ENABLED, QUICK_STOP])
def test_nothing_continues_with_a_drive_that_another_program_has_enabled(talk, word):
    with pytest.raises(ServoError, match="which this program has not requested"):
        talk({od.STATUSWORD: word})[0].require_disabled()
    talk({od.STATUSWORD: SWITCHED_ON})[0].require_disabled()


@pytest.mark.parametrize(
    ("mode", "target"),
    [
        (OperationMode.CYCLIC_SYNCHRONOUS_POSITION, od.TARGET_POSITION),
        (OperationMode.INTERPOLATED_POSITION, od.INTERPOLATION_SETPOINT),
    ],
)
def test_the_target_is_the_present_position_without_added_torque(talk, mode, target):
    requests, sdo = talk({od.POSITION_ACTUAL: -1234, target: 5, od.TORQUE_OFFSET: 77}, mode=mode)
    assert requests.hold_present_position() == -1234
    assert sdo.numbers(target) == [-1234]
    assert sdo.numbers(od.TORQUE_OFFSET) == [0]
    assert len(sdo.written) == 2


def test_a_brake_is_kept_closed_by_its_output_and_mask_and_released_in_the_other_order(talk):
    requests, sdo = talk({od.PHYSICAL_OUTPUTS: 0b100, od.OUTPUT_MASK: 0b1000})
    requests.keep_brake_closed()
    assert [(entry, data[0]) for entry, data in sdo.written] == [(od.PHYSICAL_OUTPUTS, 0b101), (od.OUTPUT_MASK, 0b1001)]
    sdo.written.clear()
    requests.release_brake()
    assert [(entry, data[0]) for entry, data in sdo.written] == [(od.OUTPUT_MASK, 0b1000), (od.PHYSICAL_OUTPUTS, 0b100)]


def test_a_drive_that_does_not_keep_its_brake_closed_is_refused(talk):
    with pytest.raises(ServoError, match="kept closed: no 60FE:1"):
        talk({})[0].keep_brake_closed()
    with pytest.raises(ServoError, match="kept closed: 60FE:2"):
        talk({od.PHYSICAL_OUTPUTS: 0, od.OUTPUT_MASK: lambda: 0})[0].keep_brake_closed()
    requests, sdo = talk({})
    requests.release_brake()
    assert not sdo.written


class Faulty:
    """A drive whose fault is reset by the n-th rising edge of bit 7."""

    def __init__(self, edges):
        self.edges, self.seen, self.last = edges, 0, 0

    def statusword(self):
        return SWITCH_ON_DISABLED if self.seen >= self.edges else FAULT


@pytest.mark.parametrize("edges", [1, 1000])
def test_a_fault_is_reset_by_rising_edges_and_in_the_end_nothing_is_commanded(talk, edges):
    drive = Faulty(edges)
    requests, sdo = talk({od.STATUSWORD: drive.statusword, od.ERROR_CODE: 0x2310, od.CONTROLWORD: 0})
    transfer = sdo._transfer

    def noticed(entry, data):
        if entry == od.CONTROLWORD and data is not None:
            word = int.from_bytes(data, "little")
            drive.seen += bool(word & 0x80 and not drive.last & 0x80)
            drive.last = word
        return transfer(entry, data)

    sdo._transfer = noticed
    if edges == 1:
        assert requests.reset_fault() is State.SWITCH_ON_DISABLED
    else:
        with pytest.raises(ServoFault, match="0x2310"):
            requests.reset_fault()
    written = sdo.numbers(od.CONTROLWORD)
    assert written[-1] == 0
    assert not {word & 0x0F for word in written} & {0x07, 0x0F}, "nothing is enabled"


def test_only_a_fault_is_reset(talk):
    requests, sdo = talk({od.STATUSWORD: READY, od.CONTROLWORD: 0})
    with pytest.raises(ServoError, match="No reset is required"):
        requests.reset_fault()
    assert not sdo.written


@pytest.mark.parametrize(("value", "able"), [(0, False), (1, True), (2, False), (3, True)])
def test_a_drive_stores_on_request_if_bit_0_says_so(talk, value, able):
    requests, _ = talk({od.STORE_ALL: value})
    if able:
        requests.require_storage()
    else:
        with pytest.raises(ServoError, match=f"is 0x{value:X}, without bit 0"):
            requests.require_storage()


def test_storing_takes_its_time_and_the_signature_save(talk):
    requests, sdo = talk({od.STORE_ALL: 1})
    requests.store_settings()
    assert sdo.written == [(od.STORE_ALL, b"save")]
    assert sdo.limits_s == [LIMITS.store_s]
    with pytest.raises(ServoError, match="no 1010:1"):
        talk({})[0].require_storage()
    refusing, _ = talk({od.STORE_ALL: 1}, {("write", od.STORE_ALL): GENERAL})
    with pytest.raises(ServoError, match="storing the settings"):
        refusing.store_settings()
