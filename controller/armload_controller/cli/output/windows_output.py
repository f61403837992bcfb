"""A payload over time on the console, as a picture and as JSON."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen
    from armload_identification.results.payload_over_time import PayloadOverTime


def show_windows(screen: Screen, history: PayloadOverTime, *, picture: Path | None) -> None:
    """Show the windows as a table, and write the picture if requested."""
    screen.result_table(history.table())
    write_picture(screen, history.picture, picture)
    screen.document(history.to_dict, {"picture": picture})


def write_picture(screen: Screen, draw: Callable[[Path], None], picture: Path | None) -> None:
    """Write a picture, if one is requested.

    Raises:
        CommissioningError: the file's ending is not a picture format.
        OSError: the file cannot be written.
    """
    from armload_controller.control_errors import CommissioningError

    try:
        screen.write(draw, picture)
    except ValueError as error:
        raise CommissioningError(f"{picture}: {error}: choose a .png or .svg") from error
