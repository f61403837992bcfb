"""`--json`: every command with a result prints one document, and its JSON Schema describes exactly its keys."""

import json
from collections import defaultdict
from contextlib import redirect_stdout
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache, partial
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from jsonschema import Draft202012Validator

from armload_controller.analysis.payload_events import PayloadEvent
from armload_controller.analysis.payload_watch import HeardBus, WatchedMoment
from armload_controller.analysis.robot_wiggle import DesignedWiggle
from armload_controller.cli.command_tree import app
from armload_controller.cli.output.fleet_output import (
    acknowledged_document,
    arm_document,
    fleet_report_document,
)
from armload_controller.cli.output.json_documents import (
    feedforward_document,
    init_document,
    nodes_document,
)
from armload_controller.cli.screen import Screen
from armload_controller.config.robot import load_robot
from armload_controller.feedforward.adaptation import AdaptationDecision, DecisionKind
from armload_controller.feedforward.offset_check import OffsetVerdict
from armload_controller.fleet.arm_runs import ArmRun, Quantity, QuantityKind
from armload_controller.fleet.attention import Acknowledgement, Attention, Finding
from armload_controller.fleet.fleet_review import (
    Anomaly,
    ArmReview,
    FleetReview,
    Suspicion,
    review_fleet,
)
from armload_controller.fleet.fleet_run import FleetProblem, FleetTally
from armload_controller.fleet.recording_row import RowOutcome
from armload_controller.session.feedforward_comparison import FollowingComparison, Measure
from armload_drivers.bring_up import arm_bring_up, drive_check
from armload_drivers.bring_up.inspection import FoundNode
from armload_drivers.canopen import node_assignment
from armload_drivers.canopen.lss_master import LssAddress
from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.cia402.state_machine import State
from armload_drivers.listening.overheard_arm import ToldPayload
from armload_identification.calibration.run_health import Compared, RunHealth
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.identification_errors import NothingMounted
from armload_identification.pipeline.any_motion import Window
from armload_identification.pipeline.arm_drift import arm_drift
from armload_identification.pipeline.recursive_estimator import LivePayload
from armload_identification.pipeline.wiggle import Wiggle
from armload_identification.recording.reading_options import Effort
from armload_identification.results.arm_history import ArmHistory
from armload_identification.results.arm_without_payload import ArmWithoutPayload
from armload_identification.results.calibrated_arm import CalibratedArm
from armload_identification.results.json_document import json_document, json_schemas
from armload_identification.results.payload_over_time import PayloadOverTime


