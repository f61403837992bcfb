"""The licence of generated source code."""

from __future__ import annotations

from typing import Final

DEFAULT_LICENCE: Final = "Apache-2.0"
"""SPDX identifier: armload's own licence."""
