"""The templates beside this file: `@name` and `@{name}` are replaced by generated text."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from string import Template


class _CTemplate(Template):
    """Uses @, which neither C nor CMake needs, while $ occurs in CMake."""

    delimiter = "@"


def filled(template: str, fields: Mapping[str, str]) -> str:
    """A template with its fields.

    Args:
        template: Name of the file, without `.in`.
        fields: Text by name; every name in the template must be given.
    """
    text = (resources.files("armload_controller.export.c_code") / f"{template}.in").read_text(encoding="ascii")
    return _CTemplate(text).substitute(fields)
