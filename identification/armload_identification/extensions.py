"""Extensions from other packages: readers of recordings, export formats, drive profiles, found by entry point.

    [project.entry-points."armload.readers"]           the suffix of the files, and a function
    trc = "my_package:read_trc"

A name that armload has itself is armload's: an entry point with it is ignored. So is a name that two packages provide,
and an extension that cannot be loaded. Each is named in a warning, and everything else works. Extensions get files,
payloads and names, and return numbers and texts; none of them gets an arm or a bus.

Plug-ins of the cycle are another matter: a robot's file names them, so a broken one is an error.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection
from enum import StrEnum
from importlib.metadata import EntryPoint, entry_points


class ExtensionGroup(StrEnum):
    """Groups of entry points."""

    READERS = "armload.readers"
    EXPORTS = "armload.exports"
    DRIVE_PROFILES = "armload.drive_profiles"


class ExtensionSkipped(UserWarning):
    """An extension that is not used; the text names its package, the reason and the remedy."""


def extension_names(group: ExtensionGroup, own: Collection[str]) -> tuple[str, ...]:
    """Names of the extensions that can be used.

    Args:
        own: Names that armload has itself.
    """
    return tuple(sorted(_usable(group, own)))


def extension(group: ExtensionGroup, name: str, own: Collection[str]) -> tuple[object, str] | None:
    """An extension, loaded, and its package with version; None if there is none with the name, or it is skipped.

    Args:
        name: Name of the entry point.
        own: Names that armload has itself.
    """
    entry = _usable(group, own).get(name)
    if entry is None:
        return None
    try:
        return entry.load(), package_of(entry)
    except Exception as problem:  # noqa: BLE001 - a package may do anything when it is imported
        skip(group, name, package_of(entry), f"cannot be loaded: {type(problem).__name__}: {problem}")
        return None


def skip(group: ExtensionGroup, name: str, package: str, why: str) -> None:
    """Warn of an extension that is not used.

    Args:
        name: Name of the entry point.
        package: The package and its version.
        why: The reason, after the name.
    """
    text = f"{name} of {package} ({group}) {why}. It is not used: update or uninstall that package"
    warnings.warn(text, ExtensionSkipped, stacklevel=3)


def package_of(entry: EntryPoint) -> str:
    """Name and version of the package that an entry point belongs to."""
    return "a package without a name" if entry.dist is None else f"{entry.dist.name} {entry.dist.version}"


def _usable(group: ExtensionGroup, own: Collection[str]) -> dict[str, EntryPoint]:
    """The entry points of a group by name, without those that are ignored."""
    found: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=group):
        found.setdefault(entry.name, []).append(entry)
    usable = {}
    for name, entries in found.items():
        packages = " and ".join(sorted(package_of(entry) for entry in entries))
        if name in own:
            skip(group, name, packages, "has a name that armload has itself")
        elif len(entries) > 1:
            skip(group, name, packages, "is provided by both")
        else:
            usable[name] = entries[0]
    return usable
