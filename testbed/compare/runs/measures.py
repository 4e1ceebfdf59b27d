"""What is compared: the measures of a run, their units, and which way is better."""

from typing import NamedTuple

EDGES = (0.0, 0.25, 0.5, 0.75, 0.999)  # of the visible share; a bin holds its upper edge
LABELS = ("hidden", "to 25 %", "to 50 %", "to 75 %", "to 100 %", "whole")


class Measure(NamedTuple):
    """One number of a run, or of a phase of it."""

    key: str  # column of `runs.parquet`
    label: str
    unit: str
    digits: int
    ideal: float | None = None  # best value; None: the smaller the better
    more: bool = False  # the greater the better

    @property
    def title(self) -> str:
        """Name with its unit."""
        return self.label if self.unit == "1" else f"{self.label} [{self.unit}]"


MEASURES = (
    Measure("gospa", "GOSPA", "m", 2),
    Measure("missed_percent", "missed", "%", 1),
    Measure("false_per_scan", "false tracks a scan", "1", 2),
    Measure("rmse_position", "position RMSE", "m", 2),
    Measure("rmse_velocity", "velocity RMSE", "m/s", 2),
    Measure("rmse_heading_deg", "heading RMSE", "deg", 1),
    Measure("rmse_length", "length RMSE", "m", 2),
    Measure("rmse_width", "width RMSE", "m", 2),
    Measure("gwd", "GWD", "m", 2),
    Measure("box_iou", "box IoU", "1", 2, ideal=1.0),
    Measure("contour_iou", "contour IoU", "1", 2, ideal=1.0),
    Measure("nees_position", "NEES position", "1", 1, ideal=2.0),
    Measure("nees_velocity", "NEES velocity", "1", 1, ideal=2.0),
    Measure("nees_heading", "NEES heading", "1", 1, ideal=1.0),
    Measure("nees_length", "NEES length", "1", 1, ideal=1.0),
    Measure("nees_width", "NEES width", "1", 1, ideal=1.0),
    Measure("switches", "switches", "1", 1),
    Measure("lost", "lost tracks", "1", 2),
    Measure("birth_delay", "birth delay", "s", 2),
    Measure("unborn_percent", "missed before birth", "%", 1),
    Measure("never", "never tracked", "1", 2),
    Measure("uncovered_gap", "longest in view without a track", "s", 2),
    Measure("ms_per_scan", "cost of a scan", "ms", 1),
    Measure("us_per_update", "cost of an update", "us", 0),
)
DRIVES = (  # of the ego, in closed loop
    Measure("collisions", "collisions", "1", 2),
    Measure("J", "J", "s", 2, more=True),
    Measure("progress", "progress", "m", 1, more=True),
    Measure("drac_max", "braking that was needed (DRAC)", "m/s^2", 2),
    Measure("tit", "time-integrated TTC", "s^2", 2),
    Measure("deceleration_max", "hardest braking", "m/s^2", 2),
    Measure("jerk", "jerk", "m/s^3", 2),
)
DRIVE = tuple(measure.key for measure in DRIVES)
KEYS = {measure.key: measure for measure in (*MEASURES, *DRIVES)}
MAIN = ("gospa", "missed_percent", "false_per_scan", "rmse_position", "rmse_velocity", "rmse_length", "nees_position")
COSTS = ("ms_per_scan", "us_per_update")  # wall time: the only columns that differ from one execution to the next

SPAN_UNITS = {  # the columns of `runs.parquet` that are no measures
    "scenario": "", "tracker": "", "seed": "1", "phase": "", "start": "s", "end": "s", "scans": "1",
    "localisation": "m^2", "missed": "m^2", "false": "m^2", "objects_per_scan": "1", "tracks_per_scan": "1",
    "objects_visible": "1", "objects_confirmed": "1", "tracks_reported": "1", "tracks_orphan": "1",
    "tracks_clutter": "1", "tracks_ghost": "1", "jumps": "1",
    "gwd2": "m^2", "abs_length": "m", "abs_width": "m",
    "nees_low": "1", "nees_high": "1", "pairs": "1", "plain_view_gap": "s", "orphan_duration": "s",
    "elapsed": "s", "ttc_min": "s", "ttc_plane_min": "s", "ttc_5": "s", "headway_min": "s", "distance_min": "m",
    "distance_min_at": "s", "speed_mean": "m/s", "speed_max": "m/s", "harsh_braking": "1",
}  # fmt: skip


def badness(key: str, value: float) -> float:
    """The value on a scale on which smaller is better: itself, its distance from the ideal, or its negative."""
    measure = KEYS[key]
    if measure.ideal is not None:
        return abs(value - measure.ideal)
    return -value if measure.more else value
