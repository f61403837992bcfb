"""Arrays kept between runs in the user's cache directory, named by a hash of everything they depend on.

A file is named by the hash of its inputs, of the sources that make it and of the versions of the libraries, so that it
cannot be stale. The directory can be deleted at any time.
"""

from __future__ import annotations

import hashlib
import os
import zipfile
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from armload_identification.float_array import FloatArray


def cache_directory() -> Path:
    """The directory of the files: in XDG_CACHE_HOME, else in .cache in the home directory."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "armload" / "benchmarks"


def fingerprint(*parts: object) -> str:
    """Hash of values: numbers, texts, enumerations, arrays, paths (their CONTENT), and dataclasses and tuples of them.

    Raises:
        TypeError: a value of another type, whose changes could go undetected.
    """
    digest = hashlib.sha256()
    for part in parts:
        _feed(digest, part)
    return digest.hexdigest()


def cached(key: str, directory: Path, make: Callable[[], dict[str, FloatArray]]) -> dict[str, FloatArray]:
    """Arrays from the cache, made and stored if they are not there.

    Args:
        key: `fingerprint` of everything that `make` depends on.
        directory: The cache; created if it does not exist.
        make: Makes the arrays.
    """
    path = directory / f"{key}.npz"
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as content:
            return {name: content[name] for name in content.files}
    except (FileNotFoundError, zipfile.BadZipFile, EOFError, ValueError):
        arrays = make()
    directory.mkdir(parents=True, exist_ok=True)
    # Renamed when complete: two processes may make the same file, and neither reads a partial one.
    unfinished = directory / f"{key}.{os.getpid()}.part"
    with unfinished.open("wb") as target:
        np.savez_compressed(target, allow_pickle=False, **arrays)
    unfinished.replace(path)
    return arrays


def _feed(digest: hashlib._Hash, value: object) -> None:
    """Hash one value with its type in front, so that 1, 1.0 and "1" differ."""
    digest.update(type(value).__name__.encode() + b":")
    if is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            digest.update(field.name.encode() + b"=")
            _feed(digest, getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Enum):
        digest.update(value.name.encode())
    elif isinstance(value, Path):
        digest.update(hashlib.sha256(value.read_bytes()).digest())
    elif isinstance(value, tuple):
        for entry in value:
            _feed(digest, entry)
    elif value is None or isinstance(value, str | int | float):
        digest.update(repr(value).encode())
    else:
        raise TypeError(f"{value!r} cannot be hashed by its content; give numbers, texts, arrays or dataclasses")
    digest.update(b";")
