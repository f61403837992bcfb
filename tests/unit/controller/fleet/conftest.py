"""What several tests of the fleet share."""

import json
import subprocess
import sys

import pytest

QUERY = "import duckdb, json, sys; print(json.dumps(duckdb.sql(sys.argv[1]).fetchall(), default=str))"


@pytest.fixture(scope="session")
def queried():
    """DuckDB's answer to a query, from a process of its own: it complains of itself when its process ends."""

    def queried(sql):
        done = subprocess.run([sys.executable, "-c", QUERY, sql], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return [tuple(row) for row in json.loads(done.stdout)]

    return queried
