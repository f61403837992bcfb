"""A payload by FIGAROH: the arm is identified loaded and unloaded, the payload is the difference of base parameters.

Arguments: URDF, name of the flange frame, loaded and unloaded CSV, nominal gains. Prints JSON: mass, centre of mass in
the flange frame, inertia about it, all projected onto possible bodies, and the half width of the mass's 95 % interval
from FIGAROH's standard deviations of the base parameters.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
from figaroh.identification.identification_tools import relative_stdev
from figaroh.identification.physical_consistency import project_p10_lmi
from figaroh.tools.qrdecomposition import build_baseRegressor, get_baseParams
from figaroh.tools.regressor import build_regressor_basic, build_regressor_reduced, get_index_eliminate
from figaroh.tools.robot import load_robot
from scipy.signal import butter, sosfiltfilt

STEP_S, LOAD = 0.01, slice(50, 60)
LOW_PASS = butter(4, 4.0, fs=1.0 / STEP_S, output="sos")
urdf, flange, loaded, unloaded, gains = sys.argv[1:]
robot = load_robot(urdf, package_dirs=str(Path(urdf).parent), load_by_urdf=True)
config = {"has_friction": True, "has_actuator_inertia": True, "has_joint_offset": True, "act_idxv": range(6)}


def run(path):
    """FIGAROH's regressor and the torque of one recording, every 50 ms."""
    lines = Path(path).read_text("utf-8").splitlines()
    rows = np.array([line.split(",") for line in lines if line.count(",") == 30], dtype=float)
    rows = rows[np.all(np.abs(rows) < 1e4, axis=1)]
    at = np.arange(rows[0, 0], rows[-1, 0], STEP_S)
    values = [np.interp(at, rows[:, 0], column) for column in rows[:, [*range(1, 7), *range(13, 19)]].T]
    smooth = sosfiltfilt(LOW_PASS, np.column_stack(values), axis=0)
    dq = np.gradient(smooth[:, :6], STEP_S, axis=0)
    ddq = np.gradient(dq, STEP_S, axis=0)
    tau = smooth[:, 6:] * np.array(gains.split(","), dtype=float)
    few = slice(50, -50, 5)
    return build_regressor_basic(robot, smooth[few, :6], dq[few], ddq[few], config), tau[few].T.ravel()


def weighted(base, tau):
    """Base parameters with a weight for each joint, and their standard deviations."""
    weight = np.ones(len(tau))
    for _ in range(3):
        found = np.linalg.lstsq(base * weight[:, None], tau * weight)[0]
        weight = np.repeat(1.0 / np.std((tau - base @ found).reshape(6, -1), axis=1), len(tau) // 6)
    deviation = relative_stdev(base * weight[:, None], found, tau * weight) * np.abs(found) / 100.0
    return found, deviation


runs = [run(loaded), run(unloaded)]
both = np.vstack([columns for columns, _ in runs])
names = dict.fromkeys(map(str, range(both.shape[1])), 0.0)
left_out, kept = get_index_eliminate(both, names, 1e-6)
_, _, independent = get_baseParams(build_regressor_reduced(both, left_out), kept, names)
base = build_baseRegressor(build_regressor_reduced(both, left_out), independent)
of_load = np.linalg.lstsq(base, both[:, LOAD])[0]
(with_it, sure), (without, sure_0) = (
    weighted(build_baseRegressor(build_regressor_reduced(columns, left_out), independent), tau) for columns, tau in runs
)
weight = 1.0 / np.hypot(sure, sure_0)
columns = of_load * weight[:, None]
plain = np.linalg.lstsq(columns, (with_it - without) * weight)[0]
half_width_kg = 1.96 * np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0])
placement = robot.model.frames[robot.model.getFrameId(flange)].placement
possible, _ = project_p10_lmi(plain)
found = placement.actInv(pin.Inertia.FromDynamicParameters(possible))
body = {"mass_kg": found.mass, "center_m": found.lever.tolist(), "inertia_kg_m2": found.inertia.tolist()}
print(json.dumps(body | {"half_width_kg": half_width_kg}))
