"""The payload file: round trip, and errors that name the key."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armload_identification.files.payload_file import format_payload, parse_payload, read_payload, write_payload
from armload_identification.identification_errors import PayloadFileError
from armload_identification.model.payload import SMALLEST_MARGIN, InertialParameters, PayloadResult, Provenance

pytestmark = pytest.mark.pure

SEEDS = st.integers(0, 100_000)


def body_of_points(seed: int) -> InertialParameters:
    """A physically possible body: eight point masses."""
    rng = np.random.default_rng(seed)
    mass_kg, points_m = rng.uniform(0.1, 2.0, 8), rng.normal(size=(8, 3)) * 0.2 + rng.normal(size=3)
    homogeneous = np.column_stack([points_m, np.ones(8)])
    return InertialParameters.from_pseudo_inertia(homogeneous.T @ (mass_kg[:, None] * homogeneous))


def result(seed: int = 0, determined: tuple[int, ...] = tuple(range(10))) -> PayloadResult:
    body = body_of_points(seed)
    flags = np.isin(np.arange(10), determined)
    plain = PayloadResult(
        "flange",
        body,
        flags,
        np.full((10, 2), np.nan),
        np.array([1.5, 2.25, 0.1]),
        np.array([1.0, 2.0, 0.125]),
        Provenance(
            "0.1.0", "c0ffee", {"loaded 1.mcap": "aa", 'un"loaded\\.mcap': "bb"}, validation_sha256={"2.csv": "c"}
        ),
    )
    ranges = np.where(flags[:, None], plain.values[:, None] + [-0.01, 0.01 / 3], np.nan)
    return replace(plain, interval_95=ranges)


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, flags=st.lists(st.integers(0, 9)))
def test_a_file_reads_back_as_what_was_written(seed, flags):
    written = result(seed, tuple(flags))
    got = parse_payload(format_payload(written))
    np.testing.assert_allclose(got.model.theta, written.model.theta, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(got.values, written.values, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(got.determined, written.determined)
    np.testing.assert_array_equal(got.interval_95, written.interval_95)
    np.testing.assert_array_equal(got.residual_rms_nm, written.residual_rms_nm)
    np.testing.assert_array_equal(got.noise_nm, written.noise_nm)
    assert (got.frame, got.provenance) == (written.frame, written.provenance)
    assert got.feedforward_ready == {0, 1, 2, 3}.issubset(flags)


def test_the_file_has_the_keys_of_the_contract_and_only_determined_values():
    content = tomllib.loads(format_payload(result(determined=(0, 1, 3, 7))))
    shared = {"mass_kg", "center_of_mass_m", "inertia_kg_m2"}
    assert set(content) == {"payload", "determined", "interval_95", "model", "residual", "provenance"}
    assert set(content["payload"]) == shared | {"frame"}
    assert set(content["payload"]["center_of_mass_m"]) == {"x", "z"}
    assert set(content["payload"]["inertia_kg_m2"]) == {"ixy"}
    assert set(content["interval_95"]["center_of_mass_m"]) == {"x", "z"}
    assert content["determined"]["center_of_mass_m"] == {"x": True, "y": False, "z": True}
    assert len(content["determined"]["inertia_kg_m2"]) == 6
    assert len(content["model"]["center_of_mass_m"]) == 3
    assert set(content["model"]["inertia_kg_m2"]) == {"ixx", "iyy", "izz", "ixy", "ixz", "iyz"}


def test_tensor_elements_are_about_the_centre_of_mass():
    inertia = np.array([[0.03, 0.001, -0.002], [0.001, 0.04, 0.003], [-0.002, 0.003, 0.05]])
    body = InertialParameters.from_center_of_mass(2.0, [0.1, -0.2, 0.3], inertia)
    values = replace(result(), model=body).values
    np.testing.assert_allclose(values, [2.0, 0.1, -0.2, 0.3, 0.03, 0.04, 0.05, 0.001, -0.002, 0.003], atol=1e-15)


def flat_body(thickness_m: float) -> InertialParameters:
    """A square plate."""
    sides = np.array([0.3, 0.3, thickness_m]) ** 2 / 12
    return InertialParameters.from_center_of_mass(2.0, [0.0, 0.0, 0.0], 2.0 * np.diag(sides.sum() - sides))


def test_a_body_closer_to_impossible_than_the_margin_is_not_written(tmp_path):
    path = tmp_path / "payload.toml"
    thin, plate = flat_body(3e-3), flat_body(4e-3)
    assert 0 < thin.margin < SMALLEST_MARGIN < plate.margin
    for body in (thin, flat_body(0.0)):
        with pytest.raises(
            PayloadFileError, match=r"model is refused: .*margin of its pseudo-inertia is .* 1e-06 is required"
        ):
            write_payload(path, replace(result(), model=body))
        assert not path.exists()
    write_payload(path, replace(result(determined=(0,)), model=plate))
    assert read_payload(path).model.margin >= SMALLEST_MARGIN


GOOD = format_payload(result(determined=(0, 1, 2, 3, 4)))
MASS = f"{result().model.mass_kg!r}"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('frame = "flange"', "frame = 3", ("payload.frame", "3", "text")),
        ('frame = "flange"', 'frame = "flange"\ncolour = "red"', ("payload.colour", "'red'", "unknown key")),
        (f"mass_kg = {MASS}", "mass_kg = 1.0", ("payload.mass_kg", "1.0", "[model]", MASS)),
        (f"mass_kg = {MASS}", "", ("payload.mass_kg", "missing")),
        ("mass_kg = true", "mass_kg = 1", ("determined.mass_kg", "1", "true or false")),
        ("mass_kg = true", "mass_kg = false", ("payload.mass_kg", MASS, "it is false in [determined]")),
        ("iyy = false", "iyy = true", ("payload.inertia_kg_m2.iyy", "missing")),
        ("iyy = false, ", "", ("determined.inertia_kg_m2.iyy", "missing")),
        ("iyy = false", "iyy = false, ikk = true", ("determined.inertia_kg_m2.ikk", "unknown key")),
        ("[model]", "[model]\nmass = 1", ("model.mass", "unknown key")),
        ("[residual]", "[remainder]", ("residual", "missing")),
        ("rms_nm = [1.5, ", "rms_nm = [", ("residual.noise_nm", "2 finite numbers")),
        ("rms_nm = [1.5", "rms_nm = [inf", ("residual.rms_nm", "inf", "finite")),
        ('armload_version = "0.1.0"', "", ("provenance.armload_version", "missing")),
        ("[payload]", "[payload", ("not valid TOML",)),
    ],
)
def test_a_bad_file_is_refused_with_file_key_value_and_expectation(tmp_path, old, new, words):
    path = tmp_path / "bad.toml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(PayloadFileError) as caught:
        read_payload(path)
    for word in (str(path), *words):
        assert word in str(caught.value)


def test_an_interval_the_wrong_way_round_is_refused():
    swapped = result()
    swapped = replace(swapped, interval_95=swapped.interval_95[:, ::-1])
    with pytest.raises(PayloadFileError, match=r"interval_95\.mass_kg is .*expected \[low, high\]"):
        parse_payload(format_payload(swapped))


def test_an_impossible_body_in_a_file_is_refused():
    impossible = InertialParameters.from_center_of_mass(2.0, [0.1, 0.0, 0.0], np.diag([0.01, 0.01, 0.05]))
    with pytest.raises(PayloadFileError, match="physically possible body"):
        parse_payload(format_payload(replace(result(), model=impossible)))


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(PayloadFileError, match=r"none\.toml: cannot be read"):
        read_payload(tmp_path / "none.toml")
