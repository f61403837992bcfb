"""A payload from one run of any motion: Pinocchio's torque of a calibrated arm, window by window, and errors."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.excitation.design_envelope import Envelope, ExcitationLimits
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.geometry.workspace import Workspace
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.identification_errors import (
    EstimationError,
    ExcitationError,
    NoPayloadMass,
    NothingMounted,
    RecordingError,
)
from armload_identification.model.payload import PARAMETER_NAMES
from armload_identification.pipeline.any_motion import FLOOR_KG, identify_windows
from armload_identification.pipeline.mass_prospect import half_widths_kg
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.pipeline.wiggle import WiggleSearch
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.recording import Recording
from armload_identification.results.payload_over_time import PayloadOverTime

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def known(calibration, pinocchio_arm):
    """Calibrated chain, transmission and empty arm."""
    chain = pinocchio_arm.chain
    return calibration.level(chain), calibration.transmission(pinocchio_arm.transmission), calibration.known_arm


@pytest.fixture(scope="module")
def loaded(pinocchio_arm):
    """A run on another motion than the calibration's."""
    return pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), True, seed=8, with_phase=False)


def only(run, moving):
    """The run with all joints but some held at their first position."""
    held = np.where(moving, run.position_rad, run.position_rad[:1])
    return replace(run, position_rad=held, velocity_rad_s=None)


def test_windows_hold_the_payload(pinocchio_arm, known, loaded):
    windows = identify_windows(loaded, *known, 5.0)
    assert len(windows) >= 2
    for window in windows:
        error = np.abs(window.found.uncertainty.values - pinocchio_arm.payload.values)[:4]
        assert (error < 1.5 * window.found.uncertainty.half_width_95[:4]).all()
        assert window.found.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.02)
        assert window.found.uncertainty.half_width_95[0] > 1.9 * FLOOR_KG
        assert window.found.parameters.is_physical


@pytest.mark.parametrize(
    ("turn", "said"),
    [
        (np.diag([1.0, 1.0, 1.0, 1.0, -1.0, 1.0]), "all columns of joint 5 are reversed"),
        (np.eye(6)[[0, 1, 2, 5, 4, 3]], "all columns of joints 4 and 6 are exchanged"),
    ],
)
def test_columns_of_a_single_run_that_belong_to_another_joint_or_direction_are_named(known, loaded, turn, said):
    """Without the search the first was a hose at joint 5, 'and the intervals allow for that', which they did not."""
    chain, transmission, arm = known
    run = replace(loaded, position_rad=loaded.position_rad @ turn, current_a=loaded.current_a @ turn)
    with pytest.raises(RecordingError, match=said):
        identify_runs(run, None, chain, transmission, arm=arm)


def test_jerky_motion_goes_through_one_window_with_the_torque(pinocchio_arm, known, jerky):
    """With steps of acceleration the noise is 1.3 to 2.1 times the calibration's."""
    chain, transmission, arm = known
    time_s, position, current = jerky
    run = Recording.from_arrays(time_s, position, current_a=current)
    found = identify_runs(run, None, chain, transmission, arm=arm)
    assert (found.plain.noise_nm / arm.noise_nm).mean() < 2.0
    assert found.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.005)


def test_what_the_model_leaves_of_a_joint_widens_the_interval(pinocchio_arm, calibration, known, loaded):
    """A square-wave torque on all joints, ten times the calibration's noise, like a change of the gears.

    The interval becomes 7.8 times as wide; with half the torque 4.4 times, with twice the torque 15 times. Without it,
    the interval is the one predicted from the calibration for this motion.
    """
    chain, transmission, arm = known
    wrong = 10.0 * arm.noise_nm * np.sign(np.sin(2.1 * loaded.time_s[:, None] + np.arange(chain.n)))
    added = wrong @ np.linalg.inv(transmission.joint_torque(np.eye(chain.n)))
    usual, off = (
        identify_runs(replace(loaded, current_a=current), None, chain, transmission, arm=arm).uncertainty
        for current in (loaded.current_a, loaded.current_a + added)
    )
    assert 5.0 < off.half_width_95[0] / usual.half_width_95[0] < 10.0
    prospect = partial(half_widths_kg, chain, calibration, pinocchio_arm.payload)
    trajectory = pinocchio_arm.trajectory(6, period_s=10.0)
    (promised_kg,) = prospect(trajectory, np.array([0.1 * loaded.time_s[-1]]))
    assert 0.9 * promised_kg < usual.half_width_95[0] < 1.1 * promised_kg


