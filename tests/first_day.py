"""The page of the first day, and the arm with which tests follow it: er50, whose file has no `[body]`."""

import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from armload_controller.session.commissioning import ROLES
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory

PAGE = Path(__file__).resolve().parents[1] / "docs" / "first-day.md"
needs_page = pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout: the documentation is not installed")


def page_commands():
    """What follows `armload` in the page's commands."""
    return re.findall(r"^ +\$ armload (.*)$", PAGE.read_text("utf-8"), re.MULTILINE)


def write_arm(folder, period_s, periods, **keys):
    """Write `arm.toml` with short excitations.

    Args:
        folder: Where to write it.
        period_s: Length of a period.
        periods: How many periods.
        keys: Values of keys that occur once in er50's file, such as cycle_hz, as in TOML.
    """
    text = (resources.files("armload_configs") / "er50.toml").read_text("utf-8")
    assert "[body" not in text
    for key, value in keys.items():
        text, count = re.subn(rf"^{key} = [^ #\n]+", f"{key} = {value}", text, flags=re.MULTILINE)
        assert count == 1
    (folder / "arm.toml").write_text(text)
    offset, reach = np.array([0.0, 0.3, 0.6, 0.0, 0.0, 0.0]), np.array([[0.2], [0.2], [0.2], [0.3], [0.44], [0.6]])
    for seed, role in enumerate(ROLES):
        swing = reach * np.random.default_rng(seed).choice([-1.0, 1.0], (2, 6, 2)) / np.array([1.0, 2.0])
        write_excitation(
            folder / f"er50_{role}.toml", Excitation(FourierTrajectory(1.0 / period_s, offset, *swing), periods)
        )
