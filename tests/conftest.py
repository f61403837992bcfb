"""Shared fixtures: arms that follow perfectly, with and without a bus, and a check for leaked threads."""

import functools
import gc
import math
import os
import pickle
import signal
import threading
import time
import tomllib
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

# Before numpy is loaded, for this process and those that tests start: on a busy machine the threads of linear algebra
# wait for each other, and tests take ten times as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest
from hypothesis import settings

from armload_drivers.bus.joined_bus import BusRole
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.arm_settings import (
    SIMULATION_IDENTITY,
    ArmSettings,
    DriveSettings,
    EffortFeedback,
    Identity,
    OperationMode,
)
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import DriverError
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, lockstep_bus, lockstep_wires
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.virtual_clock import VirtualClock
from tests.bounded import overheard
from tests.fake_servos import FakeServos
from tests.ideal_plant import IdealPlant
from tests.independent_drive import PRODUCT_CODE, VENDOR_ID
from tests.started_programs import signals_as_before

settings.register_profile("the same examples in every run", derandomize=True)
settings.load_profile("the same examples in every run")


def parse_once():
    """Parse no TOML text twice: most tests load the same few robots."""
    parse = tomllib.loads

    @functools.lru_cache(maxsize=200)
    def parsed(text):
        return pickle.dumps(parse(text))

    tomllib.loads = lambda text, **options: parse(text, **options) if options else pickle.loads(parsed(text))


parse_once()
BEGUN = pytest.StashKey[float]()


DURATION = "armload/duration_s"
"""Key of the duration of a complete run in pytest's cache."""


def pytest_report_header(config):
    """Expected duration."""
    if config.args_source is not config.ArgsSource.TESTPATHS:
        return None
    seconds = config.cache.get(DURATION, None) if hasattr(config, "cache") else None
    if seconds is None:
        return "a whole run takes about three minutes on one idle core, one and a half with WORKERS=2"
    return f"the last whole run here took {seconds:.0f} s"


def pytest_sessionstart(session):
    session.config.stash[BEGUN] = time.monotonic()


def pytest_collection(session):
    """No garbage collection while the tests are loaded."""
    gc.disable()


def pytest_collection_finish(session):
    """Exclude what was loaded from further garbage collection."""
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)
    gc.enable()


def pytest_sessionfinish(session, exitstatus):
    """Store the duration of a complete run, but not of a worker's part or of selected tests."""
    config = session.config
    whole = (
        config.args_source is config.ArgsSource.TESTPATHS
        and not config.option.keyword
        and not config.option.collectonly
    )
    if whole and exitstatus in (0, 1) and hasattr(config, "cache") and not hasattr(config, "workerinput"):
        config.cache.set(DURATION, time.monotonic() - config.stash[BEGUN])


@pytest.fixture
def interruptible():
    """SIGINT interrupts, also where the tests run in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True)
def no_leaked_threads():
    """A test that leaves a thread behind fails."""
    before = set(threading.enumerate())
    yield
    left = [t for t in threading.enumerate() if t not in before and t.is_alive()]
    for thread in left:
        thread.join(timeout=1.0)
    left = [t.name for t in left if t.is_alive()]
    assert not left, f"threads left running: {left}"


@pytest.fixture(autouse=True)
def no_signals_left_ignored():
    """Signals are handled as before, whatever command has failed in this process."""
    with signals_as_before():
        yield


@pytest.fixture(autouse=True)
def no_kept_frames(request):
    """Drop the frames of exceptions among a test's parameters, which live until the end of the run.

    The frames would keep arms alive, and Ruckig's objects, which nanobind then reports as leaked at exit.
    """
    yield
    for value in getattr(getattr(request.node, "callspec", None), "params", {}).values():
        if isinstance(value, BaseException):
            value.__traceback__ = value.__context__ = value.__cause__ = None


@pytest.fixture(scope="session")
def shared_data():
    """Folder of the measured data next to the checkout; a user's machine has none."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the measured recordings are not beside this checkout")
    return folder


class WatchedServos(FakeServos):
    """Simulated servos that log their commands; tests inject failures and distort the feedback.

    Args:
        arm: Scaling and limits of the drives.
        plant: The arm.
        failures: Scripted failures.
        events: Exception to raise, or distortion of the feedback (a function), by number of the exchange.
    """

    def __init__(self, arm, plant, failures=(), events=None):
        super().__init__(arm, plant, failures)
        self.events = events or {}
        self.log = []
        self.sent = []

    def connect(self):
        self.log.append("connect")
        super().connect()

    def enable(self):
        self.log.append("enable")
        return super().enable()

    def exchange(self, command):
        event = self.events.get(len(self.sent))
        if isinstance(event, BaseException):
            raise event
        feedback = super().exchange(command)
        self.sent.append(command)
        return event(feedback) if event else feedback

    def stop(self, suspect=None):
        self.log.append("stop")
        super().stop(suspect)

    def disable(self):
        self.log.append("disable")
        super().disable()


class RubbingPlant(IdealPlant):
    """An ideal plant with Coulomb friction of 1 N m; torque without any friction in motion is rejected as false."""

    def sample(self, cycle_s):
        sample = super().sample(cycle_s)
        rubbing_nm = np.sign(sample.axis_velocity_rad_s) * self.powered
        return replace(sample, axis_torque_nm=sample.axis_torque_nm + rubbing_nm)


@pytest.fixture
def rubbing_plant():
    return RubbingPlant


@pytest.fixture
def watched_servos():
    return WatchedServos