def test_the_noise_of_an_average_period_is_no_error_of_the_model(pinocchio_arm, known, loaded):
    """Its rows are not means over a window, so they have more noise than the calibration's."""
    chain, transmission, arm = known
    run = pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), True, seed=8)
    by_period, by_row = (
        identify_runs(each, None, chain, transmission, arm=arm).uncertainty.half_width_95[0] for each in (run, loaded)
    )
    assert by_period < 1.2 * by_row


def test_friction_that_changed_since_is_found_beside_the_payload(pinocchio_arm, known, loaded):
    """A cold arm: all friction 20 % above the calibration's, ten times the differences between its runs."""
    chain, transmission, arm = known
    velocity = np.gradient(loaded.position_rad, loaded.time_s, axis=0)
    colder = 0.2 * (np.sign(velocity) * arm.body.coulomb_nm + velocity * arm.body.viscous_nm_s_rad)
    run = replace(
        loaded, current_a=loaded.current_a + colder @ np.linalg.inv(transmission.joint_torque(np.eye(chain.n)))
    )
    found = identify_runs(run, None, chain, transmission, arm=arm)
    assert found.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.015)
    assert abs(found.parameters.mass_kg - pinocchio_arm.payload.mass_kg) < found.uncertainty.half_width_95[0]
    coulomb, viscous, _ = found.plain.friction()
    speed = 0.5 * np.abs(velocity).max(axis=0)
    usual = arm.body.coulomb_nm + arm.body.viscous_nm_s_rad * speed
    np.testing.assert_allclose((coulomb + viscous * speed) / usual, 0.2, atol=0.03)
    # Together they are known better than each alone.
    known_to = found.plain.friction_covariance(0)
    both = np.stack([np.ones_like(speed), speed], axis=1)
    deviation = np.sqrt(np.einsum("ji,jik,jk->j", both, known_to, both))
    assert (deviation < 0.05 * usual).all()
    assert (known_to[:, 0, 1] < 0.0).all()


@pytest.mark.parametrize("with_pair", [True, False])
def test_gears_may_lose_more_of_their_load_than_in_the_calibration(pinocchio_arm, known, with_pair):
    """They lost nothing there, and 4 % of it now: 1 % of the payload's mass if that is not allowed for."""
    chain, transmission, arm = known
    trajectory, today = pinocchio_arm.trajectory(6, period_s=10.0), np.full(chain.n, 0.04)
    runs = [pinocchio_arm.run(trajectory, on, seed=8 + on, load_friction=0.04) for on in (True, False)]
    pair = runs if with_pair else (runs[0], None)
    blind, found = (
        identify_runs(*pair, chain, transmission, arm=replace(arm, load_friction_spread=share * today))
        for share in (0.0, 1.0)
    )
    off, left = (abs(one.parameters.mass_kg - pinocchio_arm.payload.mass_kg) for one in (blind, found))
    assert left < 0.5 * off, (left, off)
    assert left < found.uncertainty.half_width_95[0]
    np.testing.assert_allclose(found.plain.load_friction[1:], 0.04, atol=0.005)
    np.testing.assert_array_equal(found.plain.body(0).load_friction, found.plain.load_friction)


@pytest.mark.long
def test_another_coulomb_friction_of_a_joint_is_noted_by_one_run_and_by_a_pair(pinocchio_arm, known, loaded):
    """Even if viscous friction compensates it at the speed at which friction is reported."""
    chain, transmission, arm = known
    unloaded = pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), False, seed=9, with_phase=False)
    speed = 0.5 * np.abs(np.gradient(loaded.position_rad, loaded.time_s, axis=0)[:, 1]).max()

    def other(run, at_middle):
        """30 % more Coulomb friction of joint 2; the total at that speed changes by `at_middle` of it."""
        velocity = np.gradient(run.position_rad, run.time_s, axis=0)[:, 1]
        added = np.zeros_like(run.position_rad)
        added[:, 1] = 0.3 * np.sign(velocity) + (at_middle - 0.3) * velocity / speed
        added *= arm.body.coulomb_nm
        return replace(run, current_a=run.current_a + added @ np.linalg.inv(transmission.joint_torque(np.eye(chain.n))))

    def noted(run, empty=None):
        found = identify_runs(run, empty, chain, transmission, arm=arm)
        return [note[:24] for note in found.notes if "far outside" in note]

    assert noted(loaded) == noted(loaded, unloaded) == []
    assert noted(other(loaded, 0.3)) == noted(other(loaded, 0.0)) == ["The friction of joint 2 "]
    assert noted(other(loaded, 0.0), other(unloaded, 0.0)) == ["The friction of joint 2 "]


