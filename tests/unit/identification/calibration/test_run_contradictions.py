"""A run that contradicts the others is left out, with the simple mistake that explains it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from armload_identification.calibration.calibration_constants import Contradiction
from armload_identification.calibration.mounted_runs import MountedRun, WeighedPayload
from armload_identification.calibration.run_contradictions import _Carried as Carried
from armload_identification.calibration.run_contradictions import _payload_text as payload_text
from armload_identification.identification_errors import EstimationError
from armload_identification.model.payload import InertialParameters, derived
from tests.mounted_runs import LOAD_FRICTION, calibrated, changed, named

pytestmark = pytest.mark.pure


def scaled(run, joint, factor):
    return {"current_a": run.recording.current_a * np.where(np.arange(6) == joint, factor, 1.0)}


def exchanged(run, one, other):
    order = np.arange(6)
    order[[one, other]] = order[[other, one]]
    return {
        "position_rad": run.recording.position_rad[:, order],
        "current_a": run.recording.current_a[:, order],
    }


def swapped_efforts(run, one, other):
    return {"current_a": exchanged(run, one, other)["current_a"]}


def turned(run, joint):
    sign = np.where(np.arange(6) == joint, -1.0, 1.0)
    return {"position_rad": run.recording.position_rad * sign, "current_a": run.recording.current_a * sign}


def turned_position(run, joint):
    return {"position_rad": turned(run, joint)["position_rad"]}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda run: scaled(run, 1, 1.2), "joint 2 reports 1.2[01] times its effort"),
        pytest.param(lambda run: exchanged(run, 1, 2), "joints 2 and 3 are exchanged", marks=pytest.mark.long),
        (lambda run: swapped_efforts(run, 3, 4), "the efforts of joints 4 and 5 are exchanged"),
        pytest.param(lambda run: turned(run, 2), "position and effort of joint 3 are inverted", marks=pytest.mark.long),
    ],
)
def test_a_run_that_contradicts_the_others_is_named_with_its_mistake(
    runs, weighed, pinocchio_arm, nominal, result, change, said
):
    found = calibrated(changed(runs, 3, **change(runs[3])), weighed, pinocchio_arm, nominal)
    ((name, reason),) = found.left_out
    assert name == "empty4.mcap"
    assert re.search(said, reason), reason
    assert (np.abs(np.log(found.gain_nm_a / result.gain_nm_a)) < 3.0 * result.gain_deviation).all()


@pytest.mark.parametrize("count", [3, pytest.param(4, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "change",
    [lambda run: scaled(run, 1, 1.5), lambda run: scaled(run, 2, 0.8), lambda run: turned_position(run, 1)],
)
def test_one_wrong_run_of_few_is_named_though_a_compromise_fits_all_alike(
    four, weighed, pinocchio_arm, nominal, change, count
):
    few = changed(four[:count], count - 1, **change(four[count - 1]))
    wrong = few[count - 1].recording.source.path.name
    found = calibrated(few, weighed, pinocchio_arm, nominal)
    assert [name for name, _ in found.left_out] == [wrong]
    assert not any("remains unexplained" in warning for warning in found.warnings)


def test_a_payload_of_one_run_takes_no_other_joint_along_with_the_wrong_one(four, weighed, pinocchio_arm, nominal):
    """Fitted to the wrong joint too, it makes the others look wrong."""
    found = calibrated(changed(four[:3], 1, **scaled(four[1], 2, -1.0)), weighed, pinocchio_arm, nominal)
    ((_, reason),) = found.left_out
    assert reason.endswith("it fits if the sign of joint 3's effort is flipped")


def test_exchanged_columns_of_one_run_are_no_inverted_joint_of_all(four, weighed, pinocchio_arm, nominal):
    found = calibrated(changed(four[:3], 1, **exchanged(four[1], 3, 4)), weighed, pinocchio_arm, nominal)
    assert [name for name, _ in found.left_out] == [four[1].recording.source.path.name]


@pytest.mark.parametrize(
    ("how", "joint"),
    [
        ("position_rad", 4),
        ("current_a", 5),
        *(
            pytest.param(how, joint, marks=pytest.mark.long)
            for how, joint in (("position_rad", 2), ("position_rad", 5), ("current_a", 2), ("current_a", 4))
        ),
    ],
)
def test_an_inverted_joint_of_all_runs_is_not_taken_for_one_wrong_run(
    four, weighed, pinocchio_arm, nominal, joint, how
):
    turned_alike = [
        replace(run, recording=replace(run.recording, **{how: turned(run, joint)[how]})) for run in four[:3]
    ]
    with pytest.raises(EstimationError, match=rf"joint {joint + 1} is inverted"):
        calibrated(turned_alike, weighed, pinocchio_arm, nominal)


def test_two_runs_that_contradict_each_other_are_not_called_right(four, weighed, pinocchio_arm, nominal):
    found = calibrated(changed(four[:2], 1, **scaled(four[1], 1, 1.5)), weighed, pinocchio_arm, nominal)
    assert found.left_out == ()
    assert any("of the torque of joint 2" in text and "remains unexplained" in text for text in found.warnings)


def test_a_run_with_another_payload_than_said_is_named(four, weighed, pinocchio_arm, nominal):
    lied = [replace(run, mounting="") if run.recording.source.path.name == "weighed3.mcap" else run for run in four]
    found = calibrated(lied, weighed, pinocchio_arm, nominal)
    ((name, reason),) = found.left_out
    assert name == "weighed3.mcap"
    assert re.search(r"it carries 4\.(19|2)", reason), reason
    assert "not nothing" in reason


@pytest.mark.long
def test_a_payload_that_was_remounted_and_one_in_grams_are_distinguished_from_others(
    runs, four, weighed, pinocchio_arm, other, nominal
):
    turned_arm = type(pinocchio_arm)()
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    turned_arm.payload = pinocchio_arm.payload.transformed(half_turn)
    again = turned_arm.run(turned_arm.trajectory(3, period_s=10.0), True, seed=7, load_friction=LOAD_FRICTION)
    grams = next(run for run in runs if run.recording.source.path.name == "other3.mcap")
    more = [*four, MountedRun(named(again, "again"), "weighed"), grams]
    found = calibrated(more, {**weighed, "other": WeighedPayload(2500.0)}, pinocchio_arm, nominal)
    reasons = dict(found.left_out)
    x, y, _ = pinocchio_arm.payload.center_of_mass_m
    (apart_mm,) = re.findall(r"with the centre of mass (\d+) mm from where", reasons["again.mcap"])
    assert int(apart_mm) == pytest.approx(2e3 * np.hypot(x, y), abs=1.0)
    assert re.search(r"carries 2\.[45]\d* kg, not 2500 kg: mass_kg was entered in grams", reasons["other3.mcap"])


@pytest.mark.long
def test_a_payload_in_its_place_is_not_called_remounted(four, weighed, pinocchio_arm, nominal, monkeypatch):
    """Only a change of 12 % of the mass leads to this message here, so this is taken for the same mass."""
    monkeypatch.setattr(Contradiction, "same_mass", 0.2)
    more = list(four)
    theta = pinocchio_arm.payload.theta
    inertia = np.where(np.arange(10) < 4, 0.0, np.where(np.arange(10) < 7, 0.4, 0.0))
    for name, changed_theta in (("heavy", 1.12 * theta), ("wide", theta + inertia)):
        arm = type(pinocchio_arm)()
        arm.payload = InertialParameters(changed_theta)
        run = arm.run(arm.trajectory(4, period_s=10.0), True, seed=8, load_friction=LOAD_FRICTION)
        more.append(MountedRun(named(run, name), "weighed"))
    reasons = dict(calibrated(more, weighed, pinocchio_arm, nominal).left_out)
    assert "carries 4.70" in reasons["heavy.mcap"]
    assert "not 4.200 kg as in the other runs of 'weighed'" in reasons["heavy.mcap"]
    assert "the inertia of its payload differs from that in the other runs of 'weighed'" in reasons["wide.mcap"]


def test_a_run_is_not_left_out_where_too_little_would_remain(four, weighed, pinocchio_arm, nominal):
    """What remains of a short pair fits whatever it is, so that any other run seems to contradict it."""
    runs = [replace(run, recording=run.recording.rows(slice(0, 500))) for run in four[:2]]
    current = runs[1].recording.current_a.copy()
    current[:, 1] += 3.0 * np.std(current[:, 1]) * (np.arange(500) // 30 % 5 == 2)
    assert calibrated(changed(runs, 1, current_a=current), weighed, pinocchio_arm, nominal).left_out == ()


@pytest.mark.long
def test_a_sign_that_is_flipped_is_named(runs, weighed, pinocchio_arm, nominal):
    found = calibrated(changed(runs, 0, **scaled(runs[0], 1, -1.0)), weighed, pinocchio_arm, nominal)
    ((name, reason),) = found.left_out
    assert name == "empty3.mcap"
    assert "joint 2" in reason
    assert "flipped" in reason


# Words, without a fit ---------------------------------------------------------------------------------------------


def carried(mass_kg, center_m=(0.0, 0.0, 0.1), deviation=0.01):
    theta = InertialParameters.from_center_of_mass(mass_kg, list(center_m), 0.02 * np.eye(3)).theta
    return Carried(theta, deviation**2 * np.eye(10))


@pytest.mark.parametrize(
    ("found", "mass_kg", "elsewhere", "said"),
    [
        (carried(2.5), 2500.0, None, "it carries 2.500 kg, not 2500 kg: mass_kg was entered in grams"),
        (carried(2.5), 2000.0, None, "it carries 2.500 kg, not 2000 kg: mass_kg was entered in grams"),
        (carried(2.5), 2.0, None, "it carries 2.500 kg, not 2.000 kg"),
        (carried(2.5), None, None, "it carries 2.500 kg, not nothing"),
        (carried(0.04), None, None, "it carries nothing"),
        (carried(0.06), None, None, "it carries 0.060 kg, not nothing"),
        (carried(0.2), 10.0, None, "it carries nothing"),
        (carried(0.3), 10.0, None, "it carries 0.300 kg, not 10.000 kg"),
        (carried(2.5), 4.2, carried(4.2), "it carries 2.500 kg, not 4.200 kg as in the other runs of 'box'"),
        (carried(4.4), 4.2, carried(4.2), "it carries 4.400 kg, not 4.200 kg as in the other runs of 'box'"),
        (carried(4.21), 4.2, carried(4.2), "the inertia of its payload differs from that in the other runs of 'box'"),
        (
            carried(4.21, (0.03, 0.04, 0.1)),
            4.2,
            carried(4.2),
            "mounted differently, with the centre of mass 50 mm from where it is in the other runs of 'box'",
        ),
    ],
)
def test_a_payload_is_compared_with_what_was_said_and_with_the_other_runs(found, mass_kg, elsewhere, said):
    assert said in payload_text(found, "box", mass_kg, elsewhere)


def test_a_place_that_is_hardly_known_is_no_other_place():
    here, there = carried(4.2, (0.03, 0.04, 0.1), deviation=1.0), carried(4.2, deviation=1.0)
    assert "mounted differently" not in payload_text(here, "box", None, there)


def test_the_covariance_of_a_centre_is_that_of_its_quotient():
    """Against a sample of the parameters."""
    theta = np.array([4.0, 0.4, -0.2, 0.8, *np.zeros(6)])
    half = np.zeros((10, 10))
    half[:4, :4] = [[0.02, 0.0, 0.0, 0.0], [0.004, 0.01, 0.0, 0.0], [0.0, 0.003, 0.02, 0.0], [0.01, 0.0, 0.0, 0.015]]
    values, slope = derived(InertialParameters(theta))
    covariance = (slope @ half @ half.T @ slope.T)[1:4, 1:4]
    np.testing.assert_allclose(values[1:4], [0.1, -0.05, 0.2])
    drawn = theta + np.random.default_rng(3).normal(size=(200_000, 10)) @ half.T
    np.testing.assert_allclose(covariance, np.cov((drawn[:, 1:4] / drawn[:, :1]).T), rtol=0.03, atol=2e-7)