@pytest.fixture
def ideal_servos():
    """Makes `WatchedServos` of an arm without dynamics, coupling or noise, with 0.5 A in every motor at rest."""

    def make(n, cycle_s, events=None, position_rad=None):
        drive = small_arm(counts_per_rad=1e8).drives[0]
        drives = tuple(replace(drive, joint=f"joint_{k}", node_id=k) for k in range(1, n + 1))
        arm = ArmSettings(drives, np.eye(n), cycle_s, 1_000_000, 0.1, 3)
        start_rad = np.full(n, 0.1) if position_rad is None else position_rad
        return WatchedServos(arm, RubbingPlant(start_rad, np.full(n, 10.0)), events=events)

    return make


@pytest.fixture
def connected_servos(ideal_servos):
    """Makes connected `ideal_servos`; their log starts after connecting."""

    def make(*args, **kwargs):
        servos = ideal_servos(*args, **kwargs)
        servos.connect()
        servos.log.clear()
        return servos

    return make


def small_arm(*, cycle_s=0.01, **changes):
    """Settings of three coupled joints; `changes` go to every drive."""
    drive = {
        "mode": OperationMode.CYCLIC_SYNCHRONOUS_POSITION,
        "feedback": EffortFeedback.CURRENT,
        "counts_per_rad": 1_000_000 / (2 * math.pi),
        "rated_current_a": 10.0,
        "rated_torque_nm": 200.0,
        "max_torque_permille": 3000,
        "following_error_rad": 0.5,
        "position_min_rad": -3.0,
        "position_max_rad": 3.0,
        "velocity_max_rad_s": 2.0,
        "acceleration_max_rad_s2": 5.0,
        "has_brake": True,
        "identity": SIMULATION_IDENTITY,
    } | changes
    drives = tuple(DriveSettings(joint=f"joint_{node}", node_id=node, **drive) for node in (2, 3, 5))
    coupling = np.array([[1.0, 0.0, 0.0], [0.02, 1.0, 0.0], [0.0, -0.03, 1.0]])
    return ArmSettings(drives, coupling, cycle_s, 1_000_000, 0.1, 3)


START_RAD = (0.1, -0.2, 0.3)
"""Initial positions of a small arm's axes."""


class VirtualArm:
    """Master and simulated drives of a small arm in lockstep.

    Args:
        arm: The master's settings.
        traits: Differences between drives, by node id.
        drives_arm: The drives' settings; the master's by default.
        plant: Moved by the drives.
    """

    def __init__(self, arm=None, traits=None, drives_arm=None, timeouts=None, plant=None):
        self.arm = arm or small_arm()
        self.plant = plant or IdealPlant(np.array(START_RAD), np.array([20.0, -40.0, 60.0]))
        self.clock = VirtualClock()
        wires = self.wires = lockstep_wires(self.arm)
        with ExitStack() as stack:
            self.bus = stack.enter_context(lockstep_bus(self.arm, wires, BusRole.MASTER))
            drives_bus = stack.enter_context(lockstep_bus(self.arm, wires, BusRole.DRIVES))
            self.monitors = [stack.enter_context(LockstepBus(wire)) for wire in wires]
            self.monitor = self.monitors[0]
            drives = SimulatedDrives(drives_arm or self.arm, self.plant, drives_bus, self.clock, traits)
            self.drives = stack.enter_context(drives)
            self._stack = stack.pop_all()
        sync = LockstepSync(self.clock)
        timeouts = timeouts or Timeouts(probe_s=0.05, scan_s=0.3, boot_s=0.3, sdo_s=1.0, mode_s=0.1)
        self.servos = CanopenServos(self.arm, self.bus, sync, timeouts)

    def frames(self, cob_id):
        """Data of all frames of a COB-ID since the last call for any; the others are dropped."""
        return [bytes(message.data) for message in overheard(self.monitor) if message.arbitration_id == cob_id]

    def close(self):
        """Close the servos, ignoring their errors, then the bus."""
        try:
            self.servos.close()
        except DriverError:
            assert not any(self.plant.powered)
        finally:
            self._stack.close()


@pytest.fixture
def virtual_arm():
    """Makes `VirtualArm`s and closes them."""
    with ExitStack() as stack:

        def make(*args, **kwargs):
            arm = VirtualArm(*args, **kwargs)
            stack.callback(arm.close)
            return arm

        yield make


@pytest.fixture
def arm_settings():
    """Makes settings of a small arm."""
    return small_arm


@pytest.fixture(scope="session")
def armload():
    """Run a command in this process; errors keep their type."""
    from typer import testing

    from armload_controller.cli.command_tree import app

    testing._get_command = functools.cache(testing._get_command)  # 10 ms, and always the same

    def armload(*words, columns=200):
        return testing.CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": str(columns)})

    return armload


@pytest.fixture(scope="session")
def require_accepted():
    """Fails if the command line rejects these arguments; nothing is run."""
    import typer

    from armload_controller.cli.command_tree import app

    program = typer.main.get_command(app)

    def require_accepted(words):
        command, words = program, list(words)
        while hasattr(command, "commands"):
            command = command.commands[words.pop(0)]
        command.make_context("armload", words).close()

    return require_accepted


@pytest.fixture
def independent_arm(arm_settings):
    """The same small arm with the drives of `tests/independent_drive.py`; 20 missing cycles allowed."""

    def make(mode, **changes):
        arm = arm_settings(
            cycle_s=0.02,
            mode=mode,
            feedback=EffortFeedback.TORQUE,
            counts_per_rad=None,
            rated_current_a=None,
            rated_torque_nm=None,
            identity=Identity(VENDOR_ID, PRODUCT_CODE),
            torque_offset=False,
        )
        return replace(arm, max_missing_cycles=20, **changes)

    return make
