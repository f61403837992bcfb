"""One run of any motion as a payload is fitted to it: its torque minus the calibrated arm's, row by row."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.model.body_model import smooth_sign
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.regressor import payload_regressor
from armload_identification.signals.load_signal import LoadSignal, without_body
from armload_identification.signals.motion import Motion
from armload_identification.signals.row_window import RowWindow

_ROW_S: Final = 0.05
"""Samples closer together add no information: the residual is correlated over some tenths of a second."""
_MODEL_S: Final = 0.01
"""Spacing of the model's samples that are averaged into a row, unless the run's own is greater."""


@dataclass(frozen=True, eq=False)
class KnownArmSignal:
    """K rows of n joints.

    Attributes:
        signal: The run minus the calibrated arm's torque, friction included.
        regressor: (K, n, 10) of the payload, averaged over the same window as the torque.
        onward: (K, n) weight, 0 where a joint reverses or stands still within a row's window.
    """

    signal: LoadSignal
    regressor: FloatArray
    onward: FloatArray

    @classmethod
    def of(cls, motion: Motion, chain: Chain, arm: KnownArm) -> KnownArmSignal:
        """The rows of a run; an average period is used as it is, since its motion and torque are filtered alike.

        Args:
            motion: The run.
            chain: The arm, with the tilt of its calibration.
            arm: Its calibration.
        """
        body = arm.fit.model
        moved = motion.with_delay(body.torque_delay_s)
        if moved.periodic:
            signal = without_body(moved, body.torque(chain, *moved.states))
            return cls(signal, payload_regressor(chain, *moved.states), np.ones_like(moved.torque_nm))
        thin = max(round(_MODEL_S / moved.interval_s), 1)
        step = max(round(_ROW_S / (thin * moved.interval_s)), 1)
        fine = moved.every(thin)
        window = RowWindow.of(len(fine.time_s), fine.interval_s, step)
        measured = RowWindow.of(len(moved.time_s), moved.interval_s, thin * step)
        body_nm = body.torque(chain, *fine.states)
        rows = replace(
            fine.every(step),
            states=JointStates(*(window.mean(values) for values in fine.states)),
            torque_nm=measured.mean(moved.raw_nm),
            valid=measured.usable(moved.valid),
        )
        signal = without_body(rows, body_nm[::step])
        direction = smooth_sign(fine.states.velocity_rad_s, body.reversal_speed_rad_s)
        return cls(
            replace(signal, unloaded=replace(signal.unloaded, torque_nm=window.mean(body_nm))),
            window.mean(payload_regressor(chain, *fine.states)),
            window.onward(direction),
        )

    def part(self, start_s: float, end_s: float) -> KnownArmSignal:
        """The rows from one time up to, not including, another.

        Args:
            start_s: Since the first row.
            end_s: Likewise.
        """
        rows = slice(*np.searchsorted(self.signal.time_s, [start_s, end_s]))
        return KnownArmSignal(self.signal.part(start_s, end_s), self.regressor[rows], self.onward[rows])
