"""The simulated arm's mechanics as a MuJoCo model, built from a `PlantSpec`.

One body per joint, the payload as a body welded to the flange. The rotors turn with the axes, q_axis =
C^-1 q_joint, so their inertia in joint coordinates is C^-T J C^-1, which is exactly that of a fixed tendon per axis
with a row of C^-1 as coefficients and J as armature.

An elastic joint consists of two hinges on one axis in one body: the first is the motor side, the second the deflection
of the gear. The deflection's damping is time step times stiffness, which makes MuJoCo's semi-implicit step implicit:
stable for arbitrarily light links, and lightly damped (damping ratio pi f h: 4 % at 12 Hz, 8 % at 25 Hz).
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from armload_drivers.driver_errors import SimulationError
from armload_drivers.servos import FloatArray
from armload_drivers.simulation.plant_spec import PlantSpec, PlantVariant, RigidBody

TIME_STEP_S = 0.001
"""Period of the servo loops and step of the integration."""

ELASTIC_HZ_ARM = 12.0
"""Natural frequency of the elastic joints 1 to 3."""
ELASTIC_HZ_WRIST = 25.0
"""Natural frequency of the elastic joints from the fourth on."""
WRIST = 3
"""Index of the first wrist joint."""
OUTPUT_STAGE = 0.01
"""Share of the rotor's inertia at an elastic gear's output, so that no spring acts on a massless link."""

SMALLEST_INERTIA_KG_M2 = 1e-12
"""Inertia of a point mass, because MuJoCo refuses zero."""


@dataclass(frozen=True, slots=True)
class PlantModel:
    """A compiled model at its start position, at rest.

    Attributes:
        mujoco: The module.
        model: MuJoCo's MjModel.
        data: MuJoCo's MjData.
        hinges_per_joint: 1, or 2 with elastic joints; hinge `hinges_per_joint * i` is joint i's motor side.
        axis_inertia_kg_m2: (n,) nominal inertia that each axis turns, rotor included, unloaded.
    """

    mujoco: Any
    model: Any
    data: Any
    hinges_per_joint: int
    axis_inertia_kg_m2: FloatArray


SLOW_CLOCK_S = 2e-6
"""MuJoCo's clock is replaced if reading it takes longer than this."""


@cache
def load_mujoco() -> Any:
    """MuJoCo, with its clock replaced if reading the clock is slow: it does so some thirty times a step.

    On a user-mode kernel a read takes 15 us and a step 470 us, but only 6.6 us with a callback in place of the clock.
    If the clock needs no system call, the callback costs more than it saves.

    Returns:
        The module.

    Raises:
        SimulationError: MuJoCo is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise SimulationError('the simulated arm needs MuJoCo: pip install "armload[sim]"') from error
    if _clock_read_s() > SLOW_CLOCK_S:
        mujoco.set_mjcb_time(lambda: 0.0)
    return mujoco


def _clock_read_s() -> float:
    """Time to read this machine's clock, the shortest of some attempts."""
    tries = [time.monotonic_ns() for _ in range(20)]
    return min(after - before for before, after in pairwise(tries)) * 1e-9


def build_model(spec: PlantSpec) -> PlantModel:
    """Compile a specification.

    Args:
        spec: The arm.

    Returns:
        The model, at rest at `spec.start_position_rad`; elastic joints are already deflected by their load.

    Raises:
        SimulationError: MuJoCo is missing, or refuses such an arm; names the link.
    """
    mujoco = load_mujoco()
    rotors = np.array([joint.reflected_rotor_inertia_kg_m2 for joint in spec.joints])
    to_axis: FloatArray = np.linalg.inv(spec.coupling).astype(np.float64)
    rotors_at_joints = to_axis.T @ np.diag(rotors) @ to_axis

    bare = _compile(mujoco, replace(spec, payload=None), to_axis, stiffness=None)
    inertia = _nominal_inertia(mujoco, bare)
    axis_inertia = np.diag(spec.coupling.T @ inertia @ spec.coupling).copy()

    stiffness: FloatArray | None = None
    if spec.variant is PlantVariant.HARSH:
        rated = _compile(mujoco, replace(spec, payload=spec.rated_payload), to_axis, stiffness=None)
        links = np.diag(_nominal_inertia(mujoco, rated)) - np.diag(rotors_at_joints)
        stiffness = _elastic_stiffness(links, np.diag(rotors_at_joints))
    model = _compile(mujoco, spec, to_axis, stiffness)
    data = mujoco.MjData(model)
    hinges = 1 if stiffness is None else 2
    data.qpos[::hinges] = spec.start_position_rad
    if stiffness is not None:
        load = np.empty(model.nv)
        for _ in range(3):
            mujoco.mj_forward(model, data)
            mujoco.mj_rne(model, data, 0, load)
            data.qpos[1::2] = -load[1::2] / stiffness
    mujoco.mj_forward(model, data)
    return PlantModel(mujoco, model, data, hinges, axis_inertia)


