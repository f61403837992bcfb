"""SDO over EtherCAT's mailbox (CoE), and the sync manager's watchdog, which is read and written like an object."""

from __future__ import annotations

import time
from concurrent.futures import Executor, Future

from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.cia402.drive_safety import SYNC_MANAGER_WATCHDOG_US
from armload_drivers.cia402.object_dictionary import Entry
from armload_drivers.driver_errors import ServoTimeout
from armload_drivers.ethercat.ethercat_line import EthercatLine, MailboxAbort, MailboxSilence


class CoeSdo(SdoChannel):
    """SDO access to one drive.

    Args:
        node_id: Place of the drive in the line, from 1.
        joint: Name of its joint, for errors.
        worker: One thread that makes the requests that are not waited for.
        timeout_s: Limit of one request.

    Attributes:
        unanswered: Number of consecutive requests without an answer, of those that were not waited for.
    """

    def __init__(self, node_id: int, joint: str, line: EthercatLine, worker: Executor, timeout_s: float) -> None:
        super().__init__(node_id, joint, timeout_s)
        self.unanswered = 0
        self._place, self._line, self._worker = node_id - 1, line, worker
        self._asked: Future[bytes] | None = None

    def ask(self, entry: Entry) -> None:
        """Request an object without waiting for the answer; one to an earlier request is not taken any more."""
        if self._asked is not None:
            self._asked.cancel()  # one that has not begun: at most two requests of a drive are under way
        self._asked = self._worker.submit(self._counted, entry)

    def _counted(self, entry: Entry) -> bytes:
        """Read an object; count requests without an answer."""
        try:
            found = self._request(entry, None)
        except MailboxSilence:
            self.unanswered += 1
            raise
        except MailboxAbort:
            self.unanswered = 0
            raise
        self.unanswered = 0
        return found

    def _take(self) -> bytes | None:
        """The answer to `ask`; None if no value has arrived."""
        asked = self._asked
        if asked is None or not asked.done():
            return None
        self._asked = None
        return asked.result() if asked.exception() is None else None

    def _wait(self, time_s: float) -> None:
        """Sleep."""
        time.sleep(time_s)

    def _transfer(self, entry: Entry, data: bytes | None) -> bytes:
        """Write `data`, or read if it is None."""
        verb = "reading" if data is None else "writing"
        try:
            return self._request(entry, data)
        except MailboxAbort as error:
            raise self._refused(verb, entry, error.code, str(error)) from error
        except MailboxSilence as error:
            raise ServoTimeout(
                *self.node,
                self.step,
                f"{verb} {entry}: {error}",
                "Is the drive powered and connected, at this place in the line?",
            ) from error

    def _request(self, entry: Entry, data: bytes | None) -> bytes:
        """One request."""
        line, place = self._line, self._place
        if entry is SYNC_MANAGER_WATCHDOG_US:
            if data is None:
                return line.watchdog_us(place).to_bytes(4, "little")
            line.set_watchdog_us(place, int.from_bytes(data, "little"))
        elif data is None:
            return line.upload(place, entry.index, entry.subindex, self._limit_s)
        else:
            line.download(place, entry.index, entry.subindex, data, self._limit_s)
        return b""
