"""Errors of the identification.

IdentificationError
 +-- ModelError         invalid parameters of a chain, payload or trajectory
 +-- RecordingError     a recording that cannot be read or does not fit the arm
 +-- EstimationError    data that do not determine the result
 |    +-- NoPayloadMass a payload's mass that the data do not determine, or that is not above 0
 |         +-- NothingMounted runs that prove that the arm carries nothing
 +-- ExcitationError    no trajectory within the limits
 +-- FileError          a file of this program that cannot be used: file, key, value found and what was expected
 |    +-- CalibrationFileError an arm.calibration.toml that is incomplete or inconsistent
 |    +-- RunTableError        an invalid table of an arm's runs
 |    +-- PayloadFileError     a payload.toml that is incomplete, inconsistent or physically impossible
 |    +-- ExcitationFileError  an excitation that is incomplete or inconsistent
 +-- ReportError        a report that cannot be written
 +-- ExtraMissing       a library that a plain installation does not include
"""

from __future__ import annotations

import math
import reprlib


class IdentificationError(Exception):
    """Root of everything that `armload_identification` raises; a mistake in a robot's file is a `ControlError`.

    Examples:
        >>> import armload
        >>> try:
        ...     armload.read_recording("none.mcap")
        ... except armload.IdentificationError as error:
        ...     print(type(error).__name__)
        RecordingError
    """


class ModelError(IdentificationError):
    """Invalid parameters of a chain, payload or trajectory."""


class RecordingError(IdentificationError):
    """A recording that cannot be read or does not fit the arm."""


class NamelessColumns(RecordingError):
    """A table whose column names say nothing of positions."""


class EstimationError(IdentificationError):
    """Data that do not determine the result."""


class NoPayloadMass(EstimationError):
    """A payload's mass that the data do not determine, or that is not above 0.

    Attributes:
        mass_kg: The estimate.
        half_width_kg: Half width of its 95 % interval, systematic errors included.
    """

    def __init__(self, message: str, mass_kg: float, half_width_kg: float) -> None:
        super().__init__(message)
        self.mass_kg = mass_kg
        self.half_width_kg = half_width_kg


class NothingMounted(NoPayloadMass):
    """Runs that prove that the arm carries nothing: an answer of `identify`, an error where a payload is needed.

    Attributes:
        statement: The answer with its 95 % interval.

    Examples:
        >>> import armload
        >>> issubclass(armload.NothingMounted, armload.IdentificationError)
        True
    """

    def __init__(self, mass_kg: float, half_width_kg: float, where: str = "") -> None:
        digits = max(1 - math.floor(math.log10(max(half_width_kg, 1e-9))), 0)
        self.statement = f"nothing mounted: {mass_kg:z.{digits}f} +- {half_width_kg:.{digits}f} kg"
        super().__init__(f"{where}{self.statement}", mass_kg, half_width_kg)


class ExcitationError(IdentificationError):
    """No trajectory was found within the limits."""


class FileProblem(Exception):
    """What is wrong with a file.

    Attributes:
        file: The file, or the name of the text.
        key: Dotted path of the key; the first entry of a list is [1]. Empty if the error concerns the entire file.
        found: The value found; None if there is none. A table is not repeated in the message.
        expected: What would have been accepted.
    """

    def __init__(self, file: str, key: str, found: object, expected: str) -> None:
        state = "missing" if found is None else "refused" if isinstance(found, dict) else _shortened(found)
        place = f"{file}: {_SHORT_REPR.repr(key)[1:-1]} is {state}" if key else file
        super().__init__(f"{place}: {expected}")
        self.file = file
        self.key = key
        self.found = found
        self.expected = expected


class FileError(FileProblem, IdentificationError):
    """A file of this program that cannot be read, used or written."""


class CalibrationFileError(FileError):
    """A calibration file that is incomplete or inconsistent."""


class RunTableError(FileError):
    """An invalid table of an arm's runs."""


class PayloadFileError(FileError):
    """A payload file that is incomplete, inconsistent or physically impossible."""


class ExcitationFileError(FileError):
    """An excitation file that is incomplete or inconsistent."""


class ReportError(IdentificationError):
    """A report or a figure that cannot be written."""


class ExtraMissing(IdentificationError):
    """A library that a plain installation does not include; the message names the extra that provides it."""


_SHORT_REPR = reprlib.Repr()
_SHORT_REPR.maxlevel = 3
_SHORT_REPR.maxlist = 12
_SHORT_REPR.maxstring = 300
_SHORT_REPR.maxother = 100
_SHORT_REPR.maxlong = 40


def _shortened(value: object) -> str:
    """A value for a message, abbreviated if it is long."""
    try:
        return _SHORT_REPR.repr(value)
    except ValueError:  # an integer of more digits than Python converts
        return "a number of very many digits"
