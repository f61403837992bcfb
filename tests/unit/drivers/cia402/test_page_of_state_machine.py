"""The table of the state machine on the drivers' page agrees with the code."""

from pathlib import Path

from armload_drivers.cia402.page_of_state_machine import table
from armload_drivers.cia402.state_machine import TRANSITIONS, State

README = Path(__file__).resolve().parents[4] / "drivers" / "README.md"
MAKE = 'python -c "from armload_drivers.cia402.page_of_state_machine import table; print(table())"'


def test_the_page_shows_the_tables():
    assert table() in README.read_text("utf-8"), f"replace the table in drivers/README.md by the output of\n{MAKE}"


def test_every_state_and_transition_is_in_the_table():
    rows = table().splitlines()[2:]
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == [state.title for state in State]
    for transition in TRANSITIONS:
        (row,) = (row for row in rows if row.startswith(f"| {transition.source.title} |"))
        assert f"{transition.number} " in row
        assert f": {transition.target.title}" in row
