"""The libraries of the extra `fleet`: loaded on first use, or named with the command that installs them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from armload_controller.control_errors import FleetError


def distributed() -> Any:
    """Dask's scheduler, workers and client."""
    return library("distributed", "runs recordings on Dask")


def parquet() -> Any:
    """Arrow's Parquet files."""
    return library("pyarrow.parquet", "keeps its rows as Parquet")


def fsspec() -> Any:
    """File systems, local and remote."""
    return library("fsspec", "finds recordings through it")


def library(name: str, purpose: str) -> Any:
    """A module of the extra.

    Raises:
        FleetError: it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as problem:
        raise FleetError(
            f"`armload fleet` {purpose}, and {problem.name or name} is not installed. "
            "Install it: pip install 'armload[fleet]'."
        ) from problem
