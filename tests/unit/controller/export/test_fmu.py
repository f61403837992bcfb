"""Parts of FMUs of every version: units, variables in their order, sources with their token, and the archive."""

import io
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

from armload_controller.export.fmi import fmi2, fmi3, fmu
from armload_controller.export.fmi.fmu import model_name, packed, sources, variables

DIMENSIONS = {
    "s": {"s": 1}, "rad": {"rad": 1}, "rad/s": {"rad": 1, "s": -1}, "rad/s2": {"rad": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2}, "kg": {"kg": 1}, "m": {"m": 1}, "kg.m2": {"kg": 1, "m": 2}, "1": {},
}  # fmt: skip
"""SI brochure: a newton is kg m/s2."""


@pytest.fixture(scope="module")
def subject(make_subject):
    return make_subject()


@pytest.fixture(scope="module", params=[fmi2.fmu2_texts, fmi3.fmu_texts], ids=["FMI 2.0", "FMI 3.0"])
def described(request, subject):
    """The root of a model description."""
    return ElementTree.fromstring(request.param(subject)["modelDescription.xml"])


def test_units_are_those_of_the_si(described):
    definitions = described.find("UnitDefinitions")
    assert [unit.get("name") for unit in definitions] == list(DIMENSIONS)
    for unit in definitions:
        (base,) = unit
        assert {name: int(exponent) for name, exponent in base.attrib.items()} == DIMENSIONS[unit.get("name")]


def test_both_interfaces_name_the_model_and_give_their_state(described, subject):
    version = described.get("fmiVersion")
    state = {"2.0": "FMUstate", "3.0": "FMUState"}[version]
    exchange, simulation = described.find("ModelExchange"), described.find("CoSimulation")
    for interface in (exchange, simulation):
        assert interface.get("modelIdentifier") == described.get("modelName") == model_name(subject)
        assert interface.get(f"canGetAndSet{state}") == interface.get(f"canSerialize{state}") == "true"
    assert simulation.get("canHandleVariableCommunicationStepSize") == "true"
    assert exchange.get("canHandleVariableCommunicationStepSize") is None
    not_needed = {"2.0": ("completedIntegratorStepNotNeeded", "true"), "3.0": ("needsCompletedIntegratorStep", "false")}
    name, value = not_needed[version]
    assert exchange.get(name) == value


def test_variables_are_time_motion_payload_and_torque(subject):
    found = variables(subject)
    n = len(subject.joint_names)
    assert [variable.name for variable in found[: 1 + n]] == ["time", *(f"q[{i}]" for i in range(1, n + 1))]
    assert [variable.name for variable in found[-n:]] == [f"tau[{i}]" for i in range(1, n + 1)]
    inputs = [variable for variable in found if variable.causality == "input"]
    assert len(inputs) == 3 * n
    assert all(variable.start == 0.0 for variable in inputs)
    assert [inputs[k * n].unit for k in range(3)] == ["rad", "rad/s", "rad/s2"]
    tunable = {variable.name: variable for variable in found if variable.attributes(0)["variability"] == "tunable"}
    assert next(iter(tunable)) == "mass"
    assert list(tunable)[-1] == "transition"
    assert tunable["mass"].start == subject.payload.model.mass_kg
    assert "friction" not in tunable
    assert {variable.unit for variable in found} <= set(DIMENSIONS)
    assert found[-1].attributes(7)["valueReference"] == "7"
    assert found[-1].start_attribute == {}
    assert float(inputs[0].start_attribute["start"]) == 0.0


def test_the_token_links_sources_and_description(subject, make_subject):
    texts, token = sources(subject, "fmi3.c")
    name = model_name(subject)
    assert set(texts) == {"fmi3.c", f"{name}.c", f"{name}.h"}
    assert token in texts["fmi3.c"]
    assert sources(subject, "fmi3.c")[1] == token
    other = make_subject(undetermined=("ixx",))
    assert sources(other, "fmi3.c")[1] != token
    for texts, attribute in ((fmi3.fmu_texts(subject), "instantiationToken"), (fmi2.fmu2_texts(subject), "guid")):
        said = ElementTree.fromstring(texts["modelDescription.xml"]).get(attribute)
        assert any(said in text for file, text in texts.items() if file.endswith(".c"))


def test_the_archive_has_the_texts_and_a_library_and_the_same_bytes_each_time(subject, monkeypatch):
    compiled = []
    monkeypatch.setattr(fmu, "compiled_library", lambda code, what: compiled.append(sorted(code)) or b"library")
    texts = {
        "modelDescription.xml": "<a/>",
        "sources/x.c": "int x;",
        "sources/x.h": "",
        "documentation/index.html": "h",
    }
    first, second = packed(subject, texts, "x86_64-linux"), packed(subject, texts, "x86_64-linux")
    assert first == second
    assert compiled == [["x.c", "x.h"]] * 2
    ((file, content),) = first.items()
    assert file == f"{model_name(subject)}.fmu"
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        there = {name: archive.read(name) for name in archive.namelist()}
    assert there.pop(f"binaries/x86_64-linux/{model_name(subject)}.so") == b"library"
    assert there == {name: text.encode() for name, text in texts.items()}
    assert np.all([info.date_time[0] == 1980 for info in archive.infolist()])
