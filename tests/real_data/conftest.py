"""The measured recordings of a UR10e, read and identified once for all tests."""

from __future__ import annotations

from functools import cache

import pytest

from armload_controller.config.robot import load_robot
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions


@pytest.fixture(scope="session")
def ur10e():
    return load_robot("ur10e")


@pytest.fixture(scope="session")
def ur10e_run(ur10e, shared_data):
    """Reads a recording by its path below the arm's folder."""

    @cache
    def run(path):
        return read_recording_file(shared_data / "ur10e" / path, ReadingOptions(ur10e.csv_columns))

    return run


@pytest.fixture(scope="session")
def ur10e_pair(ur10e_run):
    """A loaded and an unloaded recording by the suffix of their names: "" or "_b"."""

    def pair(suffix):
        return ur10e_run(f"loaded{suffix}.csv"), ur10e_run(f"unloaded{suffix}.csv")

    return pair


@pytest.fixture(scope="session")
def ur10e_identified(ur10e, ur10e_pair):
    """The payload of a pair, identified with nominal gains."""

    @cache
    def identified(suffix):
        return identify_runs(*ur10e_pair(suffix), ur10e.chain, ur10e.drives.transmission)

    return identified
