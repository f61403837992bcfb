"""Recordings of an arm as other programs write them, by their public sources or documentation.

A dialect writes a run: (N,) times, (N, n) positions, velocities and torques, and the names of the arm's joints.
"""

import json
from dataclasses import dataclass

import numpy as np

DEGREE = np.pi / 180.0
EPOCH_S = 1_700_000_000
START_S = EPOCH_S + 0.25
ARMS = {
    "UR": (
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ),
    "Panda": tuple(f"panda_joint{i}" for i in range(1, 8)),
    "xArm": tuple(f"joint{i}" for i in range(1, 7)),
    "iiwa": tuple(f"lbr_iiwa_joint_{i}" for i in range(1, 8)),
}
"""Names of the joints in the makers' URDFs, base first."""


@dataclass(frozen=True, eq=False)
class Run:
    """A run, times from 0."""

    time_s: np.ndarray
    position_rad: np.ndarray
    velocity_rad_s: np.ndarray
    torque_nm: np.ndarray
    names: tuple


def urdf_of(names):
    """An arm with these joints, whose axes change between z and y, as those of most arms do."""
    links = "".join(
        f'<link name="link_{i}"><inertial><origin xyz="0 0.01 0.1"/><mass value="{6.0 / (i + 1):.3f}"/>'
        '<inertia ixx="0.03" iyy="0.03" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for i in range(len(names) + 1)
    )
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="link_{i}"/><child link="link_{i + 1}"/>'
        f'<origin xyz="0 0.02 0.25"/><axis xyz="{"0 1 0" if i % 2 else "0 0 1"}"/>'
        '<limit lower="-2.8" upper="2.8" velocity="3" effort="300"/></joint>'
        for i, name in enumerate(names)
    )
    return f'<robot name="arm">{links}{joints}</robot>'


def written(path, header, columns, separator=",", comma=False, form="{:.12g}"):
    """Write a table of numbers or texts."""
    rows = [header] if header else []
    for row in zip(*columns, strict=True):
        fields = [value if isinstance(value, str) else form.format(value) for value in row]
        rows.append([field.replace(".", ",") for field in fields] if comma else fields)
    path.write_text("\n".join(separator.join(row) for row in rows) + "\n", encoding="utf-8")
    return path


def numbered(pattern, run, first=0):
    return [pattern.format(i) for i in range(first, first + len(run.names))]


def named(pattern, run, names=None):
    return [pattern.format(name) for name in names or run.names]


def stamps(run):
    return START_S + run.time_s


def columns(run, time=None, position=1.0, torque=1.0):
    return [run.time_s if time is None else time, *run.position_rad.T * position, *run.torque_nm.T * torque]


def full(run, time=None, angle=1.0):
    """Time, positions, velocities, torques."""
    arrays = (run.position_rad * angle, run.velocity_rad_s * angle, run.torque_nm)
    return [run.time_s if time is None else time, *(column for array in arrays for column in array.T)]


def rtde_recorder(run, path):
    """UniversalRobots/RTDE_Python_Client_Library, rtde/csv_writer.py (0ca7f26): spaces, name_index; PolyScope 5.23."""
    names = ["timestamp", *numbered("target_q_{}", run), *numbered("actual_q_{}", run), *numbered("actual_qd_{}", run)]
    names += [*numbered("actual_current_{}", run), *numbered("actual_current_as_torque_{}", run)]
    values = [run.time_s, *(run.position_rad + 0.01).T, *full(run)[1 : 1 + 2 * len(run.names)]]
    return written(path, names, [*values, *(run.torque_nm / 10.0).T, *run.torque_nm.T], " ")


def ur_rtde(run, path):
    """sdurobotics/ur_rtde, RTDEReceiveInterface::startFileRecording, documented in its guide "Record Data Example"."""
    names = ["timestamp", *numbered("target_q_{}", run), *numbered("target_moment_{}", run)]
    names += [
        *numbered("actual_q_{}", run),
        *numbered("actual_qd_{}", run),
        *numbered("actual_current_as_torque_{}", run),
    ]
    targets = [*(run.position_rad + 0.01).T, *(0.9 * run.torque_nm).T]
    return written(path, names, [run.time_s, *targets, *full(run)[1:]])


