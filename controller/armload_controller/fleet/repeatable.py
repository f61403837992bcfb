"""Refused or failed: whether a job that ended without a result would end so again while its files stay the same.

A job is *refused* for what armload finds wrong in the content of its files, which are all part of its key: it is done
until one of them changes. Everything else has *failed* and is repeated by the next run, because another worker, or the
same one tomorrow, may succeed:

- the operating system: a file that is missing there, or that this worker may not read, a full disk, no network;
- a library or an extra that is not installed on this worker;
- the fleet itself: another version of armload on the worker, a URL that nothing on it reads;
- a file that the robot's file names and the key leaves out because no payload depends on it: an excitation or a device
  description;
- whatever armload did not raise itself: no memory, an error of a server's library, or of the program.
"""

from __future__ import annotations

from collections.abc import Iterator

from armload_controller.control_errors import ConfigurationError, ControlError, FleetError
from armload_controller.fleet.recording_row import RowOutcome
from armload_drivers.driver_errors import DescriptionError
from armload_identification.identification_errors import ExcitationFileError, ExtraMissing, IdentificationError


def is_own(problem: BaseException) -> bool:
    """Whether armload raised an error, whose message then is a sentence for the operator."""
    return isinstance(problem, (IdentificationError, ControlError))


def outcome_of(problem: BaseException) -> RowOutcome:
    """The outcome of a job that ended with an error."""
    if is_own(problem) and not any(_may_pass(cause) for cause in _chain(problem)):
        return RowOutcome.REFUSED
    return RowOutcome.FAILED


def _chain(problem: BaseException) -> Iterator[BaseException]:
    """An error and its causes."""
    cause: BaseException | None = problem
    while cause is not None:
        yield cause
        cause = cause.__cause__


def _may_pass(problem: BaseException) -> bool:
    """Whether an error is not about the content of the job's files."""
    if isinstance(problem, OSError):
        return problem.errno is not None  # PyArrow raises others, without a number, for a damaged file
    if isinstance(problem, ConfigurationError):
        return isinstance(problem.__cause__, (DescriptionError, ExcitationFileError))
    return isinstance(problem, (ImportError, ExtraMissing, FleetError))
