"""A result as a table: printed, shown in a notebook, and drawn on the console from the same cells."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class ResultTable:
    """Cells of a table, and the sentences below it.

    Attributes:
        title: What it shows; empty for none.
        headings: Headings of the columns.
        rows: Cells.
        text_columns: Columns that contain texts; the others are right-aligned.
        sentences: What follows from it.
    """

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    text_columns: Sequence[int]
    sentences: Sequence[str] = ()


class PrintedResult(ABC):
    """A result that prints, and shows in a notebook, as its table. Dataclasses need `repr=False`."""

    @abstractmethod
    def table(self) -> ResultTable:
        """The table."""

    def __str__(self) -> str:
        """The table as text."""
        table = self.table()
        widths = [max(map(len, column)) for column in zip(table.headings, *table.rows, strict=True)]
        lines = [
            "  ".join(
                cell.ljust(width) if i in table.text_columns else cell.rjust(width)
                for i, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in (table.headings, *table.rows)
        ]
        return "\n".join([*filter(None, [table.title]), *lines, *table.sentences])

    __repr__ = __str__  # so that a prompt shows it

    def _repr_html_(self) -> str:
        """The table for a notebook."""
        from html import escape

        table = self.table()

        def row(cells: Sequence[str], tag: str) -> str:
            sides = ("left" if i in table.text_columns else "right" for i in range(len(cells)))
            return "".join(
                f'<{tag} style="text-align:{side}">{escape(cell)}</{tag}>'
                for cell, side in zip(cells, sides, strict=True)
            )

        body = "".join(f"<tr>{row(cells, 'td')}</tr>" for cells in table.rows)
        below = "".join(f"<p>{escape(sentence)}</p>" for sentence in table.sentences)
        title = f"<caption>{escape(table.title)}</caption>" if table.title else ""
        return f"<table>{title}<thead><tr>{row(table.headings, 'th')}</tr></thead><tbody>{body}</tbody></table>{below}"
