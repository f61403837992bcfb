"""Tolerant parser of device descriptions (EDS, DCF): valid parts are kept, the rest is reported.

Rules of this file:

- Vendors' files contain many errors: keys in another case, empty defaults, expressions with `$NODEID`, wrong counts,
  bytes that are not UTF-8. Each of these causes a warning that names section and key. UTF-16, and comments behind
  values, are read without one.
- A file that does not describe a CiA 402 drive is refused with a `DescriptionError`. No other exception is raised for
  any content.
- Nothing is guessed: a value that cannot be read is None.

References:
    CiA 306-1 (electronic data sheet), CiA 301, table 44 (data types).
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from armload_drivers.cia402.object_dictionary import (
    CONTROLWORD,
    DEVICE_TYPE,
    HEARTBEAT_CONSUMER,
    INTERPOLATION_SETPOINT,
    INTERPOLATION_TIME,
    POSITION_OFFSET,
    SECOND_POSITION,
    SUPPORTED_MODES,
    TARGET_POSITION,
    TORQUE_OFFSET,
    VELOCITY_OFFSET,
    Access,
    DataType,
    Entry,
    Mappable,
    is_drive,
    no_drive,
)
from armload_drivers.driver_errors import DescriptionError

LARGEST_BYTES = 8_000_000
"""The largest file examined for this project has 0.15 MB; a file larger than this is not a description."""
MOST_WARNINGS = 200
"""Further warnings are only counted."""
UNTOLD = 0xFFFF_FFFF
_ONLY_IN_CYCLIC_MODES = (INTERPOLATION_TIME, POSITION_OFFSET, VELOCITY_OFFSET, TORQUE_OFFSET)
_LONGEST_QUOTE = 40

_COMMENT = re.compile(r"\s;")
_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?")
_TERM = re.compile(r"\s*([+-]?)\s*(\$nodeid|0x[0-9a-f]+|[0-9]+)\s*", re.IGNORECASE)
_LISTS = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")
DATA_TYPES = {
    1: DataType.U8, 2: DataType.I8, 3: DataType.I16, 4: DataType.I32, 5: DataType.U8, 6: DataType.U16,
    7: DataType.U32, 8: DataType.F32, 9: DataType.STRING, 0x11: DataType.F64, 0x15: DataType.I64, 0x1B: DataType.U64,
}  # fmt: skip
"""Data types by code; a BOOLEAN is a byte in SDO. Types not listed (domains, times, 24 bits) are not read as
numbers."""
_ACCESS = {
    "ro": (Access.RO, Mappable.TPDO),
    "const": (Access.RO, Mappable.TPDO),
    "wo": (Access.WO, Mappable.RPDO),
    "rw": (Access.RW, Mappable.BOTH),
    "rwr": (Access.RW, Mappable.TPDO),
    "rww": (Access.RW, Mappable.RPDO),
}
"""By AccessType: SDO access, and the direction of PDOs that may carry the object if it is mappable."""
_RECORDS = frozenset({8, 9})
"""Object types ARRAY and RECORD, whose values are in the sub-indices."""
_MOST_SUBS = 254


@dataclass(frozen=True, slots=True)
class DescribedValue:
    """A value that may depend on the node id.

    Attributes:
        constant: The constant part.
        node_ids: Factor of the node id.
    """

    constant: int
    node_ids: int = 0

    def of(self, node_id: int) -> int:
        """The value on one node."""
        return self.constant + self.node_ids * node_id


@dataclass(frozen=True, slots=True)
class DescribedObject:
    """One entry of a description.

    Attributes:
        subindex: Sub-index.
        name: The vendor's name.
        type: Data type; None if it is neither a number nor a text.
        access: SDO access.
        mappable: Direction of PDOs that may carry it.
        value: Configured value (DCF) or value after a reset (EDS); None if the file gives none.
        text: The same for a string.
        least: Least permitted value; None if the file gives none.
        greatest: Greatest permitted value; None if the file gives none.
    """

    index: int
    subindex: int
    name: str
    type: DataType | None
    access: Access
    mappable: Mappable
    value: DescribedValue | None = None
    text: str = ""
    least: DescribedValue | None = None
    greatest: DescribedValue | None = None

    @property
    def bits(self) -> int | None:
        """Size of an integer; None for other types."""
        kind = self.type
        return None if kind is None or kind is DataType.STRING or kind.is_real else kind.bits


@dataclass(frozen=True, slots=True)
class DeviceDescription:
    """The content of a drive's description.

    Attributes:
        source: Name of the file.
        vendor_id: Expected value of 1018:1; None if the file gives none.
        product_code: Expected value of 1018:2, likewise.
        revision: Expected value of 1018:3, likewise.
        node_id: Node id of a DCF; None in an EDS.
        objects: Entries by key (index, sub-index).
        warnings: Irregularities, each with section and key.
    """

    source: str
    vendor_name: str
    vendor_id: int | None
    product_code: int | None
    revision: int | None
    node_id: int | None
    objects: Mapping[int, DescribedObject] = field(repr=False)
    warnings: tuple[str, ...] = field(repr=False)

    def find(self, entry: Entry) -> DescribedObject | None:
        """The description of an object; None if the drive does not have it."""
        return self.objects.get(entry.key)

    @property
    def modes(self) -> int:
        """Value of 6502; of a file that gives none, or 0, the streaming modes for which it has all objects."""
        cyclic = self.find(TARGET_POSITION) and any(map(self.find, _ONLY_IN_CYCLIC_MODES))
        by_objects = bool(cyclic) << 7 | bool(self.find(INTERPOLATION_SETPOINT)) << 6
        stated = self.find(SUPPORTED_MODES)
        return (stated.value.constant if stated is not None and stated.value is not None else 0) or by_objects

    def value(self, entry: Entry, node_id: int) -> int | None:
        """Value of an integer object on one node; None if unknown."""
        found = self.find(entry)
        return None if found is None or found.value is None else found.value.of(node_id)


def parse_description(data: bytes, source: str) -> DeviceDescription:
    """Read the bytes of an EDS or DCF file.

    Args:
        source: Name of the file, for messages.

    Raises:
        DescriptionError: the file does not describe a CiA 402 drive.
    """
    if len(data) > LARGEST_BYTES:
        raise DescriptionError(source, "", "", f"larger than {LARGEST_BYTES} bytes; this is not an EDS or DCF file")
    return _Reader(source).read(data)


def _shown(text: str) -> str:
    """A quotation for a message."""
    return repr(text if len(text) <= _LONGEST_QUOTE else text[:_LONGEST_QUOTE] + "...")


class _Reader:
    """One file being read."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._warnings: list[str] = []
        self._unlisted = 0
        self._sections: dict[str, dict[str, str]] = {}

    def read(self, data: bytes) -> DeviceDescription:
        """Parse the file."""
        self._split(self._text(data))
        objects = self._objects()
        if not objects:
            raise DescriptionError(self._source, "", "", "no section describes an object; is it an EDS or DCF file?")
        self._check_lists()
        if CONTROLWORD.key not in objects:
            raise DescriptionError(self._source, "6040", "", "no controlword: this device is not a CiA 402 drive")
        if SECOND_POSITION.key in objects:
            what = "a drive with several axes as sub-indices of one object cannot be used: use a drive for each axis"
            raise DescriptionError(self._source, "6064sub2", "", what)
        profile = objects.get(DEVICE_TYPE.key)
        if profile is not None and profile.value is not None:
            number = profile.value.constant
            if number and not is_drive(number):
                raise DescriptionError(
                    self._source,
                    "1000",
                    "DefaultValue",
                    f"{no_drive(number)}. If the drive itself reports otherwise (`armload drives scan`), correct the "
                    "file",
                )
        info = self._sections.get("deviceinfo", {})
        if not info:
            self._warn("DeviceInfo", "", "missing, so the identity is unknown")
        commissioning = self._sections.get("devicecomissioning", self._sections.get("devicecommissioning", {}))
        if self._unlisted:
            self._warnings.append(f"{self._source}: {self._unlisted} more warnings of this kind")
        return DeviceDescription(
            source=self._source,
            vendor_name=info.get("vendorname", ""),
            vendor_id=self._identity(info, "VendorNumber"),
            product_code=self._identity(info, "ProductNumber"),
            revision=self._identity(info, "RevisionNumber"),
            node_id=self._within("DeviceComissioning", commissioning, "NodeID", range(1, 128), "is not a node id"),
            objects=objects,
            warnings=tuple(self._warnings),
        )

    def _warn(self, section: str, key: str, what: str) -> None:
        """Keep a warning."""
        if len(self._warnings) < MOST_WARNINGS:
            self._warnings.append(f"{self._source}: [{section}]{' ' + key if key else ''}: {what}")
        else:
            self._unlisted += 1

    # Text ----------------------------------------------------------------------------------------------------

    def _text(self, data: bytes) -> str:
        """The file as text."""
        if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            return data.decode("utf-16", errors="replace")
        if b"\0" in data[:4096]:
            raise DescriptionError(self._source, "", "", "contains zero bytes; is it an EDS or DCF file in text form?")
        try:
            return data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            self._warn("(file)", f"line {line}", "bytes that are not UTF-8, read as Latin-1")
            return data.decode("latin-1")

    def _split(self, text: str) -> None:
        """Split into sections and keys, with names in lower case."""
        section: dict[str, str] | None = None
        title = ""
        for number, line in enumerate(text.splitlines(), start=1):
            stripped = line.strip()
            if not stripped or stripped[0] in ";#":
                continue
            if stripped[0] == "[":
                name, closed, _ = stripped[1:].partition("]")
                title = name.strip()
                if not closed:
                    self._warn(_shown(title)[1:-1], f"line {number}", "section without a closing bracket")
                if title.lower() in self._sections:
                    self._warn(_shown(title)[1:-1], f"line {number}", "repeated section; the two are merged")
                section = self._sections.setdefault(title.lower(), {})
                continue
            key, equals, value = stripped.partition("=")
            key = key.strip().lower()
            if section is None or not equals or not key:
                self._warn(_shown(title)[1:-1], f"line {number}", f"not understood: {_shown(stripped)}")
                continue
            if key in section:
                self._warn(_shown(title)[1:-1], _shown(key)[1:-1], "repeated key; the last one counts")
            section[key] = value.strip() if key == "parametername" else _COMMENT.split(value, 1)[0].strip()

    # Numbers -------------------------------------------------------------------------------------------------

    def _number(self, section: str, values: Mapping[str, str], key: str) -> DescribedValue | None:
        """A number, or an expression of numbers and `$NODEID`; None, with a warning, if it is neither."""
        text = values.get(key.lower(), "")
        if not text:
            return None
        constant = node_ids = at = 0
        while at < len(text):
            term = _TERM.match(text, at)
            if term is None or (at > 0 and not term[1]) or len(text) > _LONGEST_QUOTE:
                self._warn(section, key, f"{_shown(text)} is no number")
                return None
            sign = -1 if term[1] == "-" else 1
            if term[2][0] == "$":
                node_ids += sign
            else:
                constant += sign * int(term[2], 16 if term[2][:2].lower() == "0x" else 10)
            at = term.end()
        return DescribedValue(constant, node_ids)

    def _plain(self, section: str, values: Mapping[str, str], key: str) -> int | None:
        """A number without `$NODEID`."""
        number = self._number(section, values, key)
        if number is not None and number.node_ids:
            self._warn(section, key, "depends on the node id, which is not possible here")
            return None
        return None if number is None else number.constant

    def _identity(self, info: Mapping[str, str], key: str) -> int | None:
        """A number of 1018; some vendors write 0 or all ones for an unspecified value."""
        number = self._within("DeviceInfo", info, key, range(1 << 32), "does not fit 32 bits")
        return None if number in {0, UNTOLD} else number

    def _within(self, section: str, values: Mapping[str, str], key: str, allowed: range, what: str) -> int | None:
        """A number; None, with a warning, if it is not one of those allowed."""
        number = self._plain(section, values, key)
        if number is None or number in allowed:
            return number
        self._warn(section, key, f"{number} {what}")
        return None

    # Objects -------------------------------------------------------------------------------------------------

    def _objects(self) -> dict[int, DescribedObject]:
        """All entries."""
        objects: dict[int, DescribedObject] = {}
        found = [(match, name) for name in self._sections if (match := _OBJECT.fullmatch(name))]
        subs: dict[int, int] = {}
        for match, _ in found:
            if match[2] is not None:
                index = int(match[1], 16)
                subs[index] = subs.get(index, 0) + 1
        for match, name in found:
            index, sub = int(match[1], 16), int(match[2] or "0", 16)
            values, title = self._sections[name], match[1].upper() + (f"sub{match[2]}" if match[2] else "")
            if match[2] is None:
                self._check_sub_number(title, values, subs.get(index, 0))
                compact = self._plain(title, values, "CompactSubObj")
                if compact:
                    self._add_compact(objects, index, title, values, compact)
                    continue
                if index in subs or self._plain(title, values, "ObjectType") in _RECORDS:
                    continue
            objects[index << 8 | sub] = self._object(index, sub, title, values)
        return objects

    def _check_sub_number(self, title: str, values: Mapping[str, str], found: int) -> None:
        """Check SubNumber against the existing sub-indices."""
        declared = self._plain(title, values, "SubNumber")
        if declared and declared != found and not values.get("compactsubobj"):
            self._warn(title, "SubNumber", f"declares {declared}, the file has {found}")

    def _add_compact(
        self, objects: dict[int, DescribedObject], index: int, title: str, values: Mapping[str, str], count: int
    ) -> None:
        """An array described by its first element."""
        if not 0 < count <= _MOST_SUBS:
            self._warn(title, "CompactSubObj", f"{count} is not a valid number of sub-indices")
            return
        count_of = {
            "parametername": "highest sub-index",
            "datatype": "5",
            "accesstype": "ro",
            "defaultvalue": str(count),
        }
        objects[index << 8] = self._object(index, 0, title, count_of)
        for sub in range(1, count + 1):
            objects[index << 8 | sub] = self._object(index, sub, title, values)

    def _object(self, index: int, sub: int, title: str, values: Mapping[str, str]) -> DescribedObject:
        """One entry."""
        code = self._plain(title, values, "DataType")
        if code is None and values.get("objecttype", "7").lower() not in {"2", "0x2"}:
            self._warn(title, "DataType", "missing or unreadable")
        kind = DATA_TYPES.get(code) if code is not None else None
        access = values.get("accesstype", "").lower()
        if access not in _ACCESS:
            self._warn(title, "AccessType", f"{_shown(access)} is none of ro, wo, rw, rwr, rww, const")
        allowed, direction = _ACCESS.get(access, _ACCESS["ro"])
        key = "ParameterValue" if values.get("parametervalue") else "DefaultValue"
        is_number = kind is not None and kind is not DataType.STRING and not kind.is_real
        least, greatest, value = (
            self._integer(title, values, name, kind) if kind is not None and is_number else None
            for name in ("LowLimit", "HighLimit", key)
        )
        if index == HEARTBEAT_CONSUMER.index and sub and greatest is not None and greatest.constant < 1 << 16:
            self._warn(
                title, "HighLimit", f"{greatest.constant} is too large for a node id to be added, and is ignored"
            )
            greatest = None
        return DescribedObject(
            index=index,
            subindex=sub,
            name=values.get("parametername", ""),
            type=kind,
            access=allowed,
            mappable=direction if self._plain(title, values, "PDOMapping") else Mappable.NO,
            value=value,
            text=values.get(key.lower(), "") if kind is DataType.STRING else "",
            least=least,
            greatest=greatest,
        )

    def _integer(self, title: str, values: Mapping[str, str], key: str, kind: DataType) -> DescribedValue | None:
        """A value of an integer type; signed types are often written as the unsigned hexadecimal pattern."""
        value = self._number(title, values, key)
        if value is None:
            return None
        least, greatest = kind.bounds
        if not least <= value.constant < 1 << kind.bits:
            self._warn(title, key, f"{value.constant} does not fit {kind.bits} bits")
            return None
        return (
            value if value.constant <= greatest else DescribedValue(value.constant - (1 << kind.bits), value.node_ids)
        )

    def _check_lists(self) -> None:
        """Check the lists of objects against the sections."""
        listed: set[str] = set()
        for title in _LISTS:
            values = self._sections.get(title)
            if values is None:
                continue
            names = [key for key in values if key.isdecimal()]
            declared = self._plain(title, values, "SupportedObjects")
            if declared != len(names):
                self._warn(title, "SupportedObjects", f"declares {declared}, the list has {len(names)}")
            for key in names:
                index = self._plain(title, values, key)
                if index is None:
                    continue
                name = f"{index:04x}"
                listed.add(name)
                if name not in self._sections:
                    self._warn(title, key, f"object {_shown(name)} is listed but not described")
        for name in self._sections:
            match = _OBJECT.fullmatch(name)
            if match and match[2] is None and listed and name not in listed:
                self._warn(match[1].upper(), "", "described but not listed")
