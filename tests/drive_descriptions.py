"""Device descriptions written by tests: a complete CiA 402 drive, whose sections tests can change.

They contain nothing from a manufacturer's file: all objects and values are from the standard.
"""

from __future__ import annotations

_I8, _I16, _I32, _U8, _U16, _U32 = 2, 3, 4, 5, 6, 7

_VALUES = {
    "1000": (_U32, "ro", "0x00020192", 0),
    "1001": (_U8, "ro", "0", 0),
    "1005": (_U32, "rw", "0x80", 0),
    "1006": (_U32, "rw", "0", 0),
    "1016sub0": (_U8, "ro", "1", 0),
    "1016sub1": (_U32, "rw", "0", 0),
    "1017": (_U16, "rw", "0", 0),
    "1018sub0": (_U8, "ro", "2", 0),
    "1018sub1": (_U32, "ro", "", 0),
    "1018sub2": (_U32, "ro", "", 0),
    "1029sub0": (_U8, "ro", "1", 0),
    "1029sub1": (_U8, "rw", "0", 0),
    "6007": (_I16, "rw", "1", 0),
    "603F": (_U16, "ro", "0", 1),
    "6040": (_U16, "rww", "0", 1),
    "6041": (_U16, "ro", "0", 1),
    "605A": (_I16, "rw", "2", 0),
    "605B": (_I16, "rw", "0", 0),
    "605C": (_I16, "rw", "1", 0),
    "605D": (_I16, "rw", "1", 0),
    "605E": (_I16, "rw", "2", 0),
    "6060": (_I8, "rww", "0", 1),
    "6061": (_I8, "ro", "0", 1),
    "6064": (_I32, "ro", "0", 1),
    "6065": (_U32, "rw", "0", 0),
    "6066": (_U16, "rw", "0", 0),
    "6072": (_U16, "rw", "1000", 0),
    "6073": (_U16, "rw", "1000", 0),
    "6075": (_U32, "rw", "0", 0),
    "6076": (_U32, "rw", "0", 0),
    "6077": (_I16, "ro", "0", 1),
    "6078": (_I16, "ro", "0", 1),
    "607A": (_I32, "rww", "0", 1),
    "607Dsub0": (_U8, "ro", "2", 0),
    "607Dsub1": (_I32, "rw", "0", 0),
    "607Dsub2": (_I32, "rw", "0", 0),
    "6085": (_U32, "rw", "0", 0),
    "608Fsub0": (_U8, "ro", "2", 0),
    "608Fsub1": (_U32, "ro", "0", 0),
    "608Fsub2": (_U32, "ro", "0", 0),
    "60B2": (_I16, "rww", "0", 1),
    "60C1sub0": (_U8, "ro", "1", 0),
    "60C1sub1": (_I32, "rww", "0", 1),
    "60C2sub0": (_U8, "ro", "2", 0),
    "60C2sub1": (_U8, "rw", "1", 0),
    "60C2sub2": (_I8, "rw", "-3", 0),
    "6502": (_U32, "ro", "0xC0", 0),
}  # fmt: skip
"""Data type, access, default and PDO mapping by section: both streaming modes and all objects for safety settings."""


def maker_drive(without=(), changes=None):
    """Sections of a description by name.

    Args:
        without: Objects, as numbers, or sections, as "1018sub2", that the drive lacks.
        changes: Changed keys by section; missing sections are added.
    """
    sections = {}
    for name, (kind, access, default, mapping) in (_VALUES | _pdos()).items():
        sections[name] = {
            "ParameterName": f"object {name}", "ObjectType": "7", "DataType": f"0x{kind:X}", "AccessType": access,
            "DefaultValue": default, "PDOMapping": str(mapping),
        }  # fmt: skip
    gone = {f"{item:04X}" if isinstance(item, int) else item for item in without}
    sections = {
        name: keys for name, keys in sections.items() if name not in gone and name.partition("sub")[0] not in gone
    }
    for name, keys in (changes or {}).items():
        sections[name] = sections.get(name, {}) | keys
    return sections


def _pdos():
    """PDO parameters: two PDOs per direction; the first ones carry controlword and statusword."""
    rows = {}
    for first, mapping, base, word in ((0x1400, 0x1600, 0x200, "0x60400010"), (0x1800, 0x1A00, 0x180, "0x60410010")):
        for number in range(2):
            index, mapped = f"{first + number:04X}", f"{mapping + number:04X}"
            rows |= {
                f"{index}sub0": (_U8, "ro", "5", 0),
                f"{index}sub1": (_U32, "rw", f"$NODEID+0x{base + 0x100 * number:X}", 0),
                f"{index}sub2": (_U8, "rw", "1", 0),
                f"{index}sub5": (_U16, "rw", "0", 0),
                f"{mapped}sub0": (_U8, "rw", "0" if number else "1", 0),
            }
            for position in range(1, 9):
                default = word if (number, position) == (0, 1) else "0"
                rows[f"{mapped}sub{position}"] = (_U32, "rw", default, 0)
    return rows


def eds(sections, vendor=0, product=0):
    """The text of a description.

    Args:
        sections: Keys by section.
        vendor: Vendor id; 0 for none.
        product: Product code; 0 for none.
    """
    head = f"[DeviceInfo]\nVendorName=Tests\nProductName=Drive\nVendorNumber={vendor}\nProductNumber={product}\n"
    indices = {name.partition("sub")[0] for name in sections if "sub" in name}
    records = [
        f"[{index}]\nParameterName=record {index}\nObjectType=9\n"
        f"SubNumber={sum(name.startswith(index + 'sub') for name in sections)}\n"
        for index in sorted(indices)
    ]
    bodies = [
        f"[{name}]\n" + "".join(f"{key}={value}\n" for key, value in keys.items()) for name, keys in sections.items()
    ]
    return "\n".join([head, *records, *bodies])
