"""Whether an operator is at the terminal."""

import sys
from types import SimpleNamespace

import pytest

from armload_controller.cli.attendance import attended


@pytest.mark.parametrize(("terminal", "is_attended"), [(None, False), (False, False), (True, True)])
def test_an_operator_is_at_a_terminal(monkeypatch, terminal, is_attended):
    monkeypatch.setattr(sys, "stdin", None if terminal is None else SimpleNamespace(isatty=lambda: terminal))
    assert attended() is is_attended
