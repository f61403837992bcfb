"""Readers, export formats and drive profiles from other packages: the example, broken ones, and names of armload."""

import contextlib
import re
import sys
import warnings
import zipfile
from pathlib import Path

import hatchling.build
import numpy as np
import pytest

import armload
from armload_controller.config.drive_profiles import own_profiles, read_profile, shipped_profiles
from armload_controller.control_errors import ConfigurationError, ExportError
from armload_controller.export.format_registry import ExportFormat, exporter, format_names
from armload_identification.extensions import ExtensionSkipped
from armload_identification.identification_errors import RecordingError

EXAMPLE = Path(__file__).parents[3] / "example_plugin"
LINES = 60


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The example package, built and installed."""
    with contextlib.chdir(EXAMPLE):
        wheel = hatchling.build.build_wheel(str(tmp_path))
    zipfile.ZipFile(tmp_path / wheel).extractall(tmp_path / "installed")
    monkeypatch.syspath_prepend(tmp_path / "installed")
    yield
    for name in ("trace_reader", "payload_sheet", "example_drives"):
        sys.modules.pop(name, None)


@pytest.fixture
def bring(tmp_path, monkeypatch):
    """Install a package of one module with an entry point."""

    def bring(package, group, name, source="", function="function"):
        folder = tmp_path / package
        information = folder / f"{package}-2.dist-info"
        information.mkdir(parents=True)
        (folder / f"{package}_module.py").write_text(source)
        (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 2\n")
        there = f"{package}_module" + (f":{function}" if function else "")
        (information / "entry_points.txt").write_text(f"[{group}]\n{name} = {there}\n")
        monkeypatch.syspath_prepend(folder)
        brought.append(f"{package}_module")

    brought = []
    yield bring
    for module in brought:
        sys.modules.pop(module, None)


def trace(path, rows=50):
    """A trace of two joints; returns time, positions in rad and torques in N m."""
    time_s = 0.01 * np.arange(rows)
    position, torque = np.column_stack([np.sin(time_s), np.cos(time_s)]), np.column_stack([time_s, -time_s])
    table = np.column_stack([time_s, np.degrees(position), torque / 1.8])
    lines = [";".join(f"{value:.9f}".replace(".", ",") for value in row) for row in table]
    path.write_text("\n".join(["Time;ActPos1;ActPos2;ActTrq1;ActTrq2", *lines]) + "\n")
    return time_s, position, torque


def test_the_examples_reader_reads_its_files(installed, tmp_path):
    time_s, position, torque = trace(tmp_path / "run.trc")
    recording = armload.read_recording(tmp_path / "run.trc")
    np.testing.assert_allclose(recording.time_s, time_s, atol=1e-8)
    np.testing.assert_allclose(recording.position_rad, position, atol=1e-8)
    np.testing.assert_allclose(recording.torque_nm, torque, atol=1e-7)
    (tmp_path / "bad.trc").write_text("Time;ActPos1\n0,0\n")
    with pytest.raises(
        RecordingError, match=r"bad\.trc: cannot be read by torque-ceiling 1\.0: ValueError: expected 2"
    ):
        armload.read_recording(tmp_path / "bad.trc")


def test_the_examples_format_is_exported(installed, make_subject, armload_command, tmp_path):
    ((name, text),) = exporter("sheet")(make_subject()).items()
    assert name == "er50_sheet.txt"
    assert re.search(r"^mass +2\.700 kg$", text, re.MULTILINE)
    written = armload_command(make_subject("prbt"), "sheet")
    assert [path.name for path in written.files] == ["prbt_sheet.txt"]


@pytest.fixture
def armload_command(tmp_path):
    def export(subject, export_format):
        from armload_identification.files.payload_file import write_payload

        write_payload(tmp_path / "payload.toml", subject.payload)
        return armload.export("prbt", tmp_path / "payload.toml", export_format, tmp_path / "out")

    return export


def test_the_examples_profile_completes_a_drive(installed):
    profile = read_profile("example_servo", Path(), "robot.toml", "joints[1].drive.profile")
    assert profile.drive.given() == {"mode": "csp", "feedback": "current"}
    assert own_profiles({"joints": [{"drive": {"profile": "example_servo"}}]}) == ()


@pytest.mark.parametrize("file", ["trace_reader.py", "payload_sheet.py", "example_drives/example_servo.toml"])
def test_each_example_is_short(file):
    assert len((EXAMPLE / file).read_text().splitlines()) < LINES


HEADER = "time_s,position_1,position_2,torque_1,torque_2\n"
BROKEN = "raise RuntimeError('no licence')"


def test_a_broken_reader_is_named_and_the_file_is_read_without_it(bring, tmp_path):
    bring("broken", "armload.readers", "trc", BROKEN)
    (tmp_path / "run.trc").write_text(HEADER + "".join(f"{t / 10},{t},0,{t},0\n" for t in range(20)))
    with pytest.warns(ExtensionSkipped, match=r"trc of broken 2 \(armload\.readers\) cannot be loaded: RuntimeError"):
        assert armload.read_recording(tmp_path / "run.trc").time_s.size == 20


def test_a_broken_format_is_named_and_the_others_work(bring, make_subject):
    bring("broken", "armload.exports", "sheet", BROKEN)
    with (
        pytest.warns(ExtensionSkipped, match="sheet of broken 2"),
        pytest.raises(ExportError, match="no such format: one of c, fmu"),
    ):
        exporter("sheet")
    assert exporter("ur")(make_subject())


def test_a_broken_profile_is_named(bring):
    bring("broken", "armload.drive_profiles", "servo", BROKEN, function="")
    with (
        pytest.warns(ExtensionSkipped, match="servo of broken 2"),
        pytest.raises(ConfigurationError, match="expected a profile, elmo_gold"),
    ):
        read_profile("servo", Path(), "robot.toml", "joints[1].drive.profile")


def test_a_profile_cannot_consent_to_what_a_drive_lacks(bring, tmp_path):
    bring("eager", "armload.drive_profiles", "servo", function="")
    package = tmp_path / "eager" / "eager_profiles"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "servo.toml").write_text(
        '[product]\nname = "x"\nsource = "y"\n[drive]\naccept_missing = ["torque limit"]\n'
    )
    (tmp_path / "eager" / "eager-2.dist-info" / "entry_points.txt").write_text(
        "[armload.drive_profiles]\nservo = eager_profiles\n"
    )
    with pytest.raises(ConfigurationError, match=r"servo\.toml of eager 2: drive\.accept_missing"):
        read_profile("servo", Path(), "robot.toml", "joints[1].drive.profile")


STOLEN = "def function(*_):\n    raise SystemExit('never called')\n"


@pytest.mark.parametrize("suffix", ["csv", "mcap", "npz", "parquet"])
def test_no_reader_replaces_armloads(bring, tmp_path, suffix):
    bring("thief", "armload.readers", suffix, STOLEN)
    path = tmp_path / f"run.{suffix}"
    path.write_text("time_s,position_1\n0,0\n1,1\n")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExtensionSkipped)
        with contextlib.suppress(RecordingError):
            armload.read_recording(path)


@pytest.mark.parametrize("name", [*ExportFormat])
def test_no_format_replaces_armloads(bring, name):
    before = exporter(name)
    bring("thief", "armload.exports", name, STOLEN)
    assert exporter(name) is before
    with pytest.warns(ExtensionSkipped, match=rf"{name} of thief 2 .* has a name that armload has itself"):
        assert format_names().count(name) == 1


@pytest.mark.parametrize("name", shipped_profiles())
def test_no_profile_replaces_armloads(bring, name):
    before = read_profile(name, Path(), "robot.toml", "key")
    bring("thief", "armload.drive_profiles", name, STOLEN)
    assert read_profile(name, Path(), "robot.toml", "key") == before


def test_a_name_of_two_packages_is_used_from_neither(bring):
    bring("one", "armload.exports", "sheet", STOLEN)
    bring("two", "armload.exports", "sheet", STOLEN)
    with (
        pytest.warns(ExtensionSkipped, match="sheet of one 2 and two 2"),
        pytest.raises(ExportError, match="no such format"),
    ):
        exporter("sheet")


@pytest.mark.parametrize(
    ("source", "problem"),
    [
        (
            "def function(subject):\n    return {'../out': 'x'}\n",
            "gave '../out', expected names of files without folders",
        ),
        ("def function(subject):\n    return {'a.txt': 'M\\xfcll'}\n", "gave a.txt with characters that are not ASCII"),
        ("def function(subject):\n    return {}\n", "gave no file"),
        ("def function(subject):\n    return 1 / 0\n", "sheet of odd 2 failed: ZeroDivisionError"),
    ],
)
def test_what_a_format_gives_is_checked(bring, make_subject, source, problem):
    bring("odd", "armload.exports", "sheet", source)
    with pytest.raises(ExportError, match=re.escape(problem)):
        exporter("sheet")(make_subject())


@pytest.mark.parametrize(
    ("returned", "problem"),
    [
        ("{'time_s': np.zeros(3), 'position_rad': np.zeros((2, 1))}", "odd 2: time_s has shape (3,); expected (2,)"),
        ("{'time_s': np.zeros(3), 'angle': np.zeros((3, 1))}", "odd 2 gave time_s, angle; expected time_s (N,)"),
    ],
)
def test_what_a_reader_gives_is_checked(bring, tmp_path, returned, problem):
    (tmp_path / "run.trc").write_text("x")
    source = f"import numpy as np\ndef function(path):\n    return {returned}\n"
    bring("odd", "armload.readers", "trc", source)
    with pytest.raises(RecordingError, match=re.escape(problem)):
        armload.read_recording(tmp_path / "run.trc")
