"""A verdict in words: which sentence stands for which finding, with its numbers and directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.model.payload import InertialParameters
from armload_identification.verdict.agreement import Agreement, LengthNeeded, Outcome
from armload_identification.verdict.payload_verdict import PayloadVerdict, Remedy
from armload_identification.verdict.recording_checks.joint_scales import JointScales
from armload_identification.verdict.verdict_text import agreement_sentences, sentences, title

pytestmark = pytest.mark.pure

NAMES = ("base", "elbow", "wrist")
X = np.array([1.0, 0.0, 0.0])


def judged(mass_kg, center_m=(0.03, 0.04, 0.1)):
    return InertialParameters.from_center_of_mass(mass_kg, center_m, 0.01 * np.eye(3))


AGREEMENT = Agreement(
    outcome=Outcome.RIGHT,
    difference=np.array([0.02, 0.001, 0.0, 0.0]),
    statistic=1.0,
    critical=4.0,
    half_width_95=np.array([0.05, 0.002, 0.002, 0.002]),
    judged=judged(4.0),
    tolerance_kg=0.08,
    tolerance_m=0.005,
    noticeable_kg=0.2,
    noticeable_m=0.012,
    weakest=X,
)
AGREED = JointScales(np.ones(3), np.full(3, 0.01))
REMEDY = Remedy(
    length=LengthNeeded(2.5, False),
    mass_joint=1,
    center_joint=2,
    level_share=0.8,
)


def verdict(agreement=AGREEMENT, of_payload=AGREED, of_measured=AGREED, remedy=REMEDY, own_run=False):
    return PayloadVerdict(agreement, of_payload, of_measured, remedy, own_run)


def text(of, **changes):
    return sentences(verdict(replace(AGREEMENT, **of), **changes), NAMES)


def wrong(difference, **changes):
    return text({"outcome": Outcome.WRONG, "difference": np.array(difference), "statistic": 9.0} | changes)


def unclear(remedy=REMEDY, limits=(False, False), **changes):
    """The text where mass and centre of mass are as uncertain as the tolerance, or more."""
    tolerance = {"tolerance_kg": 0.199 if limits[0] else 0.2, "tolerance_m": 0.0119 if limits[1] else 0.012}
    return text({"outcome": Outcome.CANNOT_TELL} | tolerance | changes, remedy=remedy)


def test_right_tells_the_difference_its_interval_and_the_tolerance():
    (found,) = text({})
    for words in (
        "0.020 kg higher (0.5 %) +- 0.050 kg",
        "1.0 mm away (x +1.0 +- 2.0, y +0.0 +- 2.0, z +0.0 +- 2.0 mm)",
        "2 % of the mass (0.080 kg) and 5 mm",
    ):
        assert words in found
    assert "0.020 kg lower (0.5 %)" in text({"difference": np.array([-0.02, 0.0, 0.0, 0.0])})[0]


def test_a_significant_difference_within_the_tolerance_is_told():
    assert len(text({"statistic": 4.0})) == 1
    assert "significant" in text({"statistic": 4.1})[1]


@pytest.mark.parametrize(
    ("difference", "said"),
    [
        ((0.4, 0.0, 0.0, 0.0), "The payload's mass is 0.400 kg (10.0 %) too low."),
        ((-0.4, 0.0, 0.0, 0.0), "The payload's mass is 0.400 kg (10.0 %) too high."),
        ((0.0, 0.004, 0.0, -0.007), "The payload's centre of mass is off by -4.0 mm in x, +7.0 mm in z."),
        ((0.4, 0.0, 0.004, 0.0), "too low and its centre of mass is off by -4.0 mm in y."),
        ((0.05, 0.002, 0.0, 0.0), "together do not match"),
    ],
)
def test_wrong_names_what_is_off_first_as_an_error_of_the_payload(difference, said):
    assert said in wrong(difference)[0]


def remounted(turned_degrees, moved_m=(0.0, 0.0, 0.0), mass_kg=0.0):
    angle = np.radians(turned_degrees)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    before = AGREEMENT.judged.center_of_mass_m
    return " ".join(wrong([mass_kg, *(turn @ before + moved_m - before)]))


@pytest.mark.parametrize("degrees", [90.0, -90.0, 180.0, 30.0])
def test_the_same_mass_elsewhere_was_turned_about_the_flange(degrees):
    assert f"turned by {abs(degrees):.0f} degrees about" in remounted(degrees)


def test_the_same_mass_further_out_was_moved_and_another_mass_is_no_remounting():
    assert "moved or turned" in remounted(90.0, (0.0, 0.0, 0.02))
    assert "moved or turned" in remounted(0.0, (0.03, 0.04, 0.0))
    assert "turned by 90" in remounted(90.0, mass_kg=0.079), "within the tolerance of the mass"
    assert "remounted" not in remounted(90.0, mass_kg=0.081)


def test_a_centre_of_mass_on_the_axis_cannot_show_a_turn():
    on_axis = np.array([0.001, 0.001, 0.1])
    found = " ".join(wrong([0.0, 0.0, -0.002, 0.0], judged=judged(4.0, on_axis), half_width_95=np.full(4, 0.0015)))
    assert "moved or turned" in found


def test_joints_that_disagree_are_listed_with_their_scale():
    odd = JointScales(np.array([1.0, 1.2, 0.9]), np.array([0.01, 0.02, 0.2]))
    of = {"outcome": Outcome.WRONG, "difference": np.array([0.4, 0.0, 0.0, 0.0])}
    by_payload = text(of, of_payload=odd)[-1]
    assert "predicted torque: elbow 1.200 +- 0.020." in by_payload
    by_measured = text(of, of_measured=odd)[-1]
    assert "elbow 1.200 +- 0.020. Check the drive gain" in by_measured
    assert len(text(of)) == 3


def test_an_own_run_cannot_confirm_but_contradict():
    assert len(text({}, own_run=True)) == 2
    assert "identified from this recording" in text({}, own_run=True)[1]
    assert "too low" in text({"outcome": Outcome.WRONG, "difference": np.array([0.4, 0, 0, 0])}, own_run=True)[0]


@pytest.mark.parametrize(
    ("weakest", "said"),
    [
        (X, "along the flange's x axis"),
        (np.array([0.0, -0.95, 0.3122]), "along the flange's y axis"),
        (np.array([0.59, 0.11, -0.8]), "along [-0.59, -0.11, 0.80]"),
        (np.array([0.8, 0.0, 0.6]), "along [0.80, 0.00, 0.60]"),
        (np.array([-0.8, 0.001, 0.6]), "along [0.80, 0.00, -0.60]"),
    ],
)
def test_cannot_tell_names_the_smallest_error_it_would_notice_and_where(weakest, said):
    found = unclear(weakest=weakest)[1]
    assert "0.2 kg (5.0 %)" in found
    assert "12 mm" in found
    assert said in found


@pytest.mark.parametrize(("factor", "said"), [(2.5, "2.5 times"), (1.02, "1.1 times")])
def test_longer_runs_are_the_remedy_where_they_help(factor, said):
    assert said in unclear(replace(REMEDY, length=LengthNeeded(factor, False)))[-1]


@pytest.mark.parametrize(("gains_limit", "said"), [(True, "calibrate them"), (False, "No run would detect it")])
def test_where_no_length_helps_its_reason_is_the_remedy_and_no_other(gains_limit, said):
    found = unclear(replace(REMEDY, length=LengthNeeded(np.inf, gains_limit)), (True, True))
    assert said in found[-1]
    assert len(found) == 3


def test_the_joint_that_would_help_is_named():
    assert "by elbow" in unclear(limits=(True, False))[-1]
    assert "by wrist" in unclear(limits=(False, True))[-1]
    level = unclear(replace(REMEDY, level_share=0.3), (False, True))[-1]
    assert "brings the flange's x axis to the horizontal" in level
    assert len(unclear()) == 3


def test_a_comparison_says_with_what():
    assert agreement_sentences(AGREEMENT, "CAD gives")[0].startswith("CAD gives a mass")


@pytest.mark.parametrize(
    ("outcome", "verified", "own_run", "said"),
    [
        (Outcome.RIGHT, True, False, "Right within the tolerance"),
        (Outcome.RIGHT, False, False, "Repeatable within the tolerance"),
        (Outcome.RIGHT, True, True, "Cannot tell"),
        (Outcome.RIGHT, False, True, "Cannot tell"),
        (Outcome.WRONG, False, False, "Wrong"),
        (Outcome.WRONG, False, True, "Wrong"),
        (Outcome.CANNOT_TELL, False, False, "Cannot tell"),
    ],
)
def test_the_title_claims_no_more_than_is_verified(outcome, verified, own_run, said):
    agreement = replace(AGREEMENT, outcome=outcome)
    assert title(PayloadVerdict(agreement, AGREED, AGREED, REMEDY, own_run, verified)) == said


def test_an_error_of_both_is_one_sentence_with_its_share_of_the_mass():
    found = wrong((-0.4, 0.0, 0.004, -0.0021))
    assert found[0] == (
        "The payload's mass is 0.400 kg (10.0 %) too high and its centre of mass is off by -4.0 mm in y, +2.1 mm in z."
    )
    assert found[2].endswith("(F 9.0, limit 4.0).")
    other = wrong((0.4, 0.0, 0.0, 0.0), judged=judged(2.0), tolerance_kg=0.1)
    assert "0.400 kg (20.0 %) too low" in other[0]
    assert "a mass 0.400 kg higher (20.0 %) +- 0.050 kg" in other[1]
    assert "the tolerance is 5 % of the mass (0.100 kg) and 5 mm" in other[1]


@pytest.mark.parametrize(
    ("weakest", "said"), [((0.901, 0.0, -0.434), "x axis"), ((0.899, 0.0, -0.438), "along [0.90, 0.00, -0.44]")]
)
def test_a_direction_within_26_degrees_of_an_axis_is_that_axis(weakest, said):
    assert said in unclear(weakest=np.array(weakest))[1]


@pytest.mark.parametrize(("share", "said"), [(0.49, "hardly ever brings"), (0.51, "is best determined by wrist")])
def test_poses_are_missing_if_the_direction_is_level_for_less_than_half(share, said):
    assert said in unclear(replace(REMEDY, level_share=share), (False, True))[-1]


@pytest.mark.parametrize(
    ("moved_m", "turned"),
    [
        ((0.0, 0.0, 0.0049), True),
        ((0.0, 0.0, 0.0051), False),
        ((0.0029, 0.0039, 0.0), True),
        ((0.0031, 0.0041, 0.0), False),
    ],
)
def test_a_turned_payload_is_as_far_from_the_axis_and_along_it_within_the_tolerance(moved_m, turned):
    assert ("turned by" in remounted(0.0, moved_m)) is turned


def test_floors_are_said_in_grams_and_millimetres():
    found = unclear(replace(REMEDY, length=LengthNeeded(np.inf, False)))[-1]
    assert "5 g and 1 mm (one standard deviation)" in found
    assert "1.1 times the length" in unclear(replace(REMEDY, length=LengthNeeded(1.0, False)))[-1]
    assert "1.2 times the length" in unclear(replace(REMEDY, length=LengthNeeded(1.2, False)))[-1]
