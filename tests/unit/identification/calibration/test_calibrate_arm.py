"""Calibration of an arm from many runs: gains, body and a base that is not level, from Pinocchio's torque."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from armload_identification.calibration import calibrate_arm as calibrate_module
from armload_identification.calibration.calibration_constants import OtherMounting
from armload_identification.calibration.mounted_runs import MountedRun, WeighedPayload
from armload_identification.calibration.session_gains import ConfiguredArm, SessionGains
from armload_identification.estimation import solve as solve_module
from armload_identification.estimation.arm_rows import motion_with_rows
from armload_identification.estimation.base_tilt import tilt_axes
from armload_identification.estimation.estimation_constants import Solver
from armload_identification.identification_errors import EstimationError
from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.recording.reading_options import Effort
from armload_identification.signals.recorded_run import Run
from tests.mounted_runs import LOAD_FRICTION, WRONG, calibrated, named

pytestmark = pytest.mark.pure


@pytest.mark.long
def test_a_joint_that_counts_the_other_way_is_named(pinocchio_arm, weighed):
    """The polarity (607E) cannot be read from a drive of another master's."""
    run = pinocchio_arm.run(pinocchio_arm.trajectory(3, period_s=10.0), True, seed=6, with_phase=False)
    turn = np.where(np.arange(6) == 2, -1.0, 1.0)
    turned = replace(run, position_rad=run.position_rad * turn, current_a=run.current_a * turn)
    steps = []
    with pytest.raises(
        EstimationError, match=r"joint 3 is inverted.*position and effort inverted\. Invert its axis"
    ) as caught:
        calibrated(
            [MountedRun(turned, "weighed")],
            weighed,
            pinocchio_arm,
            pinocchio_arm.transmission,
            progress=lambda done, total: steps.append((done, total)),
        )
    # 42 or 43 times, depending on the compiler; in comparison with the arm as entered
    assert re.search(r"residual of the runs is 4\d\.", str(caught.value))
    done = [step[0] for step in steps]
    assert set(range(8, 27)) <= set(done), "each inverted joint that is tried is progress"
    assert steps[-1] == (26, 27), "the fit is left"


def leaning(chain, tilt_rad):
    """The chain with gravity tilted by two angles."""
    size = np.linalg.norm(chain.gravity_m_s2)
    gravity = chain.gravity_m_s2 + size * np.asarray(tilt_rad) @ tilt_axes(chain.gravity_m_s2)
    return size * gravity / np.linalg.norm(gravity)


def test_a_mass_in_grams_is_refused(runs, pinocchio_arm, nominal):
    grams = {"weighed": WeighedPayload(1000.0 * pinocchio_arm.payload.mass_kg)}
    with pytest.raises(EstimationError, match=r"weighed is said to weigh \d+ kg, .*Is mass_kg in g"):
        calibrated(runs, grams, pinocchio_arm, nominal)


def test_the_days_are_those_of_the_table_and_of_the_recordings(result):
    assert sum(run.recorded == "" for run in result.runs) == 2
    assert result.days == ("2026-03-01", "2026-03-13", "2026-03-14")
    assert result.origin.startswith("6 runs from 2026-03-01 to 2026-03-14, ")


def test_gains_friction_and_payloads_are_found_within_their_intervals(result, pinocchio_arm, other):
    assert result.effort is Effort.CURRENT
    assert result.left_out == ()
    assert result.warnings == ()
    assert result.scale_weighed
    truth = pinocchio_arm.transmission.gain_nm_a
    np.testing.assert_allclose(result.gain_nm_a, truth, rtol=0.015)
    z = np.log(result.gain_nm_a / truth) / result.gain_deviation
    assert (np.abs(z) < 3.0).all(), z
    assert result.determined.all()
    np.testing.assert_allclose(result.body.load_friction[1:4], LOAD_FRICTION, atol=0.01)
    payloads = {payload.mounting: payload for payload in result.payloads}
    for name, arm in (("weighed", pinocchio_arm), ("other", other)):
        found = payloads[name]
        error = (found.theta - arm.payload.theta)[:4]
        assert (np.abs(error) < 3.0 * found.deviation[:4] + 1e-6).all(), (name, error, found.deviation[:4])
    assert payloads["other"].theta[0] == pytest.approx(other.payload.mass_kg, rel=0.01)
    assert np.isnan(payloads["other"].weighed_kg)


