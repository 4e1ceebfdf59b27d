"""How functions are compiled, and what is said when they are; the only module that imports numba."""

import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryFile
from time import perf_counter
from typing import Any

from numba import config, njit

from trackers.compiled import cache_folder


def writable(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made where it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


class Compiler:
    """Compiles the functions of some folders, whose files, with those of this one, decide about the cache."""

    def __init__(self, *folders: Path) -> None:
        self.folder = cache_folder(*folders)
        self.keeps = not config.DISABLE_JIT and writable(self.folder)
        self.told = self.keeps or config.DISABLE_JIT

    def __call__(self, function: Any) -> Any:
        """The function compiled at its first call: IEEE arithmetic, one thread, division by zero as in numpy."""
        before, config.CACHE_DIR = config.CACHE_DIR, str(self.folder)
        try:
            return njit(cache=self.keeps, error_model="numpy", nogil=True, no_cfunc_wrapper=True)(function)
        finally:
            config.CACHE_DIR = before

    def first(self, kernel: Any, what: str, about: int) -> Callable[..., Any]:
        """The kernel, whose first compilation, of about so many seconds, is announced on stderr."""
        mark = self.folder / f"{what.replace(' ', '-')}.compiled"
        if config.DISABLE_JIT or mark.exists():
            return kernel
        done = False

        def called(*arguments: Any) -> Any:
            nonlocal done
            if done:
                return kernel(*arguments)
            if not self.told:
                print(f"{self.folder} is not writable: what is compiled is not kept", file=sys.stderr)
                self.told = True
            print(f"compiling the {what}, about {about} s of computing, once for each version ...", file=sys.stderr)
            start = perf_counter()
            result = kernel(*arguments)
            print(f"compiled the {what} in {perf_counter() - start:.0f} s", file=sys.stderr)
            done = True
            if self.keeps:
                mark.touch()
            return result

        return called


compiled = Compiler()
