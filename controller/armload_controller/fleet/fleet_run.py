"""Identifies new recordings: from the table of jobs to rows, skipping finished jobs."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from armload_controller.control_errors import ConfigurationError, ListingError
from armload_controller.fleet.job import Job
from armload_controller.fleet.job_listing import JobListing, list_jobs
from armload_controller.fleet.job_table import read_job_table
from armload_controller.fleet.recording_row import Row, RowOutcome
from armload_controller.fleet.row_store import RowStore
from armload_identification.numerals import counted

DoJobs = Callable[[Iterable[Job]], Iterator[Row]]
"""Runs jobs and yields a row for each, in any order: `Workforce.rows`, or `map(run_job, jobs)` in this process."""
_LONGEST_WAIT: Final = 64
"""Greatest number of looks between two attempts at a failing job: about an hour at one look per minute."""


@dataclass(frozen=True)
class FleetProblem:
    """A recording that was refused or failed.

    Attributes:
        arm: Name of its arm.
        loaded: The loaded recording.
        outcome: Refused or failed.
        error: The reason.
    """

    arm: str
    loaded: str
    outcome: RowOutcome
    error: str


@dataclass(repr=False)
class FleetTally:
    """Counts of a run over the jobs.

    Attributes:
        listed: Number of recordings that the table names.
        skipped: Number of them that were done before.
        outcomes: Number of the others by outcome.
        problems: Those of them that were refused or failed.
        cpu_s: CPU time of the workers.
        wall_s: Time from the first job to the last row.
        remarks: Remarks on lines of the table whose files are missing.
    """

    listed: int = 0
    skipped: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    problems: list[FleetProblem] = field(default_factory=list)
    cpu_s: float = 0.0
    wall_s: float = 0.0
    remarks: tuple[str, ...] = ()

    @classmethod
    def before(cls, listing: JobListing, jobs: Sequence[Job]) -> FleetTally:
        """The counts before the first job."""
        return cls(len(listing.jobs), len(listing.jobs) - len(jobs), remarks=listing.remarks)

    @property
    def done(self) -> int:
        """Number of recordings processed in this run."""
        return sum(self.outcomes.values())

    def __repr__(self) -> str:
        """The run in one or two lines."""
        if not self.done:
            return f"nothing new: {counted(self.skipped, 'recording')} processed before"
        rate = self.done / self.wall_s if self.wall_s > 0.0 else 0.0
        counts = ", ".join(f"{self.outcomes[outcome.value]} {outcome.value}" for outcome in RowOutcome)
        return (
            f"{counted(self.done, 'recording')} in {self.wall_s:.1f} s, {rate:.2f}/s, "
            f"{self.cpu_s / self.done:.2f} s of CPU each: {counts}; {self.skipped} processed before"
        )

    def to_dict(self) -> dict[str, Any]:
        """Counts and times for `--json`."""
        outcomes = {outcome.value: self.outcomes[outcome.value] for outcome in RowOutcome}
        lists = {"problems": [asdict(problem) for problem in self.problems], "remarks": list(self.remarks)}
        return vars(self) | {"outcomes": outcomes} | lists


def new_jobs(table: Path, store: RowStore) -> tuple[JobListing, list[Job]]:
    """All jobs of a table, and those without a row yet.

    Raises:
        ConfigurationError: the table is invalid.
        ListingError: a folder cannot be listed, or no installed library reads such URLs.
        FleetError: the existing rows cannot be read.
    """
    listing = list_jobs(read_job_table(table), table)
    done = store.done_keys()
    return listing, [job for job in listing.jobs if job.key not in done]


def do_jobs(
    listing: JobListing,
    jobs: Sequence[Job],
    store: RowStore,
    do: DoJobs,
    progress: Callable[[int], None] = lambda _done: None,
) -> FleetTally:
    """Run jobs and store each row as soon as it arrives.

    Args:
        listing: All jobs of the table.
        jobs: The jobs to run.
        store: Stores the rows.
        do: Runs the jobs.
        progress: Called with the number of jobs done.

    Raises:
        FleetError: rows cannot be written.
    """
    tally = FleetTally.before(listing, jobs)
    started_s = time.monotonic()
    for row in do(jobs):
        # By one clock: a worker's may be wrong, and the latest row of a recording is the one that counts.
        store.add(row | {"identified_utc": datetime.now(UTC)})
        tally.outcomes[row["outcome"]] += 1
        if row["outcome"] != RowOutcome.IDENTIFIED.value:
            outcome, error = RowOutcome(row["outcome"]), row["error"] or row["outcome"]
            tally.problems.append(FleetProblem(row["arm"], row["loaded"], outcome, error))
        tally.cpu_s += row["cpu_s"] or 0.0
        tally.wall_s = time.monotonic() - started_s
        progress(tally.done)
    return tally


def looks(
    table: Path, store: RowStore, do: DoJobs, sleep: Callable[[float], None], every_s: float
) -> Iterator[FleetTally | JobListing | ConfigurationError | ListingError]:
    """Run new jobs, again and again.

    Args:
        table: The table of jobs, read at every look.
        store: Stores the rows; written as Parquet after every look.
        do: Runs the jobs.
        sleep: Waits; any exception from it ends the looks.
        every_s: Time between two looks in s.

    Yields:
        The counts of a run over the jobs whose files have not changed since the previous look, if there are any; the
        listing if its remarks are new, and the same as at the previous look; or the problem with the table, which may
        just be being edited, or with a server.

    Raises:
        FleetError: rows cannot be written, or the scheduler is lost.
    """
    settled, repeats = Settled(), Repeats()
    seen: tuple[str, ...] = ()
    reported: tuple[str, ...] = ()
    while True:
        try:
            listing, jobs = new_jobs(table, store)
        except (ConfigurationError, ListingError) as problem:
            yield problem
        else:
            if listing.remarks == seen != reported:
                reported = seen
                yield listing
            seen = listing.remarks
            if ready := repeats.of(settled.of(jobs)):
                tally = do_jobs(listing, ready, store, lambda jobs: repeats.noting(do(jobs)))
                store.flush()
                yield tally
        sleep(every_s)


class Settled:
    """Finds the jobs whose files are no longer being written: unchanged at two successive looks."""

    def __init__(self) -> None:
        self._previous_keys: set[str] = set()

    def of(self, jobs: Iterable[Job]) -> list[Job]:
        """The jobs whose files have not changed since the last look."""
        now = list(jobs)
        same = [job for job in now if job.key in self._previous_keys]
        self._previous_keys = {job.key for job in now}
        return same


class Repeats:
    """Delays a failed job: it is repeated at the second look after it, then the fourth, and so on up to the 64th.

    Each attempt adds a row, and a file that stays missing would otherwise add one at every look.
    """

    def __init__(self) -> None:
        self._look_count = 0
        self._looks_to_wait: dict[str, int] = {}
        self._next_look: dict[str, int] = {}

    def of(self, jobs: Iterable[Job]) -> list[Job]:
        """The jobs to run at this look.

        Args:
            jobs: Jobs that are new, have changed or have failed.
        """
        self._look_count += 1
        return [job for job in jobs if self._next_look.get(job.key, 0) <= self._look_count]

    def noting(self, rows: Iterable[Row]) -> Iterator[Row]:
        """Pass rows of finished jobs through, and note those that failed."""
        for row in rows:
            if row["outcome"] == RowOutcome.FAILED.value:
                wait = self._looks_to_wait[row["key"]] = min(2 * self._looks_to_wait.get(row["key"], 1), _LONGEST_WAIT)
                self._next_look[row["key"]] = self._look_count + wait
            yield row
