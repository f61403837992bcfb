"""Results and settings are values: they cannot be changed, and those that hold arrays are not compared by element."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[3]
STATES = {
    "CycleSummary", "Dictionary", "DraftedFile", "FleetTally", "GroupState", "PluginTiming", "ReadingAccount", "Screen",
    "_EvenStretch", "_Reading",
}  # fmt: skip
"""Those that are filled or counted up while something runs; the screen gets a keyboard when an arm moves."""
MESSAGES = ROOT / "drivers" / "armload_drivers" / "feeds" / "ros2_messages.py"
"""Its library fills in messages."""
ARRAYS = ("FloatArray", "NDArray[")


def dataclasses(*packages):
    """Every dataclass of some packages, with the options of its decorator."""
    for package in packages:
        for file in sorted((ROOT / package).glob("armload_*/**/*.py")):
            for node in ast.walk(ast.parse(file.read_text())):
                for given in node.decorator_list if isinstance(node, ast.ClassDef) and file != MESSAGES else ():
                    if ast.unparse(given).split("(")[0] == "dataclass":
                        options = given.keywords if isinstance(given, ast.Call) else ()
                        yield node, {option.arg: option.value.value for option in options}


def test_only_states_of_something_that_runs_can_be_changed():
    found = {node.name for node, options in dataclasses("identification", "controller", "drivers")
             if not options.get("frozen")}  # fmt: skip
    assert found == STATES


def test_what_holds_an_array_is_not_compared_by_element():
    """The truth of an array with several elements is an error, which `==` of two such values would raise."""
    for node, options in dataclasses("identification", "controller"):
        holds = [field for field in node.body if isinstance(field, ast.AnnAssign)
                 and ast.unparse(field.annotation).startswith(ARRAYS)]  # fmt: skip
        assert not holds or options.get("eq") is False, node.name
