"""Columns recognised by their names, and columns named by the user."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.column_names import arrays_by_name, columns_by_name
from armload_identification.recording.csv_columns import parse_columns
from armload_identification.recording.file_reading import read_recording_file
from tests.recording_files import table_columns

pytestmark = pytest.mark.pure

HERE = Path("log.csv")
DEGREE = np.pi / 180.0


def numbered(*patterns, joints=range(1, 7)):
    return [pattern.format(joint) for pattern in patterns for joint in joints]


RTDE = [
    "timestamp",
    *numbered(
        "target_q_{}",
        "target_qd_{}",
        "target_current_{}",
        "target_moment_{}",
        "actual_q_{}",
        "actual_qd_{}",
        "actual_current_{}",
        "actual_current_window_{}",
        "joint_control_output_{}",
        "actual_TCP_pose_{}",
        "actual_TCP_speed_{}",
        "joint_temperatures_{}",
        "actual_joint_voltage_{}",
        joints=range(6),
    ),
    "actual_execution_time",
    "speed_scaling",
    "target_speed_fraction",
    "actual_momentum",
    "runtime_state",
]


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        (
            RTDE,
            table_columns(
                "timestamp",
                numbered("actual_q_{}", joints=range(6)),
                numbered("actual_qd_{}", joints=range(6)),
                numbered("actual_current_{}", joints=range(6)),
            ),
        ),
        (
            ["t", *numbered("q{}", "dq{}", "tau{}", "tau_cmd{}")],
            table_columns("t", numbered("q{}"), numbered("dq{}"), torque=numbered("tau{}")),
        ),
        (
            ["Time [ms]", *numbered("J{} Position [deg]", "J{} Velocity [deg/s]", "J{} Current [mA]")],
            table_columns(
                "Time [ms]",
                numbered("J{} Position [deg]"),
                numbered("J{} Velocity [deg/s]"),
                numbered("J{} Current [mA]"),
                scale={"time_s": 1e-3, "position_rad": DEGREE, "velocity_rad_s": DEGREE, "current_a": 1e-3},
            ),
        ),
        (
            ["time_s", "i1", "i2", "q1", "q2"],
            table_columns("time_s", ["q1", "q2"], current=["i1", "i2"]),
        ),
        (
            ["wristPosition", "elbowPosition", "elbowTorque", "wristTorque", "Timestamp"],
            table_columns(
                "Timestamp",
                ["wristPosition", "elbowPosition"],
                torque=["wristTorque", "elbowTorque"],
                joint_names=("wrist", "elbow"),
            ),
        ),
        (
            ["timestamp_ns", "shoulder_joint.pos", "elbow_joint.pos", "shoulder_joint.effort", "elbow_joint.effort"],
            table_columns(
                "timestamp_ns",
                ["shoulder_joint.pos", "elbow_joint.pos"],
                torque=["shoulder_joint.effort", "elbow_joint.effort"],
                scale={"time_s": 1e-9},
                joint_names=("shoulder_joint", "elbow_joint"),
            ),
        ),
        (["t", "q[0]", "q[1]", "effort[0]"], table_columns("t", ["q[0]", "q[1]"])),
        (["t", "q2", "q1", "q10"], table_columns("t", ["q1", "q2", "q10"])),
    ],
    ids=["RTDE", "short", "units", "currents", "camel", "ros", "torque of one", "order"],
)
def test_columns_are_recognised(header, expected):
    found = columns_by_name(HERE, header)
    assert found.groups == expected.groups
    assert found.joint_names == expected.joint_names
    assert found.scale == pytest.approx(expected.scale)


@pytest.mark.parametrize(
    ("unit", "si"),
    [("s", 1.0), ("sec", 1.0), ("seconds", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("milli_s", 1e-3)],
)
@pytest.mark.parametrize("word", ["t", "time", "stamp", "timestamp"])
def test_times_are_recognised_with_their_units(word, unit, si):
    found = columns_by_name(HERE, [f"{word}_{unit}", "q1", "q2"])
    assert found.groups["time_s"] == [f"{word}_{unit}"]
    assert found.scale.get("time_s", 1.0) == pytest.approx(si)


@pytest.mark.parametrize(
    ("names", "quantity", "si"),
    [
        (["q1 [rad]", "q2 [rad]"], "position_rad", 1.0),
        (["angle 1 degrees", "angle 2 degrees"], "position_rad", DEGREE),
        (["theta_1_degree", "theta_2_degree"], "position_rad", DEGREE),
        (["qd1 [rad/s]", "qd2 [rad/s]"], "velocity_rad_s", 1.0),
        (["speed 1 rad per s", "speed 2 rad per s"], "velocity_rad_s", 1.0),
        (["joint1.velocity_rads", "joint2.velocity_rads"], "velocity_rad_s", 1.0),
        (["curr_1_amp", "curr_2_amp"], "current_a", 1.0),
        (["current 1 [A]", "current 2 [A]"], "current_a", 1.0),
        (["i_1 [mA]", "i_2 [mA]"], "current_a", 1e-3),
        (["tau1 (Nm)", "tau2 (Nm)"], "torque_nm", 1.0),
        (["moment_1_N_m", "moment_2_N_m"], "torque_nm", 1.0),
        (["trq1 [mNm]", "trq2 [mNm]"], "torque_nm", 1e-3),
    ],
)
def test_units_in_a_name_give_the_factor_to_si(names, quantity, si):
    positions = [] if quantity == "position_rad" else ["pos1", "pos2"]
    found = columns_by_name(HERE, ["t", *positions, *names])
    assert found.groups[quantity] == names
    assert found.scale.get(quantity, 1.0) == pytest.approx(si)


@pytest.mark.parametrize(
    "other",
    ["tau_error_{}", "tau_max_{}", "torque{}_limit", "tau_offset_{}", "tau_ref_{}", "tau_std_{}", "tcp_torque_{}"],
)
def test_what_was_not_measured_is_no_column_of_the_arm(other):
    names = [other.format(1), other.format(2)]
    assert "torque_nm" not in columns_by_name(HERE, ["t", "q1", "q2", *names]).groups
    both = columns_by_name(HERE, ["t", "q1", "q2", *names, "tau1", "tau2"])
    assert both.groups["torque_nm"] == ["tau1", "tau2"]


def test_of_several_times_the_first_kind_is_taken():
    found = columns_by_name(HERE, ["stamp", "t_ms", "time_us", "q1", "q2"])
    assert found.groups["time_s"] == ["time_us"]
    assert found.scale["time_s"] == pytest.approx(1e-6)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (["a", "b"], r"no time column can be recognised in the header a, b.*--columns"),
        (["q1", "q2"], "no time column"),
        (["t", "q1"], "no positions of two or more joints"),
        (["t", "left_q1", "left_q2", "right_q1", "right_q2"], "left_q1 and right_q1 could both be the position_rad"),
        (["t", "q1_deg", "q2_rad"], "q1_deg and q2_rad are the position_rad of two joints in different units"),
        (["t", "q1", "q2", "q3_deg"], "q1 and q3_deg are .* SI units are assumed"),
        (["t", "q1", "q2", "tau1_mNm", "tau2_Nm"], "tau1_mNm and tau2_Nm are the torque_nm of two joints"),
    ],
)
def test_what_is_not_clear_is_asked_for(header, said):
    with pytest.raises(RecordingError, match=said):
        columns_by_name(HERE, header)


def test_a_table_is_read_in_si_units(tmp_path):
    path = tmp_path / "log.csv"
    time_s = 0.01 * np.arange(50)
    position = np.column_stack([np.sin(time_s), np.cos(time_s)])
    rows = np.column_stack([1e3 * time_s, position / DEGREE, 1e3 * position])
    np.savetxt(path, rows, delimiter=",", header="time_ms,q1_deg,q2_deg,i1_mA,i2_mA", comments="")
    recording = read_recording_file(path)
    np.testing.assert_allclose(recording.time_s, time_s, atol=1e-12)
    np.testing.assert_allclose(recording.position_rad, position, atol=1e-12)
    np.testing.assert_allclose(recording.current_a, position, atol=1e-12)
    assert recording.joint_names == ()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("time=0 position=1-3 current=4-6", table_columns(0, [1, 2, 3], current=[4, 5, 6])),
        ("time=t position=q1-2 torque=tau1-2", table_columns("t", ["q1", "q2"], torque=["tau1", "tau2"])),
        ("torque=c,7 velocity=a,b position=x,y time=9", table_columns(9, ["x", "y"], ["a", "b"], torque=["c", 7])),
    ],
)
def test_columns_are_written_briefly(text, expected):
    assert parse_columns(text).groups == expected.groups


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("position=1-6", "lacks the time column or the positions"),
        ("time=0,1,2 position=1-6", "lacks the time column"),
        ("time=0 position", "'position' is invalid"),
        ("time=0 positon=1-6", "'positon=1-6' is invalid"),
        ("time=0 time=1 position=1", "'time=1' is invalid"),
        ("time=0 position=6-1", "'6-1' is empty"),
        ("time=0 position=1-999999999", "is empty"),
        ("time=0 position=1-6 torque=7-11", "6 of position, 5 of torque"),
    ],
)
def test_columns_that_cannot_be_understood_are_named(text, said):
    with pytest.raises(RecordingError, match=said):
        parse_columns(text)


@pytest.mark.parametrize(
    ("text", "factors"),
    [
        ("time[ms]=0 position[deg]=1-3 torque=4-6", {"time_s": 1e-3, "position_rad": DEGREE}),
        (
            "time[us]=0 position[°]=1-3 velocity[deg/s]=4-6",
            {"time_s": 1e-6, "position_rad": DEGREE, "velocity_rad_s": DEGREE},
        ),
        ("time[s]=0 position[rad]=1-3 current[mA]=4-6", {"current_a": 1e-3}),
        ("time=0 position=1-3 torque[N mm]=4-6", {"torque_nm": 1e-3}),
    ],
)
def test_units_can_be_said(text, factors):
    assert parse_columns(text).scale == pytest.approx(factors)


def test_seconds_and_nanoseconds_are_two_columns():
    assert parse_columns("time=0,1 position=2-3 torque=4-5").groups["time_s"] == [0, 1]


@pytest.mark.parametrize("text", ["time[h]=0 position=1-6", "time=0 position[counts]=1-6", "time=0 position[Nm]=1-2"])
def test_a_unit_that_is_not_known_is_named(text):
    with pytest.raises(RecordingError, match=r"unknown unit.* can be in"):
        parse_columns(text)


@given(
    st.sampled_from([1.0, 1e-3, 1e-6, 1e-9]),
    st.sampled_from([1.0, DEGREE]),
    st.permutations(range(1, 7)),
    st.booleans(),
)
def test_the_option_says_what_was_recognised(second, angle, order, nanoseconds):
    names = [f"c{i}" for i in range(14)]
    scale = {key: factor for key, factor in (("time_s", second), ("position_rad", angle)) if factor != 1.0}
    columns = table_columns(0, order, torque=list(range(7, 13)), scale=scale, nanoseconds=13 if nanoseconds else None)
    assert parse_columns(columns.option(names).split('"')[1]) == columns


ARM = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")


@pytest.mark.parametrize(
    "pattern", ["{}.position", "robot7/{}/position", "ur_{}_pos", "pos[{}]", "{}Position", "q {} (rad)"]
)
def test_the_arms_joints_come_before_numbers(pattern):
    """`wrist_1_joint.position` was joint 1."""
    names = ["t", *(pattern.format(name) for name in sorted(ARM))]
    found = columns_by_name(HERE, names, ARM)
    assert found.groups["position_rad"] == [pattern.format(name) for name in ARM]
    assert found.joint_names == ARM
    assert set(columns_by_name(HERE, names).groups["position_rad"]) == set(names[1:])


def test_the_shortest_end_that_no_other_joint_has_is_a_name():
    names = ["t", *(f"{name}.pos" for name in ("pan", "shoulder_lift", "elbow", "wrist1", "wrist2", "wrist-3"))]
    assert columns_by_name(HERE, names, ARM).groups["position_rad"] == names[1:]


def test_a_joint_before_the_arms_first_one_is_a_question_and_another_row_of_numbers_from_0_is_none():
    arm = [f"joint_{number}" for number in range(1, 4)]
    positions = [f"{name} position" for name in arm]
    with pytest.raises(RecordingError, match=r"joint_0 position may be the first joint, or none of joint_1"):
        columns_by_name(Path("a.csv"), ["t", "joint_0 position", *positions, *(f"{name} torque" for name in arm)], arm)
    numbered = ["t", *positions, *(f"dq{number}" for number in range(3)), *(f"{name} torque" for name in arm)]
    found = columns_by_name(Path("a.csv"), numbered, arm)
    assert found.groups["position_rad"] == positions
    assert "velocity_rad_s" not in found.groups
    assert found.joint_names == tuple(arm)


@pytest.mark.parametrize(
    ("first", "factor"),
    [
        (["time", "success_rate"], 1e-3),
        (["time", "field.header.seq"], 1e-9),
        (["time"], None),
        (["time [ms]", "success_rate"], 1e-3),
    ],
)
def test_a_time_without_a_unit_is_in_that_of_the_program_that_the_header_betrays(first, factor):
    """libfranka counts milliseconds, `rostopic echo -p` nanoseconds."""
    found = columns_by_name(Path("a.csv"), [*first, "q1", "q2", "tau1", "tau2"])
    assert found.scale.get("time_s") == factor


@pytest.mark.parametrize(
    ("header", "arm", "option"),
    [
        (["a", "b", "c", "d", "e", "f", "g"], (), "time=0 position=1-3 torque=4-6"),
        (["a", "b", "t", "c", "d"], (), "time=2 position=0-1 torque=3-4"),
        (["a", "b", "t", "c", "d", "e"], ("one", "two"), "time=2 position=0-1 torque=3-4"),
        (["q1", "q2", "tau1", "tau2"], (), "time=0 position=0-1 torque=2-3"),
        (["q1", "q2", "q3", "tau1", "tau2"], (), "time=0 position=0-2"),
        (["q1_deg", "q2_deg", "tau1", "tau2"], (), "time=0 position[deg]=0-1 torque=2-3"),
        (["q1_deg", "q2_rad", "tau1", "tau2", "x"], (), "time=0 position=1-2 torque=3-4"),
        (["t", "q1", "q2", "dq1", "dq2", "tau1_mNm", "tau2_Nm"], (), "time=0 position=1-2 velocity=3-4"),
    ],
)
def test_the_option_proposed_is_the_likeliest_meaning(header, arm, option):
    """Half the columns beside the time are positions, unless names say more; the arm's number of joints counts."""
    with pytest.raises(RecordingError) as caught:
        columns_by_name(HERE, header, arm)
    assert f'such as --columns "{option}", or a [log] table' in str(caught.value)


