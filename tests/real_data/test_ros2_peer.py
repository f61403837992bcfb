"""A minute of `armload watch --ros2` at 250 Hz, published and subscribed by another implementation of DDS."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

pytest.importorskip("cyclonedds", reason="needs the extra ros2")

from benchmarks.live.ros2_feed import watched_feed

DURATION_S, RATE_HZ = 60.0, 250.0


@pytest.fixture
def peer(shared_data):
    path = os.environ.get("ARMLOAD_ROS2_PEER")
    if path is None:
        pytest.skip("ARMLOAD_ROS2_PEER does not name the program that cargo builds in tests/ros2_peer")
    return Path(path)


@pytest.mark.long
@pytest.mark.timeout(400)
def test_a_minute_of_another_ros_2_node(peer, tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.setenv("ROS_DOMAIN_ID", "93")
    found = watched_feed(peer, DURATION_S, RATE_HZ, tmp_path, "best_effort")
    assert found.published - found.received <= found.lost + 1
    assert found.lost <= 0.01 * found.published
    assert len(found.moments) >= DURATION_S - 1, "an estimate every second"
    assert found.apart <= 1e-9
    payloads = [line.split() for line in found.lines if line.startswith("payload ")]
    assert len(payloads) > 0.5 * DURATION_S
    assert payloads[-1][2] == "flange"
    assert float(payloads[-1][3]) in {m.payload.mass_kg for m in found.moments}
    assert any(line.startswith("state 0 armload: payload of ur10e: 2.") for line in found.lines)
