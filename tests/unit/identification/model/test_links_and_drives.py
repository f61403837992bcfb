"""What all models of an arm's own torque have in common: shapes, finite numbers, and coupled rotors."""

import numpy as np
import pytest

from armload_identification.identification_errors import ModelError
from armload_identification.model.finite_array import finite_array
from armload_identification.model.links_and_drives import LinksAndDrives

pytestmark = pytest.mark.pure


def made(**changes):
    values = {
        "links": np.zeros((2, 10)),
        "rotor_inertia_kg_m2": np.array([2.0, 3.0]),
        "viscous_nm_s_rad": np.zeros(2),
        "coulomb_nm": np.zeros(2),
        "coupling": np.array([[1.0, 0.0], [0.5, 1.0]]),
    }
    return LinksAndDrives(**values | changes)


def test_coupled_rotors_have_the_energy_of_their_axes():
    arm = made()
    assert arm.n == 2
    joint_rad_s = np.array([0.7, -0.4])
    axis_rad_s = np.linalg.solve(arm.coupling, joint_rad_s)
    energy = 0.5 * np.sum(arm.rotor_inertia_kg_m2 * axis_rad_s**2)
    assert 0.5 * joint_rad_s @ arm.rotor_mass_kg_m2 @ joint_rad_s == pytest.approx(energy)
    np.testing.assert_allclose(arm.rotor_mass_kg_m2, arm.rotor_mass_kg_m2.T)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"links": np.zeros((2, 9))}, r"links of the body has shape \(2, 9\); expected \(n, 10\)"),
        ({"links": np.zeros(10)}, r"links of the body has shape \(10,\); expected \(n, 10\)"),
        ({"links": np.full((2, 10), np.nan)}, "links of the body contains a number that is not finite"),
        ({"coulomb_nm": np.zeros(3)}, r"coulomb_nm of the body has shape \(3,\); expected \(2,\)"),
        ({"viscous_nm_s_rad": [0.0, np.inf]}, "viscous_nm_s_rad of the body contains a number that is not finite"),
        ({"rotor_inertia_kg_m2": np.zeros((2, 1))}, r"expected \(2,\)"),
        ({"coupling": np.eye(3)}, r"coupling of the body has shape \(3, 3\); expected \(2, 2\)"),
        ({"coupling": np.ones((2, 2))}, "no inverse"),
    ],
)
def test_what_does_not_fit_is_refused(changes, said):
    with pytest.raises(ModelError, match=said):
        made(**changes)


def test_values_are_copies():
    links = np.zeros((2, 10))
    arm = made(links=links)
    links[0, 0] = 5.0
    assert arm.links[0, 0] == 0.0


def test_a_field_is_checked_by_shape_first():
    finite_array("a", [1.0], (1,))
    with pytest.raises(ModelError, match="shape"):
        finite_array("a", [np.nan, 1.0], (1,))


def test_only_what_is_asked_for_may_be_at_the_bound():
    np.testing.assert_array_equal(finite_array("a", [0.0], (None,), least=0.0), [0.0])
    with pytest.raises(ModelError, match=r"a is \[-1e-09\]; expected numbers of at least 0"):
        finite_array("a", [-1e-9], (None,), least=0.0)
    with pytest.raises(ModelError, match=r"a is \[0.0\]; expected numbers above 0"):
        finite_array("a", [0.0], (None,), above=0.0)
