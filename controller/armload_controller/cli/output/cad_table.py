"""The table that compares a payload with CAD."""

from __future__ import annotations

from rich.table import Table

from armload_controller.cli.console_text import right
from armload_identification.results.payload_text import NOT_DETERMINED
from armload_identification.verdict.cad_comparison import RelativeErrors

PAPERS_NAMES = ("m", "c_x", "c_y", "c_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz")
PAPERS_UNITS = ("kg", "m", "m", "m", *["kg m2"] * 6)


def comparison_table(result: RelativeErrors) -> Table:
    """The paper's Table 2 for one payload."""
    title = f"Payload in the {result.frame} frame against CAD, as Chen 2016, Table 2"
    table = Table("parameter", *right("CAD", "estimate", "error"), "unit", title=title, title_justify="left")
    rows = zip(PAPERS_NAMES, PAPERS_UNITS, result.truth, result.estimate, result.error, result.determined, strict=True)
    for name, unit, truth, estimate, error, determined in rows:
        if determined:
            table.add_row(name, f"{truth:.4f}", f"{estimate:z.4f}", f"{100.0 * error:z.2f} %", unit)
        else:
            table.add_row(name, f"{truth:.4f}", NOT_DETERMINED, "", unit)
    return table