def _elastic_stiffness(links: FloatArray, rotors: FloatArray) -> FloatArray:
    """Stiffnesses (n,) that give the prescribed frequencies with a locked motor, in N m/rad.

    At the wrist a link may be lighter than the reflected rotor (a bare flange has almost no inertia), which is not
    representative of a gear made to carry a payload; the rotor's inertia is used there instead.
    """
    wrist = np.arange(len(links)) >= WRIST
    angular = 2.0 * math.pi * np.where(wrist, ELASTIC_HZ_WRIST, ELASTIC_HZ_ARM)
    return np.asarray(angular**2 * np.where(wrist, np.maximum(links, rotors), links))


def _nominal_inertia(mujoco: Any, model: Any) -> FloatArray:
    """Joint-space inertia (n, n), including rotors: the mean over all poses at right angles.

    One pose is not sufficient: an upright arm has a tenth of a stretched arm's inertia about joint 1.
    """
    data = mujoco.MjData(model)
    inertia = np.zeros((model.nv, model.nv))
    total = np.zeros_like(inertia)
    poses = list(itertools.product((-math.pi / 2.0, 0.0, math.pi / 2.0), repeat=model.nv - 1))
    for pose in poses:
        data.qpos[1:] = pose
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fullM(model, data, inertia)
        total += inertia
    return total / len(poses)


def _compile(mujoco: Any, spec: PlantSpec, to_axis: FloatArray, stiffness: FloatArray | None) -> Any:
    """MuJoCo's model of the arm, with stiff joints if `stiffness` is None."""
    description = mujoco.MjSpec()
    description.compiler.degree = False
    description.compiler.boundinertia = SMALLEST_INERTIA_KG_M2
    _set_options(mujoco, description.option, spec)

    body = description.worldbody
    for i, joint in enumerate(spec.joints):
        body = body.add_body(name=f"link {i}")
        _place(mujoco, body, joint.placement)
        _fill(body, joint.link)
        hinge = body.add_joint(name=f"motor {i}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=joint.axis)
        hinge.damping[0] = joint.viscous_nm_s_rad * spec.friction_scale
        # Any value above zero enables the friction constraint; the servo step sets the actual value.
        hinge.frictionloss = 1.0
        # Stiff enough that a loaded joint at rest creeps by less than 1e-7 rad/s.
        hinge.solref_friction = [2.0 * TIME_STEP_S, 1.0]
        hinge.solimp_friction = [0.9999, 0.9999, 0.001, 0.5, 2.0]
        if stiffness is not None:
            spring = body.add_joint(name=f"gear {i}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=joint.axis)
            spring.stiffness[0] = stiffness[i]
            spring.damping[0] = stiffness[i] * TIME_STEP_S
            spring.armature = OUTPUT_STAGE * joint.reflected_rotor_inertia_kg_m2
    if spec.payload is not None:
        tool = body.add_body(name="payload")
        _place(mujoco, tool, spec.flange)
        _fill(tool, spec.payload)
    for i, joint in enumerate(spec.joints):
        rotor = description.add_tendon(name=f"axis {i}", armature=joint.reflected_rotor_inertia_kg_m2)
        for k in np.flatnonzero(to_axis[i]):
            rotor.wrap_joint(f"motor {k}", to_axis[i, k])
    try:
        return description.compile()
    except ValueError as error:
        raise SimulationError(f"MuJoCo refuses the arm: {error}") from error


def _set_options(mujoco: Any, option: Any, spec: PlantSpec) -> None:
    """Set the integration, and disable unused features."""
    flags = mujoco.mjtDisableBit
    option.timestep = TIME_STEP_S
    option.gravity = spec.gravity_m_s2
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    # MuJoCo relates progress to the mean inertia; that of a wrist is thousands of times smaller. Costs nothing.
    option.tolerance = 1e-12
    # A diverged arm must be detected, not silently reset to its start.
    option.disableflags = int(
        flags.mjDSBL_AUTORESET
        | flags.mjDSBL_CONTACT
        | flags.mjDSBL_LIMIT
        | flags.mjDSBL_EQUALITY
        | flags.mjDSBL_SENSOR
        | flags.mjDSBL_ISLAND
    )


def _place(mujoco: Any, body: Any, pose: FloatArray) -> None:
    """Place a body at a (4, 4) pose in its parent."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(pose[:3, :3]).ravel())
    body.pos = pose[:3, 3]
    body.quat = quaternion


def _fill(body: Any, content: RigidBody) -> None:
    """Give a body its mass and inertia."""
    inertia = content.inertia_kg_m2
    body.explicitinertial = True
    body.mass = content.mass_kg
    body.ipos = content.center_of_mass_m
    body.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
