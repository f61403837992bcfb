"""Exit statuses that scripts rely on: those of the documentation, and of a shell for signals."""

import signal

import pytest
import typer

from armload_controller.cli.exit_status import ExitStatus, exit_status, require_not_wrong
from armload_identification.verdict.agreement import Outcome

pytestmark = pytest.mark.pure


def test_statuses_are_those_that_scripts_rely_on():
    names = ["DONE", "REFUSED", "USAGE", "WRONG_PAYLOAD", "CANNOT_TELL", "ATTENTION"]
    assert [ExitStatus[name].value for name in names] == [0, 1, 2, 3, 4, 5]
    assert ExitStatus.INTERRUPTED == ExitStatus.BY_SIGNAL + signal.SIGINT == 130


def test_a_verdict_has_a_status_of_its_own():
    assert [exit_status(outcome) for outcome in (Outcome.RIGHT, Outcome.WRONG, Outcome.CANNOT_TELL)] == [0, 3, 4]
    require_not_wrong(None)


@pytest.mark.parametrize("outcome", list(Outcome))
def test_only_a_wrong_payload_ends_with_status_3(outcome):
    if outcome is not Outcome.WRONG:
        require_not_wrong(outcome)
        return
    with pytest.raises(typer.Exit) as caught:
        require_not_wrong(outcome)
    assert caught.value.exit_code == 3
