"""Which entry points of other packages are used, and which are named in a warning instead."""

import warnings
from types import SimpleNamespace

import pytest

from armload_identification import extensions
from armload_identification.extensions import ExtensionGroup, ExtensionSkipped, extension, extension_names

pytestmark = pytest.mark.pure
READERS = ExtensionGroup.READERS


class Provided:
    """An entry point of a package, or of none."""

    def __init__(self, name, loaded, package="traces 1.2"):
        self.name, self._loaded = name, loaded
        self.dist = package and SimpleNamespace(name=package.split()[0], version=package.split()[1])

    def load(self):
        if isinstance(self._loaded, Exception):
            raise self._loaded
        return self._loaded


@pytest.fixture
def provided(monkeypatch):
    """Set the entry points of the readers."""

    def provided(*entries):
        by_group = {"armload.readers": entries}
        monkeypatch.setattr(extensions, "entry_points", lambda group: by_group.get(group, ()))

    return provided


def warned(call, *given):
    """What a call returns, and its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = call(*given)
    assert all(each.category is ExtensionSkipped for each in caught)
    return result, [str(each.message) for each in caught]


def test_names_are_sorted_and_those_of_one_group(provided):
    provided(Provided("trc", print), Provided("bin", print))
    assert warned(extension_names, READERS, {"csv"}) == (("bin", "trc"), [])
    assert warned(extension_names, ExtensionGroup.EXPORTS, {"csv"}) == ((), [])


@pytest.mark.parametrize(
    ("entries", "text"),
    [
        (
            [Provided("csv", print)],
            "csv of traces 1.2 (armload.readers) has a name that armload has itself. It is not used: update or "
            "uninstall that package",
        ),
        (
            [Provided("trc", print, "b 2"), Provided("trc", print, "a 1")],
            "trc of a 1 and b 2 (armload.readers) is provided by both. It is not used: update or uninstall that "
            "package",
        ),
    ],
)
def test_a_name_that_is_taken_is_not_used_and_named(provided, entries, text):
    provided(*entries, Provided("bin", print))
    assert warned(extension_names, READERS, {"csv"}) == (("bin",), [text])
    assert warned(extension, READERS, entries[0].name, {"csv"}) == (None, [text])


def test_one_is_loaded_by_its_name(provided):
    provided(Provided("trc", print), Provided("bin", len, None))
    assert warned(extension, READERS, "trc", ()) == ((print, "traces 1.2"), [])
    assert warned(extension, READERS, "bin", ()) == ((len, "a package without a name"), [])
    assert warned(extension, READERS, "none", ()) == (None, [])


def test_one_that_cannot_be_loaded_is_named_with_the_reason(provided):
    provided(Provided("trc", ValueError("no licence")))
    found, texts = warned(extension, READERS, "trc", ())
    assert found is None
    assert texts == [
        "trc of traces 1.2 (armload.readers) cannot be loaded: ValueError: no licence. It is not used: update or "
        "uninstall that package"
    ]