def test_a_run_of_parts_too_short_for_a_row_is_refused(pinocchio_arm, known, loaded):
    """Of every 0.6 s the first half is there: alone, in a window, and as a pair, also with nominal gains."""
    chain, transmission, arm = known

    def holed(run):
        kept = np.arange(run.time_s.size) // 30 % 2 == 0
        signals = {name: getattr(run, name)[kept] for name in ("time_s", "position_rad", "current_a")}
        return replace(run, velocity_rad_s=None, **signals)

    alone, empty = holed(loaded), holed(pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), False, seed=9))
    empty = replace(empty, excitation=None, phase_s=None)
    text = "no third of a second is without a gap of more than 0.1 s: record it at 20 Hz or more"
    for unloaded, calibrated in ((None, arm), (empty, arm), (empty, None)):
        with pytest.raises(EstimationError, match=f"mcap: {text}"):
            identify_runs(alone, unloaded, chain, transmission, arm=calibrated)
    assert {window.refusal for window in identify_windows(alone, *known, 10.0)} == {f"{text}."}


def test_what_the_motion_does_not_show_is_refused_with_what_is_missing(known, loaded):
    chain, transmission, arm = known
    with pytest.raises(EstimationError, match=r"only joint 3 moves.*move joints 1, 2, 4, 5 and 6 at 0\.\d+ rad/s"):
        identify_runs(only(loaded, np.arange(chain.n) == 2), None, chain, transmission, arm=arm)
    slow = replace(loaded, time_s=30.0 * loaded.time_s, velocity_rad_s=None)
    with pytest.raises(EstimationError, match=r"is at rest, or nearly so.*move joints 1 to 6 at"):
        identify_runs(slow, None, chain, transmission, arm=arm)


@pytest.mark.parametrize(
    ("joints", "determined"),
    [((2, 3), ["mass"]), ((1, 2, 3), ["mass", "cx"]), ((4, 5, 6), ["mass", "cx", "cy", "cz"])],
)
def test_what_some_joints_alone_show_is_reported_and_nothing_else(pinocchio_arm, known, joints, determined):
    """The other joints are held, at constant current."""
    found = identify_runs(moved(pinocchio_arm, joints), None, known[0], known[1], arm=known[2])
    sure = found.uncertainty.determined
    # c_y by joints 1 to 3 is within 20 mm, the limit, or just not.
    limit = {"cy"} if joints == (1, 2, 3) else set()
    names = {name for name, is_sure in zip(PARAMETER_NAMES, sure, strict=True) if is_sure}
    assert names - limit == set(determined) - limit
    error = np.abs(found.uncertainty.values - pinocchio_arm.payload.values)[sure]
    assert (error < 1.5 * found.uncertainty.half_width_95[sure]).all()
    assert not any("does not explain" in note for note in found.notes)


@pytest.mark.parametrize(("joints", "missing"), [((5, 6), "joints 1 to 4"), ((1, 2), "joints 3 to 6")])
def test_joints_that_cannot_show_a_mass_together_are_refused(pinocchio_arm, known, joints, missing):
    """From joints 5 and 6 only, a mass was once 130 half widths off: almost no signal was taken for low noise."""
    with pytest.raises(EstimationError, match=f"the mass is not determined.*move {missing} at"):
        identify_runs(moved(pinocchio_arm, joints), None, known[0], known[1], arm=known[2])


