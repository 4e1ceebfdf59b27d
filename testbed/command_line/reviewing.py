"""What `testbed review` does with logs: the viewer, or a page, an animation, a picture, a served folder of results."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console


class Options(NamedTuple):
    """The options of `testbed review`."""

    web: bool = False
    screenshot: Path | None = None
    at: float | None = None  # [s]
    view: str | None = None
    focus: int | None = None
    gif: Path | None = None
    html: Path | None = None
    report: Path | None = None

    def check(self, logs: Sequence[Path]) -> None:
        """Raise ValueError, in one sentence, for options that do not go together."""
        if self.report is not None and (logs or self._replace(report=None) != Options()):
            raise ValueError("--report shows a whole folder; leave out logs and other options, or call twice")
        if self.without_viewer and self.focus is not None:
            raise ValueError("--focus goes with the viewer and --screenshot; a page opens at a vehicle by #veh=3")
        if self.without_viewer and (self.at, self.view) != (None, None):
            raise ValueError("--at and --view go with --screenshot; a page opens at a time by #t=3.5")
        if self.web and (self.screenshot, self.html, self.gif) != (None,) * 3:
            raise ValueError("--web shows logs in a browser; leave out --screenshot, --html and --gif, or call twice")

    @property
    def without_viewer(self) -> bool:
        """Whether only a page or an animation is to be written."""
        return self.screenshot is None and (self.html, self.gif) != (None, None)


def show(logs: Sequence[Path], options: Options, console: Console) -> None:
    """Open logs in the viewer, or write what the options ask for; raises ValueError or OSError, in one sentence."""
    options.check(logs)
    logs = [chosen for path in logs for chosen in _in_folder(path, console)]
    if options.report is not None:
        from testbed.log.review_page.server import serve

        serve(options.report, lambda address: console.print(f"report   {address}\nCtrl-C ends it", highlight=False))
        return
    from testbed.log import review

    if options.html is not None:
        from testbed.log.review_page.page import write

        console.print(f"page     {write(logs, options.html)}", soft_wrap=True)
    if options.gif is not None:
        from testbed.log.review_page import animation

        console.print(f"picture  {animation.write(review.only(logs, 'an animation'), options.gif)}", soft_wrap=True)
    if options.without_viewer:
        return
    review.review(logs, options.web, options.screenshot, options.at, options.view, options.focus)
    if options.screenshot is not None:
        console.print(f"picture  {options.screenshot}", soft_wrap=True)


def _in_folder(path: Path, console: Console) -> list[Path]:
    """The newest log of a folder, in place of the folder; ValueError where it has none."""
    if not path.is_dir():
        return [path]
    logs = sorted(path.glob("*.rrd"), key=lambda log: log.stat().st_mtime)
    if not logs:
        below = next(iter(sorted(path.rglob("*.rrd"))), None)
        remedy = f"try {below.parent}" if below else "`testbed run` with --log full writes one"
        raise ValueError(f"there is no log (.rrd) in {path}; {remedy}")
    others = f", the newest of {len(logs)}; name another to open that" if len(logs) > 1 else ""
    console.print(f"log      {logs[-1]}{others}", soft_wrap=True, highlight=False)
    return logs[-1:]
