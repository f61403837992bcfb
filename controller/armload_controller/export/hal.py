"""LinuxCNC: the payload's torque as a realtime component of HAL, and a file that wires it to CiA 402 drives.

    halcompile --install armload_<robot>.comp;  loadrt armload_<robot>;  addf armload-<robot>.0.compute servo-thread -2

- q-N, dq-N, ddq-N in rad, rad/s, rad/s2, tau-N in N m, at the joints, N from 0 at the base.
- mass in kg, com-x .. com-z in m in the flange frame, ixx .. iyz in kg m2 about the centre of mass as tensor elements
  (ixy = -int xy dm): initially the payload of the file; new values apply, without a step, when set-payload is set.
- enable ramps the torque in and out; each joint's torque is limited to its parameter limit-N.
- lag: the torque is computed from the inputs of this time ago, since an arm follows its setpoints with the servos' lag.

The component contains the exported C, so it is a single file for halcompile. The HAL file reads LinuxCNC's commanded
motion, whose angular joints are in degrees, and writes per mille of rated torque (60B2) to pins of lcec, the EtherCAT
component. It is written only if the robot's file states the drives' rated torques, which define the unit of 60B2.

What is not determined: as in `c99`.

References:
    LinuxCNC 2.9, halcompile(1), "HAL Component Generator"; motion(9) for joint.N.pos-cmd, vel-cmd, acc-cmd.
    linuxcnc-ethercat, configuration reference: `<pdoEntry>` of the generic driver, names of its pins.
    CiA 402-2: 60B2, torque offset, in per mille of rated torque (6076).
"""

from __future__ import annotations

import math
import re

from armload_controller.cycle.torque_gate import OPENING_S, TORQUE_SHARE
from armload_controller.export.body_parameters import FRICTION, PARAMETERS, TRANSITION_S
from armload_controller.export.c99 import export_c
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.template import filled, written
from armload_controller.export.text_format import ascii_line, exact, provenance, spdx

LONGEST_NAME = 22
"""Greatest length of a component's name, so that its longest parameter, with .0.compute.tmax-increased, has at most 47
characters."""


def export_hal(subject: ExportSubject) -> dict[str, str]:
    """The component, and the HAL file if the unit of 60B2 is known."""
    component = f"armload_{subject.identifier}"[:LONGEST_NAME].rstrip("_")
    texts = {f"{component}.comp": _component(subject, component)}
    if subject.permille_per_nm is not None:
        texts[f"{component}.hal"] = _wiring(subject, component.replace("_", "-"), component)
    return texts


def _component(subject: ExportSubject, component: str) -> str:
    """The source for halcompile."""
    name, n = f"armload_{subject.identifier}", subject.chain.n
    code = export_c(subject)
    header, source = code[f"{name}.h"], code[f"{name}.c"].replace(f'#include "{name}.h"\n', "")
    limits_nm = TORQUE_SHARE * subject.torque_max_nm
    limits = (
        f'param rw float limit-{i} = {exact(limit)} "greatest torque of joint {i}, either direction, in N m";'
        for i, limit in enumerate(limits_nm)
    )
    payload = (
        f'pin in float {parameter.replace("_", "-")} = {exact(value)} "payload: {meaning}, in {unit}";'
        for (parameter, unit, meaning), value in zip(PARAMETERS, subject.payload.values, strict=True)
    )
    friction = "" if subject.calibration is None else f'param rw float friction = 1.0 "share of {FRICTION}";'
    return filled(
        "c_code/hal_component.comp",
        {
            "component": component,
            "robot": _quotable(subject.robot),
            "name": name,
            "GUARD": name.upper(),
            "n": str(n),
            "licence": subject.licence,
            "provenance": _quotable(provenance(subject)),
            "robot_sha256": subject.robot_sha256,
            "joints": _quotable(", ".join(f"{i} {joint}" for i, joint in enumerate(subject.joint_names))),
            "inertia": complete_inertia(subject.payload, TENSOR).statement,
            "payload_pins": "\n".join(payload),
            "friction": friction,
            "limits": "\n".join(limits),
            "limit_list": ",\n".join(f"        __comp_inst->limit_{i}" for i in range(n)),
            "transition": exact(TRANSITION_S),
            "ramp": exact(OPENING_S),
            "header": header,
            "source": source,
            "theta_of": filled("c_code/theta_of.c", {}),
            **_offsets(subject),
        },
    )


def _offsets(subject: ExportSubject) -> dict[str, str]:
    """Pins for the drives, and the code that writes them; empty if the unit of 60B2 is unknown."""
    if subject.permille_per_nm is None:
        return {"offset_pin": "", "offsets": ""}
    text = "torque offset (60B2) of the drive of axis #, in integer per mille of its rated torque"
    lines = []
    for axis, row in enumerate(subject.permille_per_nm):
        terms = (f"{exact(value)} * *__comp_inst->tau[{joint}]" for joint, value in enumerate(row) if value != 0.0)
        lines.append(f"    *__comp_inst->offset[{axis}] = rint({' + '.join(terms)});\n")
    return {"offset_pin": f'pin out float offset-#[{subject.chain.n}] "{text}";', "offsets": "".join(lines)}


def _wiring(subject: ExportSubject, prefix: str, component: str) -> str:
    """The HAL file; it must be listed in the machine's INI file after the one that adds lcec."""
    unit = prefix + ".0"
    slaves = [re.sub(r"[^0-9A-Za-z_-]", "-", joint) for joint in subject.joint_names]
    nets = []
    for i, slave in enumerate(slaves):
        for pin, source in (("q", "pos-cmd"), ("dq", "vel-cmd"), ("ddq", "acc-cmd")):
            nets.append(f"net {prefix}-{pin}-{i} joint.{i}.{source} => {unit}.{pin}-{i}")
        nets.append(f"net {prefix}-offset-{i} {unit}.offset-{i} => lcec.0.{slave}.torque-offset")
    fields = {
        "licence": spdx(subject, "#"),
        "provenance": provenance(subject),
        "robot": subject.robot,
        "slaves": ", ".join(slaves),
        "component": component,
        "prefix": prefix,
        "unit": unit,
        "position_unit": exact(math.radians(1.0)),
        "nets": "\n".join(nets),
    }
    return written("c_code/hal_wiring.hal", "#", fields)


def _quotable(text: str) -> str:
    """A text for use inside the quotes of a component's declarations."""
    return ascii_line(text).replace("\\", "/").replace('"', "'")
