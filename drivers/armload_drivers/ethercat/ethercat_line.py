"""The drives of one EtherCAT line: mailbox, states and process data.

The only file that knows pysoem.

Rules of this file:
- Mailboxes are used by one thread at a time, because SOEM has one list of errors for all drives: an error surfaces in
  the next call, whichever drive that concerns. Process data is exchanged beside it, with the interpreter released.
- SOEM compares the index of an answer, not its sub-index nor whether it is one to a write; an abort it takes whatever
  the index. A request that was given up may be answered later, and an answer twice, if the frame that fetched it was
  lost: a vendor was taken for the product (1018). Another object is read in between, therefore, before a request that
  such an answer would fit, after one without an answer, after an abort, and first of all.
- A lost frame costs the whole limit of a wait, so every wait has one. SDO requests are repeated: SOEM does not.
- Outputs are written with their exact length, which SOEM does not check: a longer one would overwrite the next drive's.

References:
    SOEM 1.4, through pysoem 1.1; ETG.1000 was not available.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from enum import IntEnum
from threading import Lock
from typing import Any

from armload_drivers.driver_errors import BusError, CommandError
from armload_drivers.ethercat.network_interface import (
    claimed_interface,
    is_running,
    missing_rights,
    require_quiet,
    require_unused,
)

REGISTER_TRIES = 5
"""Tries of reading or writing a register: each waits for a frame only."""
POLL_S = 2e-3
"""Time between two looks at a state that is awaited."""
_ANSWER_BYTES = 256
_MICRO = 1e6
_DEVICE_TYPE, _IDENTITIES = (0x1000, 0), (0x1018, 0)
"""Objects that every drive has."""
_Asked = tuple[int, int, bool]
"""Index and sub-index of a request, and whether it writes."""


class LineState(IntEnum):
    """States of EtherCAT (AL status 0130); NONE is a drive that does not answer."""

    NONE = 0
    INIT = 1
    PREOP = 2
    BOOT = 3
    SAFEOP = 4
    OP = 8


_STATE_BITS = 0x0F
STATE_ERROR = 0x10
"""Bit of a state that a drive has taken by itself, for a reason in 0134."""


def line_state_of(status: int) -> LineState:
    """State in an AL status; unknown ones count as no answer."""
    try:
        return LineState(status & _STATE_BITS)
    except ValueError:
        return LineState.NONE


class MailboxSilence(Exception):
    """A drive did not answer a request, or not intelligibly."""


class MailboxAbort(Exception):
    """A drive answered an SDO with an abort code."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


def soem() -> Any:
    """The library.

    Raises:
        BusError: it is not installed.
    """
    try:
        import pysoem
    except ImportError as error:
        raise BusError(
            "an EtherCAT master requires the library pysoem: python -m pip install 'armload[ethercat]'. It is labelled "
            "MIT and contains SOEM under the GPL version 2 with an exception for linking, so armload does not bundle it"
        ) from error
    pysoem.settings.always_release_gil = True
    return pysoem


