"""Profiles of drives: settings of a product family, one file each, named in a robot's `[joints.drive]`.

It comes with armload, with an installed package (`armload.drive_profiles`: the entry point's name is the profile's, its
value the Python package that contains NAME.toml), or is a file beside the robot's, named with its suffix. A profile
holds facts about the product. It cannot consent to missing safety properties and does not describe the arm;
both belong to the robot's file, whose keys take precedence.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from armload_controller.config.tables.profile_table import ProfileFile
from armload_controller.control_errors import ConfigurationError
from armload_identification.extensions import ExtensionGroup, extension, extension_names
from armload_identification.storage.regular_file import require_regular
from armload_identification.storage.strict_toml import parse_toml, read_text

_SUFFIX = ".toml"


def shipped_profiles() -> tuple[str, ...]:
    """Names of the profiles that come with armload."""
    names = [file.name for file in resources.files("armload_configs").joinpath("drives").iterdir()]
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in names if name.endswith(_SUFFIX)))


def profiles_of_vendor(vendor_id: int | None) -> dict[str, str]:
    """Shipped profiles whose product family is of a vendor: the family by the profile's name.

    A vendor has other families too, so this is only a hint.

    Args:
        vendor_id: 1018:1; None if the drive does not report it.
    """
    read = {name: read_profile(name, Path(), name, "profile").product for name in shipped_profiles()}
    return {name: product.name for name, product in read.items() if product.vendor_id == vendor_id is not None}


def profile_hint(vendor_id: int | None) -> str:
    """What an integrator is told about the profiles for a vendor's drives; empty if there is none."""
    found = profiles_of_vendor(vendor_id)
    listed = ", ".join(f'profile = "{name}" is for {family}' for name, family in found.items())
    return f"{listed}; other products of this vendor (0x{vendor_id:08X}) need their own" if found else ""


def read_profile(name: str, folder: Path, file: str, key: str) -> ProfileFile:
    """Read a profile.

    Args:
        name: Name of a shipped profile, or of a TOML file in the robot file's folder.
        folder: Folder of the robot's file.
        file: The robot's file, for messages.
        key: Key that names the profile, for messages.

    Raises:
        ConfigurationError: no profile has that name, or the profile cannot be used.
    """
    shipped = shipped_profiles()
    if name in shipped:
        path = Path(str(resources.files("armload_configs").joinpath("drives", name + _SUFFIX)))
    else:
        path = folder / name
        if not name.endswith(_SUFFIX):
            return _packaged(name, shipped, file, key)
        expected = f"expected a shipped profile, {', '.join(shipped)}, or a TOML file in the same folder"
        try:
            require_regular(path)
        except OSError as problem:
            raise ConfigurationError(file, key, name, f"{expected} ({problem.strerror})") from problem
    return parse_toml(read_text(path, ConfigurationError), path.name, ProfileFile, ConfigurationError)


def _packaged(name: str, shipped: tuple[str, ...], file: str, key: str) -> ProfileFile:
    """The profile of an installed package.

    Raises:
        ConfigurationError: there is none with this name, or it cannot be used.
    """
    found = extension(ExtensionGroup.DRIVE_PROFILES, name, shipped)
    if found is None:
        names = (*shipped, *extension_names(ExtensionGroup.DRIVE_PROFILES, shipped))
        expected = f"expected a profile, {', '.join(names)}, or a TOML file in the same folder"
        raise ConfigurationError(file, key, name, expected)
    module, package = found
    try:
        text = resources.files(module).joinpath(name + _SUFFIX).read_text("utf-8")  # type: ignore[arg-type]
    except (OSError, TypeError, AttributeError, UnicodeDecodeError) as problem:
        expected = f"{package} provides no {name}{_SUFFIX} in {module!r} ({problem}); reinstall that package"
        raise ConfigurationError(file, key, name, expected) from problem
    return parse_toml(text, f"{name}{_SUFFIX} of {package}", ProfileFile, ConfigurationError)


def with_profiles(values: Mapping[str, Any], folder: Path, file: str) -> dict[str, Any]:
    """The values of a robot's file, its drives completed from the profiles that they name.

    Args:
        values: Values parsed from TOML, not yet checked.
        folder: Folder of the robot's file.
        file: The robot's file, for messages.

    Raises:
        ConfigurationError: a profile cannot be used.
    """
    joints = values.get("joints")
    if not isinstance(joints, list):
        return dict(values)
    return {**values, "joints": [_completed(joint, number, folder, file) for number, joint in enumerate(joints, 1)]}


def own_profiles(values: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the profiles in the robot file's folder that its drives name, each once.

    Args:
        values: Values parsed from TOML, not yet checked.
    """
    joints = values.get("joints")
    named = dict.fromkeys(_profile_of(joint) for joint in joints) if isinstance(joints, list) else {}
    shipped = shipped_profiles()
    return tuple(name for name in named if name is not None and name not in shipped and name.endswith(_SUFFIX))


def _completed(joint: object, number: int, folder: Path, file: str) -> object:
    """One joint; anything but a table is left to the check of the whole file."""
    name = _profile_of(joint)
    if not isinstance(joint, dict) or name is None:
        return joint
    profile = read_profile(name, folder, file, f"joints[{number}].drive.profile")
    return {**joint, "drive": {**profile.drive.given(), **joint["drive"]}}


def _profile_of(joint: object) -> str | None:
    """The profile that a joint's drive names; None if it names none, or is not a table."""
    drive = joint.get("drive") if isinstance(joint, dict) else None
    name = drive.get("profile") if isinstance(drive, dict) else None
    return name if isinstance(name, str) else None
