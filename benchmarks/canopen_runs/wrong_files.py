"""Which mistakes of a robot's file the unloaded slow round names: prints a table of `controller/FOUND.md`.

The arm of every mistake in `benchmarks/arms/misread_arm.py` is moved, empty, by fakes in virtual time, up to the end of
its first slow round, or to where the torque window stops it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import cast

from armload_controller.analysis.arm_in_use import arm_in_use
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError, MotionError
from armload_controller.cycle.slow_round_torque import SlowRoundRows
from armload_controller.motion.checked_path import check_path
from armload_controller.session.mounted_load_check import unloaded_doubts
from armload_controller.session.run_session import Course, no_operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_drivers.servos import JointServos
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_identification.excitation.fourier import Excitation
from benchmarks.arms.misread_arm import MisreadPlant, mistakes
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.trials import workers
from tests.fake_servos import FakeServos

ROBOT = "prbt"
"""Of the shipped robots the one with a [body]."""


class SlowRoundOver(CommissioningError):
    """Ends a session after its slow round."""


def run() -> None:
    """Print the table."""
    every = mistakes(load_robot(ROBOT))
    with workers() as pool:
        found = list(pool.map(named, range(len(every))))
    print("| mistake | joints | named after the slow round, before full speed |\n|---|---|---|")
    for mistake, text in zip(every, found, strict=True):
        print(f"| {mistake.name} | {', '.join(str(joint + 1) for joint in mistake.joints) or '-'} | {text} |")


def named(number: int) -> str:
    """What the operator is told of one mistake."""
    robot = load_robot(ROBOT)
    plant = MisreadPlant(twin_spec(robot, Twin.NORMATIVE, None), mistakes(robot)[number])
    texts: list[str] = []

    @contextmanager
    def opened(load: SessionLoad) -> Iterator[JointServos]:
        servos = FakeServos(robot.drives.settings, cast(ArmPlant, plant))  # the same methods
        try:
            yield servos
        finally:
            servos.close()

    def look(rows: SlowRoundRows) -> list[str]:
        found = rows.fitted(robot.joint_names, robot.chain, robot.drives.transmission)
        if found is not None:
            texts.extend(found.doubts(robot.limits.torque_max_nm))
        texts.extend(unloaded_doubts(robot, arm_in_use(robot), rows))
        raise SlowRoundOver("the slow round is over")

    one = Excitation(robot.excitations["identification"].trajectory, 1)
    path = check_path(one, robot.motion_constraints, 1 / robot.bus.cycle_hz, file=robot.file, key=ROBOT)
    try:
        with run_session(robot, SessionLoad.UNLOADED, opened, no_operator()) as session:
            session.run(path, ROBOT, course=Course(look))
    except SlowRoundOver as over:
        stopped = "stopped by the torque window; " if isinstance(over.__context__, MotionError) else ""
        return stopped + ("; ".join(texts) or "no")
    except MotionError as error:
        return f"stopped: {str(error).splitlines()[0]}"
    raise RuntimeError("the run was not ended")


if __name__ == "__main__":
    run()