def strict(schema):
    """A schema that allows no key that it does not describe."""
    if isinstance(schema, list):
        return [strict(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    closed = {"additionalProperties": False} if "properties" in schema and "additionalProperties" not in schema else {}
    return closed | {key: strict(value) for key, value in schema.items()}


def described(schema, value):
    """Whether every described key is somewhere in documents; yields the paths of those that are not."""
    for key, inner in schema.get("properties", {}).items():
        found = [each[key] for each in value if isinstance(each, dict) and key in each]
        if not found:
            yield key
        yield from (f"{key}.{path}" for path in described(inner, found))
    items = [item for each in value if isinstance(each, list) for item in each]
    if "items" in schema and items:
        yield from (f"[].{path}" for path in described(schema["items"], items))


ROLES, LOADS = ("identification", "validation"), ("loaded", "unloaded")
COMMANDS = {
    "identify": "identify er50 --loaded {l1} --unloaded {u1} --validation {l2} {u2} -o {out}/p.toml --report {out}/r "
    "--mass-kg 1..30 --center-of-mass-m -0.5..0.5 -.5..0.5 -0.5..+1e0",
    "validate": "validate er50 {payload} --loaded {l2} --unloaded {u2}",
    "report": "report er50 {payload} --identified {l1} {u1} --validation {l2} {u2} -o {out}/again.html",
    "compare": "compare {payload} {payload}",
    "export": "export er50 {payload} --format urdf -o {out}",
    "design": "design prbt -o {out}/path.toml --restarts 1 --harmonics 2 --period-s 5",
    "recordings show": "recordings show {l1} {l2}",
    "tools add": "tools add gripper {payload}",
    "drives check": "drives check er50",
    "drives show": "drives show er50 --once",
    "drives reset": "drives reset er50 joint_2 --yes",
    "drives store": "drives store er50 --yes",
    "drives assign": "drives assign virtual:assigned --node-id 7 --yes",
}
"""Commands with a document that need no bus and move no arm."""


@pytest.fixture(scope="module")
def document(armload, recorded_er50, tmp_path_factory):
    """The document that a command prints; each command runs once."""
    today = recorded_er50 / "runs" / "today"
    names = {f"{load[0]}{i}": today / f"{load}_{role}.mcap" for load in LOADS for i, role in enumerate(ROLES, 1)}
    names |= {"payload": today / "payload.toml", "out": tmp_path_factory.mktemp("json")}

    @cache
    def printed(name):
        result = armload(*COMMANDS[name].format(**names).split(), "--json")
        assert result.exit_code == 0, (result.output, result.exception)
        (line,) = result.stdout.splitlines()
        return json.loads(line)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_DATA_HOME", str(names["out"]))
        patch.setattr(arm_bring_up, "LISTEN_S", 0.01)
        patch.setattr(drive_check, "reset", lambda *_: State.SWITCH_ON_DISABLED)  # no drive is in FAULT
        patch.setattr(node_assignment, "assign_node", lambda *_: LssAddress(1, 2, 3, 4))  # no node is on this bus
        yield printed


def designed_wiggle():
    """A short motion, its limits and its path, without a search for it."""
    path = FourierTrajectory(0.5, np.zeros(6), np.full((6, 1), 0.01), np.zeros((6, 1)))
    leg = SimpleNamespace(start_s=0.0, end_s=4.5)
    checked = SimpleNamespace(measured=SimpleNamespace(leg=leg), slow_round_s=8.0)
    return Wiggle(path, 2, 0.05, 180, 1), None, checked


def fleet_review():
    """An arm that carries more since its last run, which gave no result, and one that is no longer recorded."""
    change = Suspicion(Anomaly.CHANGE, Quantity(QuantityKind.MASS, "tool"), 9.0, "a sentence")
    silence = Suspicion(Anomaly.SILENCE, None, 3.0, "another")
    one = ArmReview("one", "er50", 2, 1, datetime(2026, 3, 1, tzinfo=UTC), {}, (change, silence))
    return FleetReview((one,), (ArmReview("two", "er50", 3, 0, datetime(2026, 1, 1, tzinfo=UTC)),), ())


def fleet_attention():
    """The fleet with an odd date, and a finding that is acknowledged."""
    moment = datetime(2027, 1, 1, tzinfo=UTC)
    odd = ArmRun("one", "er50", moment, "copy.csv", "", {}, "file")
    finding = Finding("two", "er50", "no recent recording", "a sentence")
    known = Acknowledgement("two", "2026-12-31", "scrapped", ("no recent recording",), "2026-03-01T00:00:00+00:00")
    needed = (Finding("one", "er50", "no result", "another"),)
    return replace(fleet_review(), odd=(odd,)), Attention(needed, ((finding, known),))


def reviewed_arm():
    """An arm with one quantity over two runs."""
    first = datetime(2026, 3, 1, tzinfo=UTC)
    runs = [
        ArmRun(
            "one",
            "er50",
            first + timedelta(days=day),
            f"{day}.mcap",
            "",
            {Quantity(QuantityKind.MASS, "tool"): (2.0, 0.1)},
        )
        for day in (0, 1)
    ]
    return review_fleet(runs).arms[0]


def nothing_on(robot):
    """An arm, its empty mass, and its runs."""
    sources = [SimpleNamespace(path=Path(name), sha256="0" * 64) for name in ("a.mcap", "b.mcap")]
    return robot, NothingMounted(-0.004, 0.012), sources


def made():
    """Documents of commands that take long or need a bus, made without these."""
    joints, ones = ("a", "b"), np.ones(2)
    offset = OffsetVerdict(joints, ones, np.array([1.0, 0.2]), np.array([0.01, 9.0]), 4)
    errors = np.full((5, 2), 0.01)
    compared = FollowingComparison(
        Measure.ADDED, joints, np.arange(5.0), errors, {"fed": 0.1 * errors}, np.array([9.0, 0.1])
    )
    node = FoundNode(3, 0x20192, "drive", Identity(1, 2, 3), (1, 8), ("1016",))
    arm = SimpleNamespace(
        robot="arm",
        effort=Effort.CURRENT,
        nominal=ones,
        gain_nm_a=ones,
        gain_half_width_95=ones,
        body=SimpleNamespace(load_friction=ones),
        determined=np.array([True, False]),
        runs=(SimpleNamespace(name="run", mounting="", off=1.0), SimpleNamespace(name="b", mounting="m", off=1.0)),
        left_out=(("other", "a sign"),),
        warnings=("a sentence",),
    )
    body = SimpleNamespace(mass_kg=1.0, center_of_mass_m=np.zeros(3))
    sure = SimpleNamespace(half_width_95=0.1 * np.ones(10), determined=np.arange(10) < 3)
    found = SimpleNamespace(parameters=body, uncertainty=sure)
    windows = (Window(0.0, 10.0, found, ""), Window(10.0, 20.0, None, "the arm stands still"))
    history = PayloadOverTime("arm", windows, SimpleNamespace(path=Path("shift.mcap")))
    two, noise = np.zeros(2), np.full(2, 0.01)
    same = Compared(two, noise, noise)
    runs = [
        RunHealth(f"{number}.mcap", "", 30.0, "nothing", same, Compared(two + (number > 3), noise, noise), same, None)
        for number in range(8)
    ]
    worn = arm_drift(SimpleNamespace(n=2, friction_nm=ones, usual_change_nm=noise), runs)
    weeks = ArmHistory("arm", "", joints, None, "arm.toml", worn, (("other.mcap", "too short"),))
    wiggle = DesignedWiggle(load_robot("prbt"), np.zeros(6), *designed_wiggle(), "armload design")
    decision = AdaptationDecision(1.0, DecisionKind.FED, "", 1.0, 0.1, (0.0, 0.0, 0.1), 0.98, (0.0, 0.0, 0.1))
    four = np.ones(4)
    sure_of = np.array([True, True, False, False])
    states = {"contact": False, "refused": 0, "covariance": np.eye(10)}
    states["friction_covariance"] = np.zeros((2, 2, 2))
    live = LivePayload(1.0, ones, four, 0.1 * four, sure_of, ones, ones, 1, 0.5, 1.0, **states)
    bus = HeardBus(100, (0, 0, 1), True, 0.0, told=ToldPayload(1.0, (0.0, 0.0, 0.1)))
    moment = WatchedMoment(1.0, live, (PayloadEvent(0.5, "grasped", 1.0),), bus)
    return [
        moment.to_dict("arm"),
        history.to_dict() | {"files": {"picture": None}},
        wiggle.to_dict() | {"files": {"excitation": "wiggle.toml", "picture": "wiggle.png"}},
        weeks.to_dict() | {"files": {"report": None, "picture": None}},
        printed(CalibratedArm("", joints, arm).to_dict, calibration="arm.toml", report="arm.html"),
        printed(partial(feedforward_document, "arm", offset, [compared], [decision]), picture="picture.svg"),
        printed(ArmWithoutPayload(*nothing_on(load_robot("prbt"))).to_dict, report="report.html"),
        nodes_document("socketcan", "can0", [node]),
        printed(partial(json_document, "commission-half", {}), directory="runs/today"),
        printed(partial(fleet_report_document, *fleet_attention()), report="report.html", metrics="fleet.prom"),
        printed(partial(arm_document, reviewed_arm()), page="one.html"),
        acknowledged_document(fleet_attention()[1].acknowledged[0][1]),
        printed(
            partial(
                json_document,
                "fleet",
                FleetTally(
                    2,
                    1,
                    problems=[FleetProblem("cell-17", "a.mcap", RowOutcome.REFUSED, "a.mcap: truncated")],
                    remarks=("line 2: no file",),
                ).to_dict(),
            ),
            directory="fleet",
        ),
        printed(
            partial(
                init_document,
                SimpleNamespace(name="arm", joint_names=joints, other_joints=("finger",)),
                SimpleNamespace(holes=["joints[1].torque_max_nm"], unchecked=["gravity"]),
                "values are missing",
                "fill these in",
            ),
            robot="arm.toml",
            identification=None,
            validation=None,
        ),
    ]


def printed(make, **files):
    """A document with its files, as a screen prints it."""
    with redirect_stdout(StringIO()) as out:
        Screen(as_json=True).document(make, {key: name and Path(name) for key, name in files.items()})
    return json.loads(out.getvalue())


def test_what_is_not_determined_has_no_number():
    watched, over_time, _, drift, calibrated, fed, *_ = made()
    assert drift["findings"][0]["run"] == "4.mcap"
    assert drift["joints"][0]["warm_up_nm"] is None
    assert watched["center_of_mass_m"] == [1.0, None, None]
    assert over_time["windows"][0]["center_of_mass_m"] == [0.0, 0.0, None]
    assert [window["mass_kg"] for window in over_time["windows"]] == [1.0, None]
    assert [joint["gain"] for joint in calibrated["joints"]] == [1.0, None]
    assert [run["mounting"] for run in calibrated["runs"]] == [None, "m"]
    assert [joint["gain"] for joint in fed["offset"]] == [1.0, None]
    assert fed["comparisons"][0]["joints"][0]["reduction"] == {"fed": pytest.approx(0.9)}
    assert [joint["carries_weight"] for joint in fed["comparisons"][0]["joints"]] == [True, False]
    assert json.loads(json.dumps(made(), allow_nan=False))


def test_a_joint_that_never_left_its_setpoint_has_no_reduction():
    joints, ones = ("a", "b"), np.ones(2)
    offset = OffsetVerdict(joints, ones, ones, np.full(2, 0.01), 4)
    errors = np.tile([0.01, 0.0], (5, 1))
    compared = FollowingComparison(Measure.ADDED, joints, np.arange(5.0), errors, {"fed": 0.1 * errors}, 9.0 * ones)
    fed = feedforward_document("arm", offset, [compared])
    reductions = [joint["reduction"]["fed"] for joint in fed["comparisons"][0]["joints"]]
    assert reductions == [pytest.approx(0.9), None]
    assert [compared.less("fed", joint, 1) for joint in (0, 1)] == ["90.0 % less", "no error without it"]


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.long] * (name in {"design", "identify", "report"})) for name in COMMANDS],
)
def test_a_document_is_as_its_schema_says(document, name):
    found = document(name)
    schema = json_schemas()[found["schema"].split("/")[1]]
    Draft202012Validator(strict(schema)).validate(found)
    wrong = found | {"robot": 5, "frame": 5, "recordings": 5, "tools": 5, "vendor_id": "x"}
    assert not Draft202012Validator(schema).is_valid(wrong)


