"""The file of a log: rerun writes to a pipe, and what comes out of it is written here, a whole block at a time.

At the first write error rerun's own file writer ends, and flushing or closing its stream may then wait for ever. The
pipe never fails; a full disk is an OSError here, and the file is readable up to its last block in any case.
"""

import os
import threading
from contextlib import suppress
from pathlib import Path
from secrets import token_bytes, token_hex

from testbed.files import check_target

CHUNK = 1 << 16  # [bytes] read from the pipe at once


class BlockFile:
    """A file beside `path`, named `<stem>.unfinished-<random>.rrd` until `finish`."""

    def __init__(self, path: Path) -> None:
        """Make its directory and open it; raises OSError, in one sentence, where it cannot be written."""
        check_target(path)
        self.path = path
        self.part = path.with_name(f"{path.stem}.unfinished-{token_hex(4)}{path.suffix}")  # where it lies now
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = open(self.part, "xb", buffering=0)  # noqa: SIM115 - open until `finish`
        except OSError as error:
            raise OSError(f"cannot write the log {path}: {error.strerror}; choose another directory") from None
        self._size = 0  # [bytes] of the blocks that were written whole
        self._failed = False
        self._waiting = bytearray()  # out of the pipe, not yet in the file
        self._block = 0  # [bytes] of it that a block has
        self._mark = token_bytes(16)  # put into the pipe behind a block
        self._marked = threading.Event()
        source, self._pipe = os.pipe()
        self._reader = threading.Thread(target=self._read, args=(source,), daemon=True)
        self._reader.start()

    @property
    def pipe(self) -> str:
        """Path of the pipe's end that is written to."""
        return f"/dev/fd/{self._pipe}"

    def write(self) -> None:
        """Write what rerun has written to the pipe before this call.

        Raises OSError, in one sentence, where that cannot be: the file then ends with the last whole block for good.
        """
        self._marked.clear()
        os.write(self._pipe, self._mark)
        self._marked.wait()
        self._append(self._block)

    def finish(self, replace: bool) -> None:
        """Write the rest, after rerun has closed its end of the pipe, and give the file its name if `replace`.

        Raises OSError, in one sentence, where the rest cannot be written, or the file not be renamed.
        """
        os.close(self._pipe)
        self._reader.join()
        try:
            self._append(len(self._waiting), last=True)
        finally:
            self._file.close()
            if replace:
                self._rename()

    def _rename(self) -> None:
        try:
            self.part = self.part.replace(self.path)
        except OSError as error:
            raise OSError(f"cannot write the log {self.path}: {error.strerror}; it is {self.part.name}") from None

    def _read(self, source: int) -> None:
        with open(source, "rb", buffering=0) as pipe:
            while data := pipe.read(CHUNK):
                unseen = max(len(self._waiting) - len(self._mark), 0)
                self._waiting += data
                if (end := self._waiting.find(self._mark, unseen)) >= 0:
                    del self._waiting[end : end + len(self._mark)]
                    self._block = end
                    self._marked.set()

    def _append(self, length: int, last: bool = False) -> None:
        left = memoryview(bytes(self._waiting[:length]))
        del self._waiting[:length]
        if self._failed:
            return
        size = self._size + length
        try:
            while left:
                left = left[self._file.write(left) :]
            if last:
                os.fsync(self._file.fileno())
        except OSError as error:
            self._failed = True
            with suppress(OSError):
                self._file.truncate(self._size)
            raise OSError(f"cannot write the log {self.path}: {error.strerror}") from error
        self._size = size
