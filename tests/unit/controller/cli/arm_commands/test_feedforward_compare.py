"""Which runs a comparison of feed-forward consists of, and what is compared with what."""

from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from armload_controller.cli.arm_commands import feedforward_compare
from armload_controller.cli.arm_commands.feedforward_compare import ARM, FRICTION, IDEAL, IDENTIFIED
from armload_controller.config.robot import load_robot
from armload_controller.feedforward.body_torque import ArmTorque, LoadFriction


class Runs:
    """Notes the runs and the comparisons."""

    def __init__(self):
        self.made, self.compared = [], []

    def plain(self, session, text):
        self.made.append((session, text))
        return text

    def with_feedforward(self, session, payload, text, tried, beside=None):
        self.made.append((session, text, tried, type(beside), payload.model.mass_kg))
        return text, "verdict"

    def compare(self, without, with_feedforward, empty, payload):
        self.compared.append((without, list(with_feedforward), empty))
        return len(self.compared)


@pytest.fixture
def compared(make_subject, monkeypatch):
    """The runs of prbt, simulated in this process or not, with a calibration or without."""
    monkeypatch.setattr(feedforward_compare, "offset_account", lambda verdict: f"account of {verdict}")

    def compared(*, simulated, calibration):
        arm, runs, shown = load_robot("prbt"), Runs(), []
        arm = arm if simulated else arm.with_bus("socketcan", "can0")
        bench = SimpleNamespace(
            arm=arm,
            used=SimpleNamespace(calibration=calibration, chain=arm.chain),
            runs=lambda: runs,
            session=lambda load: nullcontext(str(load)),
            operator=SimpleNamespace(display=SimpleNamespace(step=shown.append)),
        )
        verdict, comparisons = feedforward_compare._compare(bench, make_subject("prbt").payload)
        assert (verdict, shown) == ("verdict", ["account of verdict"])
        assert comparisons == list(range(1, len(runs.compared) + 1))
        return runs

    return compared


WITHOUT, FED = "loaded, without feed-forward", "loaded, with feed-forward"
NOTHING = type(None)


def test_a_simulated_arm_is_also_run_empty_and_with_its_true_payload(compared):
    runs = compared(simulated=True, calibration=None)
    true_kg = load_robot("prbt").simulation.payload("gripper").mass_kg
    assert runs.made == [
        ("unloaded", "empty"),
        ("loaded", WITHOUT),
        ("loaded", FED, None, NOTHING, pytest.approx(2.7)),
        ("loaded", f"loaded, {IDEAL}", "verdict", NOTHING, pytest.approx(true_kg)),
    ]
    assert runs.compared == [(WITHOUT, [IDENTIFIED, IDEAL], "empty")]


def test_a_calibration_adds_friction_and_the_arm_which_are_compared_beyond_the_lag(compared, chosen):
    runs = compared(simulated=True, calibration=chosen)
    assert [each[1:4] for each in runs.made[2:]] == [
        (FED, None, NOTHING),
        (f"loaded, {FRICTION}", "verdict", LoadFriction),
        (f"loaded, {ARM}", "verdict", ArmTorque),
        (f"loaded, {IDEAL}", "verdict", NOTHING),
    ]
    assert runs.compared == [
        (WITHOUT, [IDENTIFIED, FRICTION, IDEAL], "empty"),
        (WITHOUT, [IDENTIFIED, FRICTION, ARM], None),
    ]


def test_a_real_arm_is_compared_beyond_the_lag_alone(compared):
    runs = compared(simulated=False, calibration=None)
    assert [each[1] for each in runs.made] == [WITHOUT, FED]
    assert runs.compared == [(WITHOUT, [IDENTIFIED], None)]
