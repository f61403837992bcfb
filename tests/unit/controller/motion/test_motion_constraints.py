"""The speed limit of approaches and slow rounds: reduced speed of ISO 10218-1, or a lower one of the file."""

from types import SimpleNamespace

import pytest

from armload_controller.motion.motion_constraints import MotionConstraints


@pytest.mark.parametrize(("own_m_s", "limit_m_s"), [(None, 0.25), (0.5, 0.25), (0.2, 0.2)])
def test_reduced_speed_is_250_mm_s_or_the_files_limit_if_that_is_lower(own_m_s, limit_m_s):
    speed = None if own_m_s is None else SimpleNamespace(speed_m_s=own_m_s)
    constraints = MotionConstraints("", None, None, None, None, None, "points", speed)
    assert constraints.reduced_speed.speed_m_s == limit_m_s
    assert constraints.reduced_speed.points == "points"
