"""What every feed-forward command prepares: the arm, its trajectory, its calibration and the payload."""

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.cli.arm_commands import feedforward_bench
from armload_controller.cli.arm_commands.feedforward_bench import BenchOptions, usable
from armload_controller.control_errors import CommissioningError, ConfigurationError
from armload_controller.feedforward.feedforward_plugin import PayloadRefused
from armload_controller.motion.joint_limits import LimitViolation
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import PARAMETER_NAMES

SWING = FourierTrajectory(0.25, np.array([0.0, 0.5, 1.2, 0.0, 0.6, 0.0]), np.full((6, 1), 0.05), np.full((6, 1), 0.02))


@pytest.fixture
def bench(monkeypatch):
    """A bench of prbt with options, without an operator."""
    monkeypatch.setattr(feedforward_bench, "operator_at", lambda *_given, **_options: nullcontext("operator"))

    def bench(*, whole=False, **options):
        given = BenchOptions("prbt", cycle_hz=50.0, **options)
        arm = given.movable_arm()
        arm = replace(arm, excitations={"validation": Excitation(SWING, 3)})
        with given.bench(arm, whole=whole) as made:
            return made

    return bench


@pytest.mark.parametrize(("whole", "periods"), [(False, 1), (True, 3)])
def test_one_period_of_the_validation_is_run_or_all(bench, whole, periods):
    made = bench(whole=whole)
    assert made.path.excitation.periods == periods
    assert made.path.excitation.trajectory is SWING
    assert made.path.cycle_s == 0.02
    assert made.operator == "operator"
    assert made.used.calibration is None


def test_another_trajectory_is_a_file_that_is_checked_as_well(bench, tmp_path):
    write_excitation(tmp_path / "slow.toml", Excitation(replace(SWING, base_frequency_hz=0.2), 2))
    path = bench(excitation=tmp_path / "slow.toml").path
    assert (path.excitation.trajectory.base_frequency_hz, path.excitation.periods) == (0.2, 1)
    far = replace(SWING, offset_rad=np.full(6, 9.0))
    write_excitation(tmp_path / "far.toml", Excitation(far, 2))
    with pytest.raises(LimitViolation, match=r"prbt_joint_\d: position .* rad is beyond the limit"):
        bench(excitation=tmp_path / "far.toml")


def test_an_arm_without_a_validation_needs_the_option():
    given = BenchOptions("prbt", cycle_hz=50.0)
    arm = replace(given.movable_arm(), excitations={})
    with pytest.raises(CommissioningError, match=r"no \[excitation\] validation"), given.bench(arm):
        pass


def test_what_is_mounted_is_the_simulated_payload():
    assert BenchOptions("prbt", mounted="block").movable_arm().simulation.payload_name == "block"
    own = BenchOptions("prbt").movable_arm()
    assert own.simulation.payload_name == "gripper"
    assert own.bus.cycle_hz != BenchOptions("prbt", cycle_hz=50.0).movable_arm().bus.cycle_hz == 50.0
    with pytest.raises(ConfigurationError, match="block"):
        BenchOptions("prbt", mounted="brick").movable_arm()


def test_runs_are_commanded_with_the_gains_of_the_calibration(bench, chosen):
    made = bench()
    plain = made.runs()
    np.testing.assert_array_equal(plain._commanded, np.eye(6))
    np.testing.assert_array_equal(plain._tried_nm, np.zeros(6))
    known = replace(made, used=SimpleNamespace(calibration=chosen)).runs()
    np.testing.assert_allclose(known._commanded, chosen.commanded(made.arm.drives.coupling))
    assert (known._tried_nm > 0.0).all()


@pytest.mark.parametrize("undetermined", [(), ("cx",)])
def test_a_payload_is_fed_forward_only_if_it_is_determined(make_subject, tmp_path, undetermined):
    path = tmp_path / "payload.toml"
    payload = make_subject("prbt").payload
    known = np.array([name not in undetermined for name in PARAMETER_NAMES])
    interval = np.where(known[:, None], payload.interval_95, np.nan)
    write_payload(path, replace(payload, determined=known, interval_95=interval))
    arm = BenchOptions("prbt").movable_arm()
    if not undetermined:
        assert usable(arm, path).model.mass_kg == pytest.approx(2.7)
        return
    with pytest.raises(PayloadRefused) as caught:
        usable(arm, path)
    assert str(caught.value).startswith(f"{path}: not determined: cx; a payload is fed forward only with")
