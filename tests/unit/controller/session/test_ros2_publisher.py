"""What is published of a moment: only what is determined, and the state in words."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="needs the extra ros2")

from armload_controller.analysis.payload_events import PayloadEvent
from armload_controller.analysis.payload_watch import HeardBus, WatchedMoment
from armload_controller.session.ros2_publisher import PayloadPublisher, node_name
from tests.live_estimates import live_estimate

BUS = HeardBus(100, (0,) * 6, True, 0.0, 3)
FOUND = live_estimate(6, 2.5, 0.1, (0.01, 0.02, 0.03), time_s=4.0)


class Network:
    """Keeps what is sent, by topic."""

    def __init__(self):
        self.sent = {}

    def publication(self, topic, kind):
        self.sent[topic] = []
        return type("Kept", (), {"send": lambda _, message: self.sent[topic].append(message)})()


@pytest.fixture
def network():
    return Network()


@pytest.fixture
def publisher(network):
    return PayloadPublisher(
        network, "my arm", lambda time_s: 1_000_000_000 + round(1e9 * time_s), lambda: 7_000_000_001
    )


def test_a_determined_payload_is_published_in_the_flange_frame(publisher, network):
    determined = np.array([True, True, True, False])
    event = PayloadEvent(3.5, "grasped", 2.4)
    publisher.publish(WatchedMoment(4.0, replace(FOUND, determined=determined), (event,), BUS))
    (sent,) = network.sent["/armload/my_arm/payload"]
    assert (sent.header.stamp.sec, sent.header.stamp.nanosec, sent.header.frame_id) == (5, 0, "flange")
    assert (sent.inertia.m, sent.inertia.com.x, sent.inertia.com.y) == (2.5, 0.01, 0.02)
    assert math.isnan(sent.inertia.com.z)
    assert math.isnan(sent.inertia.ixx)
    (text,) = network.sent["/armload/my_arm/events"]
    assert json.loads(text.data) == asdict(event)
    ((status,),) = [array.status for array in network.sent["/diagnostics"]]
    values = {each.key: json.loads(each.value) for each in status.values}
    assert (status.level, status.message, status.hardware_id) == (0, "2.500 +- 0.100 kg", "my arm")
    assert (values["half_width_95_kg"], values["lost"]) == (0.1, 3)


@pytest.mark.parametrize(
    ("found", "bus", "level", "message"),
    [
        (replace(FOUND, determined=np.zeros(4, dtype=bool)), BUS, 0, "not determined yet"),
        (replace(FOUND, moving_s=np.ones(6)), BUS, 0, "not determined yet"),
        (FOUND, replace(BUS, silent_s=7.0), 3, "no joint states for 7 s"),
        (FOUND, replace(BUS, cycles=0), 3, "no joint states yet"),
        (None, BUS, 0, "recording"),
    ],
)
def test_nothing_undetermined_or_old_is_published_as_a_payload(publisher, network, found, bus, level, message):
    publisher.publish(WatchedMoment(4.0, found, (), bus))
    assert not network.sent["/armload/my_arm/payload"]
    ((status,),) = [array.status for array in network.sent["/diagnostics"]]
    assert (status.level, status.message) == (level, message)


def test_before_the_first_joint_state_the_clock_is_the_stamp(publisher, network):
    publisher.publish(WatchedMoment(None, replace(FOUND, moving_s=np.zeros(6)), (), replace(BUS, cycles=0)))
    assert not network.sent["/armload/my_arm/payload"]
    (array,) = network.sent["/diagnostics"]
    assert (array.header.stamp.sec, array.header.stamp.nanosec) == (7, 1)
    assert (array.status[0].level, array.status[0].message) == (3, "no joint states yet")


def test_contact_is_a_warning(publisher, network):
    publisher.publish(WatchedMoment(4.0, replace(FOUND, contact=True), (), BUS))
    assert network.sent["/diagnostics"][0].status[0].level == 1


def test_names_of_robots_become_names_of_nodes():
    assert [node_name(name) for name in ("ur10e", "my arm-2", "7dof")] == ["ur10e", "my_arm_2", "arm_7dof"]
