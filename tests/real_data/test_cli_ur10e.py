"""The commands around accuracy, as their user types them, on measured currents."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.files.body_file import read_body
from armload_identification.files.gains_file import read_gains
from armload_identification.files.payload_file import read_payload

WEIGHED_KG = 2.805


@pytest.fixture(scope="module")
def pairs(shared_data):
    folder = shared_data / "ur10e"
    return {
        name: ("--loaded", folder / f"loaded{suffix}.csv", "--unloaded", folder / f"unloaded{suffix}.csv")
        for name, suffix in (("a", ""), ("b", "_b"))
    }


@pytest.fixture(scope="module")
def gains(armload, pairs, tmp_path_factory):
    path = tmp_path_factory.mktemp("gains") / "gains.toml"
    result = armload("calibrate-gains", "ur10e", *pairs["a"], "--mass-kg", WEIGHED_KG, "-o", path)
    assert result.exit_code == 0, result.output
    assert "not determined, kept nominal: shoulder_pan" in result.output
    return path


@pytest.fixture(scope="module")
def body(armload, pairs, tmp_path_factory):
    path = tmp_path_factory.mktemp("body") / "body.toml"
    result = armload("identify-body", "ur10e", pairs["a"][3], "-o", path, "--check", pairs["b"][3])
    assert result.exit_code == 0, result.output
    assert "unloaded_b.csv, which was not used" in result.output
    return path


def test_gains_are_written_and_used(armload, pairs, gains, tmp_path):
    back = read_gains(gains, np.eye(6))
    assert back.calibrated.tolist() == [False, True, True, True, True, True]
    payload = tmp_path / "payload.toml"
    result = armload("identify", "ur10e", *pairs["b"], "--gains", gains, "-o", payload)
    assert result.exit_code == 0, result.output
    assert read_payload(payload).model.mass_kg == pytest.approx(WEIGHED_KG, rel=0.007)
    assert "gains are nominal" not in result.output
    assert "joint 1 are nominal" in result.output
    judged = armload("validate", "ur10e", payload, *pairs["b"], "--gains", gains)
    assert "shoulder_lift" in judged.output


def test_the_body_route_needs_no_empty_run(armload, pairs, body, tmp_path):
    assert read_body(body).model.n == 6
    payload = tmp_path / "payload.toml"
    result = armload("identify", "ur10e", *pairs["b"][:2], "--body", body, "-o", payload)
    assert result.exit_code == 0, result.output
    assert read_payload(payload).model.mass_kg == pytest.approx(WEIGHED_KG, rel=0.04)
    assert "gains are nominal" in result.output


def test_a_body_of_other_gains_is_refused(armload, pairs, body, gains):
    result = armload("identify", "ur10e", *pairs["b"][:2], "--body", body, "--gains", gains)
    assert result.exit_code == 1
    assert "Identify the body again" in str(result.exception)


def test_what_is_known_is_kept(armload, pairs, tmp_path):
    payload = tmp_path / "payload.toml"
    result = armload("identify", "ur10e", *pairs["a"], "--mass-kg", WEIGHED_KG, "-o", payload)
    assert result.exit_code == 0, result.output
    assert read_payload(payload).model.mass_kg == pytest.approx(WEIGHED_KG, rel=1e-4)
    again = armload("identify", "ur10e", *pairs["b"], "--cad", payload, "--cad-share", "0.5")
    assert again.exit_code == 0, again.output
    both = armload("compare", payload, payload)
    assert both.exit_code == 0, both.output
    assert "0.00%" in both.output
    assert "not determined" in both.output


@pytest.mark.parametrize("words", [(), ("--mass-kg", "2.8", "--payload", "p.toml")])
def test_calibration_needs_one_way_to_know_the_payload(armload, pairs, words, tmp_path):
    result = armload("calibrate-gains", "ur10e", *pairs["a"], *words, "-o", tmp_path / "gains.toml")
    assert result.exit_code == 1
    assert "exactly one of the two" in str(result.exception)
