"""Periods that an arm's bus can stream, and what a designed excitation says of itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.analysis import robot_excitation as module
from armload_controller.analysis.robot_excitation import (
    DesignedExcitation,
    DesignSearch,
    UnstreamablePeriod,
    design,
    design_envelope,
)
from armload_controller.analysis.robot_excitation import _allowed_periods as allowed_periods
from armload_controller.config.robot import load_robot

POSITION_MARGIN_RAD, RATE_SHARE, TORQUE_SHARE = 0.1, 0.7, 0.8


def bus(cycle_hz):
    return SimpleNamespace(has_bus=cycle_hz is not None, bus=SimpleNamespace(cycle_hz=cycle_hz))


@pytest.mark.parametrize(
    ("period_s", "harmonics", "cycle_hz"), [(5.0, 5, 250.0), (0.2, 5, 250.0), (4.0, 1, 2.5), (0.123, 99, None)]
)
def test_a_period_of_whole_cycles_and_enough_setpoints_is_streamed(period_s, harmonics, cycle_hz):
    found = allowed_periods(bus(cycle_hz), period_s, harmonics)
    assert (found.shortest_s, found.longest_s, found.step_s) == (period_s, period_s, period_s)


@pytest.mark.parametrize(
    ("period_s", "harmonics", "cycle_hz", "said"),
    [
        (0.0, 1, 100.0, "expected a duration above 0"),
        (-1.0, 1, 100.0, "expected a duration above 0"),
        (float("inf"), 1, None, "expected a duration above 0"),
        (float("nan"), 1, None, "expected a duration above 0"),
        (5.005, 1, 100.0, r"is 500\.500 cycles at 100 Hz, expected a whole number: give 5 or 5\.01"),
        (0.004, 1, 100.0, r"is 0\.400 cycles at 100 Hz.*: give 0\.01$"),
        (0.1, 2, 100.0, r"harmonic 2 of 0\.1 s has 5\.0 setpoints.*at least 10.*`period_s=` 0\.2 or more"),
    ],
)
def test_other_periods_are_refused_with_those_that_fit(period_s, harmonics, cycle_hz, said):
    with pytest.raises(UnstreamablePeriod, match=said):
        allowed_periods(bus(cycle_hz), period_s, harmonics)


def test_a_word_that_is_no_period_is_an_argument_of_another_type():
    with pytest.raises(TypeError, match="period_s"):
        allowed_periods(bus(100.0), "fast", 5)


@pytest.mark.parametrize(
    ("cycle_hz", "harmonics", "shortest_s", "step_s"),
    [(250.0, 5, 2.0, 0.1), (100.0, 30, 3.0, 0.1), (30.0, 5, 2.0, 0.1), (7.0, 5, 7.142857, 0.142857)],
)
def test_an_automatic_period_is_of_whole_cycles_with_ten_setpoints_for_the_highest_harmonic(
    cycle_hz, harmonics, shortest_s, step_s
):
    found = allowed_periods(bus(cycle_hz), "auto", harmonics)
    assert (found.shortest_s, found.step_s, found.longest_s) == pytest.approx((shortest_s, step_s, 20.0), rel=1e-5)
    assert (found.step_s * cycle_hz) == pytest.approx(round(found.step_s * cycle_hz))
    assert found.shortest_s * cycle_hz >= 10 * harmonics - 1e-9


def test_the_envelope_keeps_room_for_ramps_servos_and_errors():
    arm = load_robot("er50")
    whole, kept = arm.limits.excitation, design_envelope(arm)
    np.testing.assert_allclose(kept.joints.position_max_rad, whole.position_max_rad - POSITION_MARGIN_RAD)
    np.testing.assert_allclose(kept.joints.velocity_max_rad_s, RATE_SHARE * whole.velocity_max_rad_s)
    np.testing.assert_allclose(kept.torque.available_nm, arm.envelope(0.0, 1.0, TORQUE_SHARE).torque.available_nm)


@pytest.fixture
def designed():
    """The figures of a design, without a search."""
    arm = load_robot("prbt")
    path = arm.excitations["identification"].trajectory
    margins = SimpleNamespace(
        position_rad=np.array([0.5, 0.2, 0.3, 0.4, 0.6, 0.7]),
        velocity_rad_s=np.array([0.5, 0.6, 0.7, 0.1, 0.6, 0.7]),
        acceleration_rad_s2=np.ones(6),
        torque_nm=np.array([50.0, 60.0, 70.0, 80.0, 9.0, 10.0]),
        clearance_m={"floor": 0.3, "table": 0.05},
        speed_m_s={},
    )
    result = SimpleNamespace(
        trajectory=path, margins=margins, criterion="a-optimal", rank=9, seed=4, cost=0.1234, condition_number=12.5
    )
    return DesignedExcitation(arm, result, None, 6, "--seed 4")


def test_the_nearest_limit_of_every_kind_is_named(designed):
    names = designed.arm.joint_names
    assert designed.nearest() == {
        "position_rad": (names[1], 0.2),
        "velocity_rad_s": (names[3], 0.1),
        "acceleration_rad_s2": (names[0], 1.0),
        "torque_nm": (names[4], 9.0),
        "clearance_m": ("table", 0.05),
    }


def test_the_figures_are_printed_and_written(designed):
    text, document = str(designed), designed.to_dict()
    assert text.startswith(
        "a-optimal cost 0.1234, cond(Phi) 12.5, 9 of 10 parameters can be determined, 6 periods of 5 s"
    )
    assert f"{designed.arm.joint_names[1]} range 0.2 rad" in text
    assert "table 0.05 m," not in text
    assert "table 0.05 m" in text
    assert (document["rank"], document["seed"], document["periods"]) == (9, 4, 6)
    assert document["period_s"] == designed.result.trajectory.period_s
    assert document["nearest"]["clearance_m"] == {"name": "table", "room": 0.05}
    assert 0.1 < designed.speed_m_s < 5.0
    assert designed.speed_m_s == document["speed_m_s"]
    assert designed.slow_round_s > 4.0 * designed.result.trajectory.period_s * (1.0 - 1e-9)
    assert designed.robot_argument == "prbt"


@pytest.mark.parametrize(
    ("options", "measured_s", "driven"),
    [
        ({"period_s": 5.0}, 30.0, 6),
        ({"period_s": 4.0}, 30.0, 8),
        ({"period_s": 20.0}, 30.0, 3),
        ({"period_s": 5.0, "periods": 2}, 10.0, 2),
        ({"period_s": "auto"}, 30.0, 6),
        ({"period_s": "auto", "periods": 9}, 30.0, 9),
    ],
)
def test_motions_are_compared_over_the_time_of_a_run(monkeypatch, options, measured_s, driven):
    """The search itself is replaced: its settings, and how many periods are driven."""
    given = []
    period_s = options["period_s"] if options["period_s"] != "auto" else 5.0

    def search(objective, envelope, settings, **how):
        given.append(settings)
        return SimpleNamespace(trajectory=SimpleNamespace(period_s=period_s))

    monkeypatch.setattr(module, "optimal_excitation", search)
    found = design("prbt", harmonics=2, search=DesignSearch(seed=7, restarts=1), **options)
    (settings,) = given
    assert settings.slow.measured_s == measured_s
    assert (settings.harmonics, settings.seed, settings.restarts) == (2, 7, 1)
    assert found.periods == driven
    assert f"--periods {driven} --criterion a-optimal" in found.options
    design("prbt", harmonics=2, search=DesignSearch(restarts=1, criterion="condition-number"), **options)
    assert given[1].slow is None, "a condition number does not fall with the time"
