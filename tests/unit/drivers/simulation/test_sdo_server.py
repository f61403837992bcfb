"""The SDO server frame by frame, and PDO parameters in the order prescribed by the standard."""

import struct

import pytest
from canopen.sdo.exceptions import SdoAbortedError

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import Access, DataType, Entry, PdoDirection
from armload_drivers.simulation.drives.drive_pdos import Pdo
from armload_drivers.simulation.drives.sdo_server import Abort, Dictionary, SdoAbort, SdoServer

TEXT = "a name of 24 characters."


@pytest.fixture
def dictionary():
    dictionary = Dictionary()
    dictionary.add(od.DEVICE_TYPE, 0x20192)
    dictionary.add(od.DEVICE_NAME, TEXT)
    dictionary.add(od.MODE, 8)
    dictionary.add(od.TARGET_POSITION, -5)
    dictionary.add(od.CONTROLWORD, 0)
    dictionary.add(od.STATUSWORD, 0x0250)
    dictionary.add(od.POSITION_ACTUAL, 7)
    dictionary.allowed[od.MODE.key] = {0, 8}
    return dictionary


@pytest.fixture
def server(dictionary):
    return SdoServer(dictionary)


def head(command, entry):
    return struct.pack("<BHB", command, entry.index, entry.subindex)


def request(command, entry, data=b""):
    return head(command, entry) + data.ljust(4, b"\0")


def abort_of(answer):
    assert answer[0] == 0x80
    return struct.unpack_from("<I", answer, 4)[0]


def test_reading_what_fits(server):
    assert server.receive(request(0x40, od.DEVICE_TYPE)) == request(0x43, od.DEVICE_TYPE, b"\x92\x01\x02\x00")
    assert server.receive(request(0x40, od.MODE)) == request(0x4F, od.MODE, b"\x08")


def test_reading_in_segments(server):
    answer = server.receive(request(0x40, od.DEVICE_NAME))
    assert answer == request(0x41, od.DEVICE_NAME, struct.pack("<I", len(TEXT)))
    text, toggle = b"", 0
    for _ in range(4):
        answer = server.receive(bytes([0x60 | toggle]).ljust(8, b"\0"))
        assert answer[0] & 0x10 == toggle
        text += answer[1 : 8 - (answer[0] >> 1 & 7)]
        toggle ^= 0x10
    assert answer[0] & 1, "the last segment says so"
    assert text.decode() == TEXT
    assert abort_of(server.receive(bytes([0x60 | toggle]).ljust(8, b"\0"))) == Abort.UNKNOWN_COMMAND


def test_writing_what_fits(server, dictionary):
    assert server.receive(request(0x23, od.TARGET_POSITION, struct.pack("<i", -77))) == request(
        0x60, od.TARGET_POSITION
    )
    assert dictionary.values[od.TARGET_POSITION.key] == -77
    server.receive(request(0x22, od.CONTROLWORD, b"\x0f\x00"))
    assert dictionary.values[od.CONTROLWORD.key] == 15, "a client need not announce the size"


def test_writing_in_segments(server, dictionary):
    server.receive(request(0x21, od.TARGET_POSITION, struct.pack("<I", 4)))
    answer = server.receive(bytes([0x00 | (7 - 4) << 1 | 1]) + struct.pack("<i", 99) + bytes(3))
    assert answer[0] == 0x20
    assert dictionary.values[od.TARGET_POSITION.key] == 99


def test_a_repeated_toggle_is_refused(server):
    server.receive(request(0x40, od.DEVICE_NAME))
    server.receive(bytes([0x60]).ljust(8, b"\0"))
    assert abort_of(server.receive(bytes([0x60]).ljust(8, b"\0"))) == Abort.TOGGLE


