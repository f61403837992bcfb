"""How an error equal to the tolerance could be detected, and which verdict a payload's own run may give."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.verdict.agreement import LengthNeeded, Outcome
from armload_identification.verdict.payload_verdict import PayloadVerdict, remedy_for

pytestmark = pytest.mark.pure

BODY = InertialParameters.from_center_of_mass(2.0, [0.0, 0.0, 0.1], 0.01 * np.eye(3))
LENGTH = LengthNeeded(2.0, gains_limit=False)
ABOUT_Y = Chain.from_origins([np.zeros(3)], [np.zeros(3)], [(0.0, 1.0, 0.0)], np.eye(4), (0.0, 0.0, -9.81))
"""One joint with a horizontal axis."""


class Fit:
    """Joint 2 shows the mass best, joint 1 the centre of mass; notes the errors that it is asked for."""

    arm = SimpleNamespace(layout=SimpleNamespace(chain=ABOUT_Y))
    errors = None

    def seen(self, errors):
        self.errors = errors
        return np.array([[1.0, 9.0], [5.0, 2.0], [4.0, 3.0]])


def remedy(weakest=(1.0, 0.0, 0.0), position=0.0, fit=None):
    agreement = SimpleNamespace(weakest=np.array(weakest))
    motion = np.broadcast_to(np.asarray(position, dtype=float).reshape(-1, 1), (1000, 1))
    return remedy_for(agreement, LENGTH, fit or Fit(), BODY, motion)


def test_the_joints_that_would_help_are_those_that_show_an_error_best():
    found = remedy()
    assert (found.mass_joint, found.center_joint) == (1, 0)
    assert found.length is LENGTH


def test_errors_are_of_only_the_mass_and_of_only_the_centre_in_its_weakest_direction():
    fit = Fit()
    remedy((0.0, 1.0, 0.0), fit=fit)
    step = 1e-6
    of_mass, of_center = (
        (InertialParameters(BODY.theta + step * error).values - BODY.values) / step for error in fit.errors.T
    )
    np.testing.assert_allclose(of_mass, [1.0, *[0.0] * 9], atol=1e-6)
    np.testing.assert_allclose(of_center, [0.0, 0.0, 1.0, *[0.0] * 7], atol=1e-5)


@pytest.mark.parametrize(
    ("weakest", "position", "share"),
    [
        ((1.0, 0.0, 0.0), 0.0, 1.0),
        ((0.0, 0.0, 1.0), 0.0, 0.0),
        ((1.0, 0.0, 0.0), np.pi / 2, 0.0),
        ((0.0, 1.0, 0.0), 0.7, 1.0),
        ((1.0, 0.0, 0.0), np.pi / 6, 0.75),
        ((1.0, 0.0, 0.0), np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False), 0.5),
    ],
)
def test_the_weakest_direction_is_level_or_upright_along_the_motion(weakest, position, share):
    assert remedy(weakest, position).level_share == pytest.approx(share, abs=0.01)


@pytest.mark.parametrize("own_run", [True, False])
@pytest.mark.parametrize("outcome", list(Outcome))
def test_a_payloads_own_run_can_contradict_it_but_not_confirm_it(own_run, outcome):
    verdict = PayloadVerdict(SimpleNamespace(outcome=outcome), None, None, None, own_run)
    assert verdict.outcome is (Outcome.CANNOT_TELL if own_run and outcome is Outcome.RIGHT else outcome)