def test_documents_made_without_their_commands_are_as_their_schemas_say():
    for found in made():
        Draft202012Validator(strict(json_schemas()[found["schema"].split("/")[1]])).validate(found)


@pytest.mark.long
def test_no_schema_describes_a_key_that_is_not_there(document):
    printed = defaultdict(list)
    for found in (*(document(name) for name in COMMANDS), *made()):
        printed[found["schema"]].append(found)
    assert {f"armload/{kind}/1" for kind in json_schemas()} == set(printed)
    absent = {schema["title"]: list(described(schema, printed[schema["title"]])) for schema in json_schemas().values()}
    assert {kind: paths for kind, paths in absent.items() if paths} == {}


def test_the_schema_of_each_document_is_printed(armload):
    whole = json.loads(armload("schema").stdout)
    for kind, schema in whole.items():
        Draft202012Validator.check_schema(schema)
        assert json.loads(armload("schema", kind).stdout) == schema
        assert schema["title"] == f"armload/{kind}/1"
        assert schema["description"].startswith("Printed by `")
    refused = armload("schema", "payloads")
    assert refused.exit_code == 2
    assert "expected one of payload, windows" in refused.output


def test_every_command_with_a_result_has_the_option():
    def commands(command, name=""):
        inner = getattr(command, "commands", None)
        if inner is None:
            yield name, command
        for key, value in (inner or {}).items():
            yield from commands(value, f"{name} {key}".strip())

    without = {
        name
        for name, command in commands(typer.main.get_command(app))
        if not any("--json" in option.opts for option in command.params)
    }
    assert without == {"simulate", "schema"}