def plotjuggler(run, path):
    """facontidavide/PlotJuggler: CSV export, `__time` first; its joint state parser makes /topic/joint/position."""
    names = ["__time", "/joint_states/header/stamp"]
    names += [f"/joint_states/{name}/{what}" for name in run.names for what in ("effort", "position", "velocity")]
    values = np.stack([run.torque_nm, run.position_rad, run.velocity_rad_s], axis=2).reshape(len(run.time_s), -1)
    return written(path, names, [stamps(run), stamps(run), *values.T])


def foxglove(run, path):
    """A series for each joint as Foxglove's converter to tables names them: /joint_states/<joint>/position."""
    kinds = ("position", "velocity", "effort")
    names = ["timestamp", *(f"/joint_states/{name}/{what}" for what in kinds for name in sorted(run.names))]
    order = np.argsort(run.names)
    arrays = (run.position_rad, run.velocity_rad_s, run.torque_nm)
    return written(path, names, [stamps(run), *(column for array in arrays for column in array[:, order].T)])


def ros2_echo(run, path):
    """ros2/ros2cli, ros2topic/verb/echo.py (00fb659): `ros2 topic echo --csv`, no header, joints sorted by name."""
    order = np.argsort(run.names)
    ticks = np.round(run.time_s * 1e9).astype(np.int64) + 250_000_000
    texts = [[str(EPOCH_S + tick // 10**9) for tick in ticks], [str(tick % 10**9) for tick in ticks]]
    texts += [["base_link"] * len(ticks), *([run.names[i]] * len(ticks) for i in order)]
    arrays = (run.position_rad, run.velocity_rad_s, run.torque_nm)
    return written(path, None, [*texts, *(column for array in arrays for column in array[:, order].T)])


def rostopic(run, path):
    """ros/ros_comm, tools/rostopic: `rostopic echo -p`, times in ns, field.position0."""
    ticks = [str(round(value * 1e9)) for value in stamps(run)]
    names = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id", *numbered("field.name{}", run)]
    names += [*numbered("field.position{}", run), *numbered("field.velocity{}", run), *numbered("field.effort{}", run)]
    values = [ticks, [str(k) for k in range(len(ticks))], ticks, [""] * len(ticks)]
    return written(path, names, [*values, *([name] * len(ticks) for name in run.names), *full(run)[1:]])


def bagpy(run, path):
    """jmscslgroup/bagpy, bagreader.py: message_by_topic, Time of the bag, arrays as position_0."""
    names = [
        "Time",
        "header.seq",
        "header.stamp.secs",
        "header.stamp.nsecs",
        "header.frame_id",
        *numbered("name_{}", run),
    ]
    names += [*numbered("position_{}", run), *numbered("velocity_{}", run), *numbered("effort_{}", run)]
    ticks = np.round(run.time_s * 1e9).astype(np.int64) + 250_000_000
    head = [stamps(run), np.arange(len(ticks)), EPOCH_S + ticks // 10**9, ticks % 10**9, ["''"] * len(ticks)]
    return written(path, names, [*head, *([name] * len(ticks) for name in run.names), *full(run)[1:]])


def pandas_of_a_bag(run, path):
    """rosbags-dataframe's names (rosbag to pandas), and the nameless index that `DataFrame.to_csv` writes first."""
    names = ["", "header.stamp.sec", "header.stamp.nanosec"]
    names += [f"{kind}.{name}" for kind in ("position", "velocity", "effort") for name in run.names]
    ticks = np.round(run.time_s * 1e9).astype(np.int64) + 250_000_000
    return written(path, names, [np.arange(len(ticks)), EPOCH_S + ticks // 10**9, ticks % 10**9, *full(run)[1:]])


def pandas_of_dates(run, path):
    """`DataFrame.to_csv` of a frame with dates as its nameless index and columns of two levels (pandas 3.1)."""
    names = [*named("position.{}", run), *named("effort.{}", run)]
    times = np.datetime64(EPOCH_S, "s") + np.round(run.time_s * 1e6).astype("timedelta64[us]")
    written(path, ["", *names], columns(run, [str(time).replace("T", " ") for time in times]))
    rows = path.read_text().partition("\n")[2]
    levels = zip(*(name.split(".") for name in names), strict=True)
    path.write_text("".join(f",{','.join(level)}\n" for level in levels) + rows)
    return path


def german_excel(run, path):
    """Excel in German: semicolons, decimal comma, and the words a German engineer uses."""
    names = ["Zeit [ms]", *numbered("Achse {} Position [°]", run, 1), *numbered("Achse {} Drehmoment [Nm]", run, 1)]
    return written(path, names, columns(run, 1e3 * run.time_s, 1.0 / DEGREE), ";", comma=True)


def french_excel(run, path):
    """Excel in French: semicolons, decimal comma."""
    names = ["Temps [s]", *numbered("Axe {} position [degré]", run, 1), *numbered("Axe {} couple mesuré [N·m]", run, 1)]
    return written(path, names, columns(run, None, 1.0 / DEGREE), ";", comma=True)


def excel_text(run, path):
    """Excel's "Text (tab delimited)" from a German list, in its 8-bit code page."""
    names = ["Zeit (s)", *numbered("Winkel A{} (°)", run, 1), *numbered("Moment A{} (Nm)", run, 1)]
    written(path, names, columns(run, None, 1.0 / DEGREE), "\t", comma=True)
    path.write_bytes(path.read_text(encoding="utf-8").encode("cp1252"))
    return path


def libfranka(run, path):
    """frankaemika/libfranka, src/log.cpp (5b7e8cf), logToCSV: time in ms, and what was commanded beside it."""
    names = ["time", " success_rate", *numbered(" state.q[{}]", run), *numbered(" state.q_d[{}]", run)]
    names += [*numbered(" state.dq[{}]", run), *numbered(" state.dq_d[{}]", run), *numbered(" state.tau_J[{}]", run)]
    names += [*numbered(" state.tau_ext_hat_filtered[{}]", run), *numbered(" cmd.q_d[{}]", run)]
    names += numbered(" cmd.tau_J_d[{}]", run)
    q, dq, tau = run.position_rad, run.velocity_rad_s, run.torque_nm
    arrays = (q, q + 0.01, dq, dq + 0.01, tau, 0.1 * tau, q + 0.02, 0.5 * tau)
    head = [1e3 * run.time_s, np.ones(len(q))]
    return written(path, names, [*head, *(column for array in arrays for column in array.T)])


def matlab_table(run, path):
    """MATLAB's writetable: a variable of several columns becomes name_1, name_2 (doc of writetable)."""
    names = ["t", *numbered("q_{}", run, 1), *numbered("qd_{}", run, 1), *numbered("tau_{}", run, 1)]
    return written(path, names, full(run))


def matlab_timetable(run, path):
    """MATLAB's writetimetable: row times with their unit, "0.01 sec" (doc of writetimetable)."""
    names = ["Time", *numbered("q_{}", run, 1), *numbered("tau_{}", run, 1)]
    return written(path, names, columns(run, [f"{value:.6f} sec" for value in run.time_s]))


def lerobot(run, path):
    """huggingface/lerobot, data set v3: observation.state with names "elbow_flex.pos", in degrees if so configured."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder = path.with_suffix("")
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    names = [f"{name}.pos" for name in run.names]
    features = {
        "observation.state": {"dtype": "float32", "shape": [len(names)], "names": names},
        "observation.effort": {"dtype": "float32", "shape": [len(names)], "names": names},
    }
    (folder / "meta" / "info.json").write_text(json.dumps({"codebase_version": "v3.0", "features": features}))
    table = {
        "observation.state": pa.array((run.position_rad / DEGREE).tolist(), pa.list_(pa.float64(), len(names))),
        "observation.effort": pa.array(run.torque_nm.tolist(), pa.list_(pa.float64(), len(names))),
        "timestamp": run.time_s,
        "episode_index": np.zeros(len(run.time_s), dtype=np.int64),
    }
    pq.write_table(pa.table(table), folder / "data" / "chunk-000" / "file-000.parquet")
    return folder


def namespaced(run, path):
    """Two robots' namespaces, numbered; this table has the second (ROS names, REP 144 and ros2_control interfaces)."""
    kinds = ("position", "velocity", "effort")
    names = ["time", *(f"/robot2/{name}/{what}" for what in kinds for name in run.names)]
    return written(path, names, full(run, stamps(run)))


def numbered_namespace(run, path):
    """A namespace with a number before joints that are numbered too."""
    kinds = ("position", "effort")
    names = ["time_s", *(f"cell_3.arm_1.axis{i}.{what}" for what in kinds for i in range(1, len(run.names) + 1))]
    return written(path, names, columns(run))


def ros2_control(run, path):
    """ros2_control's joint_state_broadcaster interfaces, `<joint>/position`, as its CSV tools name them."""
    kinds = ("position", "velocity", "effort")
    names = ["timestamp_ns", *(f"{name}/{what}" for what in kinds for name in run.names)]
    return written(path, names, full(run, [str(round(value * 1e9)) for value in stamps(run)]))


def sunrise(run, path):
    """KUKA Sunrise DataRecorder: "%" before the header, spaces, ZeitInSec and ZeitInNanoSec, axisQMsr_<robot>[0]."""
    ticks = np.round(run.time_s * 1e9).astype(np.int64) + 250_000_000
    names = ["%ZeitInSec", "ZeitInNanoSec", *numbered("axisQMsr_LBR_iiwa_7_R800_1[{}]", run)]
    names += numbered("axisTauMsr_LBR_iiwa_7_R800_1[{}]", run)
    return written(path, names, [EPOCH_S + ticks // 10**9, ticks % 10**9, *columns(run)[1:]], " ")


def techman(run, path):
    """TechmanRobotInc/tmr_ros2's demo of the feedback state: time_stamp, joint_pos_1, joint_vel_1, joint_tor_1."""
    names = ["time_stamp", *numbered("joint_pos_{}", run, 1), *numbered("joint_vel_{}", run, 1)]
    return written(path, [*names, *numbered("joint_tor_{}", run, 1)], full(run))


def numpy_savetxt(run, path):
    """numpy.savetxt with a header: "# " before it, spaces between numbers (its documentation)."""
    names = ["# t", *numbered("q{}", run, 1), *numbered("dq{}", run, 1), *numbered("tau{}", run, 1)]
    return written(path, names, full(run), " ", form="{:.18e}")


def grafana(run, path):
    """Grafana's CSV download: quoted fields, date and time."""
    names = ['"Time"', *named('"{} position"', run), *named('"{} effort"', run)]
    times = np.datetime64(EPOCH_S, "s") + np.round(run.time_s * 1e6).astype("timedelta64[us]")
    texts = [f'"{str(time).replace("T", " ")}"' for time in times]
    return written(path, names, columns(run, texts), form='"{:.12g}"')


def units_below(run, path):
    """A line of units below the names, as many loggers write it, after a comment of the program."""
    names = ["Time", *numbered("J{} Angle", run, 1), *numbered("J{} Torque", run, 1)]
    units = ["ms", *["deg"] * len(run.names), *["Nm"] * len(run.names)]
    written(path, names, columns(run, 1e3 * run.time_s, 1.0 / DEGREE), "\t")
    head, _, rows = path.read_text().partition("\n")
    path.write_text("Logged by the cell's data logger\n" + head + "\n" + "\t".join(units) + "\n" + rows)
    return path


def controller_state(run, path):
    """joint_trajectory_controller's state as PlotJuggler flattens it: reference, feedback and error by index."""
    topic, kinds = "/joint_trajectory_controller/controller_state", ("positions", "velocities", "effort")
    parts = [f"{part}/{kind}[{{}}]" for part in ("reference", "feedback", "error") for kind in kinds]
    names = ["__time", *(name for part in parts for name in numbered(f"{topic}/{part}", run))]
    q, dq, tau = run.position_rad, run.velocity_rad_s, run.torque_nm
    arrays = (q + 0.01, dq + 0.01, 0.9 * tau, q, dq, tau, np.full_like(q, 0.01), np.full_like(q, 0.01), 0.1 * tau)
    return written(path, names, [stamps(run), *(column for array in arrays for column in array.T)])


DIALECTS = {
    dialect.__name__: dialect
    for dialect in (
        *(rtde_recorder, ur_rtde, plotjuggler, foxglove, ros2_echo, rostopic, bagpy, pandas_of_a_bag, pandas_of_dates),
        *(
            german_excel,
            french_excel,
            excel_text,
            libfranka,
            matlab_table,
            matlab_timetable,
            lerobot,
            namespaced,
            numbered_namespace,
        ),
        *(ros2_control, controller_state, sunrise, techman, numpy_savetxt, grafana, units_below),
    )
}


STYLES = (("q_{}", "dq_{}", "tau_{}"), ("Joint {} Position{}", "Joint {} Velocity{}", "Joint {} Torque{}"))
"""How an ambiguous table names positions, velocities and torques."""


def ambiguous_tables(names):
    """Headers and factors of tables that can be understood in more than one way, by what is unclear.

    Args:
        names: Names of the arm's joints.

    Yields:
        What is unclear, names of the columns, and factors of time, positions, velocities and torques.
    """
    n = len(names)
    one, zero = range(1, n + 1), range(n)

    def table(q, dq, tau, index=one, time="t", factors=(1.0, 1.0, 1.0, 1.0)):
        return [time, *(pattern.format(i) for pattern in (q, dq, tau) for i in index)], factors

    for style in ("{}_{{}}", "robot.{}[{{}}]"):
        q, dq, tau = (style.format(word) for word in ("q", "dq", "tau"))
        yield "percent", *table(q, dq, tau + " [%]")
        yield "permille", *table(q, dq, tau + "_permille")
        yield "counts", *table(q + " [counts]", dq, tau)
        yield "foot pounds", *table(q, dq, tau + " [lbf ft]")
        yield "degrees, unstated", *table(q, dq, tau, factors=(1.0, 1.0 / DEGREE, 1.0, 1.0))
        yield "degrees and deg/s, unstated", *table(q, dq, tau, factors=(1.0, 1.0 / DEGREE, 1.0 / DEGREE, 1.0))
        yield "deg/s, unstated", *table(q, dq, tau, factors=(1.0, 1.0, 1.0 / DEGREE, 1.0))
        yield "ms, unstated", *table(q, dq, tau, factors=(1e3, 1.0, 1.0, 1.0))
        yield "us, unstated", *table(q, dq, tau, factors=(1e6, 1.0, 1.0, 1.0))
        yield "minutes", *table(q, dq, tau, time="t [min]", factors=(1.0 / 60.0, 1.0, 1.0, 1.0))
        yield "mNm, unstated", *table(q, dq, tau, factors=(1.0, 1.0, 1.0, 1e3))
        yield "motor torque", *table(q, dq, style.format("motor_torque"))
        yield "encoder position", *table(style.format("encoder_position"), dq, tau)
        yield "raw torque", *table(q, dq, style.format("tau_raw"))
        yield "some torque", *table(q, dq, style.format("tau_b"))
        yield (
            "two kinds of torque",
            ["t", *(p.format(i) for p in (q, style.format("effort"), tau) for i in one)],
            (1.0,) * 4,
        )
        yield (
            "two kinds of position",
            ["t", *(p.format(i) for p in (q, style.format("position"), tau) for i in one)],
            (1.0,) * 4,
        )
        yield "two arms", ["t", *(f"{side}_{p.format(i)}" for side in "LR" for p in (q, tau) for i in zero)], (1.0,) * 4
        yield (
            "two numbers",
            ["t", *(f"arm{side}_{p.format(i)}" for side in (1, 2) for p in (q, tau) for i in one)],
            (1.0,) * 4,
        )
        yield "one joint more", *table(q, dq, tau, range(n + 1))
        yield "one joint less", *table(q, dq, tau, range(1, n))
        yield "a gap", *table(q, dq, tau, [*range(1, n), n + 1])
        yield "another start", ["t", *map(q.format, zero), *map(dq.format, zero), *map(tau.format, one)], (1.0,) * 4
        yield (
            "one in degrees",
            ["t", *map(q.format, range(1, n)), q.format(n) + " [deg]", *map(tau.format, one)],
            (1.0,) * 4,
        )
        mixed = [tau.format(i) + (" [mNm]" if i == 2 else " [Nm]") for i in one]
        yield "one in mNm", ["t", *map(q.format, one), *mixed], (1.0,) * 4
        yield "a name twice", ["t", *map(q.format, one), *map(tau.format, [1, *range(1, n)])], (1.0,) * 4
        others = [f"{word}_axis" for word in ("base", "turn", "lift", "bend", "roll", "tilt", "spin")[:n]]
        yield (
            "other joints",
            ["t", *(f"{name}.{kind}" for kind in ("position", "effort") for name in others)],
            (1.0,) * 4,
        )
