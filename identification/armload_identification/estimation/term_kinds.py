"""Terms of an arm's torque: unknowns with columns, a prior and a scope.

    y = exp(gains) [C^T (tau + friction(tau)) + rotors],        tau = links + payload, shifted by delay and tilt

A term acts at one of these places, its law. What the law does not say (which runs share it, what is known of it
beforehand, and from where) is in the term. A new term needs a law's columns and one line in the list of terms that a
problem is made of: `CONTRIBUTING.md` shows one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray

if TYPE_CHECKING:
    from armload_identification.estimation.arm_rows import ArmRows


class Scope(StrEnum):
    """What shares the values of a term."""

    ARM = "arm"
    MOUNTING = "mounting"
    RUN = "run"


LoadColumns = tuple[FloatArray, FloatArray]


class Load(Struct, frozen=True):
    """Torque that is linear in the values and passes the gears: links and payloads.

    Attributes:
        columns: Of N rows: (N, n, k) columns, and (N, 3, n, k) their change per second of delay and per rad of each
            tilt.
    """

    columns: Callable[[ArmRows], LoadColumns]


class Joint(Struct, frozen=True):
    """Torque of each joint that is linear in m values per joint and may depend on the torque its gear carries.

    Attributes:
        columns: Of N rows and the (N, n) carried torque: (m, N, n) torque per unit, and (m, N, n) its derivative with
            respect to the carried torque, None where it does not depend on it.
    """

    columns: Callable[[ArmRows, FloatArray], tuple[FloatArray, FloatArray | None]]


class Motor(Struct, frozen=True):
    """Torque of each axis on the motor's side of the coupling.

    Attributes:
        columns: Of N rows: (N, n) torque per unit, and (N, n) its change per second of delay.
    """

    columns: Callable[[ArmRows], tuple[FloatArray, FloatArray]]


class Shared(StrEnum):
    """Laws without columns of their own: they act on all of the torque."""

    GAIN = "logarithm of the factor of each axis"
    DELAY = "delay of the torque"
    TILT = "tilt of the base"


Law = Load | Joint | Motor | Shared
Values = Mapping[str, FloatArray]
"""Values of the arm's terms by name."""


class Term(Struct, frozen=True, eq=False):
    """An unknown of k values.

    Attributes:
        name: Its name, unique in a problem.
        scope: What shares its values.
        law: How it acts.
        mean: (k,) expected values.
        deviation: (k,) their standard deviations; 0 where a value is known exactly, inf where nothing is known.
        origin: Where the standard deviation comes from.
        rescaled: The (k,) standard deviations for other values of the arm's terms, if they are shares of these.
        pooled: (k,) number, from 0, of the factor on its standard deviation that is estimated from all values with the
            same number; None if the standard deviations are as given.
        freedom: Degrees of freedom that the stated standard deviation of a pooled term is worth.
    """

    name: str
    scope: Scope
    law: Law
    mean: FloatArray
    deviation: FloatArray
    origin: str
    rescaled: Callable[[Values], FloatArray] | None = None
    pooled: NDArray[np.intp] | None = None
    freedom: float = 0.0


Placed = tuple[tuple[Term, slice], ...]
"""The terms that act on a run, and where the values of each are."""
