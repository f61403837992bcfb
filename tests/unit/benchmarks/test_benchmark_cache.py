"""The benchmarks' cache: reused if nothing has changed, never if something has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_identification.excitation.fourier import FourierTrajectory
from benchmarks.arms.period_cache import cached, fingerprint
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.steady_state import Streaming, period_key
from benchmarks.arms.streamed_arm import noiseless

ROBOT = load_robot("er50")


def key(spec=None, **changes):
    streaming = Streaming(ROBOT.drives.settings, ROBOT.limits.motion)
    trajectory = changes.pop("trajectory", ROBOT.excitations["identification"].trajectory)
    return period_key(
        noiseless(spec or ROBOT.simulation.plant_spec("paper")), replace(streaming, **changes), trajectory
    )


def test_the_key_changes_with_everything_that_a_period_depends_on():
    spec = ROBOT.simulation.plant_spec("paper")
    heavier = replace(spec, payload=replace(spec.payload, mass_kg=9.815))
    joint = replace(spec.joints[3], load_friction=0.051)
    trajectory = ROBOT.excitations["identification"].trajectory
    other = FourierTrajectory(
        trajectory.base_frequency_hz, trajectory.offset_rad + 1e-9, trajectory.sin_rad, trajectory.cos_rad
    )
    keys = [
        key(),
        key(heavier),
        key(replace(spec, joints=(*spec.joints[:3], joint, *spec.joints[4:]))),
        key(replace(spec, payload=None)),
        key(replace(spec, friction_scale=1.03)),
        *(key(twin_spec(ROBOT, twin, spec.payload)) for twin in (Twin.GEARS, Twin.HARSH)),
        key(keep_every=5),
        key(arm=replace(ROBOT.drives.settings, cycle_s=0.01)),
        key(arm=replace(ROBOT.drives.settings, coupling=np.eye(6))),
        key(trajectory=other),
        key(trajectory=ROBOT.excitations["validation"].trajectory),
    ]
    assert len(set(keys)) == len(keys)


def test_the_key_does_not_change_with_what_is_added_per_seed():
    spec = ROBOT.simulation.plant_spec("paper")
    louder = tuple(replace(joint, torque_noise_nm=99.0) for joint in spec.joints)
    assert key() == key(replace(spec, joints=louder, seed=5, torque_gain_error=np.full(6, 0.02)))


def test_a_changed_source_changes_the_key(tmp_path):
    source = tmp_path / "plant.py"
    source.write_text("mu = 1")
    before = fingerprint((source,))
    source.write_text("mu = 2")
    assert fingerprint((source,)) != before


@pytest.mark.parametrize(("one", "two"), [(1, 1.0), (1, "1"), (None, "None"), ((1, 2), (12,)), (0.1, 0.1 + 1e-17 * 4)])
def test_values_that_differ_hash_differently(one, two):
    assert (fingerprint(one) == fingerprint(two)) == (one is two or (type(one) is type(two) and one == two))


def test_what_has_no_content_to_hash_is_refused():
    with pytest.raises(TypeError, match="cannot be hashed"):
        fingerprint(object())


def test_arrays_are_made_once(tmp_path):
    made = []

    def make():
        made.append(1)
        return {"torque": np.arange(6.0).reshape(3, 2)}

    first, second = (cached("k", tmp_path / "cache", make) for _ in range(2))
    assert len(made) == 1
    np.testing.assert_array_equal(first["torque"], second["torque"])


def test_a_damaged_file_is_made_anew(tmp_path):
    cached("k", tmp_path, lambda: {"x": np.zeros(2)})
    whole = (tmp_path / "k.npz").read_bytes()
    (tmp_path / "k.npz").write_bytes(whole[: len(whole) // 2])
    np.testing.assert_array_equal(cached("k", tmp_path, lambda: {"x": np.ones(2)})["x"], np.ones(2))
    assert [path.name for path in tmp_path.iterdir()] == ["k.npz"]
