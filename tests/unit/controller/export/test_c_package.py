"""The exported C as a CMake package: built, tested, installed and used by a C++17 program with two lines of CMake."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from armload_controller.export.c99 import export_c
from armload_identification.model.regressor import payload_torque

CMAKE = Path(sys.executable).with_name("cmake")
pytestmark = pytest.mark.skipif(
    shutil.which("g++") is None or shutil.which("make") is None or not CMAKE.exists(), reason="no g++, make or cmake"
)
USER = """\
cmake_minimum_required(VERSION 3.16)
project(my_controller LANGUAGES CXX)
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_EXTENSIONS OFF)
add_compile_options(-Wall -Wextra -Wconversion -Werror -pedantic)
add_executable(my_controller main.cpp)
find_package(armload_er50 1.2 REQUIRED)
target_link_libraries(my_controller PRIVATE armload_er50::armload_er50)
"""
MAIN = """\
#include <armload_er50.hpp>
#include <armload_er50_estimator.h>

#include <cstdio>

static void print(const armload_er50::Joints &torque_nm)
{
    for (const auto value : torque_nm) {
        std::printf("%.17g ", value);
    }
}

int main()
{
    armload_er50::Payload payload;
    const armload_er50::Joints q{0.1, -0.7, 0.4, 1.2, -0.5, 2.0}, dq{0.2, 0.1, -0.3, 0.5, -0.6, 0.7};
    const armload_er50::Joints ddq{1.0, -2.0, 0.5, 0.3, -0.4, 0.8};
    print(payload.compute(q, dq, ddq));
    print(payload.gravity(q));
    const armload_er50::Theta impossible{-1.0};
    const bool refused = !payload.set(impossible, 0.1, 0.01);
    const bool taken = payload.set(armload_er50::Theta{}, 0.0, 0.01);
    for (int cycle = 0; cycle < 100; cycle++) {
        (void)payload.gravity(q);
    }
    print(payload.compute(q, dq, ddq));
    armload_er50_estimator estimator;
    armload_er50_estimator_init(&estimator);
    armload_er50_estimator_update(&estimator, 0.0, q.data(), dq.data());
    return refused && taken ? 0 : 1;
}
"""


def run(*command, cwd):
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def run_unchecked(cmake, user, tmp_path, text):
    """CMake's message for a project."""
    (user / "CMakeLists.txt").write_text(text)
    command = [cmake, "-S", ".", "-B", "refused", f"-DCMAKE_PREFIX_PATH={tmp_path / 'installed'}"]
    return subprocess.run(command, cwd=user, capture_output=True, text=True, check=False, timeout=120).stderr


@pytest.mark.long
def test_find_package_and_a_class_give_pythons_torque(calibrated, tmp_path):
    subject = calibrated
    package, user = tmp_path / "package", tmp_path / "user"
    package.mkdir()
    user.mkdir()
    for name, text in export_c(subject).items():
        (package / name).write_text(text)
    run(CMAKE, "-S", ".", "-B", "build", "-DCMAKE_BUILD_TYPE=Debug", cwd=package)
    run(CMAKE, "--build", "build", cwd=package)
    tested = run(CMAKE.with_name("ctest"), "--test-dir", "build", cwd=package)
    assert "100% tests passed" in tested
    run(CMAKE, "--install", "build", "--prefix", tmp_path / "installed", cwd=package)
    shutil.rmtree(package)

    refused = run_unchecked(CMAKE, user, tmp_path, USER.replace(" 1.2 ", " 1.3 "))
    assert 'requested version "1.3"' in " ".join(refused.split())
    (user / "CMakeLists.txt").write_text(USER)
    (user / "main.cpp").write_text(MAIN)
    run(CMAKE, "-S", ".", "-B", "build", f"-DCMAKE_PREFIX_PATH={tmp_path / 'installed'}", cwd=user)
    run(CMAKE, "--build", "build", cwd=user)
    printed = np.array(run(user / "build" / "my_controller", cwd=user).split(), dtype=float).reshape(3, 6)

    state = np.array(
        [[0.1, -0.7, 0.4, 1.2, -0.5, 2.0], [0.2, 0.1, -0.3, 0.5, -0.6, 0.7], [1.0, -2.0, 0.5, 0.3, -0.4, 0.8]]
    )
    theta, still = subject.payload.model.theta, np.zeros(6)
    expected = [
        payload_torque(subject.chain, theta, *state),
        payload_torque(subject.chain, theta, state[0], still, still),
    ]
    np.testing.assert_allclose(printed[:2], expected, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(printed[2], still)
