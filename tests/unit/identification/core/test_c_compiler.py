"""Which C compiler is taken."""

import shutil
import sys

import pytest

from armload_core import c_compiler as module
from armload_core.c_compiler import c_compiler

ZIG = [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]


@pytest.mark.parametrize(
    ("stated", "there", "zig", "found"),
    [
        ("ccache gcc -m64", ["cc"], True, ["ccache", "gcc", "-m64"]),
        ("", ["clang", "gcc", "cc"], True, ["cc"]),
        (None, ["clang", "gcc"], True, ["gcc"]),
        (None, ["clang"], True, ["clang"]),
        (None, [], True, ZIG),
        (None, [], False, None),
    ],
)
def test_the_stated_one_comes_before_those_of_the_system_and_zig_is_last(monkeypatch, stated, there, zig, found):
    monkeypatch.delenv("CC", raising=False)
    if stated is not None:
        monkeypatch.setenv("CC", stated)
    monkeypatch.setattr(shutil, "which", lambda name: name if name in there else None)
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: name if zig else None)
    assert c_compiler() == found
