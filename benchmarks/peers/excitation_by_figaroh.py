"""An excitation by FIGAROH, for the payload's ten parameters: waypoints of cubic splines, placed by IPOPT.

Arguments: URDF with the limits to keep, seed of the first waypoints. Prints JSON: the positions, velocities and
accelerations found, (N, 6) each, sampled every 50 ms.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from figaroh.optimal.base_optimal_trajectory import BaseOptimalTrajectory, BaseTrajectoryIPOPTProblem
from figaroh.tools.regressor import build_regressor_basic
from figaroh.tools.robot import load_robot

LOAD = slice(50, 60)
CONFIG = """
robot: {name: ur10e, properties: {joints: {active_joints: [%s]}}}
tasks:
  identification:
    enabled: true
    problem: {include_external_forces: false, use_joint_torques: true,
      model_components: {friction: false, joint_offset: false, actuator_inertia: false,
        static_regressor: true, inertia_regressor: true}}
    signal_processing: {sampling_frequency: 100.0, cutoff_frequency: 10.0, filter_type: butterworth, filter_order: 4}
    data: {validation_data_file: ""}
  optimal_trajectory:
    enabled: true
    problem: {soft_lim: 0.05, max_attempts: 500, max_iterations: 100, segment_attempts: 3}
    trajectory: {waypoints: 6, frequency: 20, segment_duration: 2.0}
"""
urdf, seed = sys.argv[1:]
np.random.seed(int(seed))  # noqa: NPY002 FIGAROH draws from the global generator


class PayloadTrajectory(BaseOptimalTrajectory):
    """The search for a motion that excites the last link's ten parameters."""

    def create_ipopt_problem(self, *arguments):
        """FIGAROH's own problem."""
        return BaseTrajectoryIPOPTProblem(self, *arguments)

    def _stack_base_regressors(self, q, v, a, W_stack=None):
        return build_regressor_basic(self.robot, q, v, a, self.identif_config)[:, LOAD]


robot = load_robot(urdf, package_dirs=str(Path(urdf).parent), load_by_urdf=True)
names = list(robot.model.names)[1:]
with tempfile.TemporaryDirectory() as folder:
    config = Path(folder) / "config.yaml"
    config.write_text(CONFIG % ", ".join(names), "utf-8")
    search = PayloadTrajectory(robot, names, str(config))
search.identif_config["active_joints"] = names
search.identif_config["act_Jid"] = [robot.model.getJointId(name) for name in names]
search.identif_config["act_J"] = [robot.model.joints[i] for i in search.identif_config["act_Jid"]]
search.identif_config["act_idxq"] = [joint.idx_q for joint in search.identif_config["act_J"]]
search.identif_config["act_idxv"] = [joint.idx_v for joint in search.identif_config["act_J"]]
search.initialize()
found = search.solve(stack_reps=1)
print(json.dumps({key: np.asarray(found[key][0]).tolist() for key in ("P_F", "V_F", "A_F")}))
