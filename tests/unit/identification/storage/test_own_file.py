"""What armload writes may be replaced by its like, and by nothing else."""

from datetime import UTC, datetime
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure

from armload_controller.config.robot import load_robot
from armload_controller.fleet.alerts import metrics_text
from armload_controller.session.decision_log import DecisionLog
from armload_drivers.simulation.drives.drive_eds import drive_eds
from armload_identification.files.calibration_file import write_calibration
from armload_identification.identification_errors import ReportError
from armload_identification.report.figures.figure_file import write_figure
from armload_identification.report.page import write_page
from armload_identification.storage.own_file import require_own


def test_what_was_written_here_may_be_replaced_by_its_like_only(tmp_path, calibration):
    written = {name: tmp_path / name for name in ("report", "calibration", "excitation", "metrics", "decisions")}
    write_page(written["report"], '<meta charset="utf-8">\n<meta name="generator" content="armload 0.1">')
    write_calibration(written["calibration"], calibration)
    shipped = resources.files("armload_configs") / "er50_identification.toml"
    written["excitation"].write_text(shipped.read_text())
    nobody = SimpleNamespace(arms=(), absent=())
    written["metrics"].write_text(metrics_text(nobody, SimpleNamespace(acknowledged=()), datetime.now(UTC)))
    with DecisionLog(written["decisions"], "er50", SimpleNamespace(step=print)) as log:
        log.report(type("Decision", (), {"to_dict": lambda _: {}})())
    written["EDS"] = tmp_path / "EDS"
    arm = load_robot("er50").drives.settings
    written["EDS"].write_text(drive_eds(arm.drives[0], arm.cycle_s))
    for of, path in written.items():
        for what in written:
            if what == of:
                require_own(path, what, ValueError)
            else:
                with pytest.raises(ValueError, match=rf"{of} exists and is not armload's {what}: .* Give another file"):
                    require_own(path, what, ValueError)


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_a_picture_replaces_a_picture_and_no_other_file(tmp_path, suffix):
    path = tmp_path / f"picture{suffix}"
    for _ in range(2):
        write_figure(path, Figure())
    path.write_text("time_s,joint_1_position_rad\n")
    with pytest.raises(ReportError, match="is not armload's picture"):
        write_figure(path, Figure())
    with pytest.raises(ReportError, match="is not armload's report"):
        write_page(path, "<html>")
    assert path.read_text().startswith("time_s")


def test_an_empty_file_is_replaced_and_a_device_is_written_to(tmp_path):
    (tmp_path / "empty").touch()
    for path in (tmp_path / "empty", tmp_path / "new", Path("/dev/null")):
        require_own(path, "report", ValueError)