def test_an_unused_run_of_the_empty_arm_is_predicted(result, pinocchio_arm):
    state = pinocchio_arm.trajectory(8, period_s=10.0).evaluate(np.linspace(0.0, 10.0, 500))
    q, dq, ddq = state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2
    truth = pinocchio_arm.torque(q, dq, ddq, load_friction=LOAD_FRICTION)
    moving = np.abs(dq) > 0.1
    error = np.where(moving, result.body.torque(result.level(pinocchio_arm.chain), q, dq, ddq) - truth, 0.0)
    assert (np.sqrt(np.mean(error**2, axis=0)) < 0.02 * np.sqrt(np.mean(truth**2, axis=0)) + 0.1).all()


@pytest.mark.long
def test_a_third_payload_is_identified_better_with_it(result, pinocchio_arm, nominal):
    arm = type(pinocchio_arm)()
    arm.payload = InertialParameters.from_center_of_mass(3.3, [0.08, 0.02, 0.10], 0.03 * np.eye(3))
    trajectory = arm.trajectory(6, period_s=10.0)
    loaded, unloaded = (
        arm.run(trajectory, load, seed=70 + load, load_friction=LOAD_FRICTION) for load in (True, False)
    )
    before = identify_runs(loaded, unloaded, arm.chain, nominal)
    level, transmission = result.level(arm.chain), result.transmission(nominal)
    known = result.known_arm
    pair = identify_runs(loaded, unloaded, level, transmission, arm=known)
    alone = identify_runs(loaded, None, level, transmission, arm=known)
    assert pair.uncertainty.half_width_95[0] < 0.4 * before.uncertainty.half_width_95[0]
    for found in (pair, alone):
        assert found.parameters.mass_kg == pytest.approx(3.3, rel=0.01)
        error = np.abs(found.uncertainty.values - arm.payload.values)[:4]
        assert (error < 1.5 * found.uncertainty.half_width_95[:4]).all()
        assert not any("nominal" in note or "far outside" in note for note in found.notes)
    # Both with what they leave of a drift of the gains, which a pair's intervals contain.
    session = SessionGains.assumed(result).within(loaded, ConfiguredArm(result, arm.chain, nominal), loaded=True)
    drifting = identify_runs(loaded, None, level, transmission, arm=session.arm(known))
    assert drifting.uncertainty.half_width_95[0] > pair.uncertainty.half_width_95[0]
    # A cold gear: two thirds more friction on joint 3 than calibrated.
    cold = [colder(run, 2, arm) for run in (loaded, unloaded)]
    for warm, empty in ((alone, None), (pair, cold[1])):
        found = identify_runs(cold[0], empty, level, transmission, arm=known)
        (note,) = [note for note in found.notes if "far outside" in note]
        assert re.match(r"The friction of joint 3 \(\d+ standard deviations\) is far outside", note)
        change = found.arm_friction.torque_nm - warm.arm_friction.torque_nm
        expected = np.where(np.arange(6) == 2, 3.0 + 3.0 * found.arm_friction.speed_rad_s, 0.0)
        np.testing.assert_allclose(change, expected, atol=0.5)


def colder(run, joint, arm):
    """The run with 3 N m and 3 N m s/rad more friction of a joint."""
    speed = np.gradient(run.position_rad, run.time_s, axis=0)[:, joint]
    current = run.current_a.copy()
    current[:, joint] += (3.0 * np.tanh(speed / 0.01) + 3.0 * speed) / arm.transmission.gain_nm_a[joint]
    return replace(run, current_a=current)


def test_a_body_from_one_motion_says_how_little_it_knows_of_others(runs, pinocchio_arm, nominal, result):
    found = calibrated(runs[:1], {}, pinocchio_arm, nominal)
    (text,) = [text for text in found.warnings if text.startswith("for other motions")]
    named = {int(joint): int(share) / 100.0 for joint, share in re.findall(r"(\d) \((\d+) %\)", text)}
    assert len(named) >= 2
    # Its residual on the other motion is as stated, without the friction at reversals and the noise.
    other = motion_with_rows(Run.of(runs[3].recording, found.transmission(nominal)))
    moving = other.valid[:, None] & (np.abs(other.states.velocity_rad_s) > 0.1)
    left = np.where(moving, other.raw_nm - found.body.torque(found.level(pinocchio_arm.chain), *other.states), 0.0)
    share = np.sqrt(np.sum(left**2, axis=0) / np.sum(np.where(moving, other.raw_nm, 0.0) ** 2, axis=0))
    for joint, said in named.items():
        assert share[joint - 1] < 1.5 * said, (joint, share[joint - 1], said)
    assert not any(text.startswith("for other motions") for text in result.warnings)


