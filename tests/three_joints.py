"""A recording of three joints that readers of several formats are given, and what each of them must find in it."""

from __future__ import annotations

import numpy as np

TIME = 0.01 * np.arange(90)
POSITION = np.column_stack([np.sin(TIME), np.cos(2.0 * TIME), 0.5 * TIME])
TORQUE = 3.0 * POSITION + 1.0
NAMES = ["shoulder", "elbow", "wrist"]


def assert_read(recording, names=()):
    np.testing.assert_allclose(recording.time_s, TIME, atol=1e-7)
    np.testing.assert_allclose(recording.position_rad, POSITION, atol=1e-6)
    np.testing.assert_allclose(recording.torque_nm, TORQUE, atol=1e-6)
    assert recording.joint_names == tuple(names)
    assert len(recording.source.sha256) == 64
    assert recording.source.rows_read == TIME.size
