"""An arm from an operator's answers: Denavit-Hartenberg rows or joint origins, and each joint's limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from armload_controller.config.chain_from_urdf import FEWEST_JOINTS, MOST_JOINTS, STANDARD_GRAVITY_M_S2
from armload_controller.new_robot.arm_draft import ArmDraft
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.storage.toml_text import value

Ask = Callable[[str], str]
"""Shows a question, returns the answer."""

_DH_KEYS: Final = ("alpha_rad", "a_m", "d_m", "theta_rad")
_CONVENTIONS: Final = ("modified-dh", "standard-dh", "joint-origins")


class Interview:
    """Questions that are repeated until the answer is valid."""

    def __init__(self, ask: Ask, say: Callable[[str], None]) -> None:
        self._ask, self._say = ask, say

    def numbers(self, question: str, count: int, default: tuple[float, ...] | None = None) -> FloatArray:
        """A given count of finite numbers; an empty answer means the default, if there is one."""
        while True:
            answer = self._ask(question)
            if not answer.strip() and default is not None:
                return np.array(default)
            try:
                values = [float(word) for word in answer.replace(",", " ").split()]
            except ValueError:
                values = []
            if len(values) == count and np.all(np.isfinite(values)):
                return np.array(values)
            self._say(
                f"  {answer!r}: expected {count} number{'s' if count > 1 else ''}, such as {'0 ' * count}".rstrip()
            )

    def ordered(self, question: str) -> FloatArray:
        """A lower and an upper value."""
        while True:
            low, high = self.numbers(question, 2)
            if low < high:
                return np.array([low, high])
            self._say(f"  {low:g} is not below {high:g}: give the lower value first")

    def positive(self, question: str) -> float:
        """A number above zero; an empty answer means NaN, unknown."""
        while True:
            value = float(self.numbers(question, 1, (np.nan,))[0])
            if np.isnan(value) or value > 0.0:
                return value
            self._say(f"  {value:g}: expected a number above 0")

    def choice(self, question: str, names: tuple[str, ...]) -> str:
        """One of some names, or its number."""
        while True:
            answer = self._ask(question).strip()
            if answer in names:
                return answer
            if answer.isdecimal() and 1 <= int(answer) <= len(names):
                return names[int(answer) - 1]
            self._say(f"  {answer!r}: expected one of {', '.join(names)}, or its number")

    def text(self, question: str, default: str) -> str:
        """A word."""
        return self._ask(question).strip() or default


def interviewed(ask: Ask, say: Callable[[str], None]) -> ArmDraft:
    """Ask the operator for an arm.

    Args:
        ask: Asks a question and returns the answer.
        say: Shows a line.

    Returns:
        The arm; limits without an answer are NaN.
    """
    talk = Interview(ask, say)
    name = talk.text("Name of the arm [my_arm]: ", "my_arm")
    joints = 0
    while not FEWEST_JOINTS <= joints <= MOST_JOINTS:
        joints = int(talk.numbers(f"Number of joints, {FEWEST_JOINTS} to {MOST_JOINTS} [6]: ", 1, (6.0,))[0])
    listed = ", ".join(f"{i} {name}" for i, name in enumerate(_CONVENTIONS, 1))
    convention = talk.choice(f"How are the joints given? {listed}: ", _CONVENTIONS)
    while True:
        rows, flange, chain = _kinematics(talk, convention, joints)
        if isinstance(chain, Chain):
            break
        say(f"  {chain}; try again")
    say("Limits of each joint, in rad, rad/s and N m; leave speed or torque empty to fill it in later.")
    limits = []
    for joint in range(1, joints + 1):
        low, high = talk.ordered(f"Joint {joint}, least and greatest position: ")
        speed, torque = (talk.positive(f"Joint {joint}, greatest {what}: ") for what in ("speed", "torque"))
        limits.append((low, high, speed, torque))
    table, unknown = np.array(limits), np.full(joints, np.nan)
    return ArmDraft(
        name=name,
        description=f"{joints} joints, as answered to `armload init`",
        convention=convention,
        rows=rows,
        flange=flange,
        chain=chain,
        joint_names=tuple(f"joint_{i}" for i in range(1, joints + 1)),
        position_min_rad=table[:, 0],
        position_max_rad=table[:, 1],
        velocity_max_rad_s=table[:, 2],
        torque_max_nm=table[:, 3],
        viscous_nm_s_rad=unknown,
        coulomb_nm=unknown,
        links=(None,) * joints,
        other_joints=(),
        source="answers to its questions",
    )


def _kinematics(talk: Interview, convention: str, joints: int) -> tuple[tuple[str, ...], str, Chain | str]:
    """Rows, flange, and the chain or the reason why it is invalid."""
    origins = convention == "joint-origins"
    what = (
        "x y z roll pitch yaw of its frame in the previous one, then its axis x y z" if origins else "alpha a d theta"
    )
    values = np.array(
        [talk.numbers(f"Joint {i}, {what} (m, rad): ", 9 if origins else 4) for i in range(1, joints + 1)]
    )
    end = talk.numbers("Flange in the last frame, x y z roll pitch yaw [0 0 0 0 0 0]: ", 6, (0.0,) * 6)
    flange = value({"xyz_m": end[:3], "rpy_rad": end[3:]})
    gravity = np.array(STANDARD_GRAVITY_M_S2)
    try:
        pose = pose_from_xyz_rpy(end[:3], end[3:])
        if origins:
            rows = [{"xyz_m": v[:3], "rpy_rad": v[3:6], "axis": v[6:]} for v in values]
            chain = Chain.from_origins(values[:, :3], values[:, 3:6], values[:, 6:], pose, gravity)
        else:
            rows = [dict(zip(_DH_KEYS, v.tolist(), strict=True)) for v in values]
            build = Chain.from_modified_dh if convention == "modified-dh" else Chain.from_standard_dh
            chain = build(values, pose, gravity)
    except ModelError as error:
        return (), flange, str(error)
    return tuple(map(value, rows)), flange, chain
