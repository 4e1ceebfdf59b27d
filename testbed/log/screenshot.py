"""Pictures of a log without a display, and the command that opens the viewer.

Drawing needs Vulkan; without a graphics card a software renderer does (on Debian the package mesa-vulkan-drivers).
"""

import os
import re
import socket
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from testbed.files import write_atomic
from testbed.log import paths

SETTLE = 1.5  # [s] until plots and texts have been laid out

_DRIVERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")


class NoRenderer(OSError):
    """There is no viewer or no Vulkan driver on this machine."""


def renderer_missing() -> str:
    """Reason why this machine cannot draw, empty where it can."""
    if not sys.platform.startswith("linux") or os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES"):
        return ""
    if not any(driver for folder in _DRIVERS for driver in Path(folder).glob("*.json")):
        return "no Vulkan driver is installed; a software renderer will do, on Debian the package mesa-vulkan-drivers"
    return ""


def render(path: str | Path, png: str | Path, at: float, settle: float = SETTLE, view: str | None = None) -> list[str]:
    """Render the log `path` at `at` [s] of the simulation into the picture `png`, all of it or the view of a name.

    Returns the viewer's error reports, view by view: empty when the layout fits the log. Raises FileNotFoundError,
    NoRenderer where nothing can draw, or not in time, and ValueError where there is no such view.
    """
    from rerun.experimental import ViewerClient

    path, png = existing(path), Path(png)
    if reason := renderer_missing():
        raise NoRenderer(f"cannot draw {path}: {reason}")
    png.parent.mkdir(parents=True, exist_ok=True)
    program = str(_program())
    with _silent():  # the viewer keeps the streams that it was started with
        started = ViewerClient.spawn(
            headless=True, port=_free_port(), hide_welcome_screen=True, executable_path=program
        )
    with started as viewer:
        viewer.open(str(path.resolve()))
        viewer.set_time(paths.TIME, duration=at, play_state="paused")
        time.sleep(settle)
        views = viewer.get_state().views
        number = None if view is None else find_view({v.name: v.view_id for v in views}, view)
        try:
            picture = viewer.take_screenshot(number)
        except TimeoutError:
            raise NoRenderer(
                f"cannot draw {path}: the viewer did not answer in time; try again on an idle machine"
            ) from None
        write_atomic(png, picture)
        return [f"{v}: {report}" for v in views for report in v.reports]


def find_view(views: Mapping[str, str], wanted: str) -> str:
    """Number of the view of that name, or of the only one whose name begins so, whatever the case."""
    found = [name for name in views if name.lower() == wanted.lower()]
    found = found or [name for name in views if name.lower().startswith(wanted.lower())]
    if not found:
        starts = sorted({re.split("[:,(]", name)[0].strip() for name in views})  # all names are too many to be read
        raise ValueError(f"--view: no view {wanted!r}; there are {', '.join(starts)}")
    if len(found) > 1:
        raise ValueError(f"--view: more than one view {wanted!r}; there are {'; '.join(sorted(found))}")
    return views[found[0]]


@contextmanager
def _silent() -> Iterator[None]:
    """Let what is started meanwhile write to nowhere."""
    streams = (sys.stdout, sys.stderr)
    for stream in streams:
        stream.flush()
    kept = [os.dup(1), os.dup(2)]
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        for number, before in enumerate(kept, 1):
            os.dup2(before, number)
            os.close(before)


def existing(path: str | Path) -> Path:
    """The path of a log, which must exist."""
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"there is no log {path}; `testbed run` with --log full writes one")
    return path


def viewer_command(logs: Sequence[str | Path], web: bool = False) -> list[str]:
    """Command line of the viewer on some logs; `web` serves it to a browser on this machine only."""
    options = ["--serve-web", "--bind", "127.0.0.1"] if web else []
    return [str(_program()), *options, *(str(existing(log)) for log in logs)]


def _program() -> Path:
    """The viewer's own executable: stopping the launcher on the path would leave the viewer running."""
    spec = find_spec("rerun_cli")
    folder = Path(spec.origin).parent if spec and spec.origin else Path()
    for name in ("rerun", "rerun.exe"):
        if (folder / name).is_file():
            return folder / name
    raise NoRenderer("the viewer is missing; install the complete package rerun-sdk")


def _free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]