def test_whole_periods_and_reported_torque_are_calibrated_too(pinocchio_arm, nominal):
    """Drives that report torque have wrong gains as well; periods are averaged."""
    made = []
    for seed in (3, 4):
        trajectory = pinocchio_arm.trajectory(seed, period_s=10.0)
        for load in (False, True):
            run = pinocchio_arm.run(trajectory, load, seed=10 * seed + load, load_friction=LOAD_FRICTION)
            axis = run.current_a * nominal.gain_nm_a
            torque = axis @ np.linalg.inv(nominal.coupling)
            run = named(replace(run, current_a=None, torque_nm=torque), f"{seed}{load}")
            made.append(MountedRun(run, "weighed" if load else ""))
    found = calibrated(made, {"weighed": WeighedPayload(pinocchio_arm.payload.mass_kg)}, pinocchio_arm, nominal)
    assert found.effort is Effort.TORQUE
    np.testing.assert_array_equal(found.nominal, 1.0)
    assert (np.abs(np.log(found.gain_nm_a / WRONG)) < 3.0 * found.gain_deviation).all()
    np.testing.assert_allclose(found.gain_nm_a[1:], WRONG[1:], rtol=0.02)
    transmission = found.transmission(nominal)
    loaded, unloaded = made[1].recording, made[0].recording
    known = found.known_arm
    payload = identify_runs(loaded, unloaded, found.level(pinocchio_arm.chain), transmission, arm=known)
    assert payload.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.005)


def test_drives_are_given_what_their_gains_make_the_torque(result, nominal):
    """A drive's own torque is current times nominal gain; the joint torque also depends on the coupling."""
    torque = np.array([[10.0, -5.0, 3.0, 2.0, 1.0, 0.5]])
    commanded = torque @ result.commanded(nominal.coupling)
    current = (commanded @ nominal.coupling) / nominal.gain_nm_a
    np.testing.assert_allclose(result.transmission(nominal).joint_torque(current), torque, rtol=1e-12)


def test_a_base_that_is_not_level_is_found(pinocchio_arm, nominal, weighed):
    """Tilted gravity is equivalent to a tilted base: the simulated arm has tilted gravity."""
    tilt = np.radians([0.6, -0.4])
    arm = LeaningArm(leaning(pinocchio_arm.chain, tilt))
    made = []
    for seed in (3, 4, 5):
        trajectory = arm.trajectory(seed, period_s=10.0)
        for load in (False, True):
            run = arm.run(trajectory, load, seed=10 * seed + load, with_phase=False, noise=0.2)
            made.append(MountedRun(named(run, f"{seed}{load}"), "weighed" if load else ""))
    found = calibrated(made, weighed, pinocchio_arm, nominal)
    np.testing.assert_allclose(found.tilt_rad, tilt, atol=np.radians(0.15))
    assert (np.abs(found.tilt_rad - tilt) < 4.0 * found.deviation("tilt")).all()
    np.testing.assert_allclose(found.level(pinocchio_arm.chain).gravity_m_s2, arm.gravity, atol=0.03)


@pytest.mark.long
def test_a_rough_fit_that_goes_to_and_fro_says_nothing_about_the_mounting(
    runs, weighed, pinocchio_arm, nominal, monkeypatch
):
    """Mountings are compared only by the rough fit's residual, which remains valid."""
    fit, rough = solve_module.solve, []

    def restless(*arguments, **options):
        with monkeypatch.context() as patch:
            if not rough:
                patch.setattr(Solver, "settled", -1.0)
            rough.append(options.get("rough", False))
            return fit(*arguments, **options)

    monkeypatch.setattr(calibrate_module, "solve", restless)
    assert calibrated(runs, weighed, pinocchio_arm, nominal).left_out == ()
    assert rough[:2] == [True, False]


