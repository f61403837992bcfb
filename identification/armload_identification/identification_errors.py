"""What can go wrong with the mathematics and its data.

IdentificationError
 +-- ModelError         chain, payload or trajectory parameters that make no sense
 +-- RecordingError     a recording that cannot be read or does not fit the arm
 +-- EstimationError    data that do not determine what was asked
 +-- ExcitationError    no trajectory within the limits
 +-- FileError          a file of ours that cannot be used: file, key, the value found and what was expected
 |    +-- CalibrationFileError an arm.calibration.toml that is incomplete or inconsistent
 |    +-- RunTableError        a table of an arm's runs that makes no sense
 |    +-- PayloadFileError     a payload.toml that is incomplete, inconsistent or physically impossible
 |    +-- ExcitationFileError  an excitation that is incomplete or inconsistent
 +-- ReportError        a report that cannot be written
 +-- ExtraMissing       a library that a plain installation leaves out
"""

from __future__ import annotations

import reprlib


class IdentificationError(Exception):
    """Root of everything that `armload_identification` raises."""


class ModelError(IdentificationError):
    """Chain, payload or trajectory parameters that make no sense."""


class RecordingError(IdentificationError):
    """A recording that cannot be read or does not fit the arm."""


class EstimationError(IdentificationError):
    """Data that do not determine what was asked of them."""


class ExcitationError(IdentificationError):
    """No trajectory was found within the limits."""


class FileError(IdentificationError):
    """A file of ours that cannot be read, used or written.

    Attributes:
        file: The file, or what the text was called.
        key: Dotted path of the key; the first entry of a list is [1]. Empty where the file as a whole is meant.
        found: The value found; None where there is none.
        expected: What would have been accepted.
    """

    def __init__(self, file: str, key: str, found: object, expected: str) -> None:
        super().__init__(file_problem(file, key, found, expected))
        self.file = file
        self.key = key
        self.found = found
        self.expected = expected


class CalibrationFileError(FileError):
    """A calibration file that is incomplete or inconsistent."""


class RunTableError(FileError):
    """A table of an arm's runs that makes no sense."""


class PayloadFileError(FileError):
    """A payload file that is incomplete, inconsistent or physically impossible."""


class ExcitationFileError(FileError):
    """An excitation file that is incomplete or inconsistent."""


class ReportError(IdentificationError):
    """A report or a picture that cannot be written."""


class ExtraMissing(IdentificationError):
    """A library that a plain installation leaves out; the message names what brings it."""


def file_problem(file: str, key: str, found: object, expected: str) -> str:
    """One sentence about a file, a key of it, the value found there and what was expected.

    Args:
        file: Name of the file.
        key: Dotted path of the key; empty where the file as a whole is meant.
        found: The value; None where it is missing. A table is not repeated.
        expected: The end of the sentence.
    """
    if not key:
        return f"{file}: {expected}"
    if found is None:
        state = "missing"
    elif isinstance(found, dict):
        state = "refused"
    else:
        state = _shortened(found)
    return f"{file}: {_SHORT.repr(key)[1:-1]} is {state}: {expected}"


_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxlist, _SHORT.maxstring, _SHORT.maxother, _SHORT.maxlong = 3, 12, 300, 100, 40


def _shortened(value: object) -> str:
    """A value in a sentence: as written, unless it is a long one."""
    try:
        return _SHORT.repr(value)
    except ValueError:  # an integer of more digits than Python converts
        return "a number of very many digits"
