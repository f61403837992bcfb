"""A seven-joint arm simulated by Pinocchio, with all disturbances of a pair of runs at once.

It shares no dynamics with the code under test. The servos hold their positions like springs, so that the loaded arm
follows another path than the empty one; the gears have Coulomb, viscous and load-dependent friction; the drives report
torque late and with coloured noise; positions have encoder noise; gains are exact or off.

References:
    Modified D-H rows: Franka Emika, Robot and interface specifications. Links: Gaz, Cognetti, Oliva, Robuffo Giordano,
    De Luca, Dynamic identification of the Franka Emika Panda robot, IEEE RA-L 4(4), 2019.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
import pinocchio as pin
from scipy.signal import lfilter

from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission

N: Final = 7
H: Final = np.pi / 2.0
ROWS: Final = np.array(
    [
        [0.0, 0.0, 0.333, 0.0],
        [-H, 0.0, 0.0, 0.0],
        [H, 0.0, 0.316, 0.0],
        [H, 0.0825, 0.0, 0.0],
        [-H, -0.0825, 0.384, 0.0],
        [H, 0.0, 0.0, 0.0],
        [H, 0.088, 0.0, 0.0],
    ]
)
"""(7, 4) alpha_{i-1} rad, a_{i-1} m, d_i m, offset rad; modified D-H."""
FLANGE_M: Final = 0.107
LINKS: Final = np.array(
    [
        # mass kg, centre of mass m, then Ixx Iyy Izz Ixy Ixz Iyz about it, kg m2
        [4.970684, 3.875e-3, 2.081e-3, -0.1750, 0.70337, 0.70661, 9.117e-3, -1.39e-4, 6.772e-3, 1.9169e-2],
        [0.646926, -3.141e-3, -2.872e-2, 3.495e-3, 7.962e-3, 2.811e-2, 2.5995e-2, -3.925e-3, 1.0254e-2, 7.04e-4],
        [3.228604, 2.7518e-2, 3.9252e-2, -6.6502e-2, 3.7242e-2, 3.6155e-2, 1.083e-2, -4.761e-3, -1.1396e-2, -1.2805e-2],
        [3.587895, -5.317e-2, 0.104419, 2.7454e-2, 2.5853e-2, 1.9552e-2, 2.8323e-2, 7.796e-3, -1.332e-3, 8.641e-3],
        [1.225946, -1.1953e-2, 4.1065e-2, -3.8437e-2, 3.5549e-2, 2.9474e-2, 8.627e-3, -2.117e-3, -4.037e-3, 2.29e-4],
        [1.666555, 6.0149e-2, -1.4117e-2, -1.0517e-2, 1.964e-3, 4.354e-3, 5.433e-3, 1.09e-4, -1.158e-3, 3.41e-4],
        [0.735522, 1.0517e-2, -4.252e-3, 6.1597e-2, 1.2516e-2, 1.0027e-2, 4.815e-3, -4.28e-4, -1.196e-3, -7.41e-4],
    ]
)
HOME_RAD: Final = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.8])
STROKE_RAD: Final = np.array([0.7, 0.5, 0.6, 0.5, 0.7, 0.6, 0.9])
PERIOD_S: Final = 10.0
HARMONICS: Final = 5
RATE_HZ: Final = 100.0
ROTOR_KG_M2: Final = np.array([0.6, 0.6, 0.5, 0.5, 0.2, 0.2, 0.2])
COULOMB_NM: Final = np.array([0.9, 1.0, 0.7, 0.8, 0.5, 0.4, 0.4])
VISCOUS_NM_S_RAD: Final = np.array([1.0, 1.2, 0.8, 0.9, 0.4, 0.3, 0.3])
LOAD_FRICTION: Final = np.array([0.04, 0.08, 0.05, 0.08, 0.05, 0.05, 0.03])
TURN_OVER_RAD_S: Final = 2e-3
NOISE_NM: Final = np.array([0.25, 0.25, 0.2, 0.2, 0.1, 0.08, 0.06])
COLOURED: Final = 0.3
"""Share of the noise's variance that is coloured."""
MEMORY_S: Final = 0.3
ENCODER_RAD: Final = 5e-6
DELAY_S: Final = 0.002
PAYLOAD: Final = InertialParameters.from_center_of_mass(
    2.0, [0.03, -0.05, 0.08], [[0.006, 0.0005, -0.0004], [0.0005, 0.008, 0.0006], [-0.0004, 0.0006, 0.005]]
)
SAG_RAD: Final = 4e-4
"""Distance of loaded from unloaded positions where the payload's torque is greatest."""
_FINE: Final = 2000
_SAG_HARMONICS: Final = 60