@pytest.mark.parametrize(("tilt_deg", "warned"), [(1.0, False), (6.0, True)])
def test_a_base_that_is_tilted_against_the_configuration_is_remarked(
    runs, weighed, pinocchio_arm, nominal, tilt_deg, warned
):
    gravity, angle = pinocchio_arm.chain.gravity_m_s2, np.radians(tilt_deg)
    turned = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]) @ gravity
    found = calibrated(runs, weighed, pinocchio_arm, nominal, pinocchio_arm.chain.under(turned))
    said = [text for text in found.warnings if "a base that is tilted by" in text]
    assert len(said) == warned
    assert not warned or re.search(r" (5\.9|6\.[01]) deg against the configured gravity", said[0])


def test_a_wrong_mass_is_named_with_how_far_it_is_off(runs, pinocchio_arm, other, nominal):
    masses = {"weighed": pinocchio_arm.payload.mass_kg, "other": 1.3 * other.payload.mass_kg}
    found = calibrated(runs, {k: WeighedPayload(v) for k, v in masses.items()}, pinocchio_arm, nominal)
    assert any("mounting 'other': 3.250 kg was entered, all other data give" in text for text in found.warnings)


@pytest.mark.parametrize("joints", [(3, 5), (2, 3)], ids=str)
def test_joints_that_are_exchanged_in_all_runs_are_named_so(four, weighed, pinocchio_arm, nominal, joints):
    """Joints 4 and 6 were 'joint 4 is inverted: set the drive's polarity', 5 and 6 'runs contradict each other'."""
    order = np.arange(6)
    order[list(joints)] = joints[::-1]

    def exchanged(run):
        return replace(run, position_rad=run.position_rad[:, order], current_a=run.current_a[:, order])

    runs = [replace(run, recording=exchanged(run.recording)) for run in four]
    with pytest.raises(EstimationError, match=rf"joints {joints[0] + 1} and {joints[1] + 1} are exchanged"):
        calibrated(runs, weighed, pinocchio_arm, nominal)


def test_the_only_weighed_mass_is_questioned_if_it_changes_all_gains(four, pinocchio_arm, nominal):
    """From 4 standard deviations on, a mass 10 % too great, with an adapter that was not weighed, passed in silence."""
    for factor in (1.0, 1.12):
        masses = {"weighed": WeighedPayload(factor * pinocchio_arm.payload.mass_kg)}
        warnings = calibrated(four, masses, pinocchio_arm, nominal).warnings
        assert any("was entered, all other data give" in text for text in warnings) is (factor > 1.0)


def test_a_payload_that_is_known_whole_narrows_the_wrist(runs, weighed, pinocchio_arm, nominal, result):
    whole = {"weighed": WeighedPayload(pinocchio_arm.payload.mass_kg, pinocchio_arm.payload)}
    found = calibrated(runs, whole, pinocchio_arm, nominal)
    assert (found.gain_deviation[3:] < result.gain_deviation[3:]).all()
    assert (np.abs(np.log(found.gain_nm_a / pinocchio_arm.transmission.gain_nm_a)) < 3.0 * found.gain_deviation).all()


def test_without_a_weighed_mass_the_scale_is_the_priors(runs, pinocchio_arm, nominal, result):
    found = calibrated(runs, {}, pinocchio_arm, nominal)
    assert not found.scale_weighed
    assert any("no payload was weighed" in text for text in found.warnings)
    assert found.gain_deviation[1] > 3.0 * result.gain_deviation[1]
    ratio = found.gain_nm_a[2] / found.gain_nm_a[1]
    truth = pinocchio_arm.transmission.gain_nm_a
    assert ratio == pytest.approx(truth[2] / truth[1], rel=0.01)


