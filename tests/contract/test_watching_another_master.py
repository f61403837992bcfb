"""An arm under another master, canopen, watched and recorded from its frames only: mounting, dropping, calibration."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from importlib import resources
from itertools import count

import can
import numpy as np
import pytest

from armload_controller.analysis.payload_watch import PayloadWatch
from armload_controller.analysis.robot_calibration import calibrate_from_runs
from armload_controller.analysis.robot_identification import identify
from armload_controller.analysis.watch_history import WatchDiary
from armload_controller.config.robot import load_robot
from armload_controller.config.robot_runs import read_runs
from armload_controller.control_errors import CommissioningError, ConfigurationError, UnsafeBus
from armload_controller.session.bus_watch import BusWatch, recorder_of
from armload_controller.session.joint_feeds import bus_feed
from armload_controller.session.session_load import SessionLoad
from armload_drivers.driver_errors import BusError
from armload_drivers.simulation.plant_spec import ScheduledPayload
from armload_identification.calibration.mounted_runs import WeighedPayload
from armload_identification.files.calibration_file import write_calibration
from armload_identification.recording.file_reading import read_recording_file
from benchmarks.canopen_runs.canopen_master import arm_under_canopen
from benchmarks.canopen_runs.watch_picture import moments_of, overheard_shift

CYCLE_HZ, RUN_S = 50.0, 10.0
MOUNTED_S, DROPPED_S, END_S = 8.0, 17.0, 24.0
NOTICED_S = 0.7
SPEED_SHARE = (0.2, 0.6)


@pytest.fixture(scope="module")
def robot():
    return load_robot("er50").with_bus(None, None, None, CYCLE_HZ)


@pytest.fixture(scope="module")
def recorded(robot, tmp_path_factory):
    """The empty and the loaded arm under another master, recorded as by `armload watch --record`."""
    folder = tmp_path_factory.mktemp("shift") / "disc"
    folder.mkdir()
    paths = {}
    for load, payload in ((SessionLoad.UNLOADED, None), (SessionLoad.LOADED, robot.simulation.payload_name)):
        cycles = overheard_shift(robot, payload, 1 + len(paths), RUN_S)
        paths[load] = folder / f"{load}.mcap"
        with recorder_of(robot, paths[load], load) as recorder:
            moments = list(moments_of(BusWatch(robot, None, recorder), cycles))
        assert moments[-1].payload is None
        assert moments[-1].bus.cycles == len(cycles)
        assert not moments[-1].bus.enabled
        assert 0 < recorder.rows < len(cycles), "rows without torque are no use"
    return paths


@pytest.fixture(scope="module")
def calibration_file(robot, recorded):
    """The calibration from these recordings."""
    runs = read_runs(robot, list(recorded.values()))
    assert not runs.left_out
    mass_kg = robot.simulation.payload(robot.simulation.payload_name).mass_kg
    found = calibrate_from_runs(robot, replace(runs, weighed={"disc": WeighedPayload(mass_kg)}))
    path = recorded[SessionLoad.LOADED].with_name("arm.calibration.toml")
    write_calibration(path, found)
    return path


@pytest.mark.long
def test_a_payload_is_mounted_and_dropped_and_the_watch_notices(robot, calibration_file, tmp_path):
    body = robot.simulation.mounted(robot.simulation.payload_name)
    changes = (ScheduledPayload(MOUNTED_S, body), ScheduledPayload(DROPPED_S, None))
    cycles = overheard_shift(robot, None, 7, END_S, changes)
    watching_payload = PayloadWatch(robot, calibration_file)
    watching = BusWatch(robot, watching_payload, None, every_s=2.0)
    moments = list(moments_of(watching, cycles))
    first_sync_s = 1.0 / CYCLE_HZ
    events = [event for moment in moments for event in moment.events]
    assert [event.kind for event in events] == [
        "something acts",
        "changed",
        "grasped",
        "something acts",
        "changed",
        "dropped",
    ]
    for event, at_s in zip(events, np.repeat([MOUNTED_S, DROPPED_S], 3), strict=True):
        assert -0.15 < event.time_s - first_sync_s - at_s < NOTICED_S
    for event, change_kg in ((events[2], body.mass_kg), (events[5], -body.mass_kg)):
        assert event.mass_kg == pytest.approx(change_kg, rel=0.25)
    before = [m for m in moments if m.time_s < MOUNTED_S][-1].payload
    held = [m for m in moments if m.time_s < DROPPED_S][-1].payload
    # 1 % of drift of all gains is a tenth of 10 kg here.
    assert abs(before.mass_kg) < before.half_width_95[0] < 1.5
    assert abs(held.mass_kg - body.mass_kg) < held.half_width_95[0] < 1.5
    report = tmp_path / "shift.html"
    diary = WatchDiary(robot, watching_payload, "can0")
    for moment in moments:
        diary.add(moment)
    diary.write(report)
    page = report.read_text()
    assert all(str(event) in page for event in events)
    assert all(name in page for name in robot.joint_names)
    document = moments[-1].to_dict("er50")
    assert document["bus"]["enabled"] is False
    assert json.loads(json.dumps(document)) == document


@pytest.mark.long
def test_a_payload_is_identified_from_what_was_heard(robot, recorded, calibration_file):
    body = robot.simulation.payload(robot.simulation.payload_name)
    found = identify(robot, recorded[SessionLoad.LOADED], calibration=calibration_file).payload
    low, high = found.interval_95[0]
    assert low < body.mass_kg < high
    assert found.model.mass_kg == pytest.approx(body.mass_kg, rel=0.05)


@pytest.mark.long
def test_recordings_of_another_master_say_what_they_are(robot, recorded):
    recording = read_recording_file(recorded[SessionLoad.UNLOADED])
    assert recording.joint_names == robot.joint_names
    assert recording.source.run()["overheard"] is True
    assert recording.source.run()["load"] == "unloaded"
    assert recording.current_a is not None
    assert not recording.source.reasons


class DeafMouth:
    """A bus that receives nothing and fails the test on sending."""

    def __init__(self, *args, **kwargs):
        self.closed = False

    def recv(self, timeout=None):
        return None

    def shutdown(self):
        self.closed = True

    def __getattr__(self, name):
        raise AssertionError(f"the watch asked for bus.{name}")


def test_a_bus_is_opened_for_receiving_and_closed(robot, monkeypatch):
    opened = []
    monkeypatch.setattr(can, "Bus", lambda **kwargs: opened.append(DeafMouth()) or opened[-1])
    with pytest.raises(UnsafeBus, match="such as --bus socketcan:can0"), bus_feed(robot):
        pass
    with bus_feed(robot.with_bus("socketcan", "can0", None, None)) as feed:
        assert next(feed.cycles) is None
    assert [bus.closed for bus in opened] == [True]


def test_scales_that_only_the_drives_know_are_asked_for(tmp_path):
    text = (resources.files("armload_configs") / "er50.toml").read_text()
    file = tmp_path / "real.toml"
    real, _, _ = text.partition("[simulation]")
    file.write_text(re.sub(r"(?s)\n\[excitation\].*?\n\[", "\n[", real).replace("counts_per_axis_turn", "#", 1))
    arm = load_robot(str(file)).with_bus("socketcan", "can0", None, None)
    with pytest.raises(ConfigurationError, match=r"counts_per_axis_turn.*required for listening"), bus_feed(arm):
        pass


def test_silence_is_shown(robot):
    ticks = iter(np.arange(0.0, 100.0, 0.1))
    watching = BusWatch(robot, None, None, 1.0, clock=lambda: next(ticks))
    nothing = iter([None] * 40)
    left = count(-40)
    moments = list(watching.moments(nothing, lambda: next(left) < 0))
    assert [m.bus.silent_s for m in moments] == pytest.approx([1.0, 2.0, 3.0, 4.0], abs=0.2)


def test_the_kind_of_effort_must_be_the_calibrations(robot, calibration_file):
    payload = PayloadWatch(robot, calibration_file)
    with pytest.raises(CommissioningError, match="calibrated with current"):
        BusWatch(load_robot("prbt"), payload, None)


def test_the_command_listens_and_records(robot, armload, tmp_path, monkeypatch, calibration_file):
    """The complete command on a virtual bus of this process, with the frames of an earlier shift."""
    frames = []
    settings = robot.drives.settings
    with arm_under_canopen(settings, robot.simulation.plant_spec(None), lambda *frame: frames.append(frame)) as master:
        here = master.enable()
        master.go(here, here + 0.8, 0.3 * robot.limits.motion.velocity_max_rad_s)
    syncs = sum(cob_id == 0x80 for cob_id, _, _ in frames)

    class Played(DeafMouth):
        def __init__(self):
            super().__init__()
            self._frames = iter(frames)

        def recv(self, timeout=None):
            frame = next(self._frames, None)
            if frame is None:
                raise can.CanOperationError("the adapter is gone")
            return can.Message(arbitration_id=frame[0], data=frame[1], timestamp=frame[2], is_extended_id=False)

    monkeypatch.setattr(can, "Bus", lambda **kwargs: Played())
    bus = ("--bus", "socketcan:can0")
    path = tmp_path / "shift.mcap"
    page = path.with_suffix(".html")
    words = ("--calibration", calibration_file, "--record", path, "--report", page, "--json")
    run = armload("watch", "er50", *bus, *words)
    assert isinstance(run.exception, BusError)
    documents = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
    assert documents[-1]["bus"]["cycles"] > 0.4 * syncs
    partial = path.with_name("shift.partial.mcap")
    assert read_recording_file(partial).size > 50, "what was heard is kept"
    assert f"recorded up to the error: {partial}, " in run.stderr
    assert f"written: {page}, up to the error" in run.stderr
    assert page.stat().st_size > 5000


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["a.mcap", "--bus", "socketcan:can0"], "applies to an arm that moves now"),
        (["--load", "loaded"], "requires --record"),
        (["--follow"], "requires a RECORDING"),
        (["--record", "x.mcap", "--load", "heavy"], "'heavy': expected one of 'unloaded', 'loaded'"),
        (["--record", "x.mcap", "--for", "soon"], "'soon' is not a time"),
        (["--record", "x.mcap", "--for", "0s"], "expected a time above zero"),
        (["--record", "x.mcap", "--bus", "socketcan:can0", "--report", "x.html"], "requires a calibrated arm"),
    ],
)
def test_options_that_make_no_sense(armload, words, text):
    run = armload("watch", "er50", *words)
    assert run.exit_code == 2
    assert text in run.output
