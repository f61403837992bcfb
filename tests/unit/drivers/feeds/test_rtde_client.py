"""RTDE with a controller on the loopback interface: the session, the cycles, and what goes wrong."""

from __future__ import annotations

import math
import socket
import struct
from itertools import islice

import pytest

from armload_drivers.driver_errors import BusError
from armload_drivers.feeds.rtde_client import RtdeClient
from tests.rtde_controller import Controller, row

POSITION, CURRENT = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6), (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


def cycles_of(controller):
    """All cycles until the controller closes the connection."""
    found = []
    with controller.listening() as address, RtdeClient(address) as client:
        with pytest.raises(BusError, match="closed the connection"):
            found.extend(client.cycles())
        return client.rate_hz, [cycle for cycle in found if cycle is not None]


@pytest.mark.parametrize("piece", [1, 7, 10_000])
def test_packages_become_cycles_however_they_are_cut(piece):
    moment = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    rows = [row(100.0 + 0.002 * k, POSITION, CURRENT, moment=moment) for k in range(5)]
    controller = Controller(rows, piece=piece)
    rate_hz, found = cycles_of(controller)
    assert rate_hz == 500.0
    assert [cycle.feedback.time_s for cycle in found] == pytest.approx([0.002 * k for k in range(5)])
    assert tuple(found[-1].feedback.position_rad) == POSITION
    assert tuple(found[-1].feedback.current_a) == CURRENT
    assert found[-1].told.mass_kg == 1.5
    assert found[-1].told.center_of_mass_m == (0.0, 0.1, 0.2)
    assert tuple(found[-1].target_torque_nm) == moment
    assert all(cycle.enabled and cycle.lost == 0 for cycle in found)


def test_only_outputs_are_requested_and_the_session_is_the_published_one():
    controller = Controller([row(0.0)])
    cycles_of(controller)
    assert [kind for kind, _ in controller.requests] == ["V", "v", "O", "S"]
    assert controller.requests[0][1] == struct.pack(">H", 2)
    assert struct.unpack_from(">d", controller.requests[2][1]) == (500.0,)


def test_older_controllers_send_125_times_a_second():
    controller = Controller([row(0.0)], version=(3, 15, 4, 0))
    assert cycles_of(controller)[0] == 125.0
    assert struct.unpack_from(">d", controller.requests[2][1]) == (125.0,)


def test_packages_that_the_controller_left_out_are_counted():
    _, found = cycles_of(Controller([row(time_s) for time_s in (0.0, 0.002, 0.010, 0.012)]))
    assert [cycle.lost for cycle in found] == [0, 0, 3, 0]


def test_without_released_brakes_the_motors_do_not_carry_the_arm():
    _, found = cycles_of(Controller([row(0.0, mode=5), row(0.002, mode=7)]))
    assert [cycle.enabled for cycle in found] == [False, True]


def test_a_controller_that_does_not_state_its_payload_is_read_without():
    controller = Controller([row(0.0)], lacks=("payload_cog", "target_moment"))
    _, found = cycles_of(controller)
    assert found[0].told is None
    assert found[0].target_torque_nm is None
    assert [kind for kind, _ in controller.requests] == ["V", "v", "O", "O", "S"]


@pytest.mark.parametrize(
    ("controller", "text"),
    [
        (Controller(accepts_version=False), "does not support RTDE version 2"),
        (Controller(lacks=("actual_current",)), r"does not send actual_current \(NOT_FOUND instead of VECTOR6D\)"),
        (Controller(starts=False), "does not start to send"),
        (Controller(version_bytes=2), "the controller's version has 2 bytes"),
    ],
)
def test_a_controller_that_cannot_be_used_is_refused(controller, text):
    with controller.listening() as address, pytest.raises(BusError, match=text):
        RtdeClient(address)


def test_a_data_package_of_another_length_is_an_error():
    cut = Controller([row(0.0)], cut=4)
    text = r"a data package of .* bytes instead of"
    with cut.listening() as address, RtdeClient(address) as client, pytest.raises(BusError, match=text):
        list(client.cycles())


@pytest.mark.parametrize("time_s", [math.nan, math.inf])
def test_a_package_without_a_time_is_an_error(time_s):
    controller = Controller([row(0.0), row(time_s)])
    with (
        controller.listening() as address,
        RtdeClient(address) as client,
        pytest.raises(BusError, match="without a time"),
    ):
        list(client.cycles())


def test_a_payload_that_is_not_a_number_was_not_told():
    _, found = cycles_of(Controller([row(0.0, payload_kg=math.nan), row(0.002, center_m=(0.0, math.inf, 0.0))]))
    assert [cycle.told for cycle in found] == [None, None]


def test_a_package_that_arrives_byte_by_byte_does_not_hold_the_program():
    controller = Controller([row(0.0), row(0.002)], piece=1, pause_s=0.004)
    with controller.listening() as address, RtdeClient(address) as client:
        first = list(islice(client.cycles(), 3))
    assert None in first


def test_no_connection_and_no_address_are_said():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(BusError, match=r"no connection to RTDE.*Settings > Security > Services"):
        RtdeClient(f"127.0.0.1:{port}")
    for host in ("", ":30004", "robot:port"):
        with pytest.raises(BusError, match="expected the name or address"):
            RtdeClient(host)


@pytest.mark.parametrize(("host", "address"), [("robot", ("robot", 30004)), ("10.0.0.7:30005", ("10.0.0.7", 30005))])
def test_the_port_is_rtdes_unless_another_is_given_and_five_seconds_are_waited(monkeypatch, host, address):
    asked = []

    def refuse(*values):
        asked.append(values)
        raise OSError("no")

    monkeypatch.setattr(socket, "create_connection", refuse)
    with pytest.raises(BusError, match=r"no connection to RTDE \(no\)"):
        RtdeClient(host)
    assert asked == [(address, 5.0)]
