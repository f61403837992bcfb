"""The README's picture, from a commissioning of er50, and that of WATCH.md: `make pictures`.

One SVG: the arm at a moment of its excitation, the currents of three joints with and without the payload, the mass.
"""

from __future__ import annotations

import tempfile
from html import escape
from pathlib import Path

import numpy as np

import armload
from armload_identification.float_array import FloatArray
from armload_identification.numerals import NO_BREAK
from armload_identification.report.payload_in_words import mass_card
from armload_identification.results.findings import Findings
from benchmarks.canopen_runs import watch_picture

PICTURE = Path(__file__).parents[2] / "controller" / "pictures" / "result.svg"
ROBOT, JOINTS, MOMENT_S = "er50", (1, 2, 4), 12.0
"""Joints with the payload's weight, and the moment at which the arm is drawn, before the end of the excitation."""
_LOADED, _EMPTY = "#d55e00", "#56697a"
_STYLE = "text{font-family:Helvetica,Arial,'Liberation Sans',sans-serif;fill:#1a1a1a}.soft{fill:#555}"
_PIXELS_PER_M = 150.0


def run() -> None:
    """Commission the arm in a temporary folder, and draw the result."""
    with tempfile.TemporaryDirectory() as folder:
        found = armload.commission(ROBOT, folder)
        runs = [armload.read_recording(Path(folder) / f"{load}_identification.mcap") for load in ("loaded", "unloaded")]
    PICTURE.parent.mkdir(exist_ok=True)
    PICTURE.write_text(picture(found, *runs))
    print(f"{PICTURE}: {PICTURE.stat().st_size} bytes")


def picture(found: Findings, loaded: armload.Recording, unloaded: armload.Recording) -> str:
    """The SVG of a determined payload.

    Args:
        found: An identification and its validation.
        loaded: The run with the payload that it was identified from.
        unloaded: The run without it.
    """
    mass = mass_card(found.payload)
    if mass is None:
        raise SystemExit("the mass is not determined: nothing to draw")
    parts = [
        '<rect width="960" height="330" fill="#fff"/>',
        _arm(loaded.position_rad[np.searchsorted(loaded.time_s, loaded.time_s[-1] - MOMENT_S)]),
        '<text x="330" y="30" font-size="15">motor currents over ten seconds, '
        f'<tspan style="fill:{_LOADED}">with</tspan> and '
        f'<tspan style="fill:{_EMPTY}">without</tspan> the payload</text>',
        *(_currents(loaded, unloaded, joint, 46 + 92 * row) for row, joint in enumerate(JOINTS)),
        _text(735, 150, 44, mass[0], weight=700),
        _text(737, 182, 15, f"95{NO_BREAK}% interval", soft=True),
        _text(737, 202, 15, mass[1], soft=True),
        _text(737, 240, 15, found.verdict.title),
    ]
    described = escape(f"A simulated arm, its motor currents, and the result. {found.verdict.title}. Mass {mass[0]}.")
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 960 330" role="img">'
        f"<title>{described}</title><style>{_STYLE}</style>{''.join(parts)}</svg>\n"
    )


def _arm(position_rad: FloatArray) -> str:
    """The arm's joints and flange from the side, with what it carries."""
    chain = armload.load_robot(ROBOT).chain
    points = np.vstack([np.zeros(3), chain.forward(position_rad)[:, :3, 3]])
    up = -chain.gravity_m_s2 / np.linalg.norm(chain.gravity_m_s2)
    ahead = points[-1] - (points[-1] @ up) * up
    flat = np.column_stack([points @ ahead / np.linalg.norm(ahead), points @ up])
    x, y = 60.0 + _PIXELS_PER_M * flat[:, 0], 290.0 - _PIXELS_PER_M * (flat[:, 1] - flat[:, 1].min())
    links = " ".join(f"{a:.0f},{b:.0f}" for a, b in zip(x, y, strict=True))
    dots = "".join(
        f'<circle cx="{a:.0f}" cy="{b:.0f}" r="7" fill="#39618a"/>' for a, b in zip(x[1:-1], y[1:-1], strict=True)
    )
    return (
        '<rect x="20" y="290" width="270" height="6" fill="#bbb"/>'
        f'<polyline points="{links}" fill="none" stroke="#8fa9c2" stroke-width="16" stroke-linejoin="round" '
        f'stroke-linecap="round"/>{dots}<circle cx="{x[-1]:.0f}" cy="{y[-1] + 16:.0f}" r="17" fill="{_LOADED}"/>'
    )


def _currents(loaded: armload.Recording, unloaded: armload.Recording, joint: int, top: int) -> str:
    """Currents of one joint over ten seconds of the excitation, without and with the payload."""
    lines, runs = [], ((unloaded, _EMPTY), (loaded, _LOADED))
    currents = []
    for run, _ in runs:
        assert run.current_a is not None  # noqa: S101 - er50 records currents
        part = np.abs(run.time_s - run.time_s[-1] + 13.0) < 5.0
        width = max(1, int(part.sum()) // 300)
        count = int(part.sum()) // width
        currents.append(run.current_a[part][: count * width, joint].reshape(count, width).mean(axis=1))
    most = max(float(np.abs(current).max()) for current in currents)
    for (_, color), current in zip(runs, currents, strict=True):
        x, y = np.linspace(380, 710, current.size), top + 42 - 36 * current / most
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        lines.append(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.8"/>')
    axis = f'<path d="M380 {top + 42}H710" stroke="#ccc"/>'
    return _text(330, top + 47, 14, f"joint {joint + 1}", soft=True) + axis + "".join(lines)


def _text(x: int, y: int, size: int, text: str, *, weight: int = 400, soft: bool = False) -> str:
    kind = ' class="soft"' if soft else ""
    return f'<text x="{x}" y="{y}" font-size="{size}" font-weight="{weight}"{kind}>{escape(text)}</text>'


if __name__ == "__main__":
    run()
    with tempfile.TemporaryDirectory() as folder:
        watch_picture.draw(Path(folder))
