"""What the compiled kernels save: the default tracker on the same scans in both forms, in turns."""

from contextlib import closing
from importlib.util import find_spec
from typing import Any

from sensors import find as find_radar
from testbed.bench import Pairs, deciding, interleaved
from testbed.frame import Frame
from testbed.planners import find as find_planner
from testbed.run import RunConfig, make_env
from trackers import DEFAULT, build, compiled

WARM = 10  # first frames, in which kernels are compiled or loaded


def frames_of(scenario: str, seconds: int, out: str) -> tuple[list[Frame], Any]:
    """The frames of a run with the default tracker, and that tracker."""
    frames: list[Frame] = []
    config = RunConfig(scenario, duration=float(seconds + 1), out=out, log="off", metrics=False)
    with closing(make_env(config)) as env:
        tracked: Any = env
        tracked.reset(seed=0)
        tracked.attach(frames.append)
        deciding(tracked, find_planner(config.planner), seconds * tracked.unwrapped.config["policy_frequency"])
        return frames, build(DEFAULT, find_radar(config.radar).models)


def forms(scenario: str, seconds: int, out: str) -> Pairs | None:
    """CPU times [s] of each frame of the default tracker, compiled and in numpy; None where numba is not installed."""
    if find_spec("numba") is None:
        return None
    frames, tracker = frames_of(scenario, seconds, out)
    before, tracks = compiled.kernels("spline") is not None, {True: tracker.start(), False: tracker.start()}
    waiting = {form: iter(frames) for form in tracks}

    def step(form: bool) -> None:
        frame = next(waiting[form])
        compiled.use(form)
        tracks[form], _ = tracker.step(tracks[form], frame.scan, frame.scene.dt)

    pairs = interleaved(lambda: step(True), lambda: step(False), len(frames))
    compiled.use(before)
    return Pairs(pairs.plain[WARM:], pairs.extra[WARM:])
