"""A wheel for every processor, and what auditwheel may report of it."""

import json
import subprocess
import sys
from types import SimpleNamespace

import pytest

from armload_core.source.compilation import build_wheels
from armload_core.source.compilation.build_wheels import main


@pytest.fixture
def building(monkeypatch, tmp_path):
    """Builds an empty distribution; every wheel has the tag given."""
    calls = []

    def building(tag="manylinux_2_17_{}", isa=()):
        def run(*words, environment=None):
            calls.append((words, environment))
            out = words[words.index("--outdir") + 1] if "--outdir" in words else None
            if "--sdist" in words:
                subprocess.run(["tar", "-czf", f"{out}/armload-1.tar.gz", "-C", str(sources), "armload-1"], check=True)
            elif "--wheel" in words:
                (tmp_path / "dist" / f"armload-1-{environment['_PYTHON_HOST_PLATFORM']}.whl").write_bytes(
                    b"1" * 200_000
                )
            else:
                processor = "x86_64" if "x86_64" in words[-1] else "aarch64"
                return json.dumps({"overall_tag": tag.format(processor), "unsupported_isa": list(isa)})
            return ""

        sources = tmp_path / "sources"
        (sources / "armload-1").mkdir(parents=True)
        monkeypatch.setattr(build_wheels, "_run", run)
        main(tmp_path / "dist")
        return calls

    return building


def test_old_distributions_are_replaced_by_one_wheel_per_processor(building, tmp_path, capsys):
    (tmp_path / "dist").mkdir()
    for name in ("armload-0-x.whl", "armload-0.tar.gz", "other-1.whl"):
        (tmp_path / "dist" / name).touch()
    calls = building()
    wheels = [f"armload-1-manylinux_2_17_{processor}.whl" for processor in ("aarch64", "x86_64")]
    assert sorted(path.name for path in (tmp_path / "dist").iterdir()) == [*wheels, "armload-1.tar.gz", "other-1.whl"]
    environments = [environment for words, environment in calls if "--wheel" in words]
    for processor, environment in zip(("x86_64", "aarch64"), environments, strict=True):
        assert f"ziglang cc -target {processor}-linux-gnu.2.17 -mcpu=baseline -I" in environment["CC"]
        assert environment["CFLAGS"] == "-s -Werror"
    assert "x86_64.whl: 0.2 MB, requires no more than manylinux_2_17_x86_64\n" in capsys.readouterr().out


@pytest.mark.parametrize("tag", ["manylinux_2_5_{}", "manylinux_2_17_{}"])
def test_an_older_platform_suffices(building, tag):
    assert building(tag)


@pytest.mark.parametrize(
    ("tag", "isa"),
    [("manylinux_2_18_{}", ()), ("manylinux_3_0_{}", ()), ("linux_{}", ()), ("manylinux_2_17_{}", ("x86_64_v3",))],
)
def test_a_wheel_that_needs_more_is_refused(building, tag, isa):
    with pytest.raises(SystemExit, match=r"does not run on every manylinux_2_17_x86_64: auditwheel reports \{"):
        building(tag, isa)


@pytest.mark.parametrize("multiarch", ["x86_64-linux-gnu", None])
def test_headers_are_copied_for_every_processor_if_they_are_there(monkeypatch, tmp_path, multiarch):
    monkeypatch.setattr(build_wheels.sysconfig, "get_config_var", lambda name: multiarch)
    monkeypatch.setattr(build_wheels.Path, "is_file", lambda path: multiarch is not None)
    copied = []
    monkeypatch.setattr(build_wheels.shutil, "copy", lambda ours, there: copied.append((ours, there)))
    version = f"python3.{sys.version_info.minor}"
    assert build_wheels._headers_for_every_processor(tmp_path) == tmp_path
    places = [tmp_path / f"{processor}-linux-gnu" / version for processor in ("x86_64", "aarch64")]
    assert all(place.is_dir() for place in places)
    assert [there for _, there in copied] == (places if multiarch else [])
    assert {str(ours) for ours, _ in copied} <= {f"/usr/include/x86_64-linux-gnu/{version}/pyconfig.h"}


@pytest.mark.parametrize(("status", "fails"), [(0, False), (3, True)])
def test_a_module_that_fails_ends_with_its_output(monkeypatch, status, fails):
    done = SimpleNamespace(returncode=status, stdout="out\n", stderr="error\n")
    monkeypatch.setattr(build_wheels.subprocess, "run", lambda command, **_: done)
    if not fails:
        assert build_wheels._run("-m", "build") == "out\n"
        return
    with pytest.raises(SystemExit, match="-m build ended with 3:\nout\nerror\n"):
        build_wheels._run("-m", "build")