@pytest.mark.parametrize(
    ("frame", "code"),
    [
        (request(0x40, Entry(0x5000, 0, "", DataType.U8)), Abort.NO_OBJECT),
        (request(0x40, Entry(0x1000, 9, "", DataType.U8)), Abort.NO_SUBINDEX),
        (request(0x23, od.DEVICE_TYPE), Abort.READ_ONLY),
        (request(0x2F, od.TARGET_POSITION, b"\x01"), Abort.LENGTH),
        (request(0x2F, od.MODE, b"\x07"), Abort.VALUE_RANGE),
        (request(0xA0, od.DEVICE_NAME), Abort.UNKNOWN_COMMAND),  # block upload
        (request(0xC0, od.TARGET_POSITION), Abort.UNKNOWN_COMMAND),  # block download
        (bytes(8), Abort.UNKNOWN_COMMAND),  # a segment without a transfer
        (b"\x40\x00", Abort.UNKNOWN_COMMAND),
    ],
)
def test_refusals_carry_their_code(server, frame, code):
    assert abort_of(server.receive(frame)) == code


def test_a_clients_abort_ends_the_transfer(server):
    server.receive(request(0x40, od.DEVICE_NAME))
    assert server.receive(request(0x80, od.DEVICE_NAME)) is None
    assert abort_of(server.receive(bytes([0x60]).ljust(8, b"\0"))) == Abort.UNKNOWN_COMMAND


def test_a_veto_keeps_the_old_value(dictionary):
    def veto(value):
        raise SdoAbort(Abort.DEVICE_STATE)

    dictionary.vetoes[od.TARGET_POSITION.key] = veto
    with pytest.raises(SdoAbort):
        dictionary.download(0x607A, 0, struct.pack("<i", 1))
    assert dictionary.values[od.TARGET_POSITION.key] == -5


def test_a_removed_object_is_not_found(dictionary):
    dictionary.remove([0x607A])
    with pytest.raises(SdoAbort) as refusal:
        dictionary.upload(0x607A, 0)
    assert refusal.value.code is Abort.NO_OBJECT


def write(dictionary, entry, value):
    dictionary.download(entry.index, entry.subindex, struct.pack("<" + entry.type.code, value))


def refusal_of(dictionary, entry, value):
    with pytest.raises(SdoAbort) as refusal:
        write(dictionary, entry, value)
    return refusal.value.code


def test_mapping_in_the_prescribed_order(dictionary):
    pdo = Pdo(PdoDirection.TRANSMIT, 0, 5, dictionary, (od.STATUSWORD,))
    side = PdoDirection.TRANSMIT
    assert pdo.cob_id == 0x185
    write(dictionary, side.cob_id_entry(0), 0xC0000185)
    assert pdo.cob_id is None
    write(dictionary, side.count_entry(0), 0)
    write(dictionary, side.map_entry(0, 1), od.STATUSWORD.mapping)
    write(dictionary, side.map_entry(0, 2), od.POSITION_ACTUAL.mapping)
    write(dictionary, side.count_entry(0), 2)
    write(dictionary, side.type_entry(0), 1)
    write(dictionary, side.cob_id_entry(0), 0x40000285)
    assert (pdo.cob_id, pdo.type, pdo.length, pdo.synchronous) == (0x285, 1, 6, True)
    assert pdo.pack() == struct.pack("<Hi", 0x0250, 7)
    assert pdo.carries(od.POSITION_ACTUAL)


def test_received_objects_reach_the_dictionary(dictionary):
    pdo = Pdo(PdoDirection.RECEIVE, 0, 5, dictionary, (od.CONTROLWORD, od.TARGET_POSITION))
    pdo.store(struct.pack("<Hi", 0x0F, -9) + b"\xff\xff")
    assert dictionary.values[od.CONTROLWORD.key] == 0x0F
    assert dictionary.values[od.TARGET_POSITION.key] == -9


