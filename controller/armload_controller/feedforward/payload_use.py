"""Whether a payload may be used, with the same message wherever it is refused."""

from __future__ import annotations

import numpy as np

from armload_identification.model.chain import Chain
from armload_identification.model.payload import FLANGE, PARAMETER_NAMES, SMALLEST_MARGIN, PayloadResult


def another_arms(payload: PayloadResult, chain: Chain, robot: str) -> str | None:
    """Why a payload's file shows that it belongs to another arm; None if it does not.

    Args:
        payload: The payload from its file.
        chain: Kinematics of the arm.
        robot: Name of the arm.
    """
    known = payload.provenance
    if known.robot and known.robot != robot:
        return (
            f"identified on the robot {known.robot!r}, not on {robot!r}; identify it on this arm, or name the other "
            "robot"
        )
    if known.kinematics_sha256 and known.kinematics_sha256 != chain.kinematics_sha256:
        return (
            f"identified on {robot} with [kinematics] that differ from those in its file now: the flange may be "
            "elsewhere; identify it again"
        )
    return None


def why_not_usable(payload: PayloadResult, chain: Chain, robot: str, use: str) -> str | None:
    """Why a payload must not be given to a controller, and what to do about it; None if it may be.

    Args:
        payload: The payload from its file.
        chain: Kinematics of the arm that carries it.
        robot: Name of that arm.
        use: The intended use, "exported" or "fed forward".
    """
    if not payload.feedforward_ready:
        missing = ", ".join(PARAMETER_NAMES[i] for i in np.flatnonzero(~payload.determined[:4]))
        return (
            f"not determined: {missing}; a payload is {use} only with its mass and centre of mass. "
            "Identify it again on a longer or wider excitation (`armload design`)"
        )
    if payload.frame != FLANGE:
        return (
            f"the payload is given in the frame {payload.frame!r}; expected {FLANGE!r}. "
            "Identify it with the whole arm's kinematics"
        )
    if len(payload.residual_rms_nm) != chain.n:
        return (
            f"identified on {len(payload.residual_rms_nm)} joints, but {robot} has {chain.n}; "
            "give the arm that the payload was identified on"
        )
    other = another_arms(payload, chain, robot)
    if other is not None:
        return other
    if payload.model.margin < SMALLEST_MARGIN:
        return (
            f"no body has these parameters: margin {payload.model.margin:.3g}, at least {SMALLEST_MARGIN:g} is "
            "required. Identify it again"
        )
    return None
