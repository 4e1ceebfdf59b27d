"""A deterministic little run for the tests of the log: traffic, detections and two trackers made by hand."""

from typing import NamedTuple

import numpy as np

from sensors.origin import CLUTTER, CONTOUR, STATIC, VOLUME, Origin
from sensors.scene import Ego, boxes_scene
from testbed.frame import Frame, FrameScore
from testbed.log import RoadGeometry, RunMeta
from trackers.estimate import prior
from trackers.geometry import box_corners, unit
from trackers.multi.tracks import NO_TRACK, Event, StepInfo, Tracks
from trackers.scan import Scan, SensorModel

DT = 1 / 15
META = RunMeta(
    run_id="made-by-hand",
    scenario="made-by-hand",
    seed=0,
    radar="surround",
    trackers=("rm-feldmann", "htg-map"),
    planner="idm",
    config={"duration": "20 s"},
    versions={"numpy": np.__version__},
)
SIZES = np.array([[4.6, 1.86], [4.4, 1.8], [8.1, 2.45], [4.8, 1.9], [12.0, 2.5]])
SENSORS = tuple(
    SensorModel(mount=(x, 0.0, a), max_range=r, fov=f)
    for x, a, r, f in (
        (2.3, 0.0, 174.0, 0.35),
        (-2.3, np.pi, 174.0, 0.35),
        (2.0, 1.05, 30.0, 1.57),
        (2.0, -1.05, 30.0, 1.57),
    )
)


class Record(NamedTuple):
    """What one call of `RunLog.step` takes."""

    frame: Frame
    scores: dict[str, FrameScore]
    events: tuple[tuple[str, str], ...] = ()


def road(length=1200.0, lanes=4):
    x = np.array([-200.0, length])
    line = lambda y: np.stack([x, np.full(2, y)], -1)  # noqa: E731
    return RoadGeometry(
        edges=(line(-2.0), line(4.0 * lanes - 2)),
        lane_lines=tuple(line(4.0 * i + 2) for i in range(lanes - 1)),
        surface=tuple(line(4.0 * i) for i in range(lanes)),
        half_width=(2.0,) * lanes,
    )


def ego_at(t):
    pose = np.array([25.0 * t, 8.0 + 4.0 / (1 + np.exp(-(t - 6) * 2)), 0.06 * np.exp(-((t - 6) ** 2))])
    size = np.array([4.7, 1.9])
    speed = 25.0 + 3 * np.sin(t / 3)
    return Ego(pose, speed * unit(pose[2]), 0.0, size, box_corners(pose, size))


def scene_at(step, objects):
    t = step * DT
    i = np.arange(objects)
    x = -60 + 9.0 * i + (25.0 + 0.7 * np.sin(i * 2.0)) * t + 20.0 * (i % 3)
    pose = np.stack([x, 4.0 * (i % 4) + 0.2 * np.sin(t + i), 0.02 * np.cos(t + i)], -1)
    velocity = 25.0 * unit(pose[:, 2])
    return boxes_scene(pose, SIZES[i % len(SIZES)], velocity, ego=ego_at(t), time=t, dt=DT)


def scan_of(scene, rng, per_object, clutter):
    """Points on the sides that face the ego, points inside, false alarms and a post by the road."""
    objects = scene.objects
    N = len(objects.id)
    corners = box_corners(objects.pose, objects.size)
    side = np.where(objects.pose[:, 1] > scene.ego.pose[1], 2, 0)
    a, b = corners[np.arange(N), side], corners[np.arange(N), side + 1]
    on_edge = a[:, None] + rng.uniform(size=(N, per_object, 1)) * (b - a)[:, None]
    depth = np.where(rng.uniform(size=(N, per_object)) < 0.3, rng.uniform(0.2, 0.8, (N, per_object)), 0.0)
    inside = on_edge + depth[..., None] * (objects.pose[:, None, :2] - on_edge)
    points = (inside + 0.08 * rng.normal(size=inside.shape)).reshape(-1, 2)
    false = scene.ego.pose[:2] + rng.uniform((-60, -20), (90, 20), (clutter, 2))
    post = scene.ego.pose[None, :2] + np.array([20.0, 7.5])
    xy = np.concatenate([points, false, post, np.full((3, 2), np.nan)])
    padding = np.arange(len(xy)) >= len(xy) - 3
    kind = np.concatenate([np.where(depth.ravel() > 0, VOLUME, CONTOUR), np.full(clutter, CLUTTER), [STATIC] * 4])
    owner = np.concatenate([np.repeat(np.arange(N), per_object), np.full(clutter + 4, -1)])
    scan = Scan.from_xy(np.where(padding[:, None], 0.0, xy), ~padding, scene.ego.pose)
    polar = np.where(padding[:, None], np.nan, scan.polar)
    origin = Origin(owner, owner, owner, kind, np.full(N, float(per_object)), np.full(N, 0.7))
    return scan._replace(polar=polar, sensor=np.zeros(len(xy), int)), origin


