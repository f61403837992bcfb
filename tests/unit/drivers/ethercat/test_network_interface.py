"""Which network interfaces may carry EtherCAT; nothing is sent."""

import socket

import pytest

from armload_drivers.driver_errors import BusError, ForeignMaster
from armload_drivers.ethercat.network_interface import claimed, is_running, require_unused


def test_an_interface_that_is_not_there_is_named_with_those_that_are():
    with pytest.raises(BusError, match="no network interface eth99") as raised:
        require_unused("eth99")
    assert all(name in str(raised.value) for _, name in socket.if_nameindex())
    assert not is_running("eth99")


def test_an_interface_that_carries_an_address_is_refused():
    """Loopback has one on every computer."""
    with pytest.raises(BusError, match=r"127\.0\.0\.1") as raised:
        require_unused("lo")
    assert "ip address flush dev lo" in str(raised.value)
    assert "ip route flush dev lo" in str(raised.value)


def test_two_masters_of_one_interface_are_told_apart_from_two_interfaces():
    refused = pytest.raises(ForeignMaster, match="another armload uses interface eth1")
    with claimed("eth1"), claimed("eth2"), refused, claimed("eth1"):
        pass
    with claimed("eth1"):
        pass
