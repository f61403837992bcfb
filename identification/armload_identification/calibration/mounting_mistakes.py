"""An arm that is mounted differently from its configuration, or has an inverted joint, found by its runs' residual.

The runs are fitted roughly, as they are and with each mistake in turn; one that explains them much better is named.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.calibration.calibration_constants import OtherMounting
from armload_identification.calibration.run_contradictions import at_axes
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from armload_identification.model.other_mountings import directions
from armload_identification.signals.motion import Motion

Turn = Callable[[Motion], Motion]
"""A run as it would be without a mistake."""
ResidualShares = Callable[[Chain, Turn], FloatArray]
"""Logarithms of the moving joints' shares of residual in torque, for another chain and with all runs changed."""

_POSITION_AND_EFFORT: Final = "position and effort"
_TURNED: Final = {_POSITION_AND_EFFORT: (True, True), "position": (True, False), "effort": (False, True)}


class MountedDifferently(EstimationError):
    """The arm is mounted or turned in another way than configured.

    Attributes:
        residual_share: Geometric mean of the moving joints' shares of residual in torque once it is corrected.
    """

    def __init__(self, text: str, log_share: float) -> None:
        super().__init__(text)
        self.residual_share = float(np.exp(log_share))


def most_trials(chain: Chain) -> int:
    """Most fits that `refuse_other_mounting` takes.

    Args:
        chain: The arm as configured.
    """
    return 1 + len(directions(chain.gravity_m_s2)) + len(_TURNED) * chain.n


def refuse_other_mounting(shares: ResidualShares, chain: Chain, coupling: FloatArray, moves: NDArray[np.bool_]) -> None:
    """Raise if the runs show another mounting or an inverted joint.

    Args:
        shares: Fits the runs.
        chain: The arm as configured.
        coupling: (n, n) C of its motors.
        moves: (n,) False for joints that stand in all runs.

    Raises:
        MountedDifferently: naming the mistake and the remedy.
    """
    as_configured = shares(chain, lambda run: run)
    entered = float(as_configured.mean())
    may_be_turned = as_configured.max() > np.log(OtherMounting.much)
    if entered < np.log(OtherMounting.little) and not may_be_turned:
        return
    found = {}
    for how, gravity in directions(chain.gravity_m_s2).items():
        found[how] = float(shares(chain.under(gravity), lambda run: run).mean())
    best = min(found, key=lambda how: found[how])
    if may_be_turned and found[best] >= min(np.log(OtherMounting.little), entered - OtherMounting.better):
        turned = _turned_joints(partial(shares, chain), coupling, moves)
        joint, what = min(turned, key=lambda which: turned[which])
        if turned[joint, what] < min(entered - OtherMounting.better, found[best]):
            remedy = (
                "Invert its axis in the robot's configuration"
                if what == _POSITION_AND_EFFORT
                else "Set the drive's polarity (607E), or correct the recordings, so that position and effort agree"
            )
            raise MountedDifferently(
                f"joint {joint + 1} is inverted relative to its configuration: the residual of the runs is "
                f"{np.exp(entered - turned[joint, what]):.1f} times smaller with its {what} inverted. {remedy}; the "
                "polarity of a drive that armload only listens to cannot be read.",
                turned[joint, what],
            )
    if found[best] < entered - OtherMounting.better:
        raise MountedDifferently(
            f"the arm is not mounted as in its configuration: the residual is {np.exp(entered - found[best]):.1f} "
            f"times smaller if it is mounted {best}. Correct gravity_m_s2 in the robot's configuration.",
            found[best],
        )


def _turned_joints(
    shares: Callable[[Turn], FloatArray], coupling: FloatArray, moves: NDArray[np.bool_]
) -> dict[tuple[int, str], float]:
    """Mean logarithm of the residual shares with each moving axis and what of it inverted."""
    turned = {}
    for axis, (what, (position, effort)) in product(np.flatnonzero(moves).tolist(), _TURNED.items()):
        turn = np.diag(np.where(np.arange(len(coupling)) == axis, -1.0, 1.0))
        by_axis, same = at_axes(turn, coupling), np.eye(len(coupling))
        joints, torques = by_axis.T if position else same, by_axis if effort else same
        turned[axis, what] = float(shares(partial(Motion.turned, joints=joints, torques=torques)).mean())
    return turned
