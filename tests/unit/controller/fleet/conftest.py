"""Fixtures of the fleet's tests."""

import json
import subprocess
import sys

import fsspec
import pytest

QUERIES = "import duckdb, json, sys; print(json.dumps([duckdb.sql(q).fetchall() for q in sys.argv[1:]], default=str))"


@pytest.fixture(scope="session")
def queried():
    """DuckDB's answers to queries, from a separate process, because DuckDB prints warnings when its process ends."""

    def queried(*queries):
        done = subprocess.run([sys.executable, "-c", QUERIES, *queries], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return [[tuple(row) for row in rows] for rows in json.loads(done.stdout)]

    return queried


class NoCredentials(Exception):
    """An error as raised by libraries of stores: not an OSError."""


class ClosedStore(fsspec.AbstractFileSystem):
    """A store that refuses every access."""

    protocol = "closed"

    def ls(self, path, detail=True, **_options):
        raise NoCredentials("no credentials")


@pytest.fixture(scope="session")
def closed_store():
    """URL of a store that refuses every access."""
    fsspec.register_implementation("closed", ClosedStore, clobber=True)
    return "closed://cell"
