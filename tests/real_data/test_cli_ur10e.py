"""The commands for calibration and accuracy, on measured currents."""

from __future__ import annotations

import pytest

from armload_identification.files.payload_file import read_payload

WEIGHED_KG = 2.805


@pytest.fixture(scope="module")
def pairs(shared_data):
    folder = shared_data / "ur10e"
    return {
        name: ("--loaded", folder / f"loaded{suffix}.csv", "--unloaded", folder / f"unloaded{suffix}.csv")
        for name, suffix in (("a", ""), ("b", "_b"))
    }


@pytest.mark.long
def test_what_is_known_is_kept(armload, pairs, tmp_path):
    payload = tmp_path / "payload.toml"
    result = armload("identify", "ur10e", *pairs["a"], "--mass-kg", WEIGHED_KG, "-o", payload)
    assert result.exit_code == 0, result.output
    assert read_payload(payload).model.mass_kg == pytest.approx(WEIGHED_KG, rel=1e-4)
    again = armload("identify", "ur10e", *pairs["b"], "--cad", payload, "--cad-share", "0.5")
    assert again.exit_code == 0, again.output
    both = armload("compare", payload, payload)
    assert both.exit_code == 0, both.output
    assert "0.00 %" in both.output
    assert "not determined" in both.output
