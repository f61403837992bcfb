"""A payload's ten inertial parameters, whether they are physically possible, and the result of an identification."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.finite_array import finite_array, set_fields
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.numerals import decimals_for
from armload_identification.result_table import PrintedResult, ResultTable

AXES = ("x", "y", "z")
TENSOR_ELEMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""The six elements of an inertia tensor, in their order in files and results."""

PARAMETER_NAMES = ("mass", "cx", "cy", "cz", *TENSOR_ELEMENTS)
"""The ten values in their order in files and results: mass, centre of mass, tensor elements."""
UNITS = ("kg", *["m"] * 3, *["kg m2"] * 6)
NOT_DETERMINED = "not determined"
"""In place of a number that the data do not determine."""

FLANGE = "flange"
"""Name of the frame that payloads are identified in."""

SMALLEST_MARGIN = 1e-6
"""Least margin of a body in a file, after reading it back."""

REFERENCE_LENGTH_M = 0.1
"""Length in the scales of the ten values, `value_scale`."""

CONFIDENCE = 0.95
"""Of every interval."""
DETERMINED_SHARE = 0.20
"""A value is determined if the half width of its 95 % interval is at most this share of its scale, `value_scale`."""


@dataclass(frozen=True, eq=False)
class InertialParameters:
    """Inertial parameters of a rigid body in some frame.

    Attributes:
        theta: (10,) [m, m cx, m cy, m cz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz], inertia as TENSOR elements
            (Ixy = -int xy dm) about the ORIGIN of the frame, in kg, kg m, kg m2. They may be physically impossible.

    Raises:
        ModelError: not ten finite numbers.

    References:
        Chen 2016, eq. (4), but with the sign convention of URDF for the products of inertia.

    Examples:
        >>> import armload, numpy as np
        >>> tool = armload.InertialParameters.from_center_of_mass(2.0, [0.0, 0.0, 0.05], np.diag([0.01, 0.01, 0.002]))
        >>> tool.mass_kg, tool.theta.shape
        (2.0, (10,))
        >>> known = armload.KnownPayload(cad=tool)
    """

    theta: FloatArray

    def __post_init__(self) -> None:
        set_fields(self, {"theta": finite_array("theta", self.theta, (10,))})

    @classmethod
    def from_center_of_mass(
        cls, mass_kg: float, center_of_mass_m: ArrayLike, inertia_kg_m2: ArrayLike
    ) -> InertialParameters:
        """Parameters from mass, centre of mass and the inertia about it.

            I_origin = I_com + m (c^T c 1 - c c^T)

        Args:
            mass_kg: Mass.
            center_of_mass_m: (3,) centre of mass in the frame.
            inertia_kg_m2: (3, 3) symmetric inertia tensor about the centre of mass, in the frame's axes.

        Raises:
            ModelError: another shape, or a tensor that is not symmetric.
        """
        center = finite_array("centre of mass", center_of_mass_m, (3,))
        inertia = finite_array("inertia", inertia_kg_m2, (3, 3))
        if np.abs(inertia - inertia.T).max() > 1e-9 * np.abs(inertia).max():
            raise ModelError(f"inertia {inertia.tolist()} is not symmetric")
        about_origin = inertia + mass_kg * (center @ center * np.eye(3) - np.outer(center, center))
        return cls(np.concatenate([[mass_kg], mass_kg * center, tensor_elements(about_origin)]))

    @classmethod
    def from_pseudo_inertia(cls, pseudo_inertia: ArrayLike) -> InertialParameters:
        """Parameters from the pseudo-inertia matrix, the inverse of `pseudo_inertia`.

        Args:
            pseudo_inertia: (4, 4) symmetric matrix [[Sigma, m c], [m c^T, m]].

        Raises:
            ModelError: another shape.
        """
        matrix = finite_array("pseudo-inertia", pseudo_inertia, (4, 4))
        sigma = matrix[:3, :3]
        inertia = np.trace(sigma) * np.eye(3) - sigma
        return cls(np.concatenate([[matrix[3, 3]], matrix[:3, 3], tensor_elements(inertia)]))

    @property
    def mass_kg(self) -> float:
        """Mass."""
        return float(self.theta[0])

    @property
    def center_of_mass_m(self) -> FloatArray:
        """(3,) centre of mass in the frame.

        Raises:
            ModelError: the mass is zero.
        """
        if self.theta[0] == 0.0:
            raise ModelError("a body without mass has no centre of mass")
        return np.asarray(self.theta[1:4] / self.theta[0])

    @property
    def inertia_about_origin(self) -> FloatArray:
        """(3, 3) inertia tensor about the frame's origin, in kg m2."""
        return symmetric_tensor(self.theta[4:])

    @property
    def inertia_about_com(self) -> FloatArray:
        """(3, 3) inertia tensor about the centre of mass, in the frame's axes, in kg m2.

        Raises:
            ModelError: the mass is zero.
        """
        c = self.center_of_mass_m
        return self.inertia_about_origin - self.mass_kg * (c @ c * np.eye(3) - np.outer(c, c))

    @property
    def values(self) -> FloatArray:
        """(10,) mass, centre of mass, tensor elements about it, in kg, m, kg m2; in the order of `PARAMETER_NAMES`."""
        return np.concatenate([[self.mass_kg], self.center_of_mass_m, tensor_elements(self.inertia_about_com)])

    @property
    def pseudo_inertia(self) -> FloatArray:
        """(4, 4) pseudo-inertia J = int [r; 1] [r; 1]^T dm = [[Sigma, m c], [m c^T, m]].

        References:
            Wensing, Kim, Slotine, Linear matrix inequalities for physically consistent inertial parameter
            identification, IEEE RA-L 3(1), 2018, eq. (7).
        """
        inertia = self.inertia_about_origin
        matrix = np.empty((4, 4))
        matrix[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
        matrix[:3, 3] = matrix[3, :3] = self.theta[1:4]
        matrix[3, 3] = self.theta[0]
        return matrix

    @property
    def margin(self) -> float:
        """Smallest eigenvalue of the pseudo-inertia divided by its trace; -inf if the trace is not positive."""
        matrix = self.pseudo_inertia
        trace = float(np.trace(matrix))
        return float(np.linalg.eigvalsh(matrix)[0]) / trace if trace > 0.0 else -np.inf

    @property
    def is_physical(self) -> bool:
        """Whether some distribution of mass has these parameters: the margin is positive."""
        return self.margin > 0.0

    def transformed(self, pose: ArrayLike) -> InertialParameters:
        """The same body's parameters in another frame: J' = T J T^T.

        Args:
            pose: (4, 4) pose T of the present frame in the other one, so that a point p becomes T p.

        Raises:
            ModelError: another shape.
        """
        matrix = finite_array("pose", pose, (4, 4))
        return InertialParameters.from_pseudo_inertia(matrix @ self.pseudo_inertia @ matrix.T)


@dataclass(frozen=True, slots=True)
class Provenance:
    """What a payload was identified from.

    Attributes:
        armload_version: Version of the program.
        configuration_sha256: Hash of the robot's configuration file.
        recordings_sha256: File name and hash of each recording that it was identified from.
        calibration_sha256: File name and hash of the arm's calibration; empty without one.
        robot: Name of the arm; empty if unknown.
        kinematics_sha256: Its `Chain.kinematics_sha256`; empty if unknown.
        validation_sha256: File name and hash of each recording that it was validated with; empty if unknown.
    """

    armload_version: str
    configuration_sha256: str
    recordings_sha256: dict[str, str]
    calibration_sha256: dict[str, str] = field(default_factory=dict)
    robot: str = ""
    kinematics_sha256: str = ""
    validation_sha256: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False, slots=True)