@pytest.mark.parametrize(
    ("header", "time", "nanoseconds"),
    [
        (["header.stamp.secs", "header.stamp.nsecs"], "header.stamp.secs", "header.stamp.nsecs"),
        (["stamp_ns", "stamp_s"], "stamp_ns", None),
        (["stamp_ms", "stamp_ns"], "stamp_ms", None),
        (["stamp_s", "header_stamp_ns"], "stamp_s", None),
        (["joint_time", "time"], "time", None),
        (["time", "time"], 0, None),
        (["x", "time"], "time", None),
    ],
)
def test_the_time_is_the_column_with_the_fewest_other_words_and_whole_seconds_have_nanoseconds(
    header, time, nanoseconds
):
    found = columns_by_name(HERE, [*header, "q1", "q2"])
    assert found.groups["time_s"] == [time] + [nanoseconds] * (nanoseconds is not None)


@pytest.mark.parametrize(
    ("others", "said"),
    [
        (["q1", "q1", "q2"], "q1 and q1 could both be the position_rad of one joint"),
        (
            ["q1", "q2", "tau1_percent", "tau2_percent"],
            "tau1_percent to tau2_percent have an unknown unit, known are Nm",
        ),
        (["q1", "q2", "motor_tau_1", "motor_tau_2"], "motor_tau_1 to motor_tau_2 may not be the torque_nm"),
        (["q1", "q2", "foo_tau_1", "foo_tau_2"], "foo_tau_1 to foo_tau_2 may not be the torque_nm of the joints"),
        (["q1", "q2", "foo_i_1", "foo_i_2"], "foo_i_1 to foo_i_2 may not be the current_a"),
        (["q1", "q2", "tau2", "tau3"], "q1 to q2 and tau2 to tau3 are not of the same joints"),
        (["q1", "q2", "tau1", "tau2", "tau3"], "q1 to q2 and tau1 to tau3 are not of the same joints"),
    ],
)
def test_a_torque_that_may_be_something_else_is_a_question(others, said):
    with pytest.raises(RecordingError, match=said):
        columns_by_name(HERE, ["t", *others])


