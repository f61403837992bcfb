"""Reduced speed of the shipped arms, by kinematics of this file's own: read from the TOML text, computed by Pinocchio.

The controlled points are the joints' origins, the flange, and every point of the spheres around what the arm carries:
the tool's of `[workspace]`, and those of the expected and the heaviest payload. A point of a sphere is nowhere faster
than its centre's speed plus the radius times the angular velocity.
"""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ControlError
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.obstacles import Obstacles
from armload_identification.excitation.fourier import Excitation
from armload_identification.excitation.geometry.workspace import Workspace

LIMIT_M_S = 0.25
WATER_KG_M3 = 1000.0
ROBOTS = ("er50", "prbt")


class ControlledPoints:
    """The controlled points of an arm, in Pinocchio."""

    def __init__(self, text):
        tables = tomllib.loads(text)
        self.model = pin.Model()
        kinematics = tables["kinematics"]
        along_z = np.array([0.0, 0.0, 1.0])
        if kinematics["convention"] == "joint-origins":
            joints = [(pose(row), np.array(row["axis"])) for row in kinematics["origins"]]
        else:
            joints = [(craig(row), along_z) for row in kinematics["rows"]]
        last = 0
        for number, (placement, axis) in enumerate(joints):
            last = self.model.addJoint(last, pin.JointModelRevoluteUnaligned(axis), placement, f"joint {number + 1}")
        self.flange = pose(kinematics["flange"])
        self.spheres = [(np.zeros(3), 0.0)]
        for sphere in tables["workspace"]["spheres"]:
            if sphere["link"] == "tool":
                self.spheres.append((np.array(sphere["center_m"]), sphere["radius_m"]))
        for key in ("expected_payload", "heaviest_payload"):
            mass_kg, center_m = tables[key]["mass_kg"], np.array(tables[key]["center_of_mass_m"])
            self.spheres.append((center_m, (3.0 * mass_kg / (4.0 * math.pi * WATER_KG_M3)) ** (1.0 / 3.0)))

    def fastest(self, leg, samples):
        """Greatest speed of any of them on a leg at full rate, in m/s."""
        state = leg.path.evaluate(np.linspace(leg.start_s, leg.end_s, samples))
        data, found = self.model.createData(), 0.0
        for q, dq in zip(state.position_rad, leg.rate * state.velocity_rad_s, strict=True):
            pin.forwardKinematics(self.model, data, q, dq)
            moving = [pin.getVelocity(self.model, data, joint) for joint in range(1, self.model.njoints)]
            flange = self.flange.actInv(moving[-1])
            spin = np.linalg.norm(flange.angular)
            speeds = [
                np.linalg.norm(flange.linear + np.cross(flange.angular, at)) + radius * spin
                for at, radius in self.spheres
            ]
            found = max(found, *speeds, *(np.linalg.norm(joint.linear) for joint in moving))
        return found


def pose(table):
    return pin.SE3(pin.rpy.rpyToMatrix(*table["rpy_rad"]), np.array(table["xyz_m"]))


def craig(row):
    """Rot(x, alpha) Trans(x, a) Rot(z, theta) Trans(z, d)."""
    tilt, turn = pin.rpy.rpyToMatrix(row["alpha_rad"], 0.0, 0.0), pin.rpy.rpyToMatrix(0.0, 0.0, row["theta_rad"])
    return pin.SE3(tilt, np.array([row["a_m"], 0.0, 0.0])) * pin.SE3(turn, np.array([0.0, 0.0, row["d_m"]]))


class Moved:
    """An arm whose motions are planned as for a run."""

    def __init__(self, name):
        self.robot = load_robot(name)
        self.points = ControlledPoints(self.robot.text)
        self.constraints = self.robot.motion_constraints

    def path(self, excitation, **changes):
        constraints = replace(self.constraints, **changes)
        return check_path(excitation, constraints, 1.0 / self.robot.bus.cycle_hz, file=self.robot.file, key="probe")

    def rounds(self, count):
        """Slow rounds: of the shipped excitations, then of others whose joints begin at random times of the period.

        The others may touch something or be too heavy for a joint; all joints keep their limits.
        """
        shipped = list(self.robot.excitations.values())
        rng = np.random.default_rng(7)
        free = {"obstacles": Obstacles(Workspace(self.robot.chain)), "torque": None, "axis_torque": None}
        for number in range(count):
            excitation = shipped[number % len(shipped)]
            if number < len(shipped):
                yield self.path(excitation).slow.leg
            else:
                yield self.path(Excitation(shifted(excitation.trajectory, rng), 1), **free).slow.leg

    def approaches(self, count):
        """Approaches from anywhere that has a free way; each from rest to rest, some round obstacles."""
        limits = self.constraints.limits
        paths = [self.path(excitation) for excitation in self.robot.excitations.values()]
        rng = np.random.default_rng(11)
        while count:
            try:
                legs = paths[count % len(paths)].approach_from(
                    rng.uniform(limits.position_min_rad, limits.position_max_rad)
                )
            except ControlError:
                continue
            count -= 1
            yield from (checked.leg for checked in legs)


def shifted(trajectory, rng):
    """The same motion of every joint, each begun at a random time of its period."""
    orders = np.arange(1, trajectory.harmonics + 1)
    angle = rng.uniform(0.0, 2.0 * np.pi, (trajectory.n, 1)) * orders
    turned = (trajectory.sin_rad + 1j * trajectory.cos_rad) * np.exp(1j * angle)
    return replace(trajectory, sin_rad=turned.real, cos_rad=turned.imag)


@pytest.fixture(scope="module", params=ROBOTS)
def moved(request):
    return Moved(request.param)


def test_no_controlled_point_is_fast_on_the_shipped_slow_rounds_and_some_approaches(moved):
    fastest = [moved.points.fastest(leg, 1024) for leg in moved.rounds(2)]
    assert max(fastest) <= LIMIT_M_S
    assert min(fastest) > 0.9 * LIMIT_M_S
    assert max(moved.points.fastest(leg, 128) for leg in moved.approaches(6)) <= LIMIT_M_S


def test_a_slow_round_planned_for_the_arm_alone_moves_what_it_carries_too_fast(moved):
    """The speeds above are those of the spheres, not of the arm."""
    excitation = moved.robot.excitations["identification"]
    alone = moved.path(excitation, points=moved.robot.limits.points).slow.leg
    assert moved.points.fastest(alone, 1024) > 1.4 * LIMIT_M_S


@pytest.mark.long
def test_no_controlled_point_is_fast_on_8_slow_rounds_and_300_approaches(moved):
    assert max(moved.points.fastest(leg, 4096) for leg in moved.rounds(8)) <= LIMIT_M_S
    assert max(moved.points.fastest(leg, 200) for leg in moved.approaches(300)) <= LIMIT_M_S
