"""Pages that are made from tables of the code agree with it. If not: python docs/generated_pages.py."""

from pathlib import Path
from runpy import run_path

from armload_controller.cycle.stop_decisions import Cause
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.state_machine import TRANSITIONS, State

CHECKOUT = Path(__file__).resolve().parents[3]
PAGES = run_path(str(CHECKOUT / "docs" / "generated_pages.py"))


def test_the_page_of_stops_is_the_table():
    page = PAGES["stop_page"]()
    assert (CHECKOUT / "controller" / "STOPS.md").read_text("utf-8") == page
    assert all(cause.words in page and cause.advice in page for cause in Cause)


def test_the_page_of_safety_properties_is_the_table():
    page = PAGES["safety_page"]()
    assert (CHECKOUT / "drivers" / "SAFETY.md").read_text("utf-8") == page
    assert all(way.text in page and of.key in page for of in Safety for way in of.ways)


def test_the_page_of_the_drivers_shows_every_state_and_transition():
    table = PAGES["state_table"]()
    assert table in (CHECKOUT / "drivers" / "README.md").read_text("utf-8")
    rows = table.splitlines()[2:]
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == [state.title for state in State]
    for transition in TRANSITIONS:
        (row,) = (row for row in rows if row.startswith(f"| {transition.source.title} |"))
        assert f"{transition.number} " in row
        assert f": {transition.target.title}" in row
