"""A disk that is full, broken or removed at any step of any write: a clear error, the arm at rest, no partial file.

Every step fails once, in each way, through `tests/faulty_disk.py`; `test_replace_file.py` checks that there is no other
way of writing. `pytest -m soak` on this file runs the complete program on disks that are really full (four minutes on
an idle core).
"""

import re
import subprocess
import sys
from contextlib import contextmanager

import pytest
from matplotlib.figure import Figure

from armload_controller.cli.output.output_files import make_folder
from armload_controller.control_errors import (
    CommissioningError,
    ConfigurationError,
    ExportError,
    MotionError,
    RecordingFailed,
)
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.cycle.stop_decisions import Cause, cause_of
from armload_controller.export.export_files import write_files
from armload_controller.session.run_session import no_operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.identification_errors import ExcitationFileError, ReportError
from armload_identification.report.figures.figure_file import write_figure
from armload_identification.report.page import write_page
from armload_identification.storage.strict_toml import write_text
from tests.faulty_disk import FAULTS, FaultyDisk, full
from tests.short_commissioning import MIDDLE_RAD, RECORDINGS, least_robot, record, write_short_robot

ROBOT = least_robot()
CYCLE_S = 0.01


def every_failure(tmp_path, write):
    """Run `write` in an empty folder, each step failing in each way: folder, step, expected text, the error."""
    folder = tmp_path / "disk"
    folder.mkdir()
    with FaultyDisk(folder).mounted() as healthy:
        write(folder)
    for fault, said in FAULTS.items():
        for at, step in enumerate(healthy.steps, 1):
            place = tmp_path / f"{fault.__name__}-{at}" / "disk"
            place.mkdir(parents=True)
            error = None
            with FaultyDisk(place, fault, at).mounted():
                try:
                    write(place)
                except Exception as raised:  # noqa: BLE001 - the test checks its type
                    error = raised
            yield place, step, said, error


def files(folder):
    return {path.name for path in folder.iterdir()} if folder.exists() else set()


def drawn():
    return Figure(figsize=(1, 1))


@pytest.mark.parametrize(
    ("write", "kind", "name"),
    [
        (lambda folder: write_text(folder / "a.toml", "new", ConfigurationError), ConfigurationError, "a.toml"),
        (
            lambda folder: write_excitation(folder / "a.toml", ROBOT.excitations["validation"]),
            ExcitationFileError,
            "a.toml",
        ),
        (lambda folder: write_page(folder / "a.html", "new"), ReportError, "a.html"),
        (lambda folder: write_figure(folder / "a.png", drawn(), 20), ReportError, "a.png"),
        (lambda folder: write_files({"a.c": "new"}, folder), ExportError, "a.c"),
        (lambda folder: make_folder(folder / "run"), CommissioningError, "run"),
    ],
    ids=["toml", "excitation", "report", "picture", "export", "folder"],
)
def test_a_result_appears_whole_or_not_at_all(tmp_path, write, kind, name):
    failed = 0
    for place, step, said, error in every_failure(tmp_path, write):
        if error is None:  # the file has its final name already; not every file system can flush a folder
            assert step == "fsync disk"
            assert files(place) <= {name}
            continue
        failed += 1
        assert isinstance(error, kind)
        assert re.search(said, str(error))
        assert name in str(error)
        assert files(place) == set()
    assert failed >= len(FAULTS)


@contextmanager
def opened(servos):
    yield servos


def test_a_recording_that_cannot_be_written_ends_with_the_arm_at_rest(ideal_servos, tmp_path):
    """Stands with torque for the time of three flushes, from opening the file to its final name."""
    arms = []

    def stand(folder):
        servos = ideal_servos(6, CYCLE_S, position_rad=MIDDLE_RAD)
        servos.simulated = True
        arms.append(servos)
        with (
            run_session(ROBOT, SessionLoad.UNLOADED, lambda load: opened(servos), no_operator()) as session,
            Recorder(folder / "run.mcap", {"run.json": "{}"}) as recorder,
        ):
            session.hold([recorder], lambda hold: hold(lambda: len(servos.sent) >= 60))

    ways = set()
    for place, step, said, error in every_failure(tmp_path, stand):
        log = arms[-1].log
        ways.add(type(error))
        assert re.search(said, str(error)), step
        assert "run.mcap" in str(error) or "run.partial.mcap" in str(error)
        if isinstance(error, CommissioningError):
            assert log == ["connect"]
            assert files(place) == set()
            continue
        if isinstance(error, MotionError):
            assert cause_of(error.__cause__) is Cause.RECORDING
        else:
            assert isinstance(error, RecordingFailed)
        assert log[-2:] == ["stop", "disable"]
        assert files(place) <= {"run.partial.mcap"}
    assert ways == {CommissioningError, MotionError, RecordingFailed}


