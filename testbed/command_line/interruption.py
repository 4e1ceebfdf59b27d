"""Ctrl-C and SIGTERM as a request that a loop grants between two steps, so that every step is completed."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@dataclass
class InterruptRequest:
    """The signal that asked to stop, if any."""

    signal: int | None = None  # number of the signal that asked to stop

    @property
    def exit_status(self) -> int:
        """What a shell expects of a process that stopped: 128 + signal, 0 without one."""
        return 0 if self.signal is None else 128 + self.signal


@contextmanager
def interruptible() -> Iterator[InterruptRequest]:
    """While it lasts the first signal is stored in the request and the second raises KeyboardInterrupt.

    Python delivers signals to the main thread only; in any other the request stays empty.
    """
    request = InterruptRequest()

    def note(number: int, frame: FrameType | None) -> None:
        if request.signal is not None:
            raise KeyboardInterrupt
        request.signal = number

    if threading.current_thread() is not threading.main_thread():
        yield request
        return
    before = {number: signal.signal(number, note) for number in SIGNALS}
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
