"""How many tracks there were and how long they lived: what can be said of trackers without a truth."""

from collections import defaultdict

import numpy as np

from testbed.frame import Frame


class Lives:
    """Observer of the reported tracks of each tracker."""

    def __init__(self) -> None:
        self._scans: dict[str, int] = defaultdict(int)
        self._times: dict[str, dict[int, list[float]]] = defaultdict(dict)  # tracker -> track -> first, last [s], scans

    def __call__(self, frame: Frame) -> None:
        """Take the tracks of one frame."""
        for name, (tracks, _) in frame.outputs.items():
            self._scans[name] += 1
            for number in tracks._replace(state=None).reported.id.tolist():
                seen = self._times[name].setdefault(number, [frame.time, frame.time, 0])
                seen[1:] = frame.time, seen[2] + 1

    def rows(self) -> dict[str, dict[str, float]]:
        """By tracker: tracks reported, tracks a scan, median and longest life [s]."""
        return {name: self._row(name) for name in self._scans}

    def _row(self, name: str) -> dict[str, float]:
        first, last, scans = np.array(list(self._times[name].values()), float).reshape(-1, 3).T
        life = last - first
        return {
            "tracks_reported": len(life),
            "tracks_per_scan": float(scans.sum()) / self._scans[name],
            "life_median": float(np.median(life)) if len(life) else np.nan,
            "life_longest": float(life.max(initial=0.0)),
        }
