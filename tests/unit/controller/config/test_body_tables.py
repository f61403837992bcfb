"""Bodies of a robot's file, and the sphere around one that is carried."""

import numpy as np
import pytest

from armload_controller.config.tables.body_tables import CarriedPayloadTable
from armload_identification.files.inertia_table import InertiaTable
from armload_identification.storage.strict_toml import BadValue

pytestmark = pytest.mark.pure


def carried(mass_kg, moment_kg_m2, **changes):
    inertia = InertiaTable(ixx=moment_kg_m2, iyy=moment_kg_m2, izz=moment_kg_m2, ixy=0.0, ixz=0.0, iyz=0.0)
    return CarriedPayloadTable(mass_kg=mass_kg, center_of_mass_m=[0.0, 0.0, 0.1], inertia_kg_m2=inertia, **changes)


def test_a_sphere_without_a_stated_radius_holds_the_mass_as_water_or_its_inertia():
    compact = carried(10.0, 0.01).envelope("a payload")
    assert 4.0 / 3.0 * np.pi * compact.radius_m**3 * 1000.0 == pytest.approx(10.0)
    wide = carried(10.0, 10.0 * 0.4**2 * 2.0 / 3.0).envelope("a hollow ball of 0.4 m")
    assert wide.radius_m == pytest.approx(0.4)
    np.testing.assert_array_equal(wide.center_m, [0.0, 0.0, 0.1])


def test_a_stated_radius_is_used_if_the_inertia_fits_into_it():
    moment = 10.0 * 0.4**2 * 2.0 / 3.0
    assert carried(10.0, moment, envelope_radius_m=0.41).envelope("a payload").radius_m == 0.41
    with pytest.raises((BadValue, ValueError), match=r"at least 0\.4"):
        carried(10.0, moment, envelope_radius_m=0.39)
