"""Tables fitted to the console's width: no text is cut off, no word is broken, no column is omitted.

The texts of a table that is too wide are wrapped between words, evenly; if that is not enough, the table is split into
parts, one below the other, each beginning with the first column.
"""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.measure import Measurement
from rich.table import Column, Table

from armload_identification.result_table import ResultTable

_BORDER = 1
_PADDING = 2


def drawn(result: ResultTable) -> Table:
    """A result's table for the console; numbers are right-aligned."""
    columns = [
        Column(heading, justify="left" if i in result.text_columns else "right")
        for i, heading in enumerate(result.headings)
    ]
    table = Table(*columns, title=result.title or None, title_justify="left")
    for row in result.rows:
        table.add_row(*row)
    return table


def fitted(table: Table, console: Console) -> list[Table]:
    """Fit a table to a console.

    Args:
        table: Texts and numbers in columns.

    Returns:
        The table unchanged, or with reduced widths, or several tables with its columns.
    """
    most = [_width(console, column, table.columns[0])[1] for column in table.columns]
    if _table_width(most) <= console.width:
        return [table]
    least = [_width(console, column, table.columns[0])[0] for column in table.columns]
    parts: list[list[int]] = [[0]]
    for index in range(1, len(table.columns)):
        if _table_width([least[i] for i in (*parts[-1], index)]) > console.width and len(parts[-1]) > 1:
            parts.append([0])
        parts[-1].append(index)
    return [
        _partial_table(table, part, [least[i] for i in part], [most[i] for i in part], console.width) for part in parts
    ]


def _width(console: Console, column: Column, first: Column) -> tuple[int, int]:
    """Least and greatest width of a column: its longest word and its longest text; the first one names the rows."""
    sizes = [Measurement.get(console, console.options.update_width(10_000), c) for c in (column.header, *column.cells)]
    most = max(size.maximum for size in sizes)
    least = max(size.minimum for size in sizes)
    if column.justify == "right" or column is first:
        # Numbers and row names, such as "1.2 to 3.4" and "joint_2 *", are not wrapped; their heading may be.
        least = max(size.maximum for size in sizes[1:]) if len(sizes) > 1 else most
        least = max(least, sizes[0].minimum)
    return least, most


def _table_width(widths: Sequence[int]) -> int:
    """Width of a table with its borders."""
    return sum(widths) + (_PADDING + _BORDER) * len(widths) + _BORDER


def _partial_table(table: Table, columns: list[int], least: list[int], most: list[int], width: int) -> Table:
    """Some columns of a table; spare width goes to the column whose texts take most lines."""
    widths = list(least)
    for _ in range(width - _table_width(widths)):
        wanting = max(range(len(widths)), key=lambda i: (most[i] + 1) / (widths[i] + 1))
        if widths[wanting] == most[wanting]:
            break
        widths[wanting] += 1
    part = Table(title=table.title if columns[1:2] == [1] else None, title_justify=table.title_justify)
    for index, size in zip(columns, widths, strict=True):
        column = table.columns[index]
        part.add_column(column.header, justify=column.justify, overflow="fold", width=size)
    for cells in zip(*(table.columns[index].cells for index in columns), strict=True):
        part.add_row(*cells)
    return part
