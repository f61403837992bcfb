"""Reading settings again: what is asked when, of drives that answer late or not at all."""

from collections import Counter
from itertools import pairwise

import pytest

from armload_drivers.bring_up.drive_objects import DriveObjects
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cyclic.settings_watch import SettingsWatch
from armload_drivers.driver_errors import SettingChanged

READ_AGAIN_S, ANSWER_S = 1.9, 0.5

CYCLE_S = 0.01
HELD = {
    od.MAX_TORQUE: 1000,
    od.POLARITY: 0,
    od.MODE_DISPLAY: 8,
    od.QUICK_STOP_OPTION: 6,
    od.FOLLOWING_ERROR_WINDOW: 7,
    od.INTERPOLATION_TIME: 10,
    od.HEARTBEAT_CONSUMER: 1,
    od.CYCLE_PERIOD_US: 10_000,
    od.PdoDirection.TRANSMIT.count_entry(0): 3,
}
READ = [*HELD][:-1]
"""All but the mapping."""


class Sdo:
    """SDO access to a drive that answers after some cycles; None for never.

    Attributes:
        asked: Objects that were asked for, with the cycle.
        values: Values that differ from those held.
    """

    step = ""

    def __init__(self, node, delay):
        self.node, self.delay, self.now = node, delay, 0
        self.asked, self.values = [], {}

    def ask(self, entry):
        self.asked.append((entry, self.now))

    def answer(self, entry):
        open_entry, since = self.asked[-1]
        assert open_entry is entry
        if self.delay is None or self.now - since < self.delay:
            return None
        return self.values.get(entry, HELD[entry])


class Arm:
    """Drives with the same settings, and the watch on them."""

    def __init__(self, *delays):
        self.sdos = [Sdo((k, f"joint_{k}"), delay) for k, delay in enumerate(delays)]
        drives = [DriveObjects(sdo) for sdo in self.sdos]
        for drive in drives:
            drive.held = dict(HELD)
        self.watch = SettingsWatch(drives, CYCLE_S)

    def run(self, seconds):
        for _ in range(round(seconds / CYCLE_S)):
            for sdo in self.sdos:
                sdo.now += 1
            self.watch.step()


def test_every_setting_but_the_mapping_is_asked_for_in_turn():
    arm = Arm(1, 1)
    arm.run(2.0 * READ_AGAIN_S + CYCLE_S)
    for sdo in arm.sdos:
        assert Counter(entry for entry, _ in sdo.asked) == dict.fromkeys(READ, 2)


@pytest.mark.parametrize("delay", [1, round(0.9 * ANSWER_S / CYCLE_S)])
def test_an_answer_is_compared_whenever_it_comes(delay):
    arm = Arm(delay)
    arm.run(3.0 * READ_AGAIN_S)
    arm.sdos[0].values[od.MAX_TORQUE] = 1
    with pytest.raises(SettingChanged, match=r"reading the settings again: 6072.*is 1, and was 1000"):
        arm.run(3.0 * READ_AGAIN_S)


def test_a_drive_is_not_asked_while_it_owes_an_answer():
    arm = Arm(round(0.9 * ANSWER_S / CYCLE_S))
    arm.run(5.0 * READ_AGAIN_S)
    times = [cycle for _, cycle in arm.sdos[0].asked]
    assert min(later - earlier for earlier, later in pairwise(times)) >= arm.sdos[0].delay


def test_a_drive_that_never_answers_is_asked_again_in_its_turn_and_the_others_too():
    arm = Arm(None, 1)
    arm.run(10.0 * READ_AGAIN_S)
    silent, other = ([cycle for _, cycle in sdo.asked] for sdo in arm.sdos)
    assert min(later - earlier for earlier, later in pairwise(silent)) >= ANSWER_S / CYCLE_S
    assert len({entry for entry, _ in arm.sdos[0].asked}) == len(READ)
    assert len(other) > 4 * len(READ)


def test_after_a_long_wait_requests_come_no_faster_than_the_drive_answers():
    """What was not asked in time is not made up in a burst."""
    arm = Arm(None)
    arm.run(20.0 * READ_AGAIN_S)
    arm.sdos[0].delay = 1
    before = len(arm.sdos[0].asked)
    arm.run(READ_AGAIN_S)
    assert len(arm.sdos[0].asked) - before <= 2 * len(READ) + 1


def test_a_drive_that_never_answers_delays_no_other():
    arm = Arm(1, None, 1)
    arm.run(3.0 * READ_AGAIN_S)
    for sdo in (arm.sdos[0], arm.sdos[2]):
        for entry in READ:
            times = [CYCLE_S * cycle for asked, cycle in sdo.asked if asked is entry]
            assert max(later - earlier for earlier, later in pairwise(times)) < READ_AGAIN_S + 0.1
