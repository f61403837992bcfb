"""DDS on the loopback interface: what is published arrives, from publishers of either reliability."""

from __future__ import annotations

import os

import pytest

pytest.importorskip("cyclonedds", reason="needs the extra ros2")

from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic

from armload_drivers.driver_errors import BusError
from armload_drivers.feeds.ros2_messages import Header, JointState, Stamp
from armload_drivers.feeds.ros2_participant import Ros2Participant

DOMAIN = 100 + os.getpid() % 100
"""One per process, so that tests in parallel do not hear each other."""


@pytest.fixture(scope="module")
def participant():
    return Ros2Participant({"ROS_DOMAIN_ID": str(DOMAIN), "ROS_LOCALHOST_ONLY": "1"})


def state(number):
    return JointState(Header(Stamp(number, 5), "base"), ["elbow"], [0.5], [], [1.5])


def received(subscription, send, wanted):
    """Send again and again until something arrives: two nodes discover each other after a while."""
    found = []
    for number in range(200):
        send(state(number))
        found += subscription.take(0.05)
        if len(found) >= wanted:
            return found
    raise AssertionError(f"{len(found)} messages of {wanted}")


def test_what_is_published_arrives(participant):
    publication = participant.publication("/arm/joint_states", JointState)
    found = received(participant.subscription("/arm/joint_states", JointState), publication.send, 3)
    stamps = [message.header.stamp.sec for message in found]
    assert stamps == sorted(set(stamps))
    assert found[0] == state(stamps[0])


def test_a_publisher_of_best_effort_is_heard(participant):
    subscription = participant.subscription("/quick/joint_states", JointState)
    topic = Topic(participant._participant, "rt/quick/joint_states", JointState)
    writer = DataWriter(participant._participant, topic, Qos(Policy.Reliability.BestEffort))
    found = received(subscription, writer.write, 3)
    assert found[-1].name == ["elbow"]
    assert subscription.newly_lost() == 0


@pytest.mark.parametrize("domain", ["233", "-1", "seven"])
def test_a_domain_that_does_not_exist_is_refused(domain):
    with pytest.raises(BusError, match=rf"ROS_DOMAIN_ID={domain}: expected a whole number from 0 to 232"):
        Ros2Participant({"ROS_DOMAIN_ID": domain})


@pytest.mark.parametrize("topic", ["joint_states", "/", "/joint states", "/1st"])
def test_what_is_no_topic_is_refused(participant, topic):
    with pytest.raises(BusError, match="not the full name of a ROS 2 topic"):
        participant.subscription(topic, JointState)


@pytest.mark.parametrize(
    ("environment", "local"),
    [
        ({}, False),
        ({"ROS_LOCALHOST_ONLY": "0"}, False),
        ({"ROS_LOCALHOST_ONLY": "1"}, True),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "localhost"}, True),
    ],
)
def test_the_environment_says_who_is_reached(environment, local):
    assert Ros2Participant.is_local(environment) is local
