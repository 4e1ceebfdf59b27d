"""Two logs as one for the viewer: a scene each, on one time line, and their errors over each other.

Entities of each log stand below `first` and `second`.
"""

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from testbed.evaluation.metric import METRICS
from testbed.log import paths
from testbed.log.blueprint import BACKGROUND, arranged
from testbed.log.pair import BOUNDS
from testbed.log.reader import entity_paths, properties

SIDES = ("first", "second")
CURVES = ("gospa", "position", "velocity", "heading_deg", "length", "nees_position")


def write(logs: Sequence[str | Path], path: Path) -> Path:
    """Write both logs as one (.rrd), and return where; OSError or ValueError, in one sentence, where that cannot be."""
    from rerun.chunk import RrdReader

    runs = [properties(log).get("run", {}) for log in logs]
    titles = [f"{run.get('scenario', Path(log).stem)}: {run.get('trackers', '')}" for run, log in zip(runs, logs)]
    name = sha256("".join(str(Path(log).resolve()) for log in logs).encode()).hexdigest()[:12]
    both = rr.RecordingStream(paths.APPLICATION, recording_id=f"both-{name}")
    both.save(path, default_blueprint=_layout([entity_paths(log) for log in logs], titles))
    for side, log in zip(SIDES, logs, strict=True):
        chunks = RrdReader(log).stream().to_chunks()
        both.send_chunks([c.with_entity_path(f"/{side}{c.entity_path}") for c in chunks if "/__" not in c.entity_path])
    both.disconnect()
    return path


def _layout(there: Sequence[set[str]], titles: Sequence[str]) -> rrb.Blueprint:
    x0, x1, y0, y1 = BOUNDS
    bounds = rrb.VisualBounds2D(x_range=[x0, x1], y_range=[y0, y1])
    scenes: list[Any] = [
        rrb.Spatial2DView(
            origin=f"/{side}/{paths.FOLLOW}",
            contents=[f"+ /{side}/world/**", f"- /{side}/{paths.SMOOTHED}/**"],
            name=title,
            visual_bounds=bounds,
            background=BACKGROUND,
        )
        for side, title in zip(SIDES, titles, strict=True)
    ]
    plots = [
        rrb.TimeSeriesView(
            origin="/", contents=[f"+ /{side}/metrics/{key}/**" for side in SIDES], name=METRICS[key].title
        )
        for key in CURVES
        if any(entity.startswith(f"metrics/{key}/") for entities in there for entity in entities)
    ]
    speed = rrb.TimeSeriesView(
        origin="/", contents=[f"+ /{side}/{paths.EGO_SPEED}" for side in SIDES], name="speed of the ego [m/s]"
    )
    actions = [rrb.StateTimelineView(origin=f"/{side}/{paths.EGO_ACTION}", name=f"Action: {side}") for side in SIDES]
    events = [rrb.TextLogView(origin=f"/{side}/{paths.EVENTS}", name=f"Events: {side}") for side in SIDES]
    words = rrb.Vertical(*actions, rrb.Tabs(*events))
    below = rrb.Horizontal(rrb.Grid(*plots, speed), words, column_shares=[5, 3])
    return arranged([*scenes, below], [1.0, 1.0, 2.0])
