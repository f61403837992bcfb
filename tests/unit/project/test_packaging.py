"""What is pinned and shipped."""

from importlib import resources
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def test_the_pins_carry_hashes_and_no_addresses():
    lock = ROOT / "requirements.lock"
    if not lock.is_file():
        pytest.skip("not a checkout: the pins are not installed")
    pins = [line for line in lock.read_text().splitlines() if line and not line.lstrip().startswith("#")]
    assert sum(line[0].isalpha() for line in pins) > 30
    for line in pins:
        assert line[0].isalpha() or line.startswith("    --hash=sha256:"), line
        assert "/" not in line, line


@pytest.mark.pure
def test_robots_and_report_template_are_package_data():
    robots = {file.name for file in resources.files("armload_configs").iterdir()}
    assert {"er50.toml", "er50_identification.toml", "er50_validation.toml", "ur10e.toml"} <= robots
    report = {file.name for file in resources.files("armload_identification.report").iterdir()}
    assert {"template.html.j2", "style.css"} <= report
    for package in (
        "armload_core",
        "armload_drivers",
        "armload_controller",
        "armload_identification",
        "armload_configs",
    ):
        assert resources.files(package).joinpath("py.typed").is_file()
