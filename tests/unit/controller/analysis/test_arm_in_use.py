"""The calibration that an arm is used with, in each form in which it may be given."""

from __future__ import annotations

import numpy as np
import pytest

from armload_controller.analysis.arm_in_use import calibration_from
from armload_identification.results.calibrated_arm import CalibratedArm


def test_a_calibration_is_given_as_the_result_what_it_holds_or_its_file(calibration, tmp_path):
    result = CalibratedArm("an arm", tuple(f"joint_{i}" for i in range(calibration.n)), calibration)
    result.save(tmp_path / "arm.toml")
    assert calibration_from(calibration) is calibration
    assert calibration_from(result) is calibration
    for path in (tmp_path / "arm.toml", str(tmp_path / "arm.toml")):
        np.testing.assert_allclose(calibration_from(path).gain_nm_a, calibration.gain_nm_a, rtol=1e-6)
    with pytest.raises(TypeError, match=r"`calibration=` .* path of its file"):
        calibration_from(3.0)
