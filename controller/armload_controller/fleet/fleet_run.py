"""Identify what is new: from the table of jobs to rows, skipping what is done."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from armload_controller.control_errors import ConfigurationError, ListingError
from armload_controller.fleet.job import Job
from armload_controller.fleet.job_listing import JobListing, list_jobs
from armload_controller.fleet.job_table import read_job_table
from armload_controller.fleet.recording_row import Row, RowOutcome
from armload_controller.fleet.row_store import RowStore

DoJobs = Callable[[Iterable[Job]], Iterator[Row]]
"""Does jobs, and gives a row for each in any order: `Workforce.rows`, or `map(run_job, jobs)` in this process."""
_LONGEST_WAIT: Final = 64
"""Looks between two trials of a job that fails: about an hour at a look a minute."""


@dataclass
class FleetTally:
    """What came of the jobs.

    Attributes:
        listed: Recordings that the table stands for.
        skipped: Of these, done before.
        outcomes: Of the others, how many by outcome.
        cpu_s: CPU time that the workers took.
        wall_s: Time from the first job to the last row.
        remarks: Lines of the table that stand for nothing.
    """

    listed: int = 0
    skipped: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    cpu_s: float = 0.0
    wall_s: float = 0.0
    remarks: tuple[str, ...] = ()

    @classmethod
    def before(cls, listing: JobListing, jobs: Sequence[Job]) -> FleetTally:
        """Nothing is done yet.

        Args:
            listing: What the table stands for.
            jobs: Of these, the ones to do.
        """
        return cls(len(listing.jobs), len(listing.jobs) - len(jobs), remarks=listing.remarks)

    @property
    def done(self) -> int:
        """Recordings that were done now."""
        return sum(self.outcomes.values())

    @property
    def per_second(self) -> float:
        """Recordings per second; 0 where none was done."""
        return self.done / self.wall_s if self.wall_s > 0.0 else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Counts and rate: what `--json` prints of them."""
        return {
            "listed": self.listed,
            "skipped": self.skipped,
            "outcomes": {outcome.value: self.outcomes[outcome.value] for outcome in RowOutcome},
            "cpu_s": self.cpu_s,
            "wall_s": self.wall_s,
            "remarks": list(self.remarks),
        }


def new_jobs(table: Path, store: RowStore) -> tuple[JobListing, list[Job]]:
    """What a table stands for, and of that what there is no row of.

    Args:
        table: The table of jobs.
        store: The rows there are.

    Raises:
        ConfigurationError: a table that makes no sense.
        FleetError: URLs that nothing installed can read.
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
    """Do jobs and keep their rows, each as soon as it is there.

    Args:
        listing: What the table stands for.
        jobs: Of these, the ones to do.
        store: Where rows go.
        do: Who does them.
        progress: Takes how many are done.

    Raises:
        FleetError: rows cannot be written.
    """
    tally = FleetTally.before(listing, jobs)
    started_s = time.monotonic()
    for row in do(jobs):
        store.add(row)
        tally.outcomes[row["outcome"]] += 1
        tally.cpu_s += row["cpu_s"] or 0.0
        tally.wall_s = time.monotonic() - started_s
        progress(tally.done)
    return tally


def looks(
    table: Path, store: RowStore, do: DoJobs, sleep: Callable[[float], None], every_s: float
) -> Iterator[FleetTally | ConfigurationError | ListingError]:
    """Do what is new, again and again.

    Args:
        table: The table of jobs, read at every look.
        store: Where rows go; Parquet after every look.
        do: Who does the jobs.
        sleep: Waits; whatever it raises ends the looks.
        every_s: Time between two looks in s.

    Yields:
        What came of the jobs whose files have stayed as they were since the look before, where there are any; what is
        wrong with the table, which may be in the middle of being edited, or with a server.

    Raises:
        FleetError: rows cannot be written, or the scheduler is lost.
    """
    settled, repeats = Settled(), Repeats()
    while True:
        try:
            listing, jobs = new_jobs(table, store)
        except (ConfigurationError, ListingError) as problem:
            yield problem
        else:
            if ready := repeats.of(settled.of(jobs)):
                tally = do_jobs(listing, ready, store, lambda jobs: repeats.noting(do(jobs)))
                store.flush()
                yield tally
        sleep(every_s)


class Settled:
    """Which jobs have files that are no longer being written: they are the same at two looks."""

    def __init__(self) -> None:
        self._seen: set[str] = set()

    def of(self, jobs: Iterable[Job]) -> list[Job]:
        """The jobs whose files are as they were at the last look.

        Args:
            jobs: Those of this look.
        """
        now = list(jobs)
        same = [job for job in now if job.key in self._seen]
        self._seen = {job.key for job in now}
        return same


class Repeats:
    """When a job that failed is done again: at the second look after it, then the fourth, up to the 64th.

    Each time adds a row; a file that stays missing would add one at every look.
    """

    def __init__(self) -> None:
        self._looks = 0
        self._wait: dict[str, int] = {}
        self._next: dict[str, int] = {}

    def of(self, jobs: Iterable[Job]) -> list[Job]:
        """Those that are to be done at this look.

        Args:
            jobs: Those that are new, have changed or have failed.
        """
        self._looks += 1
        return [job for job in jobs if self._next.get(job.key, 0) <= self._looks]

    def noting(self, rows: Iterable[Row]) -> Iterator[Row]:
        """The same rows, with a note of those that failed.

        Args:
            rows: Rows of jobs that are done.
        """
        for row in rows:
            if row["outcome"] == RowOutcome.FAILED.value:
                wait = self._wait[row["key"]] = min(2 * self._wait.get(row["key"], 1), _LONGEST_WAIT)
                self._next[row["key"]] = self._looks + wait
            yield row
