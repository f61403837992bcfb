"""The table of a drive's safety properties, without a bus."""

import re

import pytest

from armload_drivers.cia402.arm_settings import VendorSetting
from armload_drivers.cia402.drive_safety import Safety, acceptance, has_a_way, property_of
from armload_drivers.cia402.object_dictionary import DataType, Entry


def test_every_property_says_what_is_lost_without_it_and_how_each_way_is_verified():
    for of in Safety:
        assert of.lost, of
        assert of.remedy or of is Safety.DISABLE_REACTION, of
        assert all(way.verified for way in of.ways), of


def test_every_way_writes_what_its_text_says():
    """The operator reads the text, such as `605E = 1`; the drive gets the setting."""
    said = []
    for way in (way for of in Safety for way in of.ways):
        written = {setting.entry.index: setting.value for setting in way.settings}
        for index, value in re.findall(r"\b([0-9A-F]{4}) = (\d+)\b", way.text):
            assert written[int(index, 16)] == int(value), way.text
            said.append(index)
    assert {"6007", "1029", "605A", "605B", "605C", "605D", "605E"} <= set(said)


@pytest.mark.parametrize(
    ("index", "of"),
    [
        (0x6007, Safety.MASTER_LOST), (0x1016, Safety.MASTER_LOST), (0x1029, Safety.MASTER_LOST),
        (0x605A, Safety.QUICK_STOP), (0x605C, Safety.DISABLE_REACTION), (0x6073, Safety.TORQUE_LIMIT), (0x6064, None),
    ],
)  # fmt: skip
def test_objects_belong_to_properties(index, of):
    assert property_of(index) is of


def test_ways_by_what_is_there():
    torque = {0x6073, 0x6075}
    assert has_a_way(Safety.TORQUE_LIMIT, None, lambda entry: entry.index in torque)
    assert not has_a_way(Safety.TORQUE_LIMIT, None, lambda entry: entry.index == 0x6073), "of which current?"
    assert has_a_way(Safety.MASTER_LOST, None, lambda entry: entry.index in {0x1016, 0x1029})
    assert not has_a_way(Safety.MASTER_LOST, None, lambda entry: entry.index == 0x6007), "nobody watches the heartbeat"
    assert has_a_way(Safety.DISABLE_REACTION, None, lambda entry: False)
    optional = [s for of in Safety for way in of.ways for s in way.settings if s.optional]
    assert optional
    assert all(
        has_a_way(of, None, lambda entry: entry not in {setting.entry for setting in optional}) for of in Safety
    ), "what is optional need not be there"


def test_ways_that_the_configuration_opens(arm_settings):
    def limited(**changes):
        return has_a_way(Safety.TORQUE_LIMIT, arm_settings(**changes).drives[0], lambda entry: False)

    def setting(meets):
        return (VendorSetting(Entry(0x3001, 2, "vendor's setting", DataType.U32), 5000, meets),)

    assert not limited()
    assert limited(torque_limit_in_drive=True)
    assert limited(vendor_settings=setting("torque_limit"))
    assert not limited(vendor_settings=setting("quick_stop"))
    assert not has_a_way(Safety.TORQUE_LIMIT, None, lambda entry: False)


def test_advice_keeps_what_was_accepted_before(arm_settings):
    drive = arm_settings(accept_missing=frozenset({"quick_stop"})).drives[0]
    assert acceptance((Safety.MASTER_LOST,), drive) == 'accept_missing = ["master_lost", "quick_stop"]'