def tracks_of(scene, rng, noise, lost=()):
    objects = scene.objects
    pose = objects.pose + noise * rng.normal(size=objects.pose.shape) * [1, 1, 0.1]
    size = objects.size + noise * rng.normal(size=objects.size.shape)
    estimate = prior(pose, objects.velocity + noise * rng.normal(size=(len(pose), 2)), size=np.maximum(size, 0.5))
    n = len(pose)
    existence = np.where(np.isin(objects.id, lost), 0.3, 0.98)
    reported = existence > 0.5
    return Tracks(objects.id + 100, existence, np.full(n, 9), np.full(n, 2.0), reported, np.zeros(n), estimate, 100 + n)


def output_of(scene, origin, rng, noise, step):
    lost = (2,) if 20 <= step < 40 else ()
    tracks = tracks_of(scene, rng, noise, lost)
    events = []
    if step == 0:
        events = [Event("confirmed", int(i), "existence above one half") for i in tracks.reported.id]
    if step == 20:
        events = [Event("died", 102, "no detection for 1 s"), Event("born", 150, "3 detections no track explains")]
        events += [Event("implausible", NO_TRACK, "2 detections left out")]
    n = len(tracks.id)
    owner = np.where(origin.object >= 0, origin.object + 100, -1)
    info = StepInfo(
        owner, tracks.id, np.ones(n), np.ones(n, bool), np.ones(n, int), np.zeros(n), np.full(n, np.nan), tuple(events)
    )
    reported = tracks.reported.id
    pairs = {int(i) - 100: int(i) for i in reported}
    errors = {
        i: {
            "gwd": noise * (1 + rng.uniform()),
            "position": noise * rng.uniform(),
            "velocity": noise * rng.uniform(),
            "heading_deg": 2 * noise * rng.normal(),
            "nees_position": rng.chisquare(2),
        }
        for i in pairs
    }
    mean = {
        name: float(np.mean([e[name] for e in errors.values()])) if errors else np.nan
        for name in ("gwd", "position", "velocity", "heading_deg", "nees_position")
    }
    extra = {"length": noise * rng.normal(), "gospa": 3 * noise + 2.0 * len(lost), "localisation": 3 * noise}
    extra |= {"missed": 2.0 * len(lost), "false": 0.0, "box_iou": 0.9 - noise, "objects": n, "tracks": len(reported)}
    return (tracks, info), FrameScore(pairs, errors, mean | extra)


def action_at(t):
    return ("IDLE", "FASTER", "IDLE", "LANE_RIGHT", "IDLE", "SLOWER", "IDLE")[min(int(t / 2.2), 6)]


def records(steps, seed=0, objects=5, per_object=4, clutter=5):
    """Records of a run; equal seeds give equal runs."""
    rng = np.random.default_rng(seed)
    for step in range(steps):
        scene = scene_at(step, objects)
        scan, origin = scan_of(scene, rng, per_object, clutter)
        made = {
            "rm-feldmann": output_of(scene, origin, rng, 0.3, step),
            "htg-map": output_of(scene, origin, rng, 0.12, step),
        }
        ahead = np.linspace(0, 90, 10)
        plan = scene.ego.pose[:2] + np.stack([ahead, 4.0 * np.tanh(ahead / 60) * (scene.time < 6)], -1)
        events = (("INFO", "veh_01 starts a lane change"),) if step == 30 else ()
        outputs = {name: output for name, (output, _) in made.items()}
        frame = Frame(step, scene, scan, origin, outputs, action_at(scene.time), plan)
        yield Record(frame, {name: score for name, (_, score) in made.items()}, events)


MIXING = META._replace(trackers=("rm-feldmann", "edra-imm"))  # the second tracker mixes cv, ca and ct


def mode_at(step, tracks):
    """Probabilities (T, 3): every track turns a little more likely with every step, those with odd ids brake."""
    p = np.tile([8.0, 1.0, 1.0 + step], (len(tracks), 1))
    p[tracks % 2 == 1, 1] += 20.0
    return p / p.sum(-1, keepdims=True)


def mixing_records(steps, **options):
    """The run of `records` with a second tracker that mixes motion models, with probabilities after the first step."""
    for record in records(steps, **options):
        first, (tracks, info) = record.frame.outputs.values()
        mode = None if record.frame.step == 0 else mode_at(record.frame.step, info.track)
        outputs = dict(zip(MIXING.trackers, (first, (tracks, info._replace(mode=mode))), strict=True))
        scores = dict(zip(MIXING.trackers, record.scores.values(), strict=True))
        yield Record(record.frame._replace(outputs=outputs), scores, record.events)


SUMMARY = {
    "rm-feldmann": {"gwd": 0.41, "gospa": 1.3, "lost": 3},
    "htg-map": {"gwd": 0.24, "gospa": 0.7, "lost": 2},
    "collision": False,
    "steps": 300,
}


def write(path, steps=30, **options):
    """A finished log of a small run."""
    from testbed.log import RunLog

    made = {k: options.pop(k) for k in ("seed", "objects", "per_object", "clutter") if k in options}
    meta = options.pop("meta", META)
    run = mixing_records if meta is MIXING else records
    with RunLog(path, meta, **options) as log:
        log.static(road(), SENSORS)
        for record in run(steps, **made):
            log.step(*record)
        log.close(SUMMARY)
    return path
