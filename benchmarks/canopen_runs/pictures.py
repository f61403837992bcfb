"""The README's picture, from a commissioning of prbt, and that of WATCH.md: `make pictures`.

prbt's drives report torque; with er50's nominal gains a commissioning does not determine the mass to 2 %.

One SVG shows what the top of a report shows: verdict, mass, the centre of mass on the flange, and one joint's torque.
"""

from __future__ import annotations

import re
import tempfile
from html import escape
from pathlib import Path

from typer.testing import CliRunner

import armload
from armload_controller.cli.main import app
from armload_identification.report.figures.center_figure import center_views
from armload_identification.report.figures.joint_figures import torque_figure
from armload_identification.report.numerals import NO_BREAK
from armload_identification.report.parameters import mass_card
from armload_identification.results.findings import Findings
from benchmarks.canopen_runs import watch_picture

PICTURE = Path(__file__).parents[2] / "controller" / "pictures" / "result.svg"
ROBOT = "prbt"
_COLORS = {"passed": "#009e73", "failed": "#d55e00", "missing": "#e69f00"}
_JOINT = 1
_STYLE = """
text { font-family: Helvetica, Arial, 'Liberation Sans', sans-serif; fill: #1a1a1a; }
.soft { fill: #555; }
.centre-view { font-size: 20px; }
.flange { fill: #cfd6db; }
.axis { fill: none; stroke: #c4c4c4; stroke-dasharray: 4 3; }
.ruler { fill: none; stroke: #555; stroke-width: 1.5; }
.interval { fill: #d55e00; fill-opacity: .25; stroke: #d55e00; stroke-width: 1.5; }
.cross { fill: none; stroke: #d55e00; }
.centre { fill: #d55e00; }
"""


def run() -> None:
    """Commission the arm in a temporary folder, and draw the result."""
    with tempfile.TemporaryDirectory() as folder:
        result = CliRunner().invoke(app, ["commission", ROBOT, "--output", folder])
        if result.exit_code != 0:
            raise SystemExit(result.output)
        found = armload.identify(
            ROBOT,
            *_pair(Path(folder), "identification"),
            validation=_pair(Path(folder), "validation"),
        )
    PICTURE.parent.mkdir(exist_ok=True)
    PICTURE.write_text(picture(found))
    print(f"{PICTURE}: {PICTURE.stat().st_size} bytes")


def _pair(folder: Path, role: str) -> tuple[Path, Path]:
    """Files of the loaded and the unloaded run."""
    return folder / f"loaded_{role}.mcap", folder / f"unloaded_{role}.mcap"


def picture(found: Findings) -> str:
    """The SVG of a determined payload.

    Args:
        found: An identification and its validation.
    """
    mass = mass_card(found.payload)
    fitted = found.content.fitted
    if mass is None or fitted is None:
        raise SystemExit("the mass is not determined: nothing to draw")
    side, front = center_views(found.payload)
    name = found.arm.joint_names[_JOINT]
    title = f"Joint {_JOINT + 1} ({name}): measured and predicted payload torque, and the difference."
    torque = torque_figure(fitted.signal, fitted.predicted_nm, _JOINT, "torque", title)
    parts = [
        '<rect width="960" height="590" fill="#fff"/>',
        f'<rect x="20" y="20" width="8" height="60" fill="{_COLORS[found.verdict.kind]}"/>',
        _text(44, 46, 22, f"{found.verdict.title}", weight=700),
        _text(44, 72, 15, f"Simulated arm {found.arm.name}, judged on runs that it was not identified from", soft=True),
        _text(20, 170, 62, mass[0], weight=700),
        _text(22, 204, 16, f"95{NO_BREAK}% interval {mass[1]}", soft=True),
        _text(22, 262, 16, "Payload torque of a joint: measured and predicted,"),
        _text(22, 284, 16, "and what is left of it beside the noise"),
        _placed(side.svg, 500, 20, 220, 220),
        _placed(front.svg, 730, 20, 220, 220),
        _text(610, 262, 15, side.heading, anchor="middle"),
        _text(840, 262, 15, front.heading, anchor="middle"),
        _text(500, 288, 14, "Centre of mass on the flange, to scale, with its 95 % interval", soft=True),
        _placed(torque, 20, 300, 920, 280),
    ]
    described = escape(f"{found.verdict.title}. Mass {mass[0]}, {mass[1]}.")
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 960 590" role="img">'
        f"<title>{described}</title><style>{_STYLE}</style>{''.join(parts)}</svg>\n"
    )


def _text(x: int, y: int, size: int, text: str, *, weight: int = 400, soft: bool = False, anchor: str = "start") -> str:
    kind = ' class="soft"' if soft else ""
    return (
        f'<text x="{x}" y="{y}" font-size="{size}" font-weight="{weight}" text-anchor="{anchor}"{kind}>'
        f"{escape(text)}</text>"
    )


def _placed(svg: str, x: int, y: int, width: int, height: int) -> str:
    """An SVG, placed inside another."""
    return re.sub(r"^<svg ", f'<svg x="{x}" y="{y}" width="{width}" height="{height}" ', svg)


if __name__ == "__main__":
    run()
    with tempfile.TemporaryDirectory() as folder:
        watch_picture.draw(Path(folder))
