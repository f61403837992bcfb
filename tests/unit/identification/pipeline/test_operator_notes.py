"""Notes to the operator: which finding is worth a note, and which joints and numbers it names."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.pipeline import operator_notes
from armload_identification.pipeline.operator_notes import change_notes, misfit_notes, notes_on
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.motion import ABOVE_BAND
from armload_identification.signals.reversals import reversal_weights

pytestmark = pytest.mark.pure

JOINTS, SAMPLES = 3, 40
NONE = np.zeros(JOINTS, dtype=bool)
ALL = ~NONE


def with_changes(base, changes):
    return SimpleNamespace(**(base | changes))


def moving(joints):
    """States in which these joints move at 1 rad/s."""
    speed = np.where(joints, 1.0, 0.0) * np.ones((SAMPLES, 1))
    return SimpleNamespace(position_rad=np.cumsum(0.1 * speed, axis=0), velocity_rad_s=speed)


def signal(interruptions=(0, 0), rate=1.0, moves=ALL, **changes):
    """A pair without any fault: 10 N m of payload, 0.1 N m of noise, three periods each."""
    torque = 10.0 * np.tile([[1.0], [-1.0]], (SAMPLES // 2, JOINTS))
    base = {
        "torque_nm": torque,
        "valid": np.ones(SAMPLES, dtype=bool),
        "averaged_noise_nm": np.full(JOINTS, 0.1),
        "smoothing_loss": np.zeros(JOINTS),
        "periodic": True,
        "periods": (3, 3),
        "noise_source": "the scatter of periods",
        "states": moving(ALL),
        "mismatch_rad": np.full(JOINTS, 0.005),
    }
    found = with_changes(base, changes)
    found.loaded, found.unloaded = (
        SimpleNamespace(
            periods=periods,
            interruptions=count,
            rate=rate,
            moves=moves,
            periodic=found.periodic,
            time_s=0.1 * np.arange(SAMPLES),
            interval_s=0.1,
            states=found.states,
            reversal_weight=reversal_weights(found.states.position_rad, found.states.velocity_rad_s),
        )
        for periods, count in zip(found.periods, interruptions, strict=True)
    )
    return found


def found_of(share=0.01, **changes):
    """An identification that leaves a share of the torque of each joint."""
    plain = {"theta": np.zeros(10), "rank": 10, "noise_nm": np.ones(JOINTS), "load_friction": np.full(JOINTS, 0.05)}
    plain["drifting"] = np.zeros(10)
    plain["posterior"] = SimpleNamespace(delay_s=changes.pop("delay_s", 0.001))
    plain = with_changes(plain, {name: changes.pop(name) for name in [*plain] if name in changes})
    base = {
        "plain": plain,
        "signal": signal(),
        "gains": gains(),
        "sources": (source(), source()),
        "residual_nm": signal().torque_nm * np.asarray(share),
        "struck": np.zeros(SAMPLES, dtype=bool),
        "changed": False,
        "parameters": SimpleNamespace(mass_kg=1.0),
        "plain_parameters": SimpleNamespace(margin=1.0),
        "uncertainty": SimpleNamespace(
            determined=np.ones(10, dtype=bool), undetermined_names=[], half_width_95=np.full(10, 0.1)
        ),
    }
    return with_changes(base, changes)


def source(**changes):
    base = {"rows_read": 100, "rows_dropped": 0, "reasons": {}, "truncated": False, "ignored_joints": ()}
    return with_changes(base, changes)


def gains(**changes):
    base = {
        "contradicted": NONE,
        "possible": NONE,
        "disagree": False,
        "log_gain": np.zeros(JOINTS),
        "half_width_95": np.full(JOINTS, 0.01),
        "assumed_deviation": np.full(JOINTS, 0.02),
        "noticeable": np.full(JOINTS, 0.03),
    }
    return with_changes(base, changes)


def notes(**changes):
    """The notes on a pair in which only `changes` are not as they should be."""
    transmission = changes.pop("transmission", Transmission(np.ones(JOINTS), np.eye(JOINTS), ALL))
    used = transmission.gains(from_torque=changes.pop("by_torque", False))
    fitted = changes.pop("body", None)
    return notes_on(found_of(**changes), used, None, fitted)


def test_nothing_is_said_of_a_good_pair():
    assert notes() == []


def only(found):
    (note,) = found
    return note


def test_rows_that_were_left_out_are_counted_for_the_run_they_are_of():
    odd = source(rows_dropped=7, reasons={"not finite": 4, "position jumps": 3})
    note = only(notes(sources=(source(), odd)))
    assert note.startswith("unloaded recording: 7 of 100")
    assert "4 not finite, 3 position jumps" in note
    assert only(notes(sources=(source(truncated=True), source()))).startswith("loaded recording")
    assert "gripper" in only(notes(sources=(source(ignored_joints=("gripper",)),)))


@pytest.mark.parametrize(
    ("period_s", "noted"), [(4.0, False), (4.004, False), (3.98, True), (4.08, True), (4.4, False), (8.0, False)]
)
def test_a_clock_that_is_not_the_excitations_is_noted_but_not_another_speed(period_s, noted):
    found = notes(signal=signal(rate=4.0 / period_s))
    assert [f"4 s by the time stamps, {period_s:.4g} s by the excitation" in note for note in found] == [True] * noted


@pytest.mark.parametrize(
    ("delay_s", "said"), [(0.015, None), (0.03, "30 ms before it"), (-0.03, "30 ms after it")], ids=str
)
def test_torque_that_is_late_or_early_by_more_than_a_drive_causes_is_noted(delay_s, said):
    assert [said in note for note in notes(delay_s=delay_s)] == [True] * (said is not None)


def test_pauses_are_told_with_how_often_every_part_was_measured_at_full_speed():
    loaded, unloaded = notes(signal=signal(periods=(2, 1), interruptions=(1, 4)))
    assert loaded.startswith("loaded")
    assert "slowed down once" in loaded
    assert "at least 2 times" in loaded
    assert unloaded.startswith("unloaded")
    assert "slowed down 4 times" in unloaded
    assert "at least once" in unloaded


@pytest.mark.parametrize(
    ("calibrated", "by_torque", "said"),
    [
        (ALL, False, []),
        (NONE, True, ["as reported", "not verified", "12 %", "of 3.9 % on all"]),
        (NONE, False, ["nominal", "not verified", "12 %", "of 1.6 % on all"]),
        (np.array([True, False, True]), False, ["joint 2"]),
    ],
)
def test_a_scale_that_nothing_verifies_is_named(calibrated, by_torque, said):
    transmission = Transmission(np.ones(JOINTS), np.eye(JOINTS), calibrated, np.diag([0.02**2, 0.06**2, 0.01**2]))
    found = notes(by_torque=by_torque, transmission=transmission)
    assert len(found) == bool(said)
    assert all(word in found[0] for word in said)


def test_a_weighed_mass_sets_the_scale():
    transmission = Transmission(np.ones(JOINTS), np.eye(JOINTS), NONE, 0.02**2 * np.eye(JOINTS))
    sure = SimpleNamespace(determined=np.ones(10, dtype=bool), undetermined_names=[], half_width_95=np.full(10, 2e-5))
    found = only(notes(transmission=transmission, uncertainty=sure))
    assert "the known mass sets their scale" in found
    assert "verifie" not in found


@pytest.mark.parametrize(("drifting_kg", "told"), [(-24.9, False), (-25.1, True), (25.1, True)])
def test_a_usual_drift_that_matters_is_mentioned_where_intervals_do_not_allow_for_it(drifting_kg, told):
    """Of a mass +- 0.1 kg, 0.1 % of drift matters from 0.025 kg on."""
    transmission = Transmission(np.ones(JOINTS), np.eye(JOINTS), NONE, 0.02**2 * np.eye(JOINTS))
    found = notes(transmission=transmission, drifting=np.full(10, drifting_kg))
    assert len(found) == 1 + told
    assert ("by 0.1 % from one run to the other would change the mass by 0.025 kg" in found[-1]) is told


def test_gears_of_much_loss_are_named_with_what_they_may_do_to_the_scale():
    transmission = Transmission(np.ones(JOINTS), np.eye(JOINTS), NONE, 0.02**2 * np.eye(JOINTS))
    assert "gears" not in only(notes(transmission=transmission))
    lossy = only(notes(transmission=transmission, load_friction=np.array([0.05, 0.21, 0.1])))
    assert "of 5 % if gears that lose 21 % of their load lose more in one direction" in lossy


def test_a_contradicted_gain_is_named_with_its_error_and_what_is_allowed():
    joint_2 = np.array([False, True, False])
    found = notes(gains=gains(contradicted=joint_2, log_gain=np.log([1.0, 1.10, 1.0])))
    note = only(found)
    for word in ("joint 2", "10.0 % higher", "+8.9 % to +11.1 %", "are within 3.9 %"):
        assert word in note
    assert "lower" in only(notes(gains=gains(contradicted=joint_2, log_gain=np.log([1.0, 0.9, 1.0]))))


def test_gains_of_which_one_is_wrong_are_listed_together():
    two = np.array([True, False, True])
    note = only(notes(gains=gains(disagree=True, possible=two, noticeable=np.full(JOINTS, 0.01))))
    assert "which a wrong gain of one of joints 1 and 3 explains" in note
    assert "may lie outside their intervals" in note
    none = only(notes(gains=gains(disagree=True, noticeable=np.full(JOINTS, 0.01))))
    assert "which no wrong gain alone explains" in none


def test_a_gain_that_is_named_is_not_among_those_that_cannot_be_checked():
    two = np.array([True, False, True])
    found = notes(gains=gains(disagree=True, possible=two, noticeable=np.full(JOINTS, 5.0)))
    assert "joints 1 and 3" in found[0]
    assert "about the drive gain of joint 2:" in only(found[1:])


def test_gains_that_cannot_be_checked_are_named_with_the_error_that_may_hide():
    note = only(notes(gains=gains(noticeable=np.array([0.03, np.log(1.2), 0.03]))))
    assert "on joint 2 (up to 20 %)" in note
    found = notes(gains=gains(noticeable=np.array([0.2, 0.2, 5.0])))
    assert len(found) == 2
    assert "on joints 1 " in found[0]
    assert "about the drive gain of joint 3:" in found[1]
    assert notes(gains=gains(noticeable=np.full(JOINTS, 5.0), contradicted=ALL))[-1].startswith("The data contradict")
    assert notes(gains=None) == []


def test_signals_with_gaps_or_mostly_noise_are_told_but_blows_are_no_gaps():
    loss = np.array([0.0, 0.9, 0.0])
    assert "2 (90 %)" in only(notes(signal=signal(smoothing_loss=loss)))
    valid = np.arange(SAMPLES) >= 5
    assert only(notes(signal=signal(valid=valid))).startswith(f"5 of {SAMPLES} samples")
    gaps, blow = notes(signal=signal(valid=valid), struck=np.arange(SAMPLES) < 2)
    assert gaps.startswith("3 of")
    assert blow.startswith("0.2 s of the motion were left out, from 0.0 s on")
    assert only(notes(signal=signal(valid=valid), struck=~valid)).startswith("0.5 s of the motion")


@pytest.mark.parametrize(
    ("periods", "periodic", "noise_source", "told"),
    [
        ((1, 3), True, ABOVE_BAND, True),
        ((0, 1), True, ABOVE_BAND, True),
        ((2, 2), True, ABOVE_BAND, False),
        ((0, 2), True, ABOVE_BAND, False),
        ((1, 1), True, "scatter", False),
        ((1, 1), False, ABOVE_BAND, False),
    ],
)
def test_one_period_alone_is_told(periods, periodic, noise_source, told):
    found = notes(signal=signal(periods=periods, periodic=periodic, noise_source=noise_source))
    assert len(found) == told


def test_what_the_motion_does_not_determine_is_told():
    assert "9 of 10" in only(notes(rank=9))
    determined = np.ones(10, dtype=bool)
    determined[4:] = False
    named = SimpleNamespace(determined=determined, undetermined_names=["Ixx", "Iyy"])
    assert "Ixx, Iyy" in only(notes(uncertainty=named))
    nothing = SimpleNamespace(determined=np.zeros(10, dtype=bool), undetermined_names=["mass"])
    assert "armload design" in only(notes(uncertainty=nothing)), "one note, not two"


@pytest.mark.parametrize(
    ("changed", "margin", "told"), [(True, -0.1, True), (True, 0.0, True), (True, 0.1, False), (False, -0.1, False)]
)
def test_an_impossible_estimate_is_told_where_it_was_replaced(changed, margin, told):
    assert len(notes(changed=changed, plain_parameters=SimpleNamespace(margin=margin))) == told


def body(**changes):
    """A fitted body whose model leaves a tenth of 10 N m, with friction of 1 N m and 1 N m s/rad at 1 rad/s."""
    base = {
        "torque_rms_nm": np.full(JOINTS, 10.0),
        "residual_rms_nm": np.full(JOINTS, 1.0),
        "model": SimpleNamespace(coulomb_nm=np.ones(JOINTS), viscous_nm_s_rad=np.ones(JOINTS)),
    }
    return with_changes(base, changes)


def test_joints_whose_own_torque_is_not_explained_are_named_if_they_move_and_are_loud():
    assert notes(body=body()) == []
    odd = body(residual_rms_nm=np.array([1.0, 9.0, 9.0]))
    assert "joints 2 and 3" in only(notes(body=odd))
    resting = signal(moves=np.array([True, False, True]))
    assert "joint 3" in only(notes(body=odd, signal=resting))
    quiet = signal(averaged_noise_nm=np.array([0.1, 0.1, 3.0]))
    assert "joint 2" in only(notes(body=odd, signal=quiet))


def test_friction_that_drives_the_arm_is_told_but_not_that_of_its_noise():
    def model(coulomb, viscous):
        return SimpleNamespace(coulomb_nm=np.array([1.0, coulomb, 1.0]), viscous_nm_s_rad=np.array([1.0, viscous, 1.0]))

    assert "joint 2" in only(notes(body=body(model=model(-3.0, 1.0))))
    assert notes(body=body(model=model(-3.0, 3.5))) == []
    assert notes(body=body(model=model(-1.0, 0.9))) == [], "0.1 N m of 10"


def test_a_payload_that_explains_little_is_told_as_a_whole_and_else_by_joint():
    assert not [*misfit_notes(found_of(0.1))]
    assert "explains only 19 %" in only(misfit_notes(found_of(0.9)))
    assert "joint 2" in only(misfit_notes(found_of([0.1, 0.9, 0.1])))
    quiet = signal(averaged_noise_nm=np.array([0.1, 3.0, 0.1]))
    assert not [*misfit_notes(found_of([0.1, 0.9, 0.1], signal=quiet))]
    assert "19 %" in only(misfit_notes(found_of([0.1, 0.9, 0.1], noise_nm=np.array([100.0, 1.0, 100.0]))))


def test_joints_at_rest_reversals_and_samples_not_used_are_no_misfit():
    resting = signal(states=moving(np.array([True, False, True])))
    assert not [*misfit_notes(found_of([0.1, 5.0, 0.1], signal=resting))]
    found = found_of(0.1, signal=signal(valid=np.arange(SAMPLES) >= 4))
    found.residual_nm[:4] = 1e3
    assert not [*misfit_notes(found)]
    turning = moving(ALL)
    turning.velocity_rad_s[:4] = 1e-3
    found.signal = signal(states=turning)
    assert not [*misfit_notes(found)]


def test_friction_far_outside_that_of_the_calibration_is_named():
    """Of the unloaded run if there is one: its friction is known better."""
    drift = np.full((3, JOINTS), 0.1)
    plain = {
        "theta": np.zeros(10),
        "rank": 10,
        "noise_nm": np.ones(JOINTS),
        "runs": 2,
        "friction": lambda run: np.array([[0.0, 3.0 * run, 0.0], np.zeros(JOINTS), np.zeros(JOINTS)]),
        "friction_covariance": lambda run: 1e-4 * np.tile(np.eye(2), (JOINTS, 1, 1)),
        "posterior": found_of().plain.posterior,
    }

    def noted(**changes):
        found = found_of(plain=with_changes(plain, changes), gains=None)
        used = Transmission(np.ones(JOINTS), np.eye(JOINTS), ALL).gains(from_torque=False)
        arm = SimpleNamespace(drift=drift, noise_nm=np.ones(JOINTS))
        return notes_on(found, used, arm)

    assert "friction of joint 2 " in only(noted())
    assert noted(runs=1) == []
    assert "torque of joint 3 fits" in only(noted(runs=1, noise_nm=np.array([1.0, 5.0, 20.0])))


def test_positions_that_differ_by_more_than_a_servo_sags_are_named():
    """A zero that moved by a degree between the runs."""
    mismatch_rad = np.array([0.0, np.radians(1.0), 0.0049])
    found = found_of(signal=signal(mismatch_rad=mismatch_rad), gains=None)
    used = Transmission(np.ones(JOINTS), np.eye(JOINTS), ALL).gains(from_torque=False)
    assert "differ on joint 2 (1.0 deg RMS), more than a servo sags by" in only(notes_on(found, used, None))


def noted_changes(monkeypatch, change_kg, moments_kg_m, statistic=24.1, periods=1, push=0.0):
    """Notes on a loaded and an unloaded run of 60 s, the latter of some periods; 2 kg at 0.1 m on x, +- 0.01."""
    change = SimpleNamespace(
        at_s=20.0, statistic=statistic, change=np.array([change_kg, *moments_kg_m]), deviation=np.full(4, 0.01)
    )
    pushed = SimpleNamespace(at_s=20.0, statistic=push, change=np.array([3.0, 0.0, -4.0]))
    monkeypatch.setattr(operator_notes, "events_during", lambda *_: (change, pushed))
    theta = np.array([2.0, 0.2, *np.zeros(8)])

    def run(between_s):
        source = SimpleNamespace(between_s=between_s)
        return SimpleNamespace(recording=SimpleNamespace(source=source, time_s=np.array([5.0, 65.0])))

    motions = [SimpleNamespace(began_s=7.0, periods=count) for count in (1, periods)]
    found = SimpleNamespace(
        signal=SimpleNamespace(loaded=motions[0], unloaded=motions[1]),
        plain=SimpleNamespace(theta=theta, posterior=None, arm=None),
    )
    return list(change_notes(found, run((100.0, 160.0)), run(None)))


def test_a_change_of_payload_is_dated_from_the_start_of_the_whole_recording(monkeypatch):
    """Looked at from 100 s on, motion 2 s later, the change 20 s into it; a second on either side is left out."""
    note = only(noted_changes(monkeypatch, 1.0, [0.1, 0.0, 0.0]))
    assert "during the loaded run, about 122 s after" in note
    assert "`--between 100s 121s` and `--between 123s 160s`" in note
    loaded, unloaded = noted_changes(monkeypatch, 1.0, [0.1, 0.0, 0.0], periods=2)
    assert loaded == note
    assert "`--between 0s 21s` and `--between 23s 60s`" in unloaded
    assert noted_changes(monkeypatch, 1.0, [0.1, 0.0, 0.0], statistic=24.0) == []


@pytest.mark.parametrize(
    ("change", "push", "said"),
    [
        (24.1, 24.0, "payload changed"),
        (30.2, 30.1, "payload changed"),
        (23.0, 30.1, "About 122 s after the start of the loaded run's recording, its torque differs"),
        (40.0, 40.1, "a force of 5 N"),
        (23.0, 30.0, None),
    ],
)
def test_a_push_is_noted_if_it_explains_more_than_a_change_of_payload(monkeypatch, change, push, said):
    notes = noted_changes(monkeypatch, 1.0, [0.1, 0.0, 0.0], statistic=change, push=push)
    assert (said in only(notes)) if said else (notes == [])


@pytest.mark.parametrize(
    ("change_kg", "moments_kg_m", "said"),
    [
        (1.0, [0.1, 0.0, 0.0], "by +1.000 +- 0.020 kg."),
        (1.0, [0.1 + 0.019, 0.0, 0.0], "by +1.000 +- 0.020 kg."),
        (1.0, [0.1 + 0.03, 0.0, 0.0], "kg; its centre of mass moved by +10, +0, +0 mm."),
        (1.0, [-0.2, 0.0, 0.3], "kg; its centre of mass moved by -100, +0, +100 mm."),
        (-1.5, [0.0, 0.0, 0.0], "by -1.500 +- 0.020 kg; its centre of mass moved by +300, +0, +0 mm."),
        (-1.7, [0.0, 0.0, 0.0], "by -1.700 +- 0.020 kg."),
    ],
)
def test_a_moved_centre_of_mass_is_told_where_it_is_known(monkeypatch, change_kg, moments_kg_m, said):
    """Beyond the interval of the moments, and not of the little that is left after setting down most of the mass."""
    assert said in only(noted_changes(monkeypatch, change_kg, moments_kg_m))
