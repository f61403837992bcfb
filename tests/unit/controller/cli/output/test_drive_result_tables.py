"""The tables of `armload drives`: nodes and safety properties."""

import io
from types import SimpleNamespace

import pytest
from rich.console import Console

from armload_controller.cli.console_text import fitted
from armload_controller.cli.output.drive_result_tables import (
    brake_table,
    bus_line,
    check_table,
    found_table,
    safety_table,
    status_table,
)
from armload_controller.session.brake_test import BrakeFinding
from armload_drivers.bring_up.drive_check import Check, Verdict
from armload_drivers.bring_up.inspection import ArmStatus, FoundNode
from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.cia402.drive_safety import Safety, SafetyFinding
from armload_drivers.cia402.emergency import error_text
from armload_drivers.cia402.state_machine import State


def shown(table):
    console = Console(file=io.StringIO(), width=400, markup=False)
    console.print(table)
    return console.file.getvalue()


def rows(text):
    return [[cell.strip() for cell in line.split("│")[1:-1]] for line in text.splitlines() if line.startswith("│")]


def report(number, findings):
    return SimpleNamespace(settings=SimpleNamespace(joint=f"joint_{number}", node_id=number), safety=findings)


def test_a_property_is_given_or_what_a_person_must_do_is_said():
    torque, lost = Safety.TORQUE_LIMIT, Safety.MASTER_LOST
    obstacles = (("6007 ...", "no 6007"), ("1029 ...", "no 1029:1"))
    findings = (
        SafetyFinding(Safety.TORQUE_LIMIT, torque.ways[1], False, (("6072", "no 6072"),)),
        SafetyFinding(Safety.MASTER_LOST, None, False, obstacles),
        SafetyFinding(Safety.MASTER_LOST, None, True, obstacles),
    )
    missing, accepted, given = rows(shown(safety_table([report(5, findings)])))
    assert given == ["joint_5 (5)", torque.title, "ok", f"{torque.ways[1].text}: {torque.ways[1].verified}"]
    reason = f"no 6007; no 1029:1. Consequence: {lost.lost}. {lost.remedy}"
    assert missing[2:] == ["missing", f'{reason}. Then name "master_lost" in accept_missing']
    assert accepted[2:] == ["accepted", reason]


def test_what_is_not_ok_is_first_and_equal_results_are_one_row_within_100_columns():
    drives = [report(i, (SafetyFinding(Safety.MASTER_LOST, None, i == 2, ()),)) for i in (1, 2, 3)]
    assert [row[0] for row in rows(shown(safety_table(drives)))] == ["joint_1 (1), joint_3 (3)", "joint_2 (2)"]
    steps = [Check(f"joint_{i}", i, step, Verdict.OK, "") for i in (1, 2) for step in ("answers", "modes")]
    steps += [
        Check("joint_3", 3, "answers", Verdict.WRONG, "no answer"),
        Check("joint_3", 3, "modes", Verdict.NOT_DONE, ""),
    ]
    table = check_table(steps)
    assert [row[:3] for row in rows(shown(table))] == [
        ["joint_3 (3)", "answers", Verdict.WRONG.value],
        ["joint_3 (3)", "modes", Verdict.NOT_DONE.value],
        ["joint_1 (1), joint_2 (2)", "answers", "ok"],
        ["joint_1 (1), joint_2 (2)", "modes", "ok"],
    ]
    narrow = Console(file=io.StringIO(), width=100)
    (part,) = fitted(safety_table(drives), narrow)
    narrow.print(part)
    assert max(map(len, narrow.file.getvalue().splitlines())) <= 100


def test_a_node_that_is_no_drive_shows_its_device_type():
    nodes = [
        FoundNode(3, 0x0002_0192, "servo", Identity(1, 2), (7, 8), ("master_lost",)),
        FoundNode(9, 0x0022_0811, "", Identity(1, 2), (), ()),
    ]
    drive, other = rows(shown(found_table(nodes)))
    assert (drive[1], drive[5:]) == ("servo", ["IP CSP", "master_lost"])
    assert (other[1], other[6]) == ("unnamed, not a CiA 402 drive: device type 0x00220811", "-")


def test_a_brake_holds_or_does_not_or_was_not_tried():
    found = [
        BrakeFinding("base", tried_nm=0.0, response=0.0, moved_rad=0.0),
        BrakeFinding("elbow", tried_nm=12.34, response=0.987, moved_rad=0.00012),
        BrakeFinding("wrist", tried_nm=2.0, response=1.0, moved_rad=0.25),
    ]
    assert rows(shown(brake_table(found))) == [
        ["base", "", "", "", "not tried: no brake, or no 60B2"],
        ["elbow", "12.3", "99 %", "0.0001", "holds"],
        ["wrist", "2.0", "100 %", "0.2500", "does not hold"],
    ]


def status(**changes):
    given = {"state": State.SWITCH_ON_DISABLED, "position_rad": -0.000001, "effort": 1.5, "effort_unit": "A"}
    given |= {"error_code": None, "temperature_celsius": None, "trouble": ""}
    return SimpleNamespace(joint="elbow", node_id=3, **given | changes)


@pytest.mark.parametrize(
    ("changes", "cells"),
    [
        ({}, [State.SWITCH_ON_DISABLED.title, "+0.00000", "+1.500 A", "-"]),
        ({"position_rad": None, "effort": None}, [State.SWITCH_ON_DISABLED.title, "-", "-", "-"]),
        ({"state": None, "trouble": "no answer"}, ["?", "", "", "no answer"]),
        ({"error_code": 0x2310}, [State.SWITCH_ON_DISABLED.title, "+0.00000", "+1.500 A", error_text(0x2310)]),
    ],
)
@pytest.mark.parametrize("celsius", [None, 41.6])
def test_what_a_drive_does_not_report_is_a_dash_and_a_column_nobody_fills_is_not_there(changes, cells, celsius):
    drives = [status(**changes)] + ([status(temperature_celsius=celsius)] if celsius else [])
    first, *others = rows(shown(status_table(ArmStatus(tuple(drives), None, 0, False))))
    silent = changes.get("state", "") is None
    warm = [] if celsius is None else [""] if silent else ["-"]
    assert first == ["elbow", "3", *cells[:3], *warm, cells[3]]
    assert [row[5] for row in others] == (["42"] if celsius else [])


@pytest.mark.parametrize(
    ("load", "passive", "line"),
    [
        (0.1234, False, "bus load 12.3 %, 4 error frames"),
        (0.0, True, "bus load 0.0 %, 4 error frames, error passive"),
        (None, False, "EtherCAT: drives in PREOP, no process data"),
    ],
)
def test_the_bus_is_a_line(load, passive, line):
    assert bus_line(ArmStatus((), load, 4, passive)) == line


def test_modes_are_shown_by_their_short_names_and_twins_counted():
    """CiA 402-2, 6060; 2 is velocity mode of frequency converters, which no arm uses."""
    modes = (1, 2, 3, 4, 6, 7, 8, 9, 10)
    node = FoundNode(3, 0x0002_0192, "", Identity(None, 0x12), modes, (), twins=1)
    (cells,) = rows(shown(found_table([node])))
    assert cells[1:3] == ["CiA 402 drive; 2 nodes have this id: give each its own", "-"]
    assert cells[3:] == ["0x00000012", "-", "PP 2 PV PT HM IP CSP CSV CST", "nothing"]
