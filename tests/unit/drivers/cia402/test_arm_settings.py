"""What the settings of a drive state, and what its description states for them."""

import pytest

from armload_drivers.cia402.arm_settings import EffortFeedback, Identity, OperationMode
from armload_drivers.cia402.eds_parser import parse_description
from tests.drive_descriptions import eds, maker_drive

NONE, OWN, DESCRIBED = Identity(None, None), Identity(0x0000_00AB, 0x5678), Identity(0x02DC, 0x1234)


@pytest.mark.parametrize(
    ("configured", "description", "wanted"),
    [(NONE, False, NONE), (OWN, False, OWN), (NONE, True, DESCRIBED), (OWN, True, OWN)],
)
def test_a_configured_identity_counts_more_than_a_description(arm_settings, configured, description, wanted):
    described = parse_description(eds(maker_drive(), 0x02DC, 0x1234).encode(), "drive.eds")
    drive = arm_settings(identity=configured, description=described if description else None).drives[0]
    assert drive.wanted_identity == wanted
    assert drive.is_named == (wanted is not NONE)


def test_modes_and_efforts_have_the_standards_numbers():
    """CiA 402-2: modes of operation (6060), torque and current actual value."""
    assert {mode.name: mode.value for mode in OperationMode} == {
        "INTERPOLATED_POSITION": 7,
        "CYCLIC_SYNCHRONOUS_POSITION": 8,
    }
    assert {effort.name: effort.value for effort in EffortFeedback} == {"CURRENT": 0x6078, "TORQUE": 0x6077}
