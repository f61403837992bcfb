"""Columns of the wrong sign, found from Pinocchio's links and friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.least_squares import estimate
from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline.payload_identification import identify
from armload_identification.signals.load_signal import load_signal
from armload_identification.verdict.column_mistakes import flipped_signs, looks_wrong
from armload_identification.verdict.sanity import check_signs

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def signal(pair, pinocchio_arm):
    return load_signal(*pair, pinocchio_arm.transmission)


def flipped(run, joints):
    return scaled(run, joints, -1.0)


def scaled(run, joints, factor):
    return replace(run, current_a=run.current_a * np.where(np.isin(np.arange(6), joints), factor, 1.0))


@pytest.mark.parametrize("joints", [(), (0,), (1,), (5,), (1, 2), (3, 5), (0, 1, 4)], ids=str)
def test_flipped_signs_are_found_in_either_run(signal, pinocchio_arm, joints):
    coupling = pinocchio_arm.transmission.coupling
    sign = np.where(np.isin(np.arange(6), joints), -1.0, 1.0)
    flips = coupling @ np.diag(sign) @ np.linalg.inv(coupling)  # tau = C^-T tau_axis
    for run in (signal.loaded, signal.unloaded):
        spoiled = replace(run, torque_nm=run.torque_nm @ flips)
        assert flipped_signs(spoiled, pinocchio_arm.chain, coupling) == joints


def test_good_runs_are_not_searched(signal):
    assert not looks_wrong(signal, None)


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        ((True, True), r"^loaded\.mcap and unloaded\.mcap: joint 3 .*sign of its current or torque is flipped"),
        ((True, False), r"^loaded\.mcap: joint 3 "),
        ((False, True), r"^unloaded\.mcap: joint 3 "),
    ],
    ids=["both", "loaded", "unloaded"],
)
def test_the_file_of_a_flipped_sign_is_named(pair, pinocchio_arm, spoilt, said):
    runs = [flipped(run, [2]) if spoil else run for run, spoil in zip(pair, spoilt, strict=True)]
    with pytest.raises(RecordingError, match=said):
        identify(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)


def test_a_sign_that_only_the_payload_reveals_is_found(signal, pinocchio_arm):
    """As on a last joint without friction, whose unloaded torque does not determine its sign."""
    sign = np.where(np.arange(6) == 5, -1.0, 1.0)
    spoiled = signal.with_torque_times(np.diag(sign))
    regressor = payload_regressor(pinocchio_arm.chain, *spoiled.states)
    fit = estimate(regressor, spoiled.torque_nm, spoiled.valid, np.ones(6))
    with pytest.raises(RecordingError, match=r"joint 6 .*payload torque that the other joints imply.* flipped"):
        check_signs(spoiled, regressor, fit)


@pytest.mark.parametrize(("joint", "factor"), [(2, 1.0 / 6.0), (5, 6.0)])
def test_a_gain_beyond_all_plausible_ones_is_an_error_and_no_percentage(pair, pinocchio_arm, joint, factor):
    runs = [scaled(run, [joint], factor) for run in pair]
    with pytest.raises(EstimationError, match=rf"joint {joint + 1} contradicts .*factor of 3: the sign .* gear ratio"):
        identify(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)
