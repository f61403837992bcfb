"""`armload fleet`: recordings of many arms."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.command_group import Commands
from armload_controller.cli.exit_status import ExitStatus
from armload_controller.cli.output.output_files import make_folder, require_drawable, require_folder, require_writable
from armload_controller.cli.screen import PLAIN, Screen

if TYPE_CHECKING:
    from armload_controller.fleet.fleet_run import FleetTally
    from armload_controller.fleet.row_store import RowStore


fleet = Commands("Identify and assess the recordings of many arms.")


@dataclass(frozen=True)
class FleetJobs:
    """Jobs, where their rows are kept, and who does them."""

    table: Annotated[
        Path,
        typer.Argument(metavar="JOBS", help="Table of jobs (CSV: arm, robot, loaded, unloaded, calibration, ...)."),
    ]
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the rows (Parquet, one folder per day).")]
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Address of a Dask scheduler, such as tls://host:8786; by default processes on this machine."
        ),
    ] = None
    workers: Annotated[
        int | None, typer.Option(min=1, help="Number of processes on this machine; by default the number of cores.")
    ] = None

    @contextmanager
    def claimed_store(self) -> Iterator[RowStore]:
        """The rows, for this run alone; --workers is refused with --scheduler, which has its own workers."""
        from armload_controller.fleet.row_store import RowStore
        from armload_controller.session.folder_claim import claimed_folder

        if self.scheduler is not None and self.workers is not None:
            raise typer.BadParameter(
                "cannot be combined with --scheduler, which has its own workers", param_hint="--workers"
            )
        make_folder(self.output)
        require_writable(self.output)
        with claimed_folder(self.output, "`armload fleet` run"), RowStore(self.output) as store:
            yield store


@fleet.command("identify")
def identify_command(
    given: FleetJobs,
    screen: Screen = PLAIN,
) -> None:
    """Identify every recording of the table that has no row yet.

    A refused recording is stored as a row with the reason. A second run processes only what is new, has changed or
    has failed. Exit status 1: none of the new recordings gave a result.
    """
    from armload_controller.fleet.fleet_run import FleetTally, do_jobs, new_jobs
    from armload_controller.fleet.recording_row import RowOutcome
    from armload_controller.fleet.workforce import workforce
    from armload_identification.extras import Extra, require_extra
    from armload_identification.numerals import counted

    require_extra(Extra.FLEET, "armload fleet")
    with given.claimed_store() as store:
        listing, jobs = new_jobs(given.table, store)
        screen.remarks("warning", listing.remarks)
        before = len(listing.jobs) - len(jobs)
        screen.step(f"{counted(len(listing.jobs), 'recording')}, {before or 'none'} processed before")
        if not jobs:
            tally = FleetTally.before(listing, jobs)
        else:
            try:
                with (
                    workforce(given.scheduler, given.workers) as force,
                    screen.track("identifying", len(jobs), rate=True) as progress,
                ):
                    tally = do_jobs(listing, jobs, store, force.rows, progress)
            except KeyboardInterrupt:
                screen.step("stopped: finished rows are kept, and the same command processes the rest")
                raise
    _show_tally(screen, tally, given.output)
    if tally.done and not tally.outcomes[RowOutcome.IDENTIFIED.value]:
        raise typer.Exit(ExitStatus.REFUSED)


@fleet.command("watch")
def watch_command(
    given: FleetJobs,
    every_s: Annotated[float, typer.Option(min=1.0, help="Time between two checks of the table's files in s.")] = 60.0,
    screen: Screen = PLAIN,
) -> None:
    """Identify new recordings repeatedly, until Ctrl-C.

    A recording is processed once it has not changed between two checks, because until then it may be incomplete.
    """
    from time import sleep

    from armload_controller.fleet.fleet_run import FleetTally, looks
    from armload_controller.fleet.job_listing import JobListing
    from armload_controller.fleet.workforce import workforce
    from armload_identification.extras import Extra, require_extra

    require_extra(Extra.FLEET, "armload fleet")
    try:
        with given.claimed_store() as store, workforce(given.scheduler, given.workers) as force:
            screen.step(
                f"watching {given.table}, every {every_s:g} s; a recording is processed once it has not changed "
                "between two checks. Ctrl-C ends it"
            )
            for found in looks(given.table, store, force.rows, sleep, every_s):
                if isinstance(found, FleetTally):
                    _show_tally(screen, found, given.output)
                elif isinstance(found, JobListing):
                    screen.remarks("warning", found.remarks)
                else:
                    screen.step(f"warning: {found}; nothing is processed until this is corrected")
    except KeyboardInterrupt:
        screen.step("stopped watching; finished rows are kept")


@fleet.command("report")
def report_command(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the rows.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Report (HTML) to write; by default FOLDER/report.html.")
    ] = None,
    metrics: Annotated[
        Path | None, typer.Option(help="File in Prometheus' text format to write, for the textfile collector.")
    ] = None,
    webhook: Annotated[
        str | None,
        typer.Option(envvar="ARMLOAD_WEBHOOK", help="URL that gets a POST with the findings that are new, as JSON."),
    ] = None,
    screen: Screen = PLAIN,
) -> None:
    """Assess the arms of a fleet: payload, gains and friction over time, the most suspicious first.

    Exit status 5: an arm needs attention that nobody has acknowledged.
    """
    from datetime import UTC, datetime
    from importlib.metadata import version

    from armload_identification.extras import Extra, require_extra
    from armload_identification.numerals import counted

    require_extra(Extra.FLEET, "armload fleet")
    from armload_controller.cli.output.fleet_output import fleet_report_document, suspicion_lines
    from armload_controller.fleet.alerts import metrics_text, notify, write_metrics
    from armload_controller.fleet.attention import attention_of
    from armload_controller.fleet.fleet_review import review_fleet
    from armload_controller.fleet.fleet_rows import runs_of

    now = datetime.now(UTC)
    page = output or folder / "report.html"
    runs = runs_of(folder)
    require_folder(metrics, "metrics", "--metrics")
    require_drawable(page, option="--output")
    from armload_controller.fleet.report.fleet_report import render_fleet_report
    from armload_identification.report.page import write_page

    review = review_fleet(runs)
    attention = attention_of(review, folder, now.date())
    text = render_fleet_report(review, attention.words, attention.arms)
    screen.write(lambda path: write_page(path, text), page)
    screen.result(*suspicion_lines(review, attention))
    screen.write(lambda path: write_metrics(path, metrics_text(review, attention, now)), metrics)
    screen.document(partial(fleet_report_document, review, attention), {"report": page, "metrics": metrics})
    if webhook is not None:
        sent = notify(webhook, folder, attention, version("armload"))
        screen.step(f"webhook: {counted(len(sent), 'new finding')} sent" if sent else "webhook: nothing new")
    if attention.needed:
        raise typer.Exit(ExitStatus.ATTENTION)


@fleet.command("history")
def history_command(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the rows.")],
    arm: Annotated[str, typer.Argument(metavar="ARM", help="Name of the arm.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Page (HTML) to write; by default FOLDER/ARM.html.")
    ] = None,
    screen: Screen = PLAIN,
) -> None:
    """Write a page with charts of every monitored quantity of an arm over all its recordings."""
    from datetime import UTC, datetime
    from urllib.parse import quote

    from armload_identification.extras import Extra, require_extra

    require_extra(Extra.FLEET, "armload fleet")
    from armload_controller.cli.output.fleet_output import arm_document
    from armload_controller.control_errors import ConfigurationError
    from armload_controller.fleet.attention import attention_of
    from armload_controller.fleet.fleet_review import review_fleet
    from armload_controller.fleet.fleet_rows import runs_of

    runs = runs_of(folder)
    names = sorted({run.arm for run in runs})
    if arm not in names:
        raise ConfigurationError("command line", "ARM", arm, f"expected one of {', '.join(names)}")
    page = output or folder / f"{quote(arm, safe=' ')}.html"
    require_drawable(page, option="--output")
    from armload_controller.fleet.report.fleet_report import render_arm_history
    from armload_identification.report.page import write_page

    review = review_fleet(runs)
    # an arm without a recent recording is reviewed by itself: against its own history
    found = [each for each in review.arms if each.arm == arm] or list(
        review_fleet([run for run in runs if run.arm == arm]).arms
    )
    attention = attention_of(review, folder, datetime.now(UTC).date())
    write_page(page, render_arm_history(found[0], attention.words.get(arm, "")))
    screen.result(*(suspicion.sentence for suspicion in found[0].suspicions))
    screen.step(f"written: {page}")
    screen.document(partial(arm_document, found[0]), {"page": page})


@fleet.command("acknowledge")
def acknowledge_command(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the rows.")],
    arm: Annotated[str, typer.Argument(metavar="ARM", help="Name of the arm.")],
    until: Annotated[str, typer.Option(metavar="DATE", help="Last day, such as 2026-12-31.")],
    why: Annotated[str, typer.Option(metavar="TEXT", help="The reason, shown in every report until then.")],
    screen: Screen = PLAIN,
) -> None:
    """Acknowledge what an arm has now: until DATE it needs no attention, but is listed in every report.

    A finding of another kind or quantity needs attention nevertheless.
    """
    from datetime import UTC, datetime

    from armload_identification.extras import Extra, require_extra

    require_extra(Extra.FLEET, "armload fleet")
    from armload_controller.cli.output.fleet_output import acknowledged_document
    from armload_controller.fleet.attention import acknowledge
    from armload_controller.fleet.fleet_review import review_fleet
    from armload_controller.fleet.fleet_rows import runs_of

    made = acknowledge(folder, review_fleet(runs_of(folder)), arm, until, why, datetime.now(UTC))
    screen.step(f"{arm}: acknowledged until {made.until}: {'; '.join(made.findings)}")
    screen.document(partial(acknowledged_document, made))


def _show_tally(screen: Screen, tally: FleetTally, output: Path) -> None:
    """Show the counts of a run over the jobs."""
    from armload_controller.cli.output.fleet_output import problem_lines
    from armload_identification.results.json_document import json_document

    screen.result(str(tally), *problem_lines(tally, output))
    screen.document(lambda: json_document("fleet", tally.to_dict()), {"directory": output})
