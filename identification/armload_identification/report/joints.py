"""The table of a run: each joint's torque, noise and residual."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.numerals import Numeral, align, common_decimals, numeral
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.signal_constants import Smoothing
from armload_identification.verdict.recording_checks.joint_scales import JointScales


def joint_rows(
    signal: LoadSignal,
    residual_rms_nm: FloatArray,
    names: Sequence[str],
    scales: JointScales | None,
) -> list[dict[str, Any]]:
    """The table of a run; torques in N m, of single raw samples.

    Args:
        residual_rms_nm: (n,) RMS of single raw differences minus prediction.
        names: Names of the joints.
        scales: Ratio of measured to predicted torque; None if not requested.

    Returns:
        Cells of each row: `number`, from 1, and `name`; `torque`, RMS of the payload's; `noise`, its standard deviation
        in the difference of two samples; `residual`, RMS of that difference minus prediction, and its `ratio` to the
        noise; `loss`, share of the signal removed by smoothing, in percent, `lossy` if the method allows less;
        `mismatch`, RMS difference of the two motions, and `position_fit`, of measured minus fitted position, in mrad;
        `scale` with its 95 % interval, empty if not requested or not determined.
    """
    decimals = common_decimals(signal.noise_nm, 3)
    ratio = np.where(residual_rms_nm > 0.0, np.inf, 0.0)  # infinite without noise, 0 without both
    np.divide(residual_rms_nm, signal.noise_nm, out=ratio, where=signal.noise_nm > 0.0)
    columns = {
        "torque": _column(np.sqrt(np.mean(signal.raw_nm[signal.valid] ** 2, axis=0)), decimals),
        "noise": _column(signal.noise_nm, decimals),
        "residual": _column(residual_rms_nm, decimals),
        "ratio": _column(ratio, 2),
        "loss": _column(100.0 * signal.smoothing_loss),
        "mismatch": _column(1e3 * signal.mismatch_rad),
        "position_fit": _column(1e3 * signal.loaded.position_fit_rad),
    }
    return [
        {
            "number": joint + 1,
            "name": name,
            "lossy": signal.smoothing_loss[joint] > Smoothing.loss_limit,
            "scale": "" if scales is None or not scales.determined[joint] else _scale(scales, joint),
            **{quantity: column[joint] for quantity, column in columns.items()},
        }
        for joint, name in enumerate(names)
    ]


def _scale(scales: JointScales, joint: int) -> str:
    """'1.002 ± 0.010'."""
    return f"{numeral(scales.scale[joint], 3)} ± {numeral(scales.half_width_95[joint], 3)}"


def _column(values: FloatArray, decimals: int | None = None) -> tuple[Numeral, ...]:
    """Numbers with the same number of decimals; for two digits of the greatest if not given."""
    decimals = common_decimals(values, 2) if decimals is None else decimals
    return align([numeral(float(value), decimals) for value in values])
