"""Identify and assess the recordings of many arms, from Python."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from armload_controller.config.objects_or_paths import FilePath
from armload_controller.fleet.attention import attention_of
from armload_controller.fleet.fleet_review import FleetReview, review_fleet
from armload_controller.fleet.fleet_rows import runs_of
from armload_controller.fleet.fleet_run import FleetTally, do_jobs, new_jobs
from armload_controller.fleet.row_store import RowStore
from armload_controller.fleet.workforce import workforce
from armload_controller.session.folder_claim import claimed_folder
from armload_identification.argument_types import path_of
from armload_identification.extras import Extra, require_extra


def fleet(jobs: FilePath, output: FilePath, *, workers: int | None = None, scheduler: str | None = None) -> FleetTally:
    r"""Identify every recording of a table that has no row yet, as `armload fleet identify` does.

    Processes are started: a script that calls this needs `if __name__ == "__main__":`.

    Args:
        jobs: Table of jobs (CSV: arm, robot, loaded, unloaded, calibration, ...).
        output: Folder of the rows (Parquet, one folder per day).
        workers: Number of processes on this machine; the number of cores if not given.
        scheduler: Address of a Dask scheduler, instead of processes on this machine.

    Raises:
        ConfigurationError: the table is invalid.
        FleetError: the existing rows cannot be read, or the scheduler does not answer.
        CommissioningError: another process is using the folder.

    Examples:
        >>> import armload
        >>> from pathlib import Path
        >>> names = "runs/today/loaded_identification.mcap,runs/today/unloaded_identification.mcap"
        >>> _ = Path("jobs.csv").write_text(f"arm,robot,loaded,unloaded\ncell-1,er50,{names}\n")
        >>> armload.fleet("jobs.csv", "rows", workers=1).outcomes["identified"]
        1
        >>> [arm.arm for arm in armload.fleet_report("rows", "fleet.html").arms]
        ['cell-1']
    """
    require_extra(Extra.FLEET, "a fleet")
    table, folder = path_of("jobs", jobs), path_of("output", output)
    folder.mkdir(parents=True, exist_ok=True)
    with claimed_folder(folder, "`armload fleet` run"), RowStore(folder) as store:
        listing, new = new_jobs(table, store)
        if not new:
            return FleetTally.before(listing, new)
        with workforce(scheduler, workers) as force:
            return do_jobs(listing, new, store, force.rows)


def fleet_report(rows: FilePath, report: FilePath | None = None) -> FleetReview:
    """Assess the arms of a fleet: payload, gains and friction over time, the most suspicious first.

    Args:
        rows: Folder of the rows.
        report: Report (HTML) to write; none if not given.

    Raises:
        FleetError: there are no rows, or they cannot be read.
        ReportError: the report cannot be written.
    """
    require_extra(Extra.FLEET, "a fleet")
    folder = path_of("rows", rows)
    review = review_fleet(runs_of(folder))
    if report is not None:
        require_extra(Extra.REPORT, "the report of a fleet")
        from armload_controller.fleet.report.fleet_report import render_fleet_report
        from armload_identification.report.page import write_page

        attention = attention_of(review, folder, datetime.now(UTC).date())
        page = render_fleet_report(review, attention.words, attention.arms)
        write_page(Path(report), page)
    return review