def moved(arm, joints):
    """A loaded run in which some joints move; with its noise no parameter is a borderline case."""
    of = arm.trajectory(6, period_s=10.0)
    moves = np.isin(np.arange(1, 7), joints)[:, None]
    path = FourierTrajectory(of.base_frequency_hz, of.offset_rad, of.sin_rad * moves, of.cos_rad * moves)
    return arm.run(path, True, seed=8, noise=0.7, with_phase=False)


def test_an_empty_arm_has_no_mass(pinocchio_arm, known):
    chain, transmission, arm = known
    empty = pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), False, seed=9, with_phase=False)
    with pytest.raises(NothingMounted):
        identify_runs(empty, None, chain, transmission, arm=arm)
    assert all(window.found is None for window in identify_windows(empty, chain, transmission, arm, 5.0))


def test_a_weighed_mass_does_not_make_a_payload_of_an_empty_arm(pinocchio_arm, known):
    """With the exact mass as prior its interval is narrow, whatever the data: nothing after the fit refuses it."""
    chain, transmission, arm = known
    empty = pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), False, seed=9, with_phase=False)

    def weighed(mass_kg, run=empty):
        return identify_runs(run, None, chain, transmission, arm=arm, known=KnownPayload(mass_kg=mass_kg))

    with pytest.raises(EstimationError, match=r"mass 3 kg contradicts the data\. Without it: .*nothing mounted"):
        weighed(3.0)
    with pytest.raises(NoPayloadMass) as nothing:
        identify_runs(empty, None, chain, transmission, arm=arm)
    assert 1.9 * FLOOR_KG < nothing.value.half_width_kg < 3.0 * FLOOR_KG
    light_kg = nothing.value.mass_kg + 1.5 * nothing.value.half_width_kg
    assert any("is outside the interval of the data" in note for note in weighed(light_kg).notes)
    too_little = moved(pinocchio_arm, (5, 6))
    assert weighed(pinocchio_arm.payload.mass_kg, too_little).uncertainty.determined[0]


def test_a_negative_mass_is_not_taken_for_insufficient_motion(pinocchio_arm, known):
    """As of exchanged joints, a flipped sign, or a tool taken off since the calibration."""
    chain, transmission, arm = known
    run = pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), True, seed=9, with_phase=False)
    empty = pinocchio_arm.run(pinocchio_arm.trajectory(6, period_s=10.0), False, seed=9, with_phase=False)
    lighter = replace(empty, current_a=2.0 * empty.current_a - run.current_a)
    with pytest.raises(EstimationError, match=r"the mass is negative, -\d.* Check the joint order"):
        identify_runs(lighter, None, chain, transmission, arm=arm)


def test_wrong_use_is_named(known, loaded):
    chain, transmission, arm = known
    with pytest.raises(RecordingError, match=r"expected at least one window of 900 s"):
        identify_windows(loaded, chain, transmission, arm, 900.0)


def test_the_gains_of_currents_are_not_applied_to_torques(pinocchio_arm, known, loaded):
    """Nor to the torque of a run that contains both, which would be used."""
    chain, transmission, arm = known
    both = replace(loaded, torque_nm=pinocchio_arm.transmission.joint_torque(loaded.current_a))
    for run, content in (
        (replace(both, current_a=None), "joint torque"),
        (both, "joint torque and motor current, of which the torque is used"),
    ):
        refusal = f"loaded.mcap: it contains {content}, but the arm was calibrated with motor current"
        with pytest.raises(RecordingError, match=refusal):
            identify_runs(run, None, chain, transmission, arm=arm)
        with pytest.raises(RecordingError, match=refusal):
            identify_runs(run, run, chain, transmission, arm=arm)
        with pytest.raises(RecordingError, match=refusal):
            identify_windows(run, chain, transmission, arm, 5.0)
    with pytest.raises(RecordingError, match="contains motor current, but the arm was calibrated with joint torque"):
        identify_runs(loaded, None, chain, transmission, arm=replace(arm, effort=Effort.TORQUE))


