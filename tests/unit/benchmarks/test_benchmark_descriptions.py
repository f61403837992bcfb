"""The loop that follows messages: what it reads in them, what it changes, and where it ends."""

from benchmarks.descriptions import edited, outcome_of, settings_in
from tests.drive_descriptions import eds, maker_drive

FILE = """[bus]
cycle_hz = 250.0  # assumed

[[joints]]
[joints.drive]
mode = "csp"

[[joints]]
[joints.drive]
mode = "csp"
feedback = "current"
"""


def test_a_message_says_what_to_set():
    message = (
        'Set mode = "ip". If it belongs to this arm: identity = { vendor_id = 0x1, product_code = 0x2 }\n'
        'accept_missing = ["a", "b"]. Set cycle_hz = 200, which fits. Not feedback, nor node_id=3'
    )
    assert settings_in(message, ["mode", "identity", "accept_missing", "cycle_hz", "feedback", "node_id"]) == {
        "mode": '"ip"',
        "identity": "{ vendor_id = 0x1, product_code = 0x2 }",
        "accept_missing": '["a", "b"]',
        "cycle_hz": "200",
    }


def test_every_joint_is_edited_alike():
    text, keys = edited(FILE, 'Set mode = "ip", torque_offset = false and cycle_hz = 100')
    assert keys == ("mode", "torque_offset", "cycle_hz")
    assert text.count('mode = "ip"') == text.count("torque_offset = false") == 2
    assert "csp" not in text
    assert "cycle_hz = 100\n" in text
    assert "250" not in text
    assert edited(text, 'mode = "ip"') == (text, ())


def test_a_drive_that_the_messages_bring_into_motion(tmp_path):
    path = tmp_path / "drive.eds"
    path.write_text(eds(maker_drive([0x6078, 0x60B2, 0x1017]), vendor=7, product=8))
    found = outcome_of(path)
    assert found.moves, found.last
    assert found.edits == (("identity", "torque_offset", "feedback"), ("accept_missing",))
    assert found.counts


def test_a_drive_that_they_do_not(tmp_path):
    path = tmp_path / "drive.eds"
    path.write_text(eds(maker_drive([0x6077, 0x6078])))
    found = outcome_of(path)
    assert (found.moves, found.edits) == (False, ())
    assert "6078" in found.last
    path.write_text("[1000]\nnothing")
    assert "6040" in outcome_of(path).last
