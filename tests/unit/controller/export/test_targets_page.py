"""The five lines for each target in controller/README.md are compiled or run unchanged."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import armload
from armload_controller.export.c99 import export_c
from armload_controller.export.fmi.fmi3 import export_fmu
from armload_controller.export.hal import export_hal
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import InertialParameters

PAGE = Path(__file__).parents[4] / "controller" / "README.md"
TEXT = PAGE.read_text("utf-8").partition("## The payload's torque in your controller")[2].partition("\n## ")[0]
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", TEXT, flags=re.MULTILINE | re.DOTALL)


def block(language, containing=""):
    (found,) = [text for name, text in BLOCKS if name == language and containing in text]
    assert 2 <= len([line for line in found.splitlines() if line]) <= 5 or language in {"console"}
    return found


def test_every_target_has_its_lines():
    assert [name for name, _ in BLOCKS] == ["c", "cmake", "cpp", "c", "python", "console", "ini", "toml"]


C = "double q_rad[6], dq_rad_s[6], ddq_rad_s2[6], torque_nm[6], theta[10];"
ESTIMATOR = "double time_s, q_rad[6], current_a[6], theta[10], covariance[100], friction[18], moving_s[6], status[9];"


@pytest.mark.skipif(shutil.which("gcc") is None or shutil.which("g++") is None, reason="no gcc and g++ on this machine")
@pytest.mark.parametrize(
    ("language", "containing", "compiler", "declared"),
    [
        ("c", "er50_set_payload", ["gcc", "-std=c99", "-xc"], C),
        ("c", "estimator_update", ["gcc", "-std=c99", "-xc"], ESTIMATOR),
        ("cpp", "", ["g++", "-std=c++17", "-xc++"], "armload_er50::Joints q_rad, dq_rad_s, ddq_rad_s2;"),
    ],
)
def test_the_lines_of_c_compile(calibrated, tmp_path, language, containing, compiler, declared):
    for name, text in export_c(calibrated).items():
        (tmp_path / name).write_text(text)
    include, _, lines = block(language, containing).partition("\n")
    (tmp_path / "main").write_text(f"{include}\n{declared}\nvoid cycle(void)\n{{\n{lines}\n}}\n")
    done = subprocess.run(
        [*compiler, "-fsyntax-only", "-pedantic-errors", "-I.", "main"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_the_line_of_python_runs(make_subject, tmp_path, monkeypatch):
    subject = make_subject("er50")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CFLAGS", "-O0")
    write_payload(Path("payload.toml"), subject.payload)
    state = dict(zip(("q_rad", "dq_rad_s", "ddq_rad_s2"), np.random.default_rng(3).uniform(-1, 1, (3, 6)), strict=True))
    feedforward = PayloadFeedforward(subject.chain, subject.payload.model)
    (line,) = re.findall(r"`(armload\.PayloadFeedforward\(.*\))`", TEXT)
    expected_nm = feedforward.torque_nm(state["q_rad"], state["dq_rad_s"], state["ddq_rad_s2"])
    np.testing.assert_allclose(eval(line, {"armload": armload, **state}), expected_nm, atol=1e-12)

    Path("export").mkdir()
    for name, content in export_fmu(subject).items():
        Path("export", name).write_bytes(content)
    done = {}
    exec(block("python", "fmpy"), done)
    body = subject.payload.model
    heavier = InertialParameters.from_center_of_mass(3.0, body.center_of_mass_m, body.inertia_about_com)
    still = np.zeros((3, 6))
    still[0, 1] = 0.5
    expected_nm = PayloadFeedforward(subject.chain, heavier).torque_nm(*still)[1]
    assert done["result"]["tau[2]"][-1] == pytest.approx(expected_nm, abs=1e-12)


def test_the_files_for_linuxcnc_are_those_that_are_written(make_subject):
    named = re.findall(r"export/(\S+)", block("console") + block("ini"))
    assert named == list(export_hal(make_subject("er50")))