def test_mapping_in_any_other_order_is_refused(dictionary):
    Pdo(PdoDirection.TRANSMIT, 0, 5, dictionary, (od.STATUSWORD,))
    side = PdoDirection.TRANSMIT
    first, count, cob = side.map_entry(0, 1), side.count_entry(0), side.cob_id_entry(0)
    assert refusal_of(dictionary, first, od.STATUSWORD.mapping) is Abort.UNSUPPORTED_ACCESS
    assert refusal_of(dictionary, count, 0) is Abort.UNSUPPORTED_ACCESS
    assert refusal_of(dictionary, cob, 0x40000186) is Abort.VALUE_RANGE
    write(dictionary, cob, 0xC0000185)
    assert refusal_of(dictionary, first, od.STATUSWORD.mapping) is Abort.UNSUPPORTED_ACCESS
    write(dictionary, count, 0)
    assert refusal_of(dictionary, first, 0x50000010) is Abort.NO_OBJECT
    assert refusal_of(dictionary, first, od.TARGET_POSITION.mapping) is Abort.NOT_MAPPABLE
    assert refusal_of(dictionary, first, 0x60410008) is Abort.NOT_MAPPABLE
    for position in range(1, 4):
        write(dictionary, side.map_entry(0, position), od.POSITION_ACTUAL.mapping)
    assert refusal_of(dictionary, count, 3) is Abort.PDO_TOO_LONG
    assert refusal_of(dictionary, count, 4) is Abort.NO_OBJECT
    assert refusal_of(dictionary, count, 9) is Abort.VALUE_TOO_HIGH
    assert refusal_of(dictionary, side.type_entry(0), 250) is Abort.VALUE_RANGE


def test_read_only_means_read_only():
    entry = Entry(0x2000, 0, "constant", DataType.U8, Access.RO)
    dictionary = Dictionary()
    dictionary.add(entry, 1)
    assert refusal_of(dictionary, entry, 2) is Abort.READ_ONLY


def test_the_abort_codes_are_those_that_another_library_knows():
    for code in Abort:
        assert code in SdoAbortedError.CODES, code.name
    words = {
        Abort.TOGGLE: "toggle", Abort.UNKNOWN_COMMAND: "unknown", Abort.UNSUPPORTED_ACCESS: "unsupported access",
        Abort.WRITE_ONLY: "write only", Abort.READ_ONLY: "read only", Abort.NO_OBJECT: "object does not exist",
        Abort.NOT_MAPPABLE: "cannot be mapped", Abort.PDO_TOO_LONG: "PDO length exceeded", Abort.LENGTH: "length code",
        Abort.NO_SUBINDEX: "subindex", Abort.VALUE_RANGE: "value range", Abort.VALUE_TOO_HIGH: "written too high",
        Abort.DEVICE_STATE: "present device state",
    }  # fmt: skip
    assert set(words) == set(Abort)
    for code, text in words.items():
        assert text.lower() in SdoAbortedError.CODES[code].lower()


def test_a_pdo_has_its_parameters_after_a_reset(dictionary):
    """CiA 301, 7.5.2.35 to 38: highest sub-index 5, event-driven, no inhibit time, no timer."""
    sent = Pdo(PdoDirection.TRANSMIT, 2, 5, dictionary, (od.STATUSWORD,))
    idle = Pdo(PdoDirection.RECEIVE, 3, 5, dictionary)
    values = dictionary.values
    found = [values[0x1802 << 8 | sub] for sub in (0, 1, 2, 3, 5)]
    assert found == [5, 0x4000_0385, 255, 0, 0]
    assert [values[0x1A02 << 8 | sub] for sub in range(9)] == [1, 0x6041_0010, 0, 0, 0, 0, 0, 0, 0]
    assert [values[0x1403 << 8 | sub] for sub in (0, 1, 2, 3, 5)] == [5, 0x8000_0505, 255, 0, 0]
    assert 0x1A02_09 not in values
    assert (sent.cob_id, sent.synchronous, sent.timer_s, sent.syncs, sent.length) == (0x385, False, 0.0, 0, 2)
    assert (idle.cob_id, idle.length) == (None, 0)
    assert (sent.pending, sent.deadline_s, sent.last_event) == (None, None, None)