class PayloadResult(PrintedResult):
    """Result of an identification: the content of a payload file; printed as a table.

    The ten values, their flags and intervals are in the order of `PARAMETER_NAMES`: mass, centre of mass, and
    the inertia's tensor elements about the CENTRE OF MASS.

    Attributes:
        frame: Name of the frame of all values.
        model: The complete, physically possible set for the feed-forward, which contains the determined values.
        determined: (10,) True where the data determine the value.
        interval_95: (10, 2) low and high end of the 95 % interval; nan where not determined.
        residual_rms_nm: (n,) RMS of measured minus predicted torque, per joint.
        noise_nm: (n,) standard deviation of the measured torque's noise, per joint, on the same signal.
        provenance: What the result was made from.
        mass_center: Covariance of mass and centre of mass, for comparison with another identification; None if only
            the intervals are known, as for a payload from a drawing.
        known_range: (10, 2) known ranges that narrowed the intervals, -inf and inf where there is none; None without
            any.
    """

    frame: str
    model: InertialParameters
    determined: NDArray[np.bool_]
    interval_95: FloatArray
    residual_rms_nm: FloatArray
    noise_nm: FloatArray
    provenance: Provenance
    mass_center: MassCenterCovariance | None = None
    known_range: FloatArray | None = None

    @property
    def values(self) -> FloatArray:
        """(10,) of the model, in the order of `PARAMETER_NAMES`."""
        return self.model.values

    @property
    def feedforward_ready(self) -> bool:
        """Whether mass and centre of mass are determined, which a feed-forward requires."""
        return bool(np.all(self.determined[:4]))

    def table(self) -> ResultTable:
        """The ten values, with as many digits as the interval justifies, and no number for undetermined values."""
        rows = []
        values = zip(PARAMETER_NAMES, self.values, self.determined, self.interval_95, UNITS, strict=True)
        for name, value, known, ends, unit in values:
            digits = decimals_for((ends[1] - ends[0]) / 2, value)
            interval = " to ".join(f"{end:.{digits}f}" for end in ends) if known else ""
            rows.append((name, f"{value:.{digits}f}" if known else NOT_DETERMINED, interval, unit))
        title = f"Payload in the {self.frame} frame, inertia about its centre of mass"
        return ResultTable(title, ("parameter", "estimate", "95 % interval", "unit"), rows, (0, 3))


