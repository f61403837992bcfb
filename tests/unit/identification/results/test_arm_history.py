"""An arm's history without the libraries for figures."""

import sys

import pytest

from armload_identification.identification_errors import ExtraMissing
from armload_identification.results.arm_history import ArmHistory


@pytest.mark.parametrize("output", [ArmHistory.picture, ArmHistory.report])
def test_without_matplotlib_the_error_names_the_extra(output, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    history = ArmHistory("arm", "", (), None, "arm.calibration.toml", None, ())
    with pytest.raises(ExtraMissing, match=r"arm over its runs needs Matplotlib.*'armload\[report\]'"):
        output(history, tmp_path / "drift.png")
