"""The state diagram on the drivers' page agrees with the code."""

import re
from pathlib import Path

import pytest

from armload_drivers.cia402.page_of_state_machine import mermaid
from armload_drivers.cia402.state_machine import TRANSITIONS, State

README = Path(__file__).resolve().parents[4] / "drivers" / "README.md"
MAKE = 'python -c "from armload_drivers.cia402.page_of_state_machine import mermaid; print(mermaid())"'


def test_the_page_shows_the_tables():
    shown = re.search(r"```mermaid\n(stateDiagram-v2.*?)\n```", README.read_text("utf-8"), re.DOTALL)
    assert shown, "drivers/README.md has no state diagram"
    if shown[1] != mermaid():
        pytest.fail(
            f"drivers/README.md shows another state machine than the code has; replace it by the output of\n{MAKE}"
        )


def test_every_state_and_transition_is_drawn():
    drawn = mermaid()
    for state in State:
        assert f"    {state.name} : {state.title}" in drawn
    for transition in TRANSITIONS:
        assert f"{transition.source.name} --> {transition.target.name} : {transition.number} " in drawn
    assert drawn.count(" --> ") == len(TRANSITIONS) + 2, "and those of the drive's own, 0 and 13"
