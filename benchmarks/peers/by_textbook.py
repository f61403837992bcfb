"""A payload by weighted least squares on the difference of two runs, the textbook method; NumPy, SciPy, Pinocchio.

Arguments: URDF, flange's frame, loaded and unloaded CSV, nominal gains. Prints JSON: mass, centre of
mass in the flange's frame, inertia about it, and the half width of the mass's 95 % interval for white noise.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.optimize import brute
from scipy.signal import butter, sosfiltfilt

STEP_S, FROM_S, TO_S, LATEST_S = 0.01, 8.0, 48.0, 8.0
LOW_PASS = butter(4, 4.0, fs=1.0 / STEP_S, output="sos")
urdf, flange, loaded, unloaded, gains = sys.argv[1:]


def read(path):
    """Time, positions and torques of one recording."""
    lines = Path(path).read_text("utf-8").splitlines()
    rows = np.array([line.split(",") for line in lines if line.count(",") == 30], dtype=float)
    rows = rows[np.all(np.abs(rows) < 1e4, axis=1)]
    return rows[:, 0] - rows[0, 0], rows[:, 1:7], rows[:, 13:19] * np.array(gains.split(","), dtype=float)


def sampled(time, values, at):
    """Columns, linearly interpolated at other times."""
    return np.column_stack([np.interp(at, time, column) for column in values.T])


(time, q, tau), (time_0, q_0, tau_0) = read(loaded), read(unloaded)
at = np.arange(FROM_S, TO_S, STEP_S)
q = sampled(time, q, at)
late = brute(lambda s: np.sum((q - sampled(time_0, q_0, at + s)) ** 2), [slice(-LATEST_S, LATEST_S, 0.2)])[0]
q = sosfiltfilt(LOW_PASS, q, axis=0)
dq = np.gradient(q, STEP_S, axis=0)
ddq = np.gradient(dq, STEP_S, axis=0)
difference = sosfiltfilt(LOW_PASS, sampled(time, tau, at) - sampled(time_0, tau_0, at + late), axis=0)
model = pin.buildModelFromUrdf(urdf)
data = model.createData()
phi = np.array(
    [pin.computeJointTorqueRegressor(model, data, *state)[:, -10:] for state in zip(q, dq, ddq, strict=True)]
)
weight = np.ones(6)
for _ in range(3):
    columns, right = (phi * weight[:, None]).reshape(-1, 10), (difference * weight).ravel()
    theta = np.linalg.lstsq(columns, right)[0]
    weight = 1.0 / np.std(difference - phi @ theta, axis=0)
half_width_kg = 1.96 * np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0])
placement = model.frames[model.getFrameId(flange)].placement
found = placement.actInv(pin.Inertia.FromDynamicParameters(theta))
body = {"mass_kg": found.mass, "center_m": found.lever.tolist(), "inertia_kg_m2": found.inertia.tolist()}
print(json.dumps(body | {"half_width_kg": half_width_kg}))
