"""Texts of emergency messages, including short frames."""

import pytest

from armload_drivers.cia402 import emergency

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x0000, "no error"),
        (0x8611, "following error"),
        (0x8130, "no longer receives its master's heartbeat"),
        (0x2310, "continuous overcurrent at the output"),
        (0x3210, "DC link overvoltage"),
        (0x3220, "DC link undervoltage"),
        (0x4310, "drive too hot"),
        (0x7121, "motor blocked"),
        (0x7305, "incremental sensor 1"),
        (0x7306, "sensor"),  # listed class 0x7300
        (0x8140, "bus-off"),
        (0x8250, "no setpoints from the master"),
        (0x8400, "velocity controller"),
        (0xFEFF, "not listed"),
        (0x2345, "short circuit at the output"),  # listed class 0x2340
        (0x2377, "output side"),  # listed class 0x2300
        (0xFF12, "vendor-specific"),
        (0xA000, "not listed"),
    ],
)
def test_codes_are_reported_with_number_and_meaning(code, words):
    text = emergency.error_text(code)
    assert text.startswith(f"0x{code:04X}")
    assert words in text


def test_every_code_has_a_text():
    assert all(emergency.error_text(code) for code in range(1 << 16))


def test_a_full_frame():
    message = emergency.parse_emergency(bytes.fromhex("1186210102030405"))
    assert (message.code, message.register) == (0x8611, 0x21)
    assert message.manufacturer == bytes([1, 2, 3, 4, 5])
    assert "01 02 03 04 05" in message.text


@pytest.mark.parametrize(("data", "register"), [("1186", None), ("118621", 0x21), ("11862101", 0x21)])
def test_short_frames_are_kept(data, register):
    message = emergency.parse_emergency(bytes.fromhex(data))
    assert message.code == 0x8611
    assert message.register == register


@pytest.mark.parametrize("data", [b"", b"\x11"])
def test_less_than_a_code_is_nothing(data):
    assert emergency.parse_emergency(data) is None


def test_what_a_drive_packs_is_what_a_master_parses():
    frame = emergency.pack(0x8611, 0x21)
    assert len(frame) == 8
    message = emergency.parse_emergency(frame)
    assert (message.code, message.register, message.text) == (0x8611, 0x21, emergency.error_text(0x8611))
