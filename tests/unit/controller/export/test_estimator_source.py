"""The exported estimator: one file of the core's sources, whose names are the arm's."""

import re

import pytest

from armload_controller.export.c99 import export_c
from armload_controller.export.c_code.estimator_source import estimator_texts
from tests.unit.controller.export.compiled_c import FLAGS, GCC, needs_gcc, run

NAME = "my_arm"


@pytest.fixture(scope="module")
def texts(calibrated):
    given = calibrated.chain, calibrated.calibration.body, calibrated.estimator
    return estimator_texts(NAME, "about this arm", *given, "motor current, A")


@needs_gcc
def test_it_shows_nothing_but_the_arms_functions(calibrated, tmp_path):
    for file, text in export_c(calibrated).items():
        (tmp_path / file).write_text(text)
    run(GCC, *FLAGS, "-c", "armload_er50_estimator.c", cwd=tmp_path)
    symbols = run("nm", "-g", "--defined-only", "armload_er50_estimator.o", cwd=tmp_path).split()
    functions = {name for name in symbols if re.search("[a-z]_", name)}
    assert functions >= {f"armload_er50_estimator_{what}" for what in ("init", "update", "read")}
    assert all(name.startswith("armload_er50_") for name in functions)


def test_every_name_of_the_core_is_replaced(texts):
    header, source = texts[f"{NAME}_estimator.h"], texts[f"{NAME}_estimator.c"]
    assert list(texts) == [f"{NAME}_estimator.h", f"{NAME}_estimator.c"]
    for text in (header, source):
        assert text.count("about this arm") == 1
        assert not re.search(r"\b(payload_estimator|MOST_JOINTS|BODY_PARAMETERS)\b", text)
        assert not re.search(r"(?<![A-Z_])(ESTIMATOR_\w+|FRICTION_STATES|SMOOTHED|WAITING)\b", text)
        assert "\n\n\n" not in text
        assert "ARMLOAD_PAYLOAD_ESTIMATOR_H" not in text
    assert f"{NAME.upper()}_JOINTS" in header
    assert "motor current, A" in header
    own = re.findall(r'#include "(.*)"', source)
    assert own == [f"{NAME}_estimator.h"]


def test_functions_that_only_the_core_shares_are_static_and_defined_once(texts):
    source = texts[f"{NAME}_estimator.c"]
    heads = re.findall(r"^((?:static )?(?:inline )?\w+ \**(\w+)\([^;{]*?\))\n?\s*\{", source, re.MULTILINE)
    names = [name for _, name in heads]
    assert len(names) == len(set(names)) > 10
    public = {name for head, name in heads if not head.startswith("static")}
    declared = set(re.findall(r"(\w+)\(", texts[f"{NAME}_estimator.h"]))
    assert {f"{NAME}_estimator_{what}" for what in ("init", "update", "read")} <= public <= declared
