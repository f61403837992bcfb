"""What can go wrong with the mathematics and its data.

IdentificationError
 +-- ModelError         chain, payload or trajectory parameters that make no sense
 +-- RecordingError     a recording that cannot be read or does not fit the arm
 +-- EstimationError    data that do not determine what was asked
 +-- BodyFileError      a body.toml that is incomplete or inconsistent
 +-- GainsFileError     a gains.toml that is incomplete or inconsistent
 +-- PayloadFileError   a payload.toml that is incomplete, inconsistent or physically impossible
 +-- ExcitationError    no trajectory within the limits
 +-- ReportError        a report that cannot be written
"""

from __future__ import annotations


class IdentificationError(Exception):
    """Root of everything that `armload_identification` raises."""


class ModelError(IdentificationError):
    """Chain, payload or trajectory parameters that make no sense."""


class RecordingError(IdentificationError):
    """A recording that cannot be read or does not fit the arm."""


class EstimationError(IdentificationError):
    """Data that do not determine what was asked of them."""


class BodyFileError(IdentificationError):
    """A body file that is incomplete or inconsistent."""


class GainsFileError(IdentificationError):
    """A gains file that is incomplete or inconsistent."""


class PayloadFileError(IdentificationError):
    """A payload file that is incomplete, inconsistent or physically impossible."""


class ExcitationError(IdentificationError):
    """No trajectory was found within the limits."""


class ReportError(IdentificationError):
    """A report that cannot be written."""