def chain() -> Chain:
    """The arm's kinematics as a user would configure them."""
    flange = np.eye(4)
    flange[2, 3] = FLANGE_M
    return Chain.from_modified_dh(ROWS, flange, [0.0, 0.0, -9.81])


def excitation(seed: int = 1) -> FourierTrajectory:
    """A motion at moderate speed: five harmonics of 0.1 Hz about a pose with the elbow bent.

    Args:
        seed: Draws the coefficients.
    """
    rng = np.random.default_rng(seed)
    draw = rng.normal(size=(2, N, HARMONICS)) / np.arange(1, HARMONICS + 1)
    size = STROKE_RAD[:, None] / np.sqrt(np.sum(draw**2, axis=(0, 2)))[:, None]
    return FourierTrajectory(1.0 / PERIOD_S, HOME_RAD, draw[0] * size, draw[1] * size)


@dataclass(frozen=True, eq=False)
class Effects:
    """Disturbances; all of them by default.

    Attributes:
        sag_rad: Distance between loaded and unloaded positions where the payload's torque is greatest.
        load_friction: (7,) friction as a share of the links' torque.
        delay_s: Delay of the reported torque behind the position.
        coloured: Share of the noise's variance that is coloured.
        noise: Factor on the noise of torque and encoders.
        friction: Factor on all friction.
    """

    sag_rad: float = SAG_RAD
    load_friction: FloatArray = field(default_factory=LOAD_FRICTION.copy)
    delay_s: float = DELAY_S
    coloured: float = COLOURED
    noise: float = 1.0
    friction: float = 1.0


