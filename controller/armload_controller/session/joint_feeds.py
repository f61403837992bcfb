"""Where `armload watch` gets an arm's joints: a CANopen bus, a ROS 2 topic, or the controller of a UR arm."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from armload_controller.analysis.payload_watch import WatchedMoment
from armload_controller.config.robot import Robot
from armload_controller.control_errors import CommissioningError, UnsafeBus
from armload_controller.session.arm_access import bus_of
from armload_drivers.bus.joined_bus import BusRole
from armload_drivers.feeds.rtde_client import JOINTS, RtdeClient
from armload_drivers.listening.bus_listener import overheard
from armload_drivers.listening.overheard_arm import OverheardArm, OverheardCycle
from armload_identification.recording.reading_options import Effort


@dataclass(frozen=True, eq=False)
class JointFeed:
    """The cycles of an arm.

    Attributes:
        name: Where they come from, for the operator.
        what_is_sent: What armload sends there, for the operator.
        cycles: Cycles; None while nothing is received.
        effort: What the cycles contain; None for what the configured drives report.
        publish: Makes a moment known there.
    """

    name: str
    what_is_sent: str
    cycles: Iterator[OverheardCycle | None]
    effort: Effort | None = None
    publish: Callable[[WatchedMoment], None] = lambda moment: None


@contextmanager
def bus_feed(robot: Robot) -> Iterator[JointFeed]:
    """The drives of an arm on its CANopen bus; see `bus_listener.overheard`.

    Args:
        robot: The arm, with its bus.

    Raises:
        UnsafeBus: the bus is virtual, where no other process can be heard.
        ConfigurationError: the file lacks a scale, which would have to be read from a drive.
        BusError: the interface cannot be opened.
    """
    if robot.bus.in_virtual_time:
        raise UnsafeBus(
            "the virtual bus carries nothing from outside this process: give a RECORDING, or the arm's bus, such as "
            "--bus socketcan:can0"
        )
    if robot.bus.on_ethercat:
        raise UnsafeBus(
            "an arm on EtherCAT cannot be listened to: a second master would take its drives out of operation. Watch "
            "it through its controller (ROS 2, RTDE), or give a RECORDING"
        )
    robot.drives.require_scales()
    arm = OverheardArm(robot.drives.settings)
    with bus_of(robot, BusRole.LISTENER) as bus:
        yield JointFeed(f"{robot.bus.address}", "nothing is sent", overheard(bus, arm))


@contextmanager
def rtde_feed(robot: Robot, host: str) -> Iterator[JointFeed]:
    """The controller of a UR arm.

    Args:
        host: Name or address of the controller.

    Raises:
        CommissioningError: the robot is no arm of six joints.
        BusError: see `RtdeClient`.
    """
    if robot.n != JOINTS:
        raise CommissioningError(
            f"{robot.file}: {robot.n} joints; --rtde is for arms of Universal Robots, which have {JOINTS}"
        )
    with RtdeClient(host) as client:
        sent = f"{client.rate_hz:g} Hz; only outputs are requested"
        yield JointFeed(host, sent, client.cycles(), Effort.CURRENT)


@contextmanager
def ros2_feed(robot: Robot, topic: str, effort: Effort) -> Iterator[JointFeed]:
    """A topic of `sensor_msgs/JointState`.

    Args:
        topic: Name of the topic.

    Raises:
        CommissioningError: the extra ros2 is not installed.
        BusError: there is no network, or the name is not a topic's.
    """
    try:
        from armload_controller.session.ros2_publisher import PayloadPublisher
        from armload_drivers.feeds.joint_state_feed import JointStateCycles, joint_state_cycles
        from armload_drivers.feeds.ros2_messages import JointState
        from armload_drivers.feeds.ros2_participant import Ros2Participant
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "cyclonedds":
            raise
        raise CommissioningError('--ros2 needs cyclonedds: pip install "armload[ros2]"') from error
    participant = Ros2Participant(os.environ)
    states = JointStateCycles(robot.joint_names, current=effort is Effort.CURRENT)
    publisher = PayloadPublisher(participant, robot.name, states.stamp_ns)
    cycles = joint_state_cycles(participant.subscription(topic, JointState), topic, states)
    where = f"{topic} (ROS 2 domain {participant.domain_id})"
    yield JointFeed(
        where,
        f"published: {publisher.node}/payload, {publisher.node}/events, /diagnostics",
        cycles,
        effort,
        publisher.publish,
    )
