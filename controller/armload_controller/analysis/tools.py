"""Tools by name: payload files of grippers and the like, of which a workpiece is told apart.

They are kept in `$XDG_DATA_HOME/armload/tools`, by default `~/.local/share/armload/tools`, one file per tool.
"""

from __future__ import annotations

import difflib
import os
import re
from pathlib import Path

from armload_controller.control_errors import ConfigurationError
from armload_controller.export.export_files import write_files
from armload_identification.files.payload_file import read_payload
from armload_identification.identification_errors import PayloadFileError
from armload_identification.model.payload import PayloadResult
from armload_identification.storage.strict_toml import read_text

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


def tools_folder() -> Path:
    """The folder of the user's tools; it may not exist."""
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share") / "armload" / "tools"


def tool_names() -> tuple[str, ...]:
    """Names of the user's tools."""
    return tuple(sorted(path.stem for path in tools_folder().glob("*.toml")))


def add_tool(name: str, payload: Path) -> Path:
    """Keep a payload file as a tool.

    Args:
        name: Letters, digits, - and _.

    Returns:
        The tool's file.

    Raises:
        ConfigurationError: the name is not possible, or another payload has it.
        PayloadFileError: the file cannot be read, or mass or centre of mass is not determined.
        ExportError: the file cannot be written.
    """
    if not _NAME.fullmatch(name):
        raise ConfigurationError("command line", "NAME", name, "expected letters, digits, - and _, 64 at most")
    tool = read_payload(payload)
    if not tool.feedforward_ready:
        expected = (
            "expected a payload with determined mass and centre of mass: identify the tool on a longer excitation"
        )
        raise PayloadFileError(str(payload), "determined", None, expected)
    path = tools_folder() / f"{name}.toml"
    text = read_text(payload, PayloadFileError)
    if path.exists() and read_text(path, PayloadFileError) != text:
        expected = f"another payload has this name; choose another one, or remove {path}"
        raise ConfigurationError("command line", "NAME", name, expected)
    write_files({path.name: text}, path)
    return path


def tool_payload(name_or_file: str) -> PayloadResult:
    """The payload of a tool.

    Args:
        name_or_file: Name of a tool, or path of a payload file.

    Raises:
        ConfigurationError: neither.
        PayloadFileError: the file cannot be read.
    """
    names = tool_names()
    if name_or_file in names:
        return read_payload(tools_folder() / f"{name_or_file}.toml")
    if Path(name_or_file).is_file():
        return read_payload(name_or_file)
    close = difflib.get_close_matches(name_or_file, names, n=1)
    meant = f" Did you mean {close[0]}?" if close else ""
    raise ConfigurationError(
        "command line",
        "--minus",
        name_or_file,
        f"no such tool, and no such file.{meant} Tools are: {', '.join(names) or 'none'}; add one with `armload tools "
        "add NAME payload.toml`",
    )
