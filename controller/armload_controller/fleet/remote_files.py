"""Files on any file system of fsspec: listing, detection of changes, and a local copy.

Readers of recordings require local files. A remote one is copied to the local disk in blocks while it is processed, so
readers need no remote access and memory does not grow with the file.

A server's failure is an `OSError` with some file systems and an error of the client library with others, such as
botocore's for s3://, so any exception is treated as such a failure.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any, Final

from armload_controller.control_errors import ListingError

_CHANGE_KEYS: Final = (
    "size",
    "mtime",
    "ETag",
    "etag",
    "LastModified",
    "Last-Modified",
    "last_modified",
    "updated",
    "md5",
)
"""Metadata that change when a file's content does; each file system provides some of them."""
_DATE_KEYS: Final = ("mtime", "LastModified", "Last-Modified", "last_modified", "updated")
_MISSING: Final = "missing"
_PACKAGES: Final = {
    "s3": "s3fs",
    "gs": "gcsfs",
    "gcs": "gcsfs",
    "az": "adlfs",
    "abfs": "adlfs",
    "http": "aiohttp",
    "https": "aiohttp",
}
"""Package that fsspec requires for a protocol."""


@dataclass(frozen=True)
class RemoteFile:
    """Metadata of a file or folder.

    Attributes:
        url: Path or URL.
        stamp: Changes when the content does; "missing" if there is no such file.
        modified: Time of the last change; None if the file system does not state it.
    """

    url: str
    stamp: str
    modified: datetime | None

    @property
    def is_missing(self) -> bool:
        """Whether there is no such file, as opposed to a server that does not answer."""
        return self.stamp == _MISSING

    @classmethod
    def of(cls, url: str) -> RemoteFile:
        """Get a file's metadata.

        Args:
            url: Path or URL.

        Raises:
            ListingError: no installed library reads such URLs.
        """
        files, path = _file_system(url)
        try:
            info = files.info(path)
            if info.get("type") == "directory":
                parts = [files.info(part) for part in sorted(files.find(path))]
                stamp = ";".join(f"{part['name'].removeprefix(path).strip('/')} {_stamp(part)}" for part in parts)
                dates = [date for part in parts if (date := _modified(part)) is not None]
                return cls(url, stamp, max(dates, default=None))
        except FileNotFoundError:
            return cls(url, _MISSING, None)
        except Exception as problem:  # noqa: BLE001 - a server that does not answer today may answer tomorrow
            return cls(url, f"{_MISSING}: {problem}", None)
        return cls(url, _stamp(info), _modified(info))


def is_url(text: str) -> bool:
    """Whether a text is a URL; everything else is a path."""
    return "://" in text


def matches(pattern: str) -> tuple[list[tuple[str, tuple[str, ...]]], list[str]]:
    """The files and folders that match a pattern.

    Args:
        pattern: Path or URL, in which `*` matches any part of one name; no hidden files.

    Returns:
        Path or URL of each file or folder, sorted, with the text that every `*` matched; and the folders that match a
        part of the pattern, but that this user may not list.

    Raises:
        ListingError: a folder cannot be listed, or no installed library reads such URLs.
    """
    if "*" not in pattern:
        return [(pattern, ())], []
    files, path = _file_system(pattern)
    closed: list[str] = []
    try:
        found = _matching_paths(files, path, closed, to_the_end=pattern.endswith("*"))
    except Exception as problem:
        reason = f"cannot be listed ({problem}); check the table of jobs and the server"
        raise ListingError(f"{pattern}: {reason}") from problem
    there = sorted((files.unstrip_protocol(path) if is_url(pattern) else path, stars) for path, stars in found)
    return there, closed


