"""What several tests of the fleet share."""

import json
import subprocess
import sys

import fsspec
import pytest

QUERIES = "import duckdb, json, sys; print(json.dumps([duckdb.sql(q).fetchall() for q in sys.argv[1:]], default=str))"


@pytest.fixture(scope="session")
def queried():
    """DuckDB's answers to queries, from a process of its own: it complains of itself when its process ends."""

    def queried(*queries):
        done = subprocess.run([sys.executable, "-c", QUERIES, *queries], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return [[tuple(row) for row in rows] for rows in json.loads(done.stdout)]

    return queried


class NoCredentials(Exception):
    """As libraries of stores raise: no OSError."""


class ClosedStore(fsspec.AbstractFileSystem):
    """Wants what nobody has."""

    protocol = "closed"

    def ls(self, path, detail=True, **_options):
        raise NoCredentials("no credentials")


@pytest.fixture(scope="session")
def closed_store():
    """URL of a store that gives nobody anything."""
    fsspec.register_implementation("closed", ClosedStore, clobber=True)
    return "closed://cell"
