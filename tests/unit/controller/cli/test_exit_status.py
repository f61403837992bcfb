"""Exit statuses that scripts rely on: those of the documentation, and of a shell for signals."""

import signal

import pytest

from armload_controller.cli.exit_status import ExitStatus

pytestmark = pytest.mark.pure


def test_statuses_are_those_that_scripts_rely_on():
    names = ["DONE", "REFUSED", "USAGE", "WRONG_PAYLOAD", "CANNOT_TELL", "ATTENTION"]
    assert [ExitStatus[name].value for name in names] == [0, 1, 2, 3, 4, 5]
    assert ExitStatus.INTERRUPTED == ExitStatus.BY_SIGNAL + signal.SIGINT == 130