@dataclass(frozen=True, eq=False)
class SaggingPanda:
    """The arm on one motion, with and without its payload.

    Attributes:
        effects: Its disturbances.
        motion: The commanded motion.
        payload: Of the loaded run.
        periods: Whole periods of each run.
    """

    effects: Effects = field(default_factory=Effects)
    motion: FourierTrajectory = field(default_factory=excitation)
    payload: InertialParameters = PAYLOAD
    periods: int = 5
    _clean: dict[bool, tuple[FloatArray, FloatArray]] = field(init=False, default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        time_s = np.arange(_FINE) / _FINE * PERIOD_S
        state = self.motion.evaluate(time_s)
        commanded = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
        links = {loaded: self._link_torque(loaded, *commanded) for loaded in (False, True)}
        greatest = np.abs(links[True] - links[False]).max(axis=0)
        for loaded, torque in links.items():
            sag = -self.effects.sag_rad * torque / greatest
            self._clean[loaded] = self._period(loaded, np.fft.rfft(sag, axis=0) / _FINE)

    def _period(self, loaded: bool, sag: np.ndarray) -> tuple[FloatArray, FloatArray]:
        """(K, 7) position and reported torque of one period; rotor inertia does not load the gears."""
        time_s = np.arange(round(PERIOD_S * RATE_HZ)) / RATE_HZ
        position = self._moved(time_s, sag)[0]
        q, dq, ddq = self._moved(time_s - self.effects.delay_s, sag)
        links = self._link_torque(loaded, q, dq, ddq)
        direction = np.tanh(dq / TURN_OVER_RAD_S)
        friction = direction * (COULOMB_NM + self.effects.load_friction * np.abs(links)) + VISCOUS_NM_S_RAD * dq
        return position, links + ROTOR_KG_M2 * ddq + self.effects.friction * friction

    def _moved(self, time_s: FloatArray, sag: np.ndarray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Commanded motion plus sag: position, velocity and acceleration, (K, 7) each, by analytic derivatives."""
        state = self.motion.evaluate(time_s)
        rate = 2j * np.pi / PERIOD_S * np.arange(_SAG_HARMONICS)
        turning = np.exp(time_s[:, None] * rate)
        twice = np.where(np.arange(_SAG_HARMONICS) == 0, 1.0, 2.0)
        kept = sag[:_SAG_HARMONICS] * twice[:, None]
        moved = [(turning @ (kept * rate[:, None] ** order)).real for order in range(3)]
        given = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
        return tuple(one + more for one, more in zip(given, moved, strict=True))

    def _link_torque(self, loaded: bool, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """(K, 7) by Pinocchio's recursive Newton-Euler."""
        model = _model(self.payload if loaded else None)
        data = model.createData()
        return np.array([pin.rnea(model, data, *state) for state in zip(q, dq, ddq, strict=True)])

    def pair(
        self, seed: int, gain_error: FloatArray | None = None, *, with_phase: bool = False
    ) -> tuple[Recording, Recording]:
        """A loaded and an unloaded run.

        Args:
            seed: Draws the noise.
            gain_error: (7,) e; the motor gives 1 + e times the torque that its drive reports.
            with_phase: Whether the recordings have the excitation and their phase in it.
        """
        rng = np.random.default_rng([seed, 7])
        error = np.zeros(N) if gain_error is None else gain_error
        return self._run(rng, True, error, with_phase), self._run(rng, False, error, with_phase)

    def _run(self, rng: np.random.Generator, loaded: bool, gain_error: FloatArray, with_phase: bool) -> Recording:
        position, torque = (np.tile(part, (self.periods, 1)) for part in self._clean[loaded])
        samples = len(position)
        time_s = np.arange(samples) / RATE_HZ
        share = self.effects.coloured
        decay = np.exp(-1.0 / (RATE_HZ * MEMORY_S))
        drive = rng.normal(size=(samples + 500, N)) * np.sqrt(1.0 - decay**2)
        slow = lfilter([1.0], [1.0, -decay], drive, axis=0)[500:]
        noise = np.sqrt(1.0 - share) * rng.normal(size=(samples, N)) + np.sqrt(share) * slow
        position = position + self.effects.noise * ENCODER_RAD * rng.normal(size=position.shape)
        return Recording.from_arrays(
            time_s,
            position,
            current_a=(torque + self.effects.noise * NOISE_NM * noise) / (1.0 + gain_error),
            phase_s=time_s + 1.0 / RATE_HZ if with_phase else None,
            excitation=Excitation(self.motion, self.periods) if with_phase else None,
            name="loaded" if loaded else "unloaded",
        )


def nominal_transmission(*, exact: bool) -> Transmission:
    """Gains of one.

    Args:
        exact: Whether they are known to be exact; nominal otherwise.
    """
    return Transmission(np.ones(N), np.eye(N), np.full(N, exact))


def _model(payload: InertialParameters | None) -> pin.Model:
    """The arm in Pinocchio."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    parent = 0
    for number, (row, link) in enumerate(zip(ROWS, LINKS, strict=True), 1):
        alpha, a, d, _ = row
        turn = pin.utils.rotate("x", alpha)
        placement = pin.SE3(turn, np.array([a, 0.0, 0.0]) + turn @ np.array([0.0, 0.0, d]))
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint{number}")
        mass, center, (xx, yy, zz, xy, xz, yz) = link[0], link[1:4], link[4:]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        model.appendBodyToJoint(parent, pin.Inertia(mass, center, inertia), pin.SE3.Identity())
    if payload is not None:
        flange = pin.SE3(np.eye(3), np.array([0.0, 0.0, FLANGE_M]))
        body = pin.Inertia(payload.mass_kg, payload.center_of_mass_m, payload.inertia_about_com)
        model.appendBodyToJoint(parent, body, flange)
    return model