def test_a_table_a_document_and_a_picture(known, loaded, tmp_path):
    still = loaded.time_s[-1] + np.arange(0.01, 6.0, 0.01)
    run = Recording.from_arrays(
        np.concatenate([loaded.time_s, still]),
        np.vstack([loaded.position_rad, loaded.position_rad[-1] + 1e-3 * np.sin(still)[:, None]]),
        current_a=np.vstack([loaded.current_a, loaded.current_a[-1] + 1e-3 * np.cos(9.0 * still)[:, None]]),
        name="shift.csv",
    )
    history = PayloadOverTime("six", identify_windows(run, *known, 10.0), run.source)
    assert str(history).splitlines()[2].startswith("0.0 to 10.0 ")
    document = history.to_dict()
    assert document["windows"][0]["mass_kg"] > 1.0
    history.picture(tmp_path / "mass.svg")
    assert b"mass" in (tmp_path / "mass.svg").read_bytes()


@pytest.fixture(scope="module")
def about(pinocchio_arm):
    """A pose, and all limits with a range of 6 degrees about it."""
    place = np.array([0.2, -0.4, 0.6, 0.1, 0.3, -0.2])
    ones, chain = np.ones(6), pinocchio_arm.chain
    joints = ExcitationLimits(place - 0.1, place + 0.1, 1.0 * ones, 10.0 * ones, 300.0 * ones)
    torque = TorqueLimits.from_share(chain, np.zeros(6), pinocchio_arm.payload, 1e4 * ones)
    return place, Envelope(joints, torque, Workspace(chain))


@pytest.fixture(scope="module")
def wiggle(pinocchio_arm, calibration, known, about):
    """The shortest motion that determines the mass to 3 %."""
    prospect = partial(half_widths_kg, known[0], calibration, pinocchio_arm.payload)
    return found_about(prospect, about, 0.03 * pinocchio_arm.payload.mass_kg)


def found_about(prospect, about, wanted_kg, objection=lambda trajectory: None, progress=lambda done, total: None):
    place, envelope = about
    return WiggleSearch(prospect, envelope, place, 0.01, objection).shortest(wanted_kg, 1, progress)


def test_a_wiggle_of_some_degrees_shows_the_mass_as_well_as_promised(pinocchio_arm, known, about, wiggle):
    assert about[1].worst(wiggle.trajectory).max() <= 0.0
    assert wiggle.half_width_kg <= 0.03 * pinocchio_arm.payload.mass_kg
    assert wiggle.lasts_s <= 10.0
    run = pinocchio_arm.run(wiggle.trajectory, True, seed=3, periods=wiggle.periods + 1, with_phase=False)
    found = identify_runs(run, None, known[0], known[1], arm=known[2])
    width = found.uncertainty.half_width_95[0]
    assert 0.5 * wiggle.half_width_kg < width < 2.0 * wiggle.half_width_kg
    assert abs(found.parameters.mass_kg - pinocchio_arm.payload.mass_kg) < 1.5 * width


def test_more_periods_promise_more_but_never_more_than_the_calibration_knows(pinocchio_arm, calibration, known, wiggle):
    prospect = partial(half_widths_kg, known[0], calibration, pinocchio_arm.payload)
    widths = prospect(wiggle.trajectory, np.array([1.0, 2.0, 4.0, 1e4]))
    assert widths[0] > widths[1] > widths[2] > 1.96 * FLOOR_KG
    assert widths[3] > 0.5 * widths[2]


def test_a_wiggle_that_must_not_be_driven_is_none(pinocchio_arm, calibration, known, about, monkeypatch):
    prospect = partial(half_widths_kg, known[0], calibration, pinocchio_arm.payload)
    for name, value in (("PERIODS_S", (2.0,)), ("_DRAWS", 5), ("_VARIATIONS", 5)):
        monkeypatch.setattr(f"armload_identification.pipeline.wiggle.{name}", value)
    with pytest.raises(ExcitationError, match=r"respects all limits; touches the post\. Choose another position"):
        found_about(prospect, about, 1.0, lambda trajectory: "touches the post")
    steps = []
    with pytest.raises(
        ExcitationError,
        match=r"no motion of at most 60 s .* the mass to 0\.001 kg \(95 %\); the best one determines it to 0\.\d+ kg",
    ):
        found_about(prospect, about, 0.001, steps.append, lambda done, total: steps.append((done, total)))
    assert [step for step in steps if isinstance(step, tuple)] == [(0, 1), (1, 1)]
    assert steps[-1] == (1, 1), "all periods are evaluated only after the last motion"
