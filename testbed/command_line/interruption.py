"""Ctrl-C and SIGTERM as a wish that a loop grants between two steps, so that no step is cut in half."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@dataclass
class Wish:
    """What was asked for so far."""

    signal: int | None = None  # number of the signal that asked to stop

    @property
    def exit_status(self) -> int:
        """What a shell expects of a process that stopped: 128 + signal, 0 without one."""
        return 0 if self.signal is None else 128 + self.signal


@contextmanager
def interruptible() -> Iterator[Wish]:
    """While it lasts the first signal is noted in the wish and the second raises KeyboardInterrupt.

    Python delivers signals to the main thread only; in any other nothing changes and the wish stays empty.
    """
    wish = Wish()

    def note(number: int, frame: FrameType | None) -> None:
        if wish.signal is not None:
            raise KeyboardInterrupt
        wish.signal = number

    if threading.current_thread() is not threading.main_thread():
        yield wish
        return
    before = {number: signal.signal(number, note) for number in SIGNALS}
    try:
        yield wish
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
