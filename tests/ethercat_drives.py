"""The arms of the tests on EtherCAT, and the drives that suit them.

    python -m tests.ethercat_drives ARM COMMAND ...

runs a command below `../shared/tools/with-ethercat` with the drives of `small` (three axes) or `er50` (six); `large` is
six axes at 2 ms, `fixed` are those of `small` with mappings that cannot be written. The drives state the simulation's
identity, so that armload accepts them as simulated ones.
"""

import os
import re
import sys
import tarfile
from importlib import resources

from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY
from tests.lockstep_line import TOOLS

COUNTS_PER_MOTOR_TURN = 2**17
PROFILE_VELOCITY = 54321
IDENTITY = f"vendor_id = {SIMULATION_IDENTITY.vendor_id}, product_code = {SIMULATION_IDENTITY.product_code}"
_KEY = r"^{} = ([\d.]+)"
_BUS = """\
[bus]
interface = "ethercat"
channel = "{channel}"
cycle_hz = {cycle_hz}
watchdog_s = {watchdog_s}
max_missing_cycles = {max_missing_cycles}

[[joints]]"""


def er50_text(channel, *, watchdog_s=2.0, cycle_hz=250.0, max_missing_cycles=3):
    """er50's file with an EtherCAT bus; with-ethercat's drives report torque (6077), from which current is computed."""
    text = (resources.files("armload_configs") / "er50.toml").read_text("utf-8")
    bus = _BUS.format(channel=channel, watchdog_s=watchdog_s, cycle_hz=cycle_hz, max_missing_cycles=max_missing_cycles)
    text, buses = re.subn(r"\[bus\].*?\[\[joints\]\]", bus, text, count=1, flags=re.S)

    def effort(found):
        scale = float(found[2]) / 1000
        return (
            f'{found[1]}effort_object = {{ index = 0x6077, subindex = 0, type = "i16", a_per_unit = {scale} }}\n'
            f"identity = {{ {IDENTITY} }}\nrated_current_a = {found[2]}"
        )

    text, drives = re.subn(r'(feedback = "current"[^\n]*\n[^\n]*\n)rated_current_a = ([\d.]+)', effort, text)
    assert (buses, drives) == (1, 6)
    return text


def _presets(drive, gear, rated_nm, counts=COUNTS_PER_MOTOR_TURN):
    """Objects of one drive, or of all."""
    values = {"608F:1": counts, "6091:1": gear, "6076:0": round(1000 * rated_nm / gear)}
    return [word for entry, value in values.items() for word in ("--set", f"{drive}{entry}={value}")]


def _entry(index, bits):
    """An object in a PDO."""
    kind = {16: "INT", 32: "DINT"}[bits]
    object_ = f"<Index>#x{index}</Index><SubIndex>0</SubIndex>"
    return f"<Entry>{object_}<BitLen>{bits}</BitLen><DataType>{kind}</DataType></Entry>"


def _esi_of_fixed_mappings():
    """Path, within this process and those that it becomes, of the drives' ESI file with mappings of its own, read only.

    Outputs 607A, 6081, 6040, 60B2; inputs 6077, 6064, 606C, 6041.
    """
    with tarfile.open(TOOLS / "ethercat" / "kickcat.tar.xz") as archive:
        text = archive.extractfile("kickcat/ecat402-drive.xml").read().decode()
    for kind, mapped in {
        "Rx": {"607A": 32, "6081": 32, "6040": 16, "60B2": 16},
        "Tx": {"6077": 16, "6064": 32, "606C": 32, "6041": 16},
    }.items():
        own = "".join(_entry(index, bits) for index, bits in mapped.items())
        before = rf'<{kind}Pdo Fixed="0"(.*?)<Entry>.*?(</{kind}Pdo>)'
        text = re.sub(before, rf'<{kind}Pdo Fixed="1"\1{own}\2', text, count=1, flags=re.S)
    descriptor = os.memfd_create("esi", 0)
    os.write(descriptor, text.encode())
    return f"/proc/{os.getpid()}/fd/{descriptor}"


def options(arm):
    """Options of with-ethercat."""
    known = [f"1018:1={SIMULATION_IDENTITY.vendor_id}", f"1018:2={SIMULATION_IDENTITY.product_code}"]
    words = ["--plant-timeout", "60"]
    words += [word for entry in (*known, "6075:0=10000") for word in ("--set", entry)]
    if arm == "fixed":
        words += ["--esi", _esi_of_fixed_mappings(), "--set", f"6081:0={PROFILE_VELOCITY}"]
    if arm in {"small", "fixed"}:
        return ["--drives", "3", "--cycle-us", "10000", *words, *_presets("", 1, 200.0, 1_000_000)]
    if arm == "large":
        return ["--drives", "6", "--cycle-us", "2000", *words, *_presets("", 1, 200.0, 1_000_000)]
    text = (resources.files("armload_configs") / "er50.toml").read_text("utf-8").split("[simulation]")[0]
    gears, torques, currents = (
        [float(value) for value in re.findall(_KEY.format(key), text, re.M)]
        for key in ("gear_ratio", "rated_torque_nm", "rated_current_a")
    )
    for number, (gear, rated_nm, rated_a) in enumerate(zip(gears, torques, currents, strict=True)):
        words += _presets(f"{number}:", round(gear), rated_nm)
        words += ["--set", f"{number}:6075:0={round(1000 * rated_a)}"]
    return ["--drives", "6", "--cycle-us", "4000", *words]


if __name__ == "__main__":
    arm, *command = sys.argv[1:]
    tool = str(TOOLS / "with-ethercat")
    os.execv(tool, [tool, *options(arm), "--", *command])