def test_a_joint_that_never_moves_keeps_its_gain_and_is_named(pinocchio_arm, nominal, weighed, monkeypatch):
    rough = []
    monkeypatch.setattr(OtherMounting, "little", 0.01)

    def counted(*given, **how):
        rough.append(how == {"rough": True})
        return solve_module.solve(*given, **how)

    monkeypatch.setattr(calibrate_module, "solve", counted)
    made = []
    for seed in (3, 4):
        trajectory = pinocchio_arm.trajectory(seed, period_s=10.0)
        still = np.where(np.arange(6)[:, None] == 5, 0.0, 1.0)
        trajectory = replace(trajectory, sin_rad=still * trajectory.sin_rad, cos_rad=still * trajectory.cos_rad)
        for load in (False, True):
            run = pinocchio_arm.run(trajectory, load, seed=10 * seed + load, with_phase=False)
            position = run.position_rad.copy()
            position[:, 5] = position[0, 5]
            made.append(
                MountedRun(named(replace(run, position_rad=position), f"{seed}{load}"), "weighed" if load else "")
            )
    found = calibrated(made, weighed, pinocchio_arm, nominal)
    assert rough.count(True) == 1, "no other mounting is tried for a joint that is not explained because it is still"
    assert any("no run moves joint 6" in text for text in found.warnings)
    assert found.determined.tolist() == [True] * 5 + [False]
    assert found.gain_nm_a[5] == pytest.approx(nominal.gain_nm_a[5], rel=1e-6)
    assert found.gain_deviation[5] > 0.04


def test_runs_that_cannot_be_used_are_named_and_left_out(runs, weighed, pinocchio_arm, nominal, result):
    short = MountedRun(named(runs[0].recording.rows(np.arange(len(runs[0].recording.time_s)) < 150), "short"), "")
    five = runs[0].recording
    five = MountedRun(
        named(replace(five, position_rad=five.position_rad[:, :5], current_a=five.current_a[:, :5]), "five"), ""
    )
    torque = runs[0].recording
    torque = MountedRun(named(replace(torque, torque_nm=torque.current_a, current_a=None), "torque"), "")
    slow = MountedRun(named(runs[0].recording.rows(slice(None, None, 12)), "slow"), "")
    lost = [("lost.csv", "no such file")]
    found = calibrated([*runs, short, five, torque, slow], weighed, pinocchio_arm, nominal, left_out=lost)
    reasons = dict(found.left_out)
    assert set(reasons) == {"lost.csv", "short.mcap", "five.mcap", "torque.mcap", "slow.mcap"}
    assert "record it at 20 Hz or more" in reasons["slow.mcap"]
    assert "expected 3 s or more" in reasons["short.mcap"]
    assert "5 joints" in reasons["five.mcap"]
    assert "it contains torque, most runs contain current" in reasons["torque.mcap"]
    np.testing.assert_allclose(found.gain_nm_a, result.gain_nm_a, rtol=1e-9)
    with pytest.raises(EstimationError, match="no recording can be used"):
        calibrated([short, five], weighed, pinocchio_arm, nominal)


def test_runs_of_one_name_are_distinguished(four, weighed, pinocchio_arm, nominal):
    """By their folders; duplicates are numbered."""
    short = four[0].recording.rows(np.arange(len(four[0].recording.time_s)) < 150)
    two = [replace(four[0], recording=in_folder(run, name)) for name, run in (("a", four[0].recording), ("b", short))]
    found = calibrated([*two, four[1]], weighed, pinocchio_arm, nominal)
    assert [name for name, _ in found.left_out] == ["b/empty3.mcap"]
    assert found.runs[0].name == "a/empty3.mcap"
    twice = calibrated([*four[:2], four[1]], weighed, pinocchio_arm, nominal)
    assert [run.name for run in twice.runs][-1] == "weighed3.mcap (3)"
    assert len(twice.provenance.recordings_sha256) == 3


def in_folder(run, name):
    return replace(run, source=replace(run.source, path=run.source.path.parent / name / "empty3.mcap"))


@pytest.mark.usefixtures("result")
def test_progress_ends_where_it_said(steps):
    done = [step[0] for step in steps]
    assert done == sorted(done)
    assert set(range(done[-1] - 6, done[-1] + 1)) <= set(done), "each run that is left out is progress"
    assert steps[-1][0] == steps[-1][1]


def LeaningArm(gravity):  # noqa: N802 - stands for a class
    """The Pinocchio arm of `conftest` with tilted gravity."""
    from tests.unit.conftest import PinocchioArm

    class Leaning(PinocchioArm):
        def _model(self, payload):
            model = super()._model(payload)
            model.gravity.linear = self.gravity
            return model

    arm = Leaning()
    arm.gravity = gravity
    return arm
