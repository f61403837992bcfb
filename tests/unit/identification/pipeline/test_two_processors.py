"""The answer does not depend on the processor: rounding must not decide what is fitted."""

import json
import os
import subprocess
import sys

import pytest

PROGRAM = """
import json
from threadpoolctl import threadpool_info
from armload_controller.config.robot import load_robot
from armload_identification.pipeline.payload_identification import identify_runs
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.trials import pair

robot = load_robot("prbt")
payload = robot.simulation.plant_spec("gripper").payload
setup = setup_of("two processors", robot, Twin.NORMATIVE, shipped_motion(robot, periods=1), payload)
values = []
for seed in range(2):
    loaded, unloaded, _ = pair(setup, seed)
    found = identify_runs(loaded, unloaded, setup.chain, setup.transmission).uncertainty
    values.append([found.values[:4].tolist(), found.half_width_95[:4].tolist()])
kernels = sorted({each.get("architecture", "") for each in threadpool_info() if each["internal_api"] == "openblas"})
print(json.dumps([kernels, values]))
"""


def identified(kernel):
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, timeout=300, check=True
    )
    return json.loads(done.stdout)


@pytest.mark.long
def test_other_kernels_of_the_linear_algebra_give_the_same_payload():
    (plain, first), (other, second) = identified("Prescott"), identified("Haswell")
    if plain == other:
        pytest.skip(f"the linear algebra has one kind of kernels here: {plain}")
    for (values, half_width), (again, _) in zip(first, second, strict=True):
        for value, width, same in zip(values, half_width, again, strict=True):
            assert abs(value - same) < 0.01 * width
