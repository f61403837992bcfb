"""`inertia_kg_m2` of a payload file and of a robot's file: a complete inertia tensor."""

from __future__ import annotations

from armload_identification.float_array import FloatArray
from armload_identification.model.payload import TENSOR_ELEMENTS, symmetric_tensor
from armload_identification.storage.strict_toml import Table


class InertiaTable(Table):
    """Tensor elements about the centre of mass, kg m2."""

    ixx: float
    iyy: float
    izz: float
    ixy: float
    ixz: float
    iyz: float

    def tensor(self) -> FloatArray:
        """(3, 3) symmetric tensor."""
        return symmetric_tensor([getattr(self, key) for key in TENSOR_ELEMENTS])
