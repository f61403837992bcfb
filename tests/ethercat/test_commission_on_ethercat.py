"""er50 commissioned over EtherCAT, and the same arm over CANopen: run with `python -m tests.ethercat_drives er50`."""

import pytest

from tests.both_buses import commissioned_twice
from tests.lockstep_line import UNDER_IT, WHY

pytestmark = [pytest.mark.ethercat, pytest.mark.skipif(not UNDER_IT, reason=WHY)]

MASS_TOLERANCE = 0.015


def test_the_payload_is_the_same_as_over_canopen(tmp_path):
    (found, intervals, verdict), (other, other_intervals, other_verdict), truth = commissioned_twice(
        tmp_path, periods=2
    )
    assert found["mass"] == pytest.approx(truth.mass_kg, rel=MASS_TOLERANCE)
    assert other["mass"] == pytest.approx(truth.mass_kg, rel=MASS_TOLERANCE)
    assert verdict == other_verdict
    assert intervals.keys() == other_intervals.keys()
    for name, value in found.items():
        low, high = other_intervals[name]
        assert low <= value <= high, name
        low, high = intervals[name]
        assert low <= other[name] <= high, name
