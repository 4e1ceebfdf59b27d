"""Protection of class constants: `intersection-*` environments write theirs into IDMVehicle for the whole process."""

from types import TracebackType
from typing import Any

from highway_env.vehicle.behavior import IDMVehicle


class ProtectedConstants:
    """Context manager: what is written to the constants inside stays inside, and is there again at the next entry.

    A stock environment runs in it exactly as it would alone:

        fence = ProtectedConstants()
        with fence: env.reset(seed=0)
        with fence: env.step(1)
    """

    def __init__(self, cls: type = IDMVehicle) -> None:
        self._cls = cls
        self._inside: dict[str, Any] | None = None
        self._outside: list[dict[str, Any]] = []

    def __enter__(self) -> "ProtectedConstants":
        self._outside.append(self._read())
        if self._inside is not None and len(self._outside) == 1:
            self._write(self._inside)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        outside = self._outside.pop()
        if not self._outside:  # a nested entry leaves everything to the outermost one
            self._inside = self._read()
            self._write(outside)

    def _read(self) -> dict[str, Any]:
        return {k: v for k, v in vars(self._cls).items() if k.isupper()}

    def _write(self, constants: dict[str, Any]) -> None:
        for name in self._read().keys() - constants.keys():
            delattr(self._cls, name)
        for name, value in constants.items():
            setattr(self._cls, name, value)
