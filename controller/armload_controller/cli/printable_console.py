"""A console on which no text from a file can do more than be read."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.text import Text

from armload_controller.cli.printable_text import printable


class PrintableConsole(Console):
    """Rich's console; every string that it is given is made printable first, and none of it is markup.

    Args:
        **options: As Rich has them.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, highlight=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """See `Console.render_str`.

        Args:
            text: The string.
            **options: As Rich has them.
        """
        return super().render_str(printable(text), **options)