class EthercatLine:
    """One line of drives. Use as a context manager; leaving it puts the drives in INIT, without torque.

    Args:
        interface: Network interface, such as eth1.

    Attributes:
        interface: The same.
        size: Number of drives found.
        worker: One running thread, for requests beside the cycle.
    """

    def __init__(self, interface: str) -> None:
        self.interface = interface
        self.size = 0
        self._soem = soem()
        self._master = self._soem.Master()
        self._lock = Lock()
        self._slaves: list[Any] = []
        self._output_bytes: list[int] = []
        self._before: dict[int, _Asked] = {}
        self._in_doubt: set[int] = set()
        self.worker = ThreadPoolExecutor(1, thread_name_prefix="mailbox")
        self._errors = tuple(
            getattr(self._soem, name) for name in ("WkcError", "PacketError", "MailboxError", "SdoInfoError")
        )
        try:
            self._master.open(interface)
        except ConnectionError as error:
            raise BusError(f"interface {interface} cannot be opened: {error}") from error
        self.worker.submit(lambda: None).result()  # started now: a thread inherits the priority of its starter

    def close(self) -> None:
        """Put all drives in INIT and close the interface. Idempotent."""
        self.worker.shutdown()
        if not self._master.context_initialized:
            return
        if self._slaves:
            self.request(LineState.INIT)
        self._slaves = []
        self._master.close()

    def find(self) -> int:
        """Put all drives in INIT, which removes their torque, give them addresses and bring them to PREOP.

        Returns:
            Their number.
        """
        self.size = max(self._master.config_init(), 0)
        self._in_doubt = set(range(self.size))
        self._slaves = list(self._master.slaves) if self.size else []
        if self._slaves:
            self.request(LineState.PREOP)
        return self.size

    def on_emergency(self, place: int, take: Callable[[int, int, bytes], None]) -> None:
        """Have a function called with code, register and the maker's bytes of every emergency message of a drive."""

        def received(message: Any) -> None:
            words = message.w1.to_bytes(2, "little") + message.w2.to_bytes(2, "little")
            take(message.error_code, message.error_reg, bytes([message.b1]) + words)

        self._slaves[place].add_emergency_callback(received)

    def _slave(self, place: int) -> Any:
        """One drive."""
        if place >= len(self._slaves):
            raise MailboxSilence(f"the line has {len(self._slaves)} devices only")
        return self._slaves[place]

    # Mailbox -------------------------------------------------------------------------------------------------

    def upload(self, place: int, index: int, subindex: int, limit_s: float) -> bytes:
        """Value of an object.

        Args:
            place: Place of the drive in the line, from 0.
            subindex: Sub-index.
            limit_s: Limit of the wait.

        Raises:
            MailboxAbort: the drive refuses.
            MailboxSilence: it does not answer.
        """
        slave = self._slave(place)
        asked = index, subindex, False
        return bytes(self._mailbox(place, asked, limit_s, lambda: slave.sdo_read(index, subindex, _ANSWER_BYTES)))

    def download(self, place: int, index: int, subindex: int, data: bytes, limit_s: float) -> None:
        """Write an object. Arguments and errors as `upload`."""
        slave = self._slave(place)
        asked = index, subindex, True
        self._mailbox(place, asked, limit_s, lambda: slave.sdo_write(index, subindex, data))

    def poll_mailbox(self, place: int) -> None:
        """Look into the mailbox of a drive: emergency messages wait there until they are read."""
        with self._lock:
            try:
                self._slaves[place].mbx_receive()
            except self._errors:
                return

    def _mailbox(self, place: int, asked: _Asked, limit_s: float, request: Callable[[], Any]) -> Any:
        """Make a request; repeat it within its limit if a frame was lost, as 5 of 300 are at 2 % of lost frames."""
        begun_s, why, slave = time.monotonic(), "", self._slave(place)
        with self._lock:
            before, self._before[place] = self._before.get(place, asked), asked
            if before[0] == asked[0] and before != asked:
                self._in_doubt.add(place)
            other = _DEVICE_TYPE if asked[0] != _DEVICE_TYPE[0] else _IDENTITIES
            while (left_s := begun_s + limit_s - time.monotonic()) > 0.0:
                self._master.sdo_read_timeout = self._master.sdo_write_timeout = int(_MICRO * left_s)
                try:
                    if place in self._in_doubt:
                        slave.sdo_read(*other)
                        self._in_doubt.remove(place)
                    return request()
                except self._soem.SdoError as error:
                    if place not in self._in_doubt:
                        self._in_doubt.add(place)
                        raise MailboxAbort(error.abort_code & 0xFFFF_FFFF, error.desc) from error
                    why = f"0x{other[0]:04X} was refused"
                except self._soem.Emergency:  # one that waited; its drive has a function for it, or is not of the arm
                    why = "only an emergency message arrived"
                except self._errors as error:
                    why = str(error) or type(error).__name__
                except AssertionError:  # the error of another drive surfaced: see above
                    why = "an error of another drive"
                self._in_doubt.add(place)
        raise MailboxSilence(why or f"no answer within {limit_s:g} s")

    # Registers and states ------------------------------------------------------------------------------------

    def watchdog_us(self, place: int) -> int:
        """Time of the sync manager's watchdog (0400, 0420)."""
        slave = self._slave(place)
        return round(1000 * float(self._register(lambda: slave.get_watchdog("processdata"))))

    def set_watchdog_us(self, place: int, time_us: int) -> None:
        """Set the time of the sync manager's watchdog.

        Raises:
            MailboxAbort: it is longer than the register holds.
            MailboxSilence: the drive does not answer.
        """
        slave = self._slave(place)
        most_ms = float(self._register(slave.get_max_watchdog_time))
        if time_us > 1000 * most_ms:
            raise MailboxAbort(0x0609_0031, f"at most {most_ms:g} ms are possible")
        self._register(lambda: slave.set_watchdog("processdata", time_us / 1000))

    def _register(self, access: Callable[[], Any]) -> Any:
        """Read or write a register; repeated if a frame was lost."""
        with self._lock:
            for _ in range(REGISTER_TRIES):
                with suppress(*self._errors):
                    return access()
        raise MailboxSilence(f"no answer to {REGISTER_TRIES} frames")

    def alias(self, place: int) -> int:
        """Station alias in the drive's EEPROM; 0 is none."""
        with self._lock:
            return int.from_bytes(bytes(self._slaves[place].eeprom_read(4))[:2], "little")

    def identity(self, place: int) -> tuple[str, int, int, int]:
        """Name, vendor, product and revision in the drive's EEPROM."""
        slave = self._slave(place)
        return slave.name, slave.man, slave.id, slave.rev

    def statuses(self) -> list[int]:
        """AL status of every drive; 0 where a drive does not answer."""
        self._master.read_state()
        return [slave.state for slave in self._slaves]

    def reason(self, place: int) -> str:
        """Why a drive has left its state by itself (0134), as text."""
        code = self._slaves[place].al_status
        return f"0x{code:04X} {self._soem.al_status_code_to_string(code)}"

    def request(self, state: LineState, place: int | None = None) -> None:
        """Request a state of one drive, or of all; an error that a drive reports is acknowledged before.

        The acknowledgement must not remain in a drive's AL control: with-ethercat's drives then acknowledge every later
        error by themselves, and go on in OP with closed outputs.
        """
        statuses = self.statuses()
        slaves = self._slaves if place is None else [self._slaves[place]]
        for slave in slaves:
            status = statuses[self._slaves.index(slave)]
            if status & STATE_ERROR:
                slave.state = status  # in a request this bit acknowledges
                slave.write_state()
        for target in [self._master] if place is None else slaves:
            target.state = int(state)
            target.write_state()

    def reaches(self, state: LineState, place: int, limit_s: float) -> bool:
        """Whether a drive reaches a state within a time; without a cable this is not waited for.

        It looks often, because a look holds the interpreter.
        """
        end_s = time.monotonic() + limit_s
        while line_state_of(self._slaves[place].state_check(int(state), 0)) is not state:
            if time.monotonic() > end_s or not is_running(self.interface):
                return False
            time.sleep(POLL_S)
        return True

    # Process data --------------------------------------------------------------------------------------------

    def map(self) -> list[tuple[int, int]]:
        """Place the mapped objects of all drives in one image.

        Returns:
            Bytes of outputs and inputs of each drive.

        Raises:
            BusError: the mappings cannot be placed.
        """
        with self._lock:
            try:
                self._master.config_map()
            except self._soem.ConfigMapError as error:
                found = "; ".join(str(one) or type(one).__name__ for one in error.error_list)
                raise BusError(f"the drives' process data cannot be mapped: {found}") from error
        lengths = [(len(slave.output), len(slave.input)) for slave in self._slaves]
        self._output_bytes = [outputs for outputs, _ in lengths]
        return lengths

    def follow_clock(self, place: int, cycle_s: float) -> bool:
        """Let a drive follow its distributed clock (SYNC0); False if the line has none."""
        if not self._master.config_dc():
            return False
        self._slaves[place].dc_sync(True, round(1e9 * cycle_s))
        return True

    @property
    def expected_counter(self) -> int:
        """Working counter of a frame in which all mapped drives take part."""
        return int(self._master.expected_wkc)

    def put(self, place: int, data: bytes) -> None:
        """Outputs of a drive in the next frame.

        Raises:
            CommandError: they have a wrong length.
        """
        expected = self._output_bytes[place]
        if len(data) != expected:
            raise CommandError(f"{len(data)} bytes of outputs instead of {expected}")
        self._slaves[place].output = data

    def exchange(self, limit_s: float) -> int:
        """Send one frame of process data and wait for its return; the working counter, negative if it did not."""
        self._master.send_processdata()
        return int(self._master.receive_processdata(int(_MICRO * limit_s)))

    def get(self, place: int) -> bytes:
        """Inputs of a drive in the last frame that returned."""
        return bytes(self._slaves[place].input)


@contextmanager
def open_line(interface: str) -> Iterator[EthercatLine]:
    """A line, after checking that nothing else uses its interface and its drives; closed after the block.

    Args:
        interface: Network interface, such as eth1.

    Raises:
        BusError: the interface does not exist, belongs to a network or may not be opened, pysoem is missing, no drive
            answers, or one is in OP without a master.
        ForeignMaster: another master uses it.
    """
    soem()
    require_unused(interface)
    rights = missing_rights()
    if rights:
        raise BusError(rights)
    with claimed_interface(interface):
        require_quiet(interface)
        with closing(EthercatLine(interface)) as line:
            yield line
