"""An excitation by armload, for the payload's ten parameters. Arguments: robot file, seed. Prints the motion as JSON.

Positions, velocities and accelerations, (N, 6) each, sampled every 50 ms.
"""

import json
import sys

import numpy as np

import armload

robot, seed = sys.argv[1:]
found = armload.design(robot, search=armload.DesignSearch(int(seed), 1, "condition-number")).result.trajectory
state = found.evaluate(np.arange(0.0, found.period_s, 0.05))
motion = {"P_F": state.position_rad, "V_F": state.velocity_rad_s, "A_F": state.acceleration_rad_s2}
print(json.dumps({key: values.tolist() for key, values in motion.items()}))
