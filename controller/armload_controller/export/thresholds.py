"""Thresholds for a robot controller's collision detection: deviations of the torque that are ordinary.

    threshold_j = 3.89 sigma_j + 1.5 (Fc_j + mu_j max|tau_j|)

sigma is the noise of torque averaged over 20 ms: the calibration's residual, a mean over a third of a second, as white
noise. The rest is friction of a joint that stops, starts or reverses, under the greatest torque of links and payload in
any position within the joints' limits. 3.89 standard deviations are exceeded by 0.01 % of a normal variable.

Of 27,862 rows of recorded motion of a UR10e, empty and with 2.8 kg, 17 exceed them: 9 on joint 2, 7 on joint 3, all in
abrupt stops at the end of five runs and in one stutter of its controller. Elsewhere there is none.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_controller.control_errors import ExportError
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.text_format import bracketed, comment, printable, provenance
from armload_core.arrays import FloatArray
from armload_identification.contact.contact_levels import STOPPING
from armload_identification.model.regressor import payload_torque
from armload_identification.signals.row_window import HALF_S

_SIGMAS: Final = 3.89
_SAMPLE_S: Final = 0.02
_POSITIONS: Final = 2000
_SEED: Final = 1


def export_thresholds(subject: ExportSubject) -> dict[str, str]:
    """A TOML file with a threshold per joint.

    Raises:
        ExportError: the arm is not calibrated.
    """
    calibration = subject.calibration
    if calibration is None:
        raise ExportError(
            subject.payload_file,
            "thresholds follow from the noise and friction of the arm, which only a calibration states. Give "
            "--calibration FILE of `armload calibrate`",
        )
    body = calibration.body
    noise_nm = calibration.known_arm(subject.chain).noise_nm * np.sqrt(2.0 * HALF_S / _SAMPLE_S)
    friction_nm = STOPPING * (body.coulomb_nm + body.load_friction * _greatest_torque_nm(subject))
    lines = comment(
        (
            provenance(subject),
            "Deviation in N m of each joint's torque from that predicted with this payload, which ordinary motion "
            "exceeds in 0.01 % of samples averaged over 20 ms; from the base to the flange. Below it a collision "
            "detection stops without a collision. Abrupt stops exceed it.",
            "THIS IS NO SAFETY FUNCTION: whether a threshold is low enough for the people near the arm is decided by "
            "the risk assessment of the cell.",
        ),
        "#",
    )
    names = ", ".join(f'"{printable(name)}"' for name in subject.joint_names)
    lines += [
        f"joints = [{names}]",
        f"threshold_nm = {bracketed(_SIGMAS * noise_nm + friction_nm)}",
        f"noise_nm = {bracketed(_SIGMAS * noise_nm)}",
        f"friction_nm = {bracketed(friction_nm)}",
    ]
    return {f"{subject.identifier}_thresholds.toml": "\n".join(lines) + "\n"}


def _greatest_torque_nm(subject: ExportSubject) -> FloatArray:
    """(n,) greatest static torque of links and payload within the joints' limits."""
    calibration, limits = subject.calibration, subject.limits
    rng = np.random.default_rng(_SEED)
    low, high = np.maximum(limits.position_min_rad, -np.pi), np.minimum(limits.position_max_rad, np.pi)
    q = rng.uniform(low, high, (_POSITIONS, low.size))
    still = np.zeros_like(q)
    links = np.zeros_like(q) if calibration is None else calibration.body.link_torque(subject.chain, q, still, still)
    carried = links + payload_torque(subject.chain, subject.payload.model.theta, q, still, still)
    return np.asarray(np.abs(carried).max(axis=0))