def test_of_a_validation_there_is_no_identification(document):
    assert document("validate")["identification"] is None


def test_of_a_reset_the_drive_and_its_state_are_printed(document):
    found = document("drives reset")
    node_id = load_robot("er50").drives.settings.drives[1].node_id
    assert (found["joint"], found["node_id"], found["state"]) == ("joint_2", node_id, "SWITCH ON DISABLED")


def test_a_reset_that_is_not_confirmed_prints_no_document(armload, monkeypatch):
    monkeypatch.setattr(drive_check, "reset", lambda *_: None)
    result = armload("drives", "reset", "er50", "joint_2", "--json")
    assert (result.exit_code, result.stdout) == (1, "")


@pytest.mark.long
def test_one_schema_serves_identify_validate_and_report(document):
    found = document("identify")
    assert found["payload"]["mass_kg"] == pytest.approx(9.81, abs=0.2)
    assert found["files"]["payload"].endswith("p.toml")
    assert Path(found["files"]["report"]).is_file()
    assert found["validation"]["joints"][0]["name"] == found["joint_names"][0]
    assert document("report")["recordings"]["identification"][0]["file"].endswith("loaded_identification.mcap")


def test_a_refusal_prints_no_document(armload, tmp_path):
    result = armload("compare", tmp_path / "nothing.toml", tmp_path / "nothing.toml", "--json")
    assert result.exit_code == 1
    assert result.stdout == ""


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--mass-kg", "1..x"), "'1..x': expected a number such as 2.1, or a range such as 1..3"),
        (("--mass-kg", "1..2..3"), "or a range such as 1..3"),
        (("--mass-kg", "3..1"), "the known mass is 3 to 1 kg; expected the lower number first"),
        (("--center-of-mass-m", "0", "-0.1..-0.2", "0"), "centre of mass's y is -0.1 to -0.2 m; expected the lower"),
    ],
)
def test_a_range_that_is_none_is_refused_before_anything_is_read(armload, option, message):
    result = armload("identify", "er50", "--loaded", "none.mcap", *option)
    assert result.exit_code != 0
    assert message in f"{' '.join(result.output.replace('│', ' ').split())} {result.exception}"
