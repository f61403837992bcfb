"""The tolerated error of a payload, 2 % of its mass and 10 mm; cheap to import, for the command line."""

from __future__ import annotations

from dataclasses import dataclass

from armload_identification.identification_errors import ModelError
from armload_identification.verdict.decision_levels import DefaultTolerance


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Tolerated error of a payload.

    Attributes:
        mass_share: As a share of its mass.
        center_m: As a distance of its centre of mass.

    Raises:
        ModelError: a tolerance that is not between 0 and 1.

    Examples:
        >>> import armload
        >>> armload.Tolerance(mass_share=0.05)
        Tolerance(mass_share=0.05, center_m=0.01)
    """

    mass_share: float = DefaultTolerance.mass_share
    center_m: float = DefaultTolerance.center_m

    def __post_init__(self) -> None:
        for name, value in (("share of the mass", self.mass_share), ("distance of the centre of mass", self.center_m)):
            if not 0.0 < value < 1.0:
                raise ModelError(f"the tolerance's {name} is {value}; expected 0 to 1, such as 0.02 or 0.01 m")