def _matching_paths(files: Any, path: str, closed: list[str], *, to_the_end: bool) -> list[tuple[str, tuple[str, ...]]]:
    """Paths that match a pattern, with the text that every `*` matched.

    Args:
        files: The file system.
        path: The pattern on it.
        closed: Takes the folders that matched a `*` and may not be listed, such as lost+found; a folder that the
            pattern names must be listed.
        to_the_end: Its last name contains a `*`, so listed paths need no check for existence.
    """
    files.invalidate_cache()
    first, *rest = path.split("/")
    found: list[tuple[str, tuple[str, ...]]] = [(first, ())]
    for name in rest:
        if "*" not in name:
            found = [(f"{folder}/{name}", stars) for folder, stars in found]
            continue
        wanted = re.compile("(?!\\.)" * name.startswith("*") + "(.*)".join(map(re.escape, name.split("*"))))
        listed = []
        for folder, stars in found:
            try:
                listed += [(child, stars) for child in _children(files, folder)]
            except PermissionError:
                if not stars:
                    raise
                closed.append(folder)
        found = [
            (child, (*stars, *match.groups()))
            for child, stars in listed
            if (match := wanted.fullmatch(child.rsplit("/", 1)[-1]))
        ]
    return [(path, stars) for path, stars in found if to_the_end or files.exists(path)]


def with_stars(pattern: str, stars: tuple[str, ...]) -> str | None:
    """A pattern with every `*` replaced, or None if there are fewer texts than stars.

    Args:
        pattern: Path or URL with `*`.
        stars: Texts that the stars of another pattern matched, in order.
    """
    first, *rest = pattern.split("*")
    if len(rest) > len(stars):
        return None
    return first + "".join(star + text for star, text in zip(stars, rest, strict=False))


@contextmanager
def local_copy(url: str, folder: str | None = None) -> Iterator[Path]:
    """A local path of a file: the file itself if local, otherwise a copy that exists within the block.

    Args:
        url: Path or URL of a file or folder.
        folder: Folder for the copy; by default the system's for temporary files.

    Raises:
        ListingError: no installed library reads such URLs.
        OSError: the file does not exist or cannot be copied.
    """
    if not is_url(url):
        yield Path(url)
        return
    files, path = _file_system(url)
    with tempfile.TemporaryDirectory(prefix="armload-", dir=folder) as own:
        copy = Path(own) / (path.rstrip("/").rsplit("/", 1)[-1] or "recording")
        # not isdir(): over HTTP that reads the complete file to see whether it is a list of files
        files.get(path, str(copy), recursive=files.info(path).get("type") == "directory")
        yield copy


def _file_system(url: str) -> tuple[Any, str]:
    """The file system of a URL, and the path on it."""
    from fsspec.core import url_to_fs

    try:
        files, path = url_to_fs(url if is_url(url) else os.fspath(Path(url).absolute()))
    except ImportError as problem:
        protocol = url.partition("://")[0]
        raise ListingError(
            f"{url}: {problem}. For {protocol}:// install it: pip install {_PACKAGES.get(protocol, protocol)}"
        ) from problem
    except Exception as problem:  # a file system may raise anything about a URL that it cannot use
        raise ListingError(f"{url}: {problem}; expected a path, or a URL that fsspec knows, such as s3://") from problem
    return files, path


def _children(files: Any, folder: str) -> list[str]:
    """Paths in a folder; empty if the folder does not exist."""
    try:
        return [str(path).rstrip("/") for path in files.ls(folder or "/", detail=False)]
    except (FileNotFoundError, NotADirectoryError):
        return []


def _stamp(info: dict[str, Any]) -> str:
    return " ".join(str(info[key]) for key in _CHANGE_KEYS if info.get(key) is not None)


def _modified(info: dict[str, Any]) -> datetime | None:
    """Time of a file's last change, in any of the file systems' formats."""
    said = next((info[key] for key in _DATE_KEYS if info.get(key) is not None), None)
    try:
        if isinstance(said, datetime):
            return said.astimezone(UTC)
        if isinstance(said, str):
            return parsedate_to_datetime(said).astimezone(UTC)
        return None if said is None else datetime.fromtimestamp(float(said), UTC)
    except (ValueError, OverflowError):
        return None
