"""The compiled form of what the multi-object tracker does around the filter: from the scan to claims, and leftovers.

This module does not import numba; see `trackers.compiled`. What is rare stays numpy: births, deaths, division, union.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from trackers.compiled import available
from trackers.compiled.core import whole
from trackers.composed import Composed, informed
from trackers.estimate import Estimate
from trackers.filter import Abilities
from trackers.multi.association import Association, SortedScan
from trackers.multi.cells import Linkage
from trackers.multi.evidence import Evidence
from trackers.multi.exclusion import Exclusion
from trackers.multi.existence import Existence
from trackers.multi.initiation import Initiation
from trackers.multi.leftovers import Suppression
from trackers.multi.outage import SensorOutage
from trackers.multi.tracks import Rest, Seen, StepInfo, Tracks
from trackers.multi.visibility import Visibility
from trackers.multi.way import Way
from trackers.multi.window import Unexplained, Window
from trackers.scan import Scan
from trackers.shade import NO_SHADE
from trackers.size.likelihood import TOGETHER
from trackers.size.posterior import SizePosterior

FIELDS = ("polar", "pose", "velocity", "noise")


def supported(tracker: Any) -> bool:
    """Whether the compiled functions say the same as the parts of a multi-object tracker; of other classes none do."""
    i, filter = tracker.initiation, tracker.filter
    parts = (tracker.association, tracker.existence, tracker.outage, tracker.suppression, i, i.window, i.linkage,
             i.evidence, tracker.exclusion)  # fmt: skip
    ours = (Association, Existence, SensorOutage, Suppression, Initiation, Window, Linkage, Evidence, Exclusion)
    if tuple(map(type, parts)) != ours or getattr(filter, "compiled", True) is False:
        return False
    can = Abilities.of(filter)
    if can.log_spatial is None and can.reach is None:
        return True
    sized = type(filter) is Composed and type(filter.size) is SizePosterior
    return (
        sized
        and len(filter.size.sensors) == len(tracker.sensors)
        and bool(np.isinf(filter.size.profiles.inside_depth).all())
    )


class Life:
    """The compiled form of the parts of a multi-object tracker; its methods give None for what has none."""

    def __init__(self, tracker: Any) -> None:
        from trackers.compiled.multi.rules import Boxes, Detections, Limits, Pool, Rules, Sizes
        from trackers.compiled.multi.steps import finish_all, plausible_all, see_all, share_all, turn_all

        self.limited, self.see, self.share, self.finish = plausible_all, see_all, share_all, finish_all
        self.turn = turn_all
        self.Boxes, self.Detections, self.Pool, self.Sizes = Boxes, Detections, Pool, Sizes
        self.rules, self.limits, self.filter = Rules.of(tracker), Limits.of(), tracker.filter
        self.sensors, self.most, self.complete = len(tracker.sensors), tracker.most_detections, tracker.complete_above
        core = getattr(tracker.filter, "core", None)
        fits = core is not None and core.sheets >= self.sensors and self.most <= TOGETHER
        self.core = core if fits else None
        self.sized = Abilities.of(tracker.filter).log_spatial is not None
        self.unsized = Sizes(*(np.zeros((0, *shape)) for shape in ((3,), (2,), (4, 4), *[(2,)] * 4, (1,), (1,))))

    @classmethod
    def of(cls, tracker: Any) -> "Life | None":
        """That of a tracker, None where it has none."""
        return cls(tracker) if available() and supported(tracker) else None

    def plausible(self, scan: Scan) -> bool:
        """Whether a scan is one that `trackers.validation.admit` returns as it came; False: it may not be."""
        M, S, n = len(scan.mask), self.sensors, len(scan.pose)
        due = scan.delivered is None or (isinstance(scan.delivered, np.ndarray) and scan.delivered.shape == (S,))
        shapes = ((M, 3), (M,), (n, 3), (len(scan.velocity), 2), (len(scan.noise), 3), (len(scan.sensor),), (6,))
        kinds = "fbfffif"
        for a, shape, kind in zip(scan, shapes, kinds):
            if type(a) is not np.ndarray or a.shape != shape or a.dtype.kind != kind or a.itemsize not in (1, 8):
                return False
        axes = {n, *shapes[3][:1], *shapes[4][:1], *shapes[5]} <= {1, M}
        if not axes or not due or (scan.delivered is not None and scan.delivered.dtype != bool):
            return False
        fields = [whole(getattr(scan, name)) for name in FIELDS]
        return self.limited(*fields, whole(scan.platform), scan.sensor, S, self.limits)

    def predict(self, state: Any, dt: float) -> Any:
        """The state of the filter after dt [s]."""
        found = self.core.predict(*state, dt) if self.core is not None and dt > 0 else None
        return None if found is None else self.filter.remembered(found)

    def update(self, seen: Seen, occluder: NDArray | None) -> tuple[Any, Any] | None:
        """State and information of the filter after the detections that tracks own.

        occluder (T,) bool are the tracks that hide others; None: detections of what is partly hidden stay as they are.
        """
        if self.core is None:
            return None
        T, (motion, place, size) = len(seen.tracks.id), seen.tracks.state
        z, shade = self._detections(seen.z), NO_SHADE
        if occluder is not None:
            box, platform = self._boxes(seen.tracks.estimate), whole(seen.z.scan.platform)
            sight, rate, shade = self.turn(
                seen.owner, z, box, occluder, seen.view.share, platform, self.rules.sheets.mount
            )
            z = z._replace(sight=sight, rate=rate)
        rows, start = self.share(seen.owner, z, T, self.most)
        size = size._replace(fully_visible=seen.view.complete > self.complete)
        found = self.core.update_rows(motion, place, size, rows, start, shade)
        return None if found is None else (self.filter.remembered(found), informed(found, np.diff(start)))

    def seen(self, tracks: Tracks, scan: Scan, dt: float) -> Seen | None:
        """The claims of predicted tracks, whose `existence` is that before dt [s]; scan is one that was admitted."""
        fields = [whole(getattr(scan, name)) for name in FIELDS]
        M, S = len(scan.mask), self.sensors
        sensor = scan.sensor + np.zeros(M, int)
        polar = fields[0]
        order = np.lexsort((polar[:, 2], polar[:, 1], polar[:, 0], sensor))
        order = order[scan.mask[order]]
        told = scan.delivered is not None
        before = np.zeros(S) if tracks.memory.out is None else tracks.memory.out
        out = 1.0 - scan.delivered if told else whole(before)  # type: ignore[operator]
        hidden = np.zeros(len(tracks.id)) if tracks.hidden is None else tracks.hidden
        z, v, c = self.see(order, *fields, sensor, whole(scan.platform), self._boxes(tracks.estimate),
                           self._sizes(tracks.state), whole(tracks.existence), tracks.hits, whole(hidden), told, out,
                           float(dt), self.rules)  # fmt: skip
        tracks = tracks._replace(existence=c.alive, memory=tracks.memory._replace(out=v.out))
        of_scan = Scan(z.polar, np.ones(len(order), bool), z.pose, z.velocity, z.noise, z.sensor, scan.platform)
        sorted_scan = SortedScan(of_scan, *z[5:10], z.sensor, *z[10:])  # type: ignore[call-arg]
        T = len(tracks.id)
        info = StepInfo(
            np.zeros(0, int), tracks.id, c.expected, v.in_view, c.number, c.log_ratio, np.full(T, np.nan), ()
        )
        return Seen(tracks, sorted_scan, order, c.owner, Visibility(*v[:7]), info)

    def rest(self, seen: Seen, updated: Tracks, dt: float) -> Rest:
        """Existence and leftovers of a step, whose tracks have their estimates after the update."""
        memory, tracks = seen.tracks.memory, seen.tracks
        way, loose = np.zeros(len(seen.owner)), seen.owner < 0
        way[loose] = (memory.way or Way.of(seen.z.scan.platform)).direction(seen.z.xy[loose])
        found = self.finish(self._boxes(updated.estimate), tracks.existence, seen.info.log_ratio, seen.owner,
                            self._detections(seen.z), self.Pool(*memory.unexplained), way,
                            memory.time + dt, float(dt), tracks.divided, self.rules)  # fmt: skip
        return Rest(found[0], found[1], Unexplained(*found[2]), *found[3:])

    def _detections(self, z: SortedScan) -> Any:
        s = z.scan
        return self.Detections(s.polar, s.pose, s.velocity, s.noise, *z[6:7], *z[1:6], *z[7:])

    def _boxes(self, e: Estimate) -> Any:
        return self.Boxes(*map(whole, (e.pose, e.velocity, e.yaw_rate, e.size, e.cov, e.size_std, e.yaw_rate_std)))

    def _sizes(self, state: Any) -> Any:
        if not self.sized:
            return self.unsized
        box, size = self.filter.box(state), state.size
        b = size.belief
        return self.Sizes(*map(whole, (box.pose, box.size, box.cov, size.anchor, b.size, b.offset, b.offset_var,
                                       b.length, b.width)))  # fmt: skip
