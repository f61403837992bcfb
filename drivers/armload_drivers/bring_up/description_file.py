"""Reads the file of a device description; `cia402.eds_parser` parses it."""

from __future__ import annotations

import stat
from pathlib import Path

from armload_drivers.cia402.eds_parser import LARGEST_BYTES, DeviceDescription, parse_description
from armload_drivers.driver_errors import DescriptionError


def read_description(path: Path) -> DeviceDescription:
    """Read an EDS or DCF file.

    Raises:
        DescriptionError: the file cannot be read, or is not a description of a CiA 402 drive.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # opening a pipe waits for a writer, and a device may be endless
            raise DescriptionError(path.name, "", "", "not a regular file; give an EDS or DCF file")
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)  # the parser refuses a larger file
    except OSError as error:
        raise DescriptionError(path.name, "", "", f"cannot be read: {error.strerror}") from error
    return parse_description(data, path.name)
