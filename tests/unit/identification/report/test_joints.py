"""The table of a run's joints: RMS values, ratios and units."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.report.joints import joint_rows
from armload_identification.signals.signal_constants import Smoothing

pytestmark = pytest.mark.pure


def signal(noise_nm=(0.5, 0.25), loss=(0.0, 0.0)):
    raw = np.array([[3.0, 1.0], [-4.0, 1.0], [100.0, 100.0]])
    return SimpleNamespace(
        raw_nm=raw,
        valid=np.array([True, True, False]),
        noise_nm=np.array(noise_nm),
        smoothing_loss=np.array(loss),
        mismatch_rad=np.array([0.0012, 0.0001]),
        loaded=SimpleNamespace(position_fit_rad=np.array([0.00005, 0.00002])),
    )


def texts(rows, name):
    return [row[name].text for row in rows]


def test_values_are_those_of_the_valid_rows_in_the_units_of_the_page():
    rows = joint_rows(signal(), np.array([1.0, 0.125]), ("a", "b"), None)
    assert [(row["number"], row["name"], row["scale"]) for row in rows] == [(1, "a", ""), (2, "b", "")]
    assert [float(text) for text in texts(rows, "torque")] == pytest.approx([np.sqrt(12.5), 1.0], abs=1e-3)
    assert texts(rows, "ratio") == ["2.00", "0.50"]
    assert [float(text) for text in texts(rows, "noise")] == [0.5, 0.25]
    assert [float(text) for text in texts(rows, "mismatch")] == pytest.approx([1.2, 0.1])
    assert [float(text) for text in texts(rows, "position_fit")] == pytest.approx([0.05, 0.02])
    assert len({text.partition(".")[2].__len__() for text in texts(rows, "torque") + texts(rows, "residual")}) == 1


def test_without_noise_a_residual_is_infinitely_more_and_none_is_none():
    rows = joint_rows(signal(noise_nm=(0.0, 0.0)), np.array([1.0, 0.0]), ("a", "b"), None)
    assert texts(rows, "ratio")[0] in ("∞", "inf")
    assert float(texts(rows, "ratio")[1]) == 0.0


@pytest.mark.parametrize(("share", "lossy"), [(0.9, False), (1.1, True)])
def test_smoothing_that_takes_too_much_is_marked(share, lossy):
    loss = share * Smoothing.loss_limit
    rows = joint_rows(signal(loss=(0.0, loss)), np.ones(2), ("a", "b"), None)
    assert [row["lossy"] for row in rows] == [False, lossy]
    assert float(texts(rows, "loss")[1]) == pytest.approx(100.0 * loss, rel=0.1)


def test_scales_are_shown_where_they_are_determined():
    scales = SimpleNamespace(
        scale=np.array([1.0021, np.nan]), half_width_95=np.array([0.01, np.inf]), determined=np.array([True, False])
    )
    rows = joint_rows(signal(), np.ones(2), ("a", "b"), scales)
    assert [row["scale"] for row in rows] == ["1.002 ± 0.010", ""]
