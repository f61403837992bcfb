"""A disk that fails at a chosen step: every step of writing a file below a folder is counted, and can fail.

Steps are: open for writing, a write to the operating system, fsync, rename, mkdir. From the chosen one on all steps
fail, as on a full or removed disk; files can still be deleted on a full disk.
"""

import errno
import io
import os
import shutil
from contextlib import contextmanager
from pathlib import Path

import pytest


def full(folder):
    """No space is left."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def broken(folder):
    """The device does not answer."""
    raise OSError(errno.EIO, os.strerror(errno.EIO))


def removed(folder):
    """The folder was removed; the error is the operating system's."""
    shutil.rmtree(folder, ignore_errors=True)


FAULTS = {full: "No space left on device", broken: "Input/output error", removed: "No such file or directory|removed"}
"""Faults, with a pattern of their error message."""


class FaultyDisk:
    """A folder on such a disk.

    Args:
        folder: On the disk.
        fault: One of `FAULTS`.
        at: Number of the first step that fails, from 1; None for no fault.

    Attributes:
        steps: Steps so far, such as "write payload.toml".
    """

    def __init__(self, folder, fault=full, at=None):
        self.folder, self.fault, self.at = Path(folder).resolve(), fault, at
        self.steps = []

    def step(self, what, path):
        """Count a step, and fail if it is the chosen one or a later one."""
        path = Path(os.fsdecode(path)).absolute()
        if self.folder not in (path, *path.parents):
            return
        self.steps.append(f"{what} {path.name}")
        if self.at is not None and len(self.steps) >= self.at:
            self.fault(self.folder)

    @contextmanager
    def mounted(self):
        """Within the block, this process writes to the folder through this disk."""
        disk, opened, fsync = self, io.open, os.fsync

        class File(io.FileIO):
            def write(self, data):
                disk.step("write", self.name)
                return super().write(data)

        def open_(file, mode="r", *rest, **more):
            if not set(mode) & set("wxa") or isinstance(file, int) or Path(file).is_dir():  # a file without a name
                return opened(file, mode, *rest, **more)
            disk.step("open", file)
            if "b" not in mode:
                return opened(file, mode, *rest, **more)
            return io.BufferedWriter(File(os.fspath(file), mode))

        def flushed(descriptor):
            disk.step("fsync", Path(f"/proc/self/fd/{descriptor}").readlink())
            fsync(descriptor)

        def counted(what, act):
            def counting(path, *rest, **more):
                disk.step(what, path)
                return act(path, *rest, **more)

            return counting

        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(io, "open", open_)
            patched.setattr(os, "fsync", flushed)
            for name in ("rename", "replace", "mkdir"):
                patched.setattr(os, name, counted(name, getattr(os, name)))
            yield self
