"""This process in a ROS 2 network: readers and writers of topics, with `cyclonedds` and without an installation of ROS.

The environment is that of any ROS 2 node: ROS_DOMAIN_ID, ROS_LOCALHOST_ONLY, ROS_AUTOMATIC_DISCOVERY_RANGE (of which
LOCALHOST is honoured) and, for everything else, CYCLONEDDS_URI.

References:
    ROS 2 design, "Topic and Service name mapping to DDS": a topic `/name` is `rt/name` in DDS.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from cyclonedds.core import DDSException, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from armload_drivers.driver_errors import BusError

_LAST_DOMAIN: Final = 232
"""UDP ports of higher domains do not exist."""
_RECEIVED: Final = 2000
"""Samples kept while this process is busy: two seconds at 1 kHz."""
_SENT: Final = 100
"""Samples kept for a slow subscriber."""
_LOCAL: Final = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='127.0.0.1' multicast='true'/></Interfaces>"
    "</General></Domain></CycloneDDS>"
)
_NAME: Final = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


class Ros2Participant:
    """This process in a ROS 2 network, as the environment states it.

    Args:
        environment: Environment variables.

    Attributes:
        domain_id: The domain.

    Raises:
        BusError: a variable has no usable value, or there is no network.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        text = environment.get("ROS_DOMAIN_ID", "").strip() or "0"
        if not text.isdecimal() or int(text) > _LAST_DOMAIN:
            raise BusError(f"ROS_DOMAIN_ID={text}: expected a whole number from 0 to {_LAST_DOMAIN}, such as 0")
        self.domain_id = int(text)
        local_only = self.is_local(environment)
        try:
            # The domain's settings hold as long as this object does.
            self._domain = Domain(self.domain_id, _LOCAL) if local_only else None
            self._participant = DomainParticipant(self.domain_id)
        except DDSException as error:
            where = "the loopback interface" if local_only else "a network interface"
            raise BusError(f"ROS 2 domain {self.domain_id} needs {where}, which is not up: {error}") from error

    @staticmethod
    def is_local(environment: Mapping[str, str]) -> bool:
        """Whether the environment restricts ROS 2 to this computer."""
        return (
            environment.get("ROS_LOCALHOST_ONLY", "").strip() == "1"
            or environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip().upper() == "LOCALHOST"
        )

    def subscription(self, topic: str, kind: type[IdlStruct]) -> Subscription:
        """Subscribe to a topic.

        Args:
            topic: Its ROS name, such as /joint_states.
            kind: Type of its messages.

        Raises:
            BusError: not the name of a topic.
        """
        return Subscription(self._participant, Topic(self._participant, _dds_name(topic), kind))

    def publication(self, topic: str, kind: type[IdlStruct]) -> Publication:
        """Publish on a topic.

        Args:
            topic: Its ROS name.
            kind: Type of its messages.

        Raises:
            BusError: not the name of a topic.
        """
        return Publication(self._participant, Topic(self._participant, _dds_name(topic), kind))


class Subscription:
    """The messages of one topic, whether its publishers are reliable or offer best effort only.

    Args:
        participant: The process in the network.
    """

    def __init__(self, participant: DomainParticipant, topic: Topic[Any]) -> None:
        self._participant, self._topic = participant, topic
        self._open(Policy.Reliability.Reliable(duration(milliseconds=100)))

    def _open(self, reliability: Any) -> None:
        """Create the reader, instead of any earlier one."""
        self._reader: DataReader[Any] = DataReader(self._participant, self._topic, _quality(reliability, _RECEIVED))
        self._condition = ReadCondition(self._reader, SampleState.Any | ViewState.Any | InstanceState.Any)
        self._waiting = WaitSet(self._participant)
        self._waiting.attach(self._condition)

    def take(self, timeout_s: float) -> list[Any]:
        """The messages received since the last call, in order; waits for the first.

        Args:
            timeout_s: Longest wait.

        Raises:
            BusError: the middleware failed.
        """
        try:
            self._waiting.wait(duration(seconds=timeout_s))
            found = self._reader.take(_RECEIVED)
            # A reliable reader gets nothing from a publisher that offers best effort only.
            refused = self._reader.get_requested_incompatible_qos_status()  # type: ignore[no-untyped-call]
            if refused.total_count_change:
                self._open(Policy.Reliability.BestEffort)
        except DDSException as error:
            raise BusError(f"receiving from ROS 2 failed: {error}") from error
        return [message for message in found if message.sample_info.valid_data]

    def newly_lost(self) -> int:
        """Number of samples that were found lost since the last call."""
        status = self._reader.get_sample_lost_status()  # type: ignore[no-untyped-call]
        return max(int(status.total_count_change), 0)


class Publication:
    """A topic to publish on, reliably.

    Args:
        participant: The process in the network.
    """

    def __init__(self, participant: DomainParticipant, topic: Topic[Any]) -> None:
        reliability = Policy.Reliability.Reliable(duration(milliseconds=100))
        self._writer: DataWriter[Any] = DataWriter(participant, topic, _quality(reliability, _SENT))

    def send(self, message: IdlStruct) -> None:
        """Publish a message.

        Args:
            message: Of the topic's type.

        Raises:
            BusError: the middleware failed.
        """
        try:
            self._writer.write(message)
        except DDSException as error:
            raise BusError(f"publishing to ROS 2 failed: {error}") from error


def _quality(reliability: Any, depth: int) -> Qos:
    """Quality of service: what is sent later only, the last `depth` of it."""
    return Qos(reliability, Policy.Durability.Volatile, Policy.History.KeepLast(depth))


def _dds_name(topic: str) -> str:
    """Name of a ROS topic in DDS."""
    if not _NAME.fullmatch(topic):
        raise BusError(
            f"{topic!r} is not the full name of a ROS 2 topic; write it as `ros2 topic list` does: /joint_states"
        )
    return f"rt{topic}"