def test_where_there_is_room_again_a_commissioning_goes_on(ideal_servos, tmp_path):
    """The disk is full in the middle of the second run: the first is kept, the second is repeated."""

    def make_servos():
        servos = ideal_servos(6, CYCLE_S, position_rad=MIDDLE_RAD)
        servos.simulated = True
        return servos

    folder, half = tmp_path / "run", [SessionLoad.UNLOADED]
    folder.mkdir()
    with FaultyDisk(folder, full, 40).mounted() as disk, pytest.raises(MotionError, match="No space left on device"):
        record(ROBOT, folder, make_servos, half)
    assert "rename unloaded_identification.partial.mcap" in disk.steps
    whole = folder / "unloaded_identification.mcap"
    written_ns = whole.stat().st_mtime_ns
    assert files(folder) == {whole.name, "unloaded_validation.partial.mcap"}
    record(ROBOT, folder, make_servos, half)
    assert whole.stat().st_mtime_ns == written_ns
    assert files(folder) & RECORDINGS == {whole.name, "unloaded_validation.mcap"}


START = "from armload_controller.cli.entry import main; main()"
ON_A_DISK_OF = """
mount -t tmpfs -o size=$1k none "$2" || exit 77
shift; folder=$1; shift
"$@"; echo "status $?"
mount -o remount,size=100m "$folder"
"$@"; echo "status $?"
ls "$folder/run"
"""


@pytest.fixture(scope="module")
def commissioning_kb(tmp_path_factory):
    """Size of a commissioning's files on a disk with pages of 4 kB."""
    folder = tmp_path_factory.mktemp("measured")
    robot = write_short_robot(folder)
    command = [sys.executable, "-c", START, "commission", robot, "--output", folder / "run"]
    assert subprocess.run(command, capture_output=True, timeout=600, check=False).returncode in {0, 3}
    return sum(4 * -(-path.stat().st_size // 4096) for path in (folder / "run").rglob("*") if path.is_file())


@pytest.mark.soak
@pytest.mark.timeout(800)
@pytest.mark.parametrize("share", [0.0025, 0.01, 0.02, 0.1, 0.25, 0.3, 0.5, 0.6, 0.8, 0.9, 0.98, 0.995])
def test_the_program_on_a_full_disk_says_so_and_goes_on_when_there_is_room(tmp_path, commissioning_kb, share):
    """Disks in memory, from zero to nearly the size that a commissioning needs."""
    robot, disk, size_kb = write_short_robot(tmp_path), tmp_path / "disk", round(share * commissioning_kb / 4) * 4
    disk.mkdir()
    command = [sys.executable, "-c", START, "commission", robot, "--output", disk / "run"]
    words = ["unshare", "-Urm", "sh", "-c", ON_A_DISK_OF, "sh", str(size_kb), disk, *command]
    done = subprocess.run(words, capture_output=True, text=True, timeout=600, check=False)
    if done.returncode == 77 or "unshare:" in done.stderr:
        pytest.skip(f"no disk of its own: {done.stderr}")
    first, second = re.findall(r"^status (\d+)$", done.stdout, re.MULTILINE)
    print(f"{size_kb} kB:", *re.findall(r"^error: .*", done.stderr, re.MULTILINE))  # noqa: T201
    assert first == "1"
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr
    assert "While stopping" not in done.stderr
    assert second in {"0", "3"}, done.stderr
    assert RECORDINGS | {"payload.toml", "report.html"} <= set(done.stdout.split())
