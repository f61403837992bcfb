"""What is exported: a payload, the arm that carries it, and where both come from."""

from __future__ import annotations

import re
from dataclasses import dataclass

from armload_controller.control_errors import ExportError
from armload_controller.feedforward.payload_use import why_not_usable
from armload_identification.model.chain import Chain
from armload_identification.model.payload import PayloadResult


@dataclass(frozen=True, eq=False)
class ExportSubject:
    """A payload that may be written for others; one that may not be cannot be made into a subject.

    Attributes:
        robot: Name of the robot.
        joint_names: Names of the joints, from the base to the flange.
        chain: Kinematics up to the flange, and gravity.
        payload: The payload, in the flange frame.
        payload_file: The file it was read from, as messages name it; the exported texts have its name without folders.
        payload_sha256: Hash of that file.
        armload_version: Version of the program.

    Raises:
        ExportError: mass or centre of mass is not determined, the payload is not in the flange frame, was
            identified on an arm with another number of joints, or is no body that can exist.
    """

    robot: str
    joint_names: tuple[str, ...]
    chain: Chain
    payload: PayloadResult
    payload_file: str
    payload_sha256: str
    armload_version: str

    def __post_init__(self) -> None:
        problem = why_not_usable(self.payload, self.chain, self.robot, "exported")
        if problem is not None:
            raise ExportError(self.payload_file, problem)

    @property
    def identifier(self) -> str:
        """The robot's name as an identifier of C, RAPID and file systems: lower case, digits, underscores."""
        name = re.sub(r"[^0-9a-z]+", "_", self.robot.lower()).strip("_")
        return name if name[:1].isalpha() else f"robot_{name}".rstrip("_")
