"""How the kernels are compiled, and what is said if they cannot be."""

import subprocess
from types import SimpleNamespace

import pytest

from armload_core.source.compilation import build_extension
from armload_core.source.compilation.build_extension import CustomBuildHook, compile_extension


@pytest.fixture
def compiling(monkeypatch, tmp_path):
    """Compile with a compiler that a test decides on; returns the commands."""
    (tmp_path / "Python.h").touch()
    monkeypatch.setenv("CFLAGS", "-g '-DNAME=a b'")
    commands = []

    def compiling(status=0, compiler=("cc",)):
        def run(command, **_):
            commands.append(command)
            if status == 0:
                (tmp_path / command[-1]).write_text("compiled")
            return SimpleNamespace(returncode=status, stderr="a warning\n")

        monkeypatch.setattr(build_extension, "c_compiler", lambda: compiler and list(compiler))
        monkeypatch.setattr(subprocess, "run", run)
        compile_extension(tmp_path, ("-fsanitize=address",), tmp_path)
        return commands

    return compiling


def test_all_sources_become_one_file_that_is_replaced_when_it_is_complete(compiling, tmp_path, capsys):
    (tmp_path / "kernels.abi3.so").write_text("old")
    (command,) = compiling()
    assert (tmp_path / "kernels.abi3.so").read_text() == "compiled"
    assert not command[-1].endswith("kernels.abi3.so")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["Python.h", "kernels.abi3.so"]
    assert capsys.readouterr().err == "a warning\n"
    sources = [word for word in command if word.endswith(".c")]
    assert len(sources) > 10
    assert sources == sorted(sources)
    flags = command[: command.index(sources[0])]
    assert flags[-3:] == ["-g", "-DNAME=a b", "-fsanitize=address"]
    assert command[-3:-1] == ["-lm", "-o"]


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"compiler": None}, r"written in C, but no C compiler was found\. Install one"),
        ({"status": 3, "compiler": ("my cc", "-m64")}, "were not compiled: 'my cc' ended with 3$"),
    ],
)
def test_without_a_working_compiler_there_is_no_file(compiling, tmp_path, given, text):
    with pytest.raises(SystemExit, match=text):
        compiling(**given)
    assert [path.name for path in tmp_path.iterdir()] == ["Python.h"]


def test_missing_headers_are_named(tmp_path):
    with pytest.raises(SystemExit, match=f"no Python.h in {tmp_path}.*apt install python3-dev"):
        compile_extension(tmp_path, (), tmp_path)


def test_a_wheel_is_for_this_platform_and_any_python_from_3_11(monkeypatch, tmp_path):
    compiled = []
    monkeypatch.setattr(build_extension, "compile_extension", compiled.append)
    monkeypatch.setattr(build_extension.sysconfig, "get_platform", lambda: "linux-x86_64.v2")
    package = build_extension.SOURCE.parent
    hook = CustomBuildHook(str(package.parents[1]), {}, None, None, "", "wheel")
    data = {"artifacts": []}
    hook.initialize("standard", data)
    assert compiled == [package]
    assert data == {
        "artifacts": [f"{package.parent.name}/armload_core/kernels.abi3.so"],
        "pure_python": False,
        "tag": "cp311-abi3-linux_x86_64_v2",
    }
