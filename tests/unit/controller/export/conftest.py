"""An export as a library, and an arm with constructed calibration."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest

from armload_controller.export.c99 import export_c
from armload_controller.export.straight_line.precision import Precision
from armload_identification.calibration.calibration_result import ArmCalibration, kinematics_sha256
from armload_identification.model.body_model import BodyModel
from armload_identification.model.payload import Provenance
from armload_identification.pipeline.estimator_constants import estimator_constants
from armload_identification.recording.reading_options import Effort
from armload_identification.signals.joint_torque import Transmission
from tests.unit.controller.export.compiled_c import FLAGS, GCC, run


@pytest.fixture(scope="session")
def library(tmp_path_factory):
    """An export as a library with its self-test; each is compiled once."""
    made = {}

    def library(subject, *options, precision=Precision.DOUBLE):
        texts = export_c(subject, precision)
        name = next(file.removesuffix(".hpp") for file in texts if file.endswith(".hpp"))
        key = texts[f"{name}.c"], options
        if key not in made:
            folder = tmp_path_factory.mktemp(name)
            for file, text in texts.items():
                (folder / file).write_text(text)
            sources = [file for file in texts if file.endswith(".c")]
            flags = [*FLAGS, *options, "-DARMLOAD_SELFTEST", "-shared", "-fPIC"]
            run(GCC, *flags, *sources, "-o", "a.so", "-lm", cwd=folder)
            made[key] = ctypes.CDLL(str(folder / "a.so"))
        return made[key], name

    return library


@pytest.fixture(scope="session")
def any_calibration():
    """A calibration with random links and friction, and two motors that each turn two joints."""

    def any_calibration(chain):
        n = chain.n
        rng = np.random.default_rng(30)
        coupling = np.eye(n)
        coupling[n - 1, n - 2] = 0.5
        links = rng.uniform(-1.0, 1.0, (n, 10)) * [10.0, *[2.0] * 3, *[1.0] * 6]
        body = BodyModel(
            links=links,
            rotor_inertia_kg_m2=rng.uniform(0.1, 1.0, n),
            viscous_nm_s_rad=rng.uniform(1.0, 5.0, n),
            coulomb_nm=rng.uniform(2.0, 6.0, n),
            coupling=coupling,
            base=np.ones((n, 10), dtype=bool),
            root_nm=rng.uniform(0.1, 1.0, n),
            offset_nm=rng.uniform(-1.0, 1.0, n),
            load_friction=rng.uniform(0.02, 0.1, n),
            torque_delay_s=0.003,
            reversal_speed_rad_s=rng.uniform(0.01, 0.03, n),
        )
        ones = np.ones(n)
        return ArmCalibration(
            robot="any",
            effort=Effort.CURRENT,
            gain_nm_a=rng.uniform(5.0, 15.0, n),
            nominal=10.0 * ones,
            body=body,
            tilt_rad=np.array([0.01, -0.02]),
            covariance=np.eye(n + 10 * n + 5 * n + 3),
            drift=rng.uniform(0.1, 0.5, (3, n)),
            noise_nm=rng.uniform(0.5, 1.5, n),
            correlation_s=0.02 * ones,
            level_nm=50.0 * ones,
            payloads=(),
            runs=(),
            left_out=(),
            warnings=(),
            kinematics_sha256=kinematics_sha256(chain),
            provenance=Provenance("0", "0", {}),
        )

    return any_calibration


@pytest.fixture(scope="session")
def calibrated(make_subject, any_calibration):
    """The er50, calibrated and not level."""
    subject = make_subject("er50")
    calibration = any_calibration(subject.chain)
    transmission = Transmission(np.full(6, 10.0), calibration.body.coupling)
    return replace(
        subject,
        chain=calibration.level(subject.chain),
        calibration=calibration,
        estimator=estimator_constants(calibration, subject.chain, transmission),
        calibration_sha256={"arm.calibration.toml": "77ab"},
    )
