"""Arrays from outside: what a message shows of them."""

import numpy as np
import pytest

from armload_identification.identification_errors import ModelError
from armload_identification.model.finite_array import finite_array, set_fields

pytestmark = pytest.mark.pure


def test_of_a_long_array_the_message_gives_the_first_wrong_number_and_its_place():
    values = np.ones((1000, 2))
    values[[3, 700], 1] = -2.5, -1.0
    with pytest.raises(ModelError) as raised:
        finite_array("speed", values, (None, 2), least=0.0)
    assert str(raised.value) == (
        "speed is -2.5 at [3, 1] (2 of 2000 numbers are wrong); expected numbers of at least 0"
    )


def test_a_short_array_is_shown_whole():
    with pytest.raises(ModelError, match=r"gear is \[1\.0, -2\.0\]; expected numbers above 0"):
        finite_array("gear", [1.0, -2.0], (2,), above=0.0)


def test_one_number_may_not_be_finite():
    with pytest.raises(ModelError, match=r"time contains a number that is not finite: inf at \[40\] \(1 of 50 "):
        finite_array("time", np.where(np.arange(50) == 40, np.inf, 0.0), (50,))


def test_arrays_of_a_frozen_object_cannot_be_changed():
    class Holder:
        pass

    holder, given = Holder(), np.zeros(3)
    set_fields(holder, {"gear": given, "name": "arm"})
    with pytest.raises(ValueError, match="read-only"):
        holder.gear[0] = 1.0
    assert holder.name == "arm"
