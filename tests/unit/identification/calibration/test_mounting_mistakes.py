"""Another mounting or an inverted joint, found by the residual of all runs."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.calibration.calibration_constants import OtherMounting
from armload_identification.calibration.mounting_mistakes import most_trials, refuse_other_mounting
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from tests.mounted_runs import calibrated

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(("gravity", "how"), [((0.0, 0.0, 9.81), "on the floor"), ((0.0, 9.81, 0.0), "on the floor")])
def test_a_mounting_that_was_entered_wrongly_is_named(four, weighed, pinocchio_arm, nominal, gravity, how):
    chain = pinocchio_arm.chain
    wrong = Chain(chain.placement, chain.axis, chain.flange, np.array(gravity))
    with pytest.raises(EstimationError, match=f"mounted {how}, gravity_m_s2 = .0.0, 0.0, -9.81."):
        calibrated(four[:2], weighed, pinocchio_arm, nominal, wrong)


# The choice between mistakes, with residuals that a test decides ---------------------------------------------------

MUCH, LITTLE = np.log(OtherMounting.much), np.log(OtherMounting.little)
JOINT_3 = tuple(np.where(np.arange(6) == 2, -1.0, 1.0))
PLAIN = (1.0,) * 6


class Shares:
    """Mean residual shares by the direction of gravity, and by the signs of position and effort.

    Attributes:
        plain: Of everything else, of six joints.
    """

    def __init__(self, plain, by_gravity=None, by_turn=None):
        self.plain = np.broadcast_to(plain, 6)
        self.by_gravity, self.by_turn = by_gravity or {}, by_turn or {}
        self.turns = []

    def __call__(self, chain, turn):
        turned = getattr(turn, "keywords", None)
        if turned is None:
            return self._shares(self.by_gravity.get(tuple(np.sign(chain.gravity_m_s2)), self.plain))
        signs = tuple(np.diag(turned["joints"])), tuple(np.diag(turned["torques"]))
        self.turns.append(signs)
        return self._shares(self.by_turn.get(signs, self.plain))

    def _shares(self, found):
        return np.broadcast_to(found, 6)


@pytest.fixture
def refuse(pinocchio_arm):
    """Judges shares; returns the number of trials beside the arm as configured."""

    def refuse(shares, moves=(True,) * 6, coupling=None):
        trials = []
        coupling = np.eye(6) if coupling is None else coupling

        def counted(*of):
            trials.append(of)
            return shares(*of)

        refuse_other_mounting(counted, pinocchio_arm.chain, coupling, np.array(moves))
        return len(trials) - 1

    return refuse


def test_an_arm_that_is_explained_is_not_tried_otherwise(refuse):
    assert refuse(Shares(LITTLE - 0.01, {(0.0, 0.0, 1.0): LITTLE - 5.0})) == 0


def test_a_mounting_that_explains_much_more_is_named_with_how_much(refuse):
    shares = Shares(LITTLE + 1.0, {(0.0, 0.0, 1.0): LITTLE - 1.0, (1.0, 0.0, 0.0): LITTLE - 0.5})
    with pytest.raises(EstimationError, match=r"7\.4 times smaller if it is mounted on the ceiling"):
        refuse(shares)
    assert not shares.turns, "the arm is explained"


@pytest.mark.parametrize(("gain", "refused"), [(0.9, False), (1.1, True)])
def test_a_mounting_that_explains_little_more_is_not(refuse, gain, refused):
    shares = Shares(LITTLE + 0.5, {(0.0, 0.0, 1.0): LITTLE + 0.5 - gain * OtherMounting.better})
    if refused:
        with pytest.raises(EstimationError, match="on the ceiling"):
            refuse(shares)
    else:
        assert refuse(shares) == 5


def test_joints_are_tried_where_one_is_not_explained_at_all(refuse, pinocchio_arm):
    quiet = np.append(np.full(5, LITTLE + 0.5), MUCH - 0.01)
    shares = Shares(quiet)
    assert refuse(shares) == 5
    assert not shares.turns
    shares = Shares(np.append(np.full(5, LITTLE + 0.5), MUCH + 0.01))
    assert refuse(shares, moves=[True, True, True, True, True, False]) == 5 + 15
    assert most_trials(pinocchio_arm.chain) == 1 + 5 + 18
    assert {turn for turn in shares.turns if turn[0][2] < 0.0 or turn[1][2] < 0.0} == {
        (JOINT_3, JOINT_3),
        (JOINT_3, PLAIN),
        (PLAIN, JOINT_3),
    }


@pytest.mark.parametrize(
    ("turn", "what", "remedy"),
    [
        ((JOINT_3, JOINT_3), "position and effort", "Invert its axis"),
        ((JOINT_3, PLAIN), "position", "polarity"),
        ((PLAIN, JOINT_3), "effort", "polarity"),
    ],
)
def test_an_inverted_joint_is_named_with_what_is_inverted(refuse, turn, what, remedy):
    with pytest.raises(
        EstimationError, match=rf"joint 3 is inverted.* 20\.1 times smaller with its {what} inverted"
    ) as e:
        refuse(Shares(MUCH + 1.0, by_turn={turn: MUCH - 2.0}))
    assert remedy in str(e.value)


def test_of_a_joint_and_a_mounting_the_better_explanation_is_named(refuse):
    hung = {(0.0, 0.0, 1.0): MUCH}
    with pytest.raises(EstimationError, match="joint 3"):
        refuse(Shares(MUCH + 1.0, hung, {(JOINT_3, JOINT_3): MUCH - 0.1}))
    with pytest.raises(EstimationError, match="on the ceiling"):
        refuse(Shares(MUCH + 1.0, hung, {(JOINT_3, JOINT_3): MUCH + 0.1}))


def test_an_inverted_axis_turns_the_joints_that_it_is_coupled_to(refuse):
    coupling = np.eye(6)
    coupling[3, 2] = 0.5
    shares = Shares(MUCH + 1.0)
    joints = []
    call = shares.__call__

    def noted(chain, turn):
        keywords = getattr(turn, "keywords", None)
        if keywords is not None:
            joints.append(keywords["joints"])
        return call(chain, turn)

    refuse(noted, moves=np.arange(6) == 2, coupling=coupling)
    axis_rad = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    turned = np.array([0.1, 0.2, -0.3, 0.4, 0.5, 0.6])
    np.testing.assert_allclose((coupling @ axis_rad) @ joints[0], coupling @ turned)