@pytest.mark.parametrize(
    "others",
    [
        ["foo_qd_1", "foo_qd_2"],
        ["qd1_deg", "qd2_rad"],
        ["qd1_pct", "qd2_pct"],
        ["qd3", "qd4"],
    ],
)
def test_velocities_that_may_be_something_else_are_left_out(others):
    found = columns_by_name(HERE, ["t", "q1", "q2", *others, "tau1", "tau2"])
    assert ("velocity_rad_s" in found.groups, found.groups["torque_nm"]) == (False, ["tau1", "tau2"])


def test_motors_have_currents_but_the_positions_are_those_of_the_joints():
    motor = ["motor_q1", "motor_q2", "motor_current_1", "motor_current_2"]
    found = columns_by_name(HERE, ["t", *motor, "q1", "q2"])
    assert (found.groups["position_rad"], found.groups["current_a"]) == (["q1", "q2"], motor[2:])
    with pytest.raises(RecordingError, match="motor_q1 to motor_q2 may not be the position_rad"):
        columns_by_name(HERE, ["t", *motor])


@pytest.mark.parametrize(
    ("header", "joints"),
    [
        (["joint a position", "joint b position"], ("a", "b")),
        (["left arm a position", "left arm b position"], ("a", "b")),
        (["position left x 1", "position left y 2"], ("x_1", "y_2")),
        (["arm position", "arm hand position"], ("arm", "arm_hand")),
        (["q1 [actual]", "q2 [actual]"], ()),
        (["q1 [foo]", "q2 [foo]"], None),
    ],
)
def test_joints_are_called_by_the_words_that_tell_them_apart(header, joints):
    if joints is None:
        with pytest.raises(RecordingError, match=r"may not be the position_rad of the joints"):
            columns_by_name(HERE, ["t", *header])
    else:
        found = columns_by_name(HERE, ["t", *header])
        assert (found.groups["position_rad"], found.joint_names) == (header, joints)


@pytest.mark.parametrize(
    ("header", "fits"),
    [
        (["q0", "q1", "q2"], True),
        (["q1", "q2", "q3"], True),
        (["q1", "q3", "q4"], False),
        (["q1", "q2"], False),
        (["q1", "q2", "q3", "q4"], False),
    ],
)
def test_numbers_without_a_gap_are_the_joints_of_an_arm(header, fits):
    if fits:
        assert columns_by_name(HERE, ["t", *header], ("base", "elbow", "wrist")).groups["position_rad"] == header
    else:
        with pytest.raises(
            RecordingError, match=f"{', '.join(header)} may not be the arm's joints, base, elbow, wrist"
        ):
            columns_by_name(HERE, ["t", *header], ("base", "elbow", "wrist"))


def test_of_an_archives_arrays_the_first_known_name_of_each_quantity_is_used():
    assert arrays_by_name(["action", "q", "observation.state", "effort", "t"]) == {
        "time_s": "t",
        "position_rad": "observation.state",
        "torque_nm": "effort",
    }
