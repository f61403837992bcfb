"""Options that several commands share, as one parameter of each command."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import is_dataclass
from functools import wraps
from typing import get_type_hints

from typer.models import ArgumentInfo

from armload_controller.cli.output.output_files import require_apart


def with_option_groups(command: Callable[..., None]) -> Callable[..., None]:
    """A command whose parameters that are dataclasses are replaced with their fields, each an option or argument."""
    own = inspect.signature(command, eval_str=True).parameters
    kinds = {name: each.annotation for name, each in own.items()}
    groups = {name: _fields(kind) for name, kind in kinds.items() if isinstance(kind, type) and is_dataclass(kind)}
    options = [option for name, each in own.items() for option in groups.get(name, [each])]

    @wraps(command)
    def given(**values: object) -> None:
        require_apart(values, {option.name: _shown_name(option) for option in options})
        for name, fields in groups.items():
            values[name] = kinds[name](**{field.name: values.pop(field.name) for field in fields})
        command(**values)

    # by keyword, since a group with defaults may stand before an option without
    by_keyword = [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in options]
    given.__signature__ = inspect.Signature(by_keyword)  # type: ignore[attr-defined]
    return given


def _shown_name(parameter: inspect.Parameter) -> str:
    """The name of an option or argument, as it is shown to the user."""
    about = (*getattr(parameter.annotation, "__metadata__", ()), None)[0]
    if isinstance(about, ArgumentInfo):
        return str(about.metavar or parameter.name.upper()).strip("[].")
    return f"--{parameter.name.replace('_', '-')}"


def _fields(group: type) -> list[inspect.Parameter]:
    """The fields of a dataclass; those that it inherits have the types that they have where they are defined."""
    types = get_type_hints(group, include_extras=True)
    return [each.replace(annotation=types[name]) for name, each in inspect.signature(group).parameters.items()]
