"""The identified body rejects inconsistent arguments, and accepts any result of a fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import ModelError
from armload_identification.model.body_model import BodyModel

pytestmark = pytest.mark.pure

THREE = np.zeros(3)
BODY = BodyModel(
    links=np.zeros((3, 10)),
    base=np.ones((3, 10), dtype=bool),
    rotor_inertia_kg_m2=THREE,
    coulomb_nm=THREE,
    viscous_nm_s_rad=THREE,
    root_nm=THREE,
    offset_nm=THREE,
    load_friction=THREE,
    torque_delay_s=0.0,
    reversal_speed_rad_s=np.ones(3),
    coupling=np.eye(3),
)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"links": np.zeros((3, 9))}, r"links of the body has shape \(3, 9\); expected \(n, 10\)"),
        ({"links": np.full((3, 10), np.inf)}, "links of the body contains a number that is not finite"),
        ({"base": np.ones((2, 10), dtype=bool)}, r"base of the body has shape \(2, 10\); expected \(3, 10\)"),
        ({"rotor_inertia_kg_m2": np.zeros(2)}, r"rotor_inertia_kg_m2 .*\(2,\); expected \(3,\)"),
        ({"coulomb_nm": np.array([0.0, np.nan, 0.0])}, "coulomb_nm of the body contains a number that is not finite"),
        ({"coupling": np.ones((3, 3))}, r"coupling \[\[.*has no inverse"),
        ({"coupling": np.eye(2)}, r"coupling .*expected \(3, 3\)"),
        ({"load_friction": np.zeros(4)}, r"load_friction .*expected \(3,\)"),
        ({"root_nm": np.array([0.0, 0.0, np.inf])}, "root_nm of the body contains a number that is not finite"),
        ({"torque_delay_s": np.nan}, "torque_delay_s of the body contains a number that is not finite"),
        ({"reversal_speed_rad_s": THREE}, "reversal_speed_rad_s of the body is .* expected numbers above 0"),
    ],
)
def test_a_body_that_does_not_fit_is_refused(changed, reason):
    with pytest.raises(ModelError, match=reason):
        replace(BODY, **changed)


def test_noise_may_leave_an_identified_friction_below_zero():
    np.testing.assert_array_equal(replace(BODY, coulomb_nm=THREE - 0.1).coulomb_nm, THREE - 0.1)


def test_friction_without_load_is_that_of_its_three_laws():
    size = np.array([1.0, 2.0, 4.0])
    body = replace(BODY, coulomb_nm=size, root_nm=2.0 * size, viscous_nm_s_rad=3.0 * size)
    np.testing.assert_allclose(body.unloaded_friction(np.full(3, 0.25)), (1.0 + 2.0 * 0.5 + 3.0 * 0.25) * size)


def test_a_payload_adds_its_torque_and_the_friction_that_it_causes(any_arm):
    """Coulomb friction and friction by load oppose the motion; a payload that relieves a joint takes friction away."""
    rng = np.random.default_rng(4)
    chain, _ = any_arm(rng, 3)
    body = replace(
        BODY,
        links=rng.normal(size=(3, 10)),
        coulomb_nm=np.array([1.0, 2.0, 0.5]),
        viscous_nm_s_rad=np.array([0.3, 0.2, 0.1]),
        load_friction=np.array([0.1, 0.05, 0.2]),
        reversal_speed_rad_s=np.full(3, 1e-6),
    )
    q, dq, ddq = rng.normal(size=(3, 40, 3))
    links, payload = body.link_torque(chain, q, dq, ddq), rng.normal(size=(40, 3))
    direction = np.sign(dq)
    own = links + direction * (body.coulomb_nm + body.load_friction * np.abs(links))
    alone, loaded = body.torque(chain, q, dq, ddq), body.torque(chain, q, dq, ddq, payload)
    np.testing.assert_allclose(alone, own + body.viscous_nm_s_rad * dq, rtol=1e-4, atol=1e-4)
    added = body.added_friction(links, payload, dq)
    np.testing.assert_allclose(loaded - alone, payload + added, atol=1e-12)
    more = np.abs(links + payload) - np.abs(links)
    np.testing.assert_allclose(added, body.load_friction * direction * more, rtol=1e-4, atol=1e-6)