def test_a_pdo_follows_its_type_timer_and_identifier(dictionary):
    side = PdoDirection.TRANSMIT
    pdo = Pdo(side, 0, 5, dictionary, (od.STATUSWORD,))
    write(dictionary, side.timer_entry(0), 250)
    assert pdo.timer_s == pytest.approx(0.25)
    for type_, synchronous in ((0, True), (240, True), (254, False), (255, False)):
        write(dictionary, side.type_entry(0), type_)
        assert pdo.synchronous is synchronous
    for type_ in (241, 253):
        assert refusal_of(dictionary, side.type_entry(0), type_) is Abort.VALUE_RANGE
    cob = side.cob_id_entry(0)
    assert refusal_of(dictionary, cob, 0x6000_0185) is Abort.VALUE_RANGE, "29 bits"
    write(dictionary, cob, 0x0000_0185)
    write(dictionary, cob, 0x8000_07FF)
    write(dictionary, cob, 0x0000_07FF)
    assert pdo.cob_id == 0x7FF


def test_a_frame_holds_eight_objects_or_64_bits_and_no_more(dictionary):
    pdo, side = Pdo(PdoDirection.TRANSMIT, 0, 5, dictionary), PdoDirection.TRANSMIT
    small = Entry(0x2001, 0, "a byte", DataType.U8, Access.RO, od.Mappable.TPDO)
    dictionary.add(small, 0x5A)
    for position in range(1, 9):
        write(dictionary, side.map_entry(0, position), small.mapping)
    write(dictionary, side.count_entry(0), 8)
    assert pdo.pack() == bytes([0x5A] * 8)
    assert refusal_of(dictionary, side.map_entry(0, 1), 0) is Abort.UNSUPPORTED_ACCESS, "counted"
    write(dictionary, side.count_entry(0), 0)
    for position in (1, 2):
        write(dictionary, side.map_entry(0, position), od.POSITION_ACTUAL.mapping)
    write(dictionary, side.count_entry(0), 2)
    assert pdo.length == 8
    assert refusal_of(dictionary, side.count_entry(0), 3) is Abort.PDO_TOO_LONG, "72 bits"
    assert refusal_of(dictionary, side.count_entry(0), 9) is Abort.VALUE_TOO_HIGH


def test_a_number_is_read_by_its_low_bytes_and_a_real_as_one(dictionary):
    dictionary.add(Entry(0x2002, 0, "small", DataType.U8), 0x1FF)
    dictionary.add(Entry(0x2003, 0, "real", DataType.F32), 1.5)
    assert dictionary.upload(0x2002, 0) == b"\xff"
    assert dictionary.upload(0x2003, 0) == struct.pack("<f", 1.5)
    assert dictionary.upload(0x607A, 0) == struct.pack("<i", -5)


def test_an_object_added_to_a_complete_dictionary_is_kept_but_not_accessible(dictionary):
    dictionary.complete = True
    dictionary.add(od.ERROR_CODE, 3)
    dictionary.add(od.MODE, 0)
    dictionary.add(od.SOFTWARE_VERSION, "1")
    assert (dictionary.values[od.ERROR_CODE.key], dictionary.values[od.MODE.key]) == (3, 8)
    assert od.ERROR_CODE.key not in dictionary.entries
    assert od.SOFTWARE_VERSION.key not in dictionary.texts


def test_what_an_object_forgets_is_confirmed_and_its_reactions_do_not_run(dictionary):
    ran = []
    dictionary.reactions[od.TARGET_POSITION.key] = lambda: ran.append(1)
    dictionary.forgets = {0x607A}
    write(dictionary, od.TARGET_POSITION, 8)
    assert (dictionary.values[od.TARGET_POSITION.key], ran) == (-5, [])
    dictionary.forgets = ()
    write(dictionary, od.TARGET_POSITION, 8)
    assert (dictionary.values[od.TARGET_POSITION.key], ran) == (8, [1])


def test_a_name_is_written_as_it_is(dictionary):
    dictionary.add(Entry(0x2004, 0, "name", DataType.STRING), "")
    dictionary.download(0x2004, 0, b"abc")
    assert dictionary.upload(0x2004, 0) == b"abc"
