"""Every entity path of a review log, shared by writer, blueprint and reader.

Geometry is under `world` in world coordinates (metres, x forward, y down on the screen as in highway-env), one entity a
layer; numbers are under `metrics`, `objects` and `ego`.
"""

import re
from functools import lru_cache

from testbed.evaluation.reasons import vehicle

APPLICATION = "eot_testbed"
STEP, TIME = "step", "sim_time"  # the two timelines: frame number, seconds of simulation

FOLLOW = "world/follow"  # translation of the ego: origin of the close-ups
OVERVIEW = "world/overview"  # the same, but fixed to the middle of a small map: origin of the overview
EGO = "world/ego"  # pose of the ego
RADAR_FOV = "world/ego/radar_fov"
RINGS, RING_LABELS = "world/ego/rings", "world/ego/ring_labels"
ROAD_SURFACE, ROAD_EDGES, ROAD_LANES = "world/road/surface", "world/road/edges", "world/road/lanes"
WALLS = "world/walls"
TRUTH_CONTOUR, TRUTH_HEADING, TRUTH_EGO = "world/truth/contour", "world/truth/heading", "world/truth/ego"
TRUTH_NAMES = "world/truth/name"
EGO_PLAN = "world/ego_plan"
EGO_ACTION, EGO_SPEED = "ego/action", "ego/speed"
EGO_TTC, EGO_DRAC, EGO_BRAKING = "ego/risk/ttc", "ego/risk/drac", "ego/risk/braking"
EVENTS = "events"
CONFIG, SUMMARY, MOMENTS, OBJECTS, LEGEND = "run/config", "run/summary", "run/moments", "run/objects", "run/legend"

TRACKER_LAYERS = ("extent", "tentative", "covariance", "heading", "center", "label")
CHANGE_LAYERS = ("contour_before", "contour_after")  # only of trackers that learn contours
SMOOTHED = "world/smoothed"  # tracks smoothed over all detections of the run
SEEN = "radar"  # leaf of an object's entity: detections, expected number and visible share

RISK = (EGO_TTC, EGO_DRAC, EGO_BRAKING)  # where the drive is measured

_ESCAPED = re.compile(r"[^A-Za-z0-9_.\-]")
_PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]*")


@lru_cache(maxsize=1024)
def part(name: str) -> str:
    """Return `name` where it can be one part of an entity path without escapes, else raise ValueError."""
    if not _PLAIN.fullmatch(name) or name.startswith("__"):
        raise ValueError(f"name {name!r} cannot be part of a log path; use letters, digits, '_', '-' and '.' only")
    return name


@lru_cache(maxsize=1024)
def plain(tracker: str) -> str:
    """The name of a tracker as one part of an entity path: what needs escapes there becomes a hyphen.

    >>> plain("my_ekf:CentroidEKF:gain=2")
    'my_ekf-CentroidEKF-gain-2'
    """
    return part(_ESCAPED.sub("-", tracker))


def detections(kind: str) -> str:
    """Layer of the detections of one kind, see `sensors.origin.KINDS`."""
    return f"world/detections/{part(kind)}"


def tracker(name: str, layer: str) -> str:
    """Layer of one tracker, see `TRACKER_LAYERS` and `CHANGE_LAYERS`."""
    return f"world/trackers/{plain(name)}/{part(layer)}"


def smoothed(name: str, layer: str) -> str:
    """Layer of one tracker's smoothed tracks, "extent" or "path"."""
    return f"{SMOOTHED}/{plain(name)}/{part(layer)}"


def metric(name: str, tracker: str) -> str:
    """A metric of the whole frame."""
    return f"metrics/{part(name)}/{plain(tracker)}"


def of_object(object_id: int, leaf: str) -> str:
    """Numbers of one object: errors of the tracker `leaf`, or of the radar for `SEEN`."""
    return f"objects/{vehicle(object_id)}/{plain(leaf)}"
