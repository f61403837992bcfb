"""What is told of the frames of a line."""

from types import SimpleNamespace

import pytest

from armload_drivers.ethercat.ethercat_servos import EthercatServos


@pytest.fixture
def servos():
    """Servos without a line, with the counters of a cycle."""
    servos = EthercatServos.__new__(EthercatServos)
    servos._ethercat_cycle, servos._reported = None, (0, 0)
    return servos


def test_only_what_is_new_since_the_last_call_is_told(servos):
    assert servos.take_remarks() == ()
    servos._ethercat_cycle = counters = SimpleNamespace(sent=100, lost=0, wrong=0)
    assert servos.take_remarks() == ()
    counters.lost = 3
    ending = "Check cables, plugs and drives"
    assert servos.take_remarks() == (f"warning: bus: 3 of 100 frames did not return in time. {ending}",)
    assert servos.take_remarks() == ()
    counters.sent, counters.lost, counters.wrong = 200, 4, 2
    assert servos.take_remarks() == (
        "warning: bus: 1 of 200 frames did not return in time, 2 of 200 frames had a wrong working counter. " + ending,
    )
    counters.wrong = 3
    assert servos.take_remarks() == (f"warning: bus: 1 of 200 frames had a wrong working counter. {ending}",)