def value_scale(mass_kg: float) -> FloatArray:
    """(10,) scale of each value of a payload: m; 0.1 m for the centre of mass; m (0.1 m)^2 for the inertia about it."""
    return np.array([mass_kg] + [REFERENCE_LENGTH_M] * 3 + [mass_kg * REFERENCE_LENGTH_M**2] * 6)


_PLACES = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
"""Index of each element of a tensor among the six."""


def symmetric_tensor(elements: ArrayLike) -> FloatArray:
    """(..., 3, 3) tensors of their (..., 6) elements, in the order of `TENSOR_ELEMENTS`."""
    return np.asarray(np.asarray(elements, dtype=np.float64)[..., _PLACES])


def tensor_elements(tensor: FloatArray) -> FloatArray:
    """(..., 6) elements of (..., 3, 3) tensors, in the order of `TENSOR_ELEMENTS`."""
    return np.asarray(tensor[..., [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])


PSEUDO_INERTIA_BASIS = np.array([InertialParameters(row).pseudo_inertia for row in np.eye(10)])
"""(10, 4, 4) pseudo-inertia of one unit of each parameter: J(theta) = sum_i theta_i BASIS_i."""


def derived(parameters: InertialParameters) -> tuple[FloatArray, FloatArray]:
    """Mass, centre of mass and inertia about it, and their derivatives by theta.

        c = s / m,    I_com = I - (s^T s 1 - s s^T) / m

    Args:
        parameters: Where they are evaluated.

    Returns:
        (10,) quantities in the order of `PARAMETER_NAMES`, and (10, 10) derivatives by theta.
    """
    mass, first = parameters.mass_kg, parameters.theta[1:4]
    slope = np.zeros((10, 10))
    slope[0, 0] = 1.0
    slope[1:4, 0] = -first / mass**2
    slope[1:4, 1:4] = np.eye(3) / mass
    slope[4:, 4:] = np.eye(6)
    # By each element of s: of s s^T - (s^T s) 1.
    by_each = [np.outer(e, first) + np.outer(first, e) - 2.0 * (e @ first) * np.eye(3) for e in np.eye(3)]
    steiner = np.column_stack([tensor_elements(part) for part in by_each])
    slope[4:, 1:4] = steiner / mass
    # Euler's theorem: the Steiner part is of degree two in s, so its value is half of s times its gradient.
    slope[4:, 0] = -0.5 * steiner @ first / mass**2
    return parameters.values, slope
