"""The radar: a Scene in, a Scan and its Origin out; order of a scan and equations in docs/methods/radar.md."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sensors.aspects import Aspects, Parameters, interpolated, mean_counts, shown
from sensors.compiled import Fan, look
from sensors.ghosts import Ghosts, Rig, draw_ghosts
from sensors.illumination import Beams, Illuminated, Visible, beam_azimuths, illuminate
from sensors.origin import Origin
from sensors.persistence import Persistence
from sensors.raycast import outline_edges
from sensors.reflections import BodyFigures, Mounted, vehicle_returns, wall_returns
from sensors.returns import Returns, add_noise, false_alarms, fold_rates, join, merge_cells, rows
from sensors.roadside import Roadside, roadside_returns
from sensors.scattering import draw_counts
from sensors.scene import Scene, check_scene
from sensors.wheels import with_wheels
from trackers.compiled import available
from trackers.scan import DepthProfile, Scan, SensorModel

MAX_MOUNT = (10.0, 2.5)  # [m] along and across from the centre: half of the longest and widest of vehicles


@dataclass(frozen=True)
class Sensor:
    """One mounted radar. The defaults are a plausible side radar.

    Fields whose names end in `_deg` are in degrees. The heading of the mount is in radians: (-2.35, 0.0, np.pi) looks
    back, and `sensors.rigs.facing` takes degrees.
    """

    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)  # x, y [m], heading in RAD, from the vehicle's centre
    max_range: float = 30.0  # [m]
    fov_deg: float = 90.0  # full opening angle
    spacing_deg: float = 0.25  # between rays; what is thinner may be missed
    sigma_range: float = 0.15  # [m]
    sigma_azimuth_deg: float = 1.2
    sigma_rate: float = 0.12  # [m/s]
    max_rate: float = 60.0  # [m/s] false alarms have range rates within +- this
    count_at_15m: float = 7.0  # expected detections at 15 m of an object that shows 3 m of projected outline
    count_falloff: float = 0.6  # exponent of (15 m / range)
    count_max: float = 40.0  # of one object
    count_shape: float = 2.0  # of the negative binomial; inf: Poisson; 0: not random, the mean rounded
    detection_probability: float = 1.0  # that a visible object returns anything at all in a scan
    grazing: float = 0.5  # 0: returns spread over the projected outline; 1: over its true length
    share_volume: float = 0.2  # of the detections that come from inside the body
    depth_contour: float = 0.12  # [m] mean depth behind the surface of the others
    depth_volume: float = np.inf  # [m] mean depth of those inside, before the body cuts it; inf: uniform
    share_scatter: float = 0.0  # of the detections, displaced by multipath, mirrors, mounting parts
    scatter: float = 0.5  # [m] standard deviation of that displacement, each axis
    cell_range: float = 0.0  # [m] resolution cell; all three 0: nothing merges
    cell_azimuth_deg: float = 0.0
    cell_rate: float = 0.0  # [m/s]; 0: range rate does not separate returns
    cell_power: float = 0.0  # exponent by which noise falls with the power of what merged; 0: not, 0.5: as its root
    fold_rate: float = np.inf  # [m/s] range rates beyond +- this come back at the other end; inf: none do
    wheels: float = 0.0  # of the returns of a moving body seen from its side, those of turning wheels
    clutter: float = 2.0  # expected false alarms a scan
    static_density: float = 0.25  # [1/m] returns of a wall at 15 m; falls off as counts do
    rate: float = np.inf  # [1/s] of its measurements; inf: one in every scan of the rig
    phase: float = 0.0  # share of its period by which the first measurement is late
    profile: DepthProfile = field(default_factory=DepthProfile)  # where its detections lie on a body, as far as known
    roadside: Roadside | None = None  # what stands beside the road but for guard rails; None: nothing
    aspects: Aspects | None = None  # what vehicles return by the side that they show; None: all sides alike
    persistence: Persistence | None = None  # how long scattering centres stay on a body; None: drawn anew in each scan

    def __post_init__(self) -> None:
        for name in numeric():
            value = np.asarray(getattr(self, name))
            if np.isnan(value).any() or (name != "mount" and (value < 0).any()):
                raise ValueError(f"sensor.{name} must be a number of at least 0, got {getattr(self, name)}")
        if fault := fault_of_mount(self.mount):
            raise ValueError(f"sensor.mount {fault}")
        if not isinstance(self.persistence, Persistence | None):
            raise ValueError(
                f"sensor.persistence must be a Persistence or None, got {self.persistence}; "
                "give a lifetime as Persistence(lifetime=...)"
            )
        if self.rate == 0:
            raise ValueError("sensor.rate must be positive, got 0; leave a sensor that never measures out of the rig")
        if self.phase >= 1:
            raise ValueError(f"sensor.phase must be below 1, got {self.phase}; it is a share of the period")
        for name in ("max_range", "fov_deg", "spacing_deg"):
            if getattr(self, name) <= 0 or np.isinf(getattr(self, name)):
                raise ValueError(f"sensor.{name} must be positive and finite, got {getattr(self, name)}")
        if self.fold_rate == 0:
            raise ValueError("sensor.fold_rate must be positive, got 0; inf folds no range rate")
        if self.fov_deg > 360:
            raise ValueError(f"sensor.fov_deg must be at most 360, got {self.fov_deg}; it is the full angle in degrees")
        for name in ("detection_probability", "share_volume", "share_scatter", "wheels"):
            if getattr(self, name) > 1:
                raise ValueError(f"sensor.{name} must be within 0 and 1, got {getattr(self, name)}; it is a share")

    @cached_property
    def azimuths(self) -> NDArray:
        """Azimuth (B,) [rad] of each ray in the sensor frame."""
        return beam_azimuths(np.radians(self.fov_deg), np.radians(self.spacing_deg))

    @cached_property
    def model(self) -> SensorModel:
        """The data sheet that a tracker may know: counts are means, detection probability included."""
        return SensorModel(
            mount=self.mount,
            max_range=self.max_range,
            fov=float(np.radians(self.fov_deg)),
            sigma_range=self.sigma_range,
            sigma_azimuth=float(np.radians(self.sigma_azimuth_deg)),
            sigma_rate=self.sigma_rate,
            max_rate=min(self.max_rate, self.fold_rate),
            fold_rate=self.fold_rate,
            count_at_15m=self.count_at_15m * self.detection_probability,  # (RAD.10)
            count_falloff=self.count_falloff,
            count_max=self.count_max * self.detection_probability,  # (RAD.10)
            clutter=self.clutter,
            profile=self.profile,
        )


def fault_of_mount(mount: tuple[float, float, float]) -> str:
    """What is wrong with a mount x, y [m], heading [rad], in words; empty where it can be right."""
    if np.shape(mount) != (3,):
        return f"must be x, y [m] and heading [rad], got {mount}"
    if (np.abs(mount[:2]) > MAX_MOUNT).any():
        return f"is {mount[0]:g} m, {mount[1]:g} m from the vehicle's centre, outside of any vehicle; give metres"
    if abs(mount[2]) > 2 * np.pi:
        return f"has the heading {mount[2]:g} rad, more than a turn; it is in rad: for degrees write np.radians(...)"
    return ""


def numeric() -> list[str]:
    """Names of the fields of a `Sensor` that are numbers."""
    return [one.name for one in fields(Sensor) if one.name not in ("profile", "roadside", "aspects", "persistence")]


@dataclass(frozen=True)
class Radar:
    """A rig of mounted radars; those that measure at one instant share a scan."""

    name: str
    note: str  # where its figures come from, one line
    sensors: tuple[Sensor, ...]
    rate: float | None = None  # [1/s] of scans; None: one every simulated frame
    ghosts: Ghosts | None = None  # None: no ghosts
    compiled: bool = field(default=True, repr=False)  # where the extra `fast` is installed; the same to rounding

    def __post_init__(self) -> None:
        if not self.sensors:
            raise ValueError(f"{self.name}: sensors is empty; a rig needs at least one")
        if not isinstance(self.sensors, tuple) or not all(isinstance(sensor, Sensor) for sensor in self.sensors):
            raise ValueError(f"{self.name}: sensors must be a tuple of Sensor, got {self.sensors!r}")
        if self.rate is not None and not self.rate > 0:
            raise ValueError(f"{self.name}: rate must be positive, got {self.rate}; None scans every frame")

    @cached_property
    def models(self) -> tuple[SensorModel, ...]:
        """Data sheets for a tracker, in the order of `Scan.sensor`."""
        return tuple(sensor.model for sensor in self.sensors)

    @cached_property
    def _columns(self) -> dict[str, NDArray]:
        return {name: np.array([getattr(s, name) for s in self.sensors], float) for name in numeric()}

    def column(self, name: str, scale: float = 1.0) -> NDArray:
        """One parameter (S,) of all sensors."""
        return scale * self._columns[name]

    @cached_property
    def _aspects(self) -> dict[str, NDArray] | None:
        """Parameters by name, (S,) or (S, 3), of all sensors; None where to none of them sides differ."""
        if all(sensor.aspects is None for sensor in self.sensors):
            return None
        given = [s.aspects or Aspects.alike(s.count_max, s.count_shape) for s in self.sensors]
        return {one.name: np.array([getattr(a, one.name) for a in given], float) for one in fields(Aspects)}

    @cached_property
    def _body_figures(self) -> BodyFigures:
        """Figures of all sensors that say where on a body its returns lie."""
        lifetime = np.array([sensor.persistence.lifetime if sensor.persistence else 0.0 for sensor in self.sensors])
        column = self.column
        return BodyFigures(
            column("grazing"), column("share_volume"), column("depth_contour"), column("depth_volume"),
            column("share_scatter"), column("scatter"), lifetime, self._aspects,
        )  # fmt: skip

    @cached_property
    def _fan(self) -> Fan | None:
        """What the compiled form needs; None where a sensor has what that has not."""
        more = any(s.roadside or s.persistence or s.aspects for s in self.sensors)
        if more or self.ghosts is not None:
            return None
        _, azimuth, spacing = self._rays
        count = np.array([len(s.azimuths) for s in self.sensors])
        rates = np.array([(m.count_at_15m, m.count_falloff, m.count_max) for m in self.models], float)
        reach, fov = self.column("max_range"), self.column("fov_deg", np.pi / 180)
        figures = np.stack(self._body_figures[:6], -1)
        return Fan(np.cumsum(count) - count, count, azimuth, reach, fov, spacing, rates, figures)

    @cached_property
    def sigma(self) -> NDArray:
        """Standard deviations (S, 3) of range [m], azimuth [rad], range rate [m/s]."""
        azimuth = self.column("sigma_azimuth_deg", np.pi / 180)
        return np.stack([self.column("sigma_range"), azimuth, self.column("sigma_rate")], -1)

    @cached_property
    def cells(self) -> NDArray:
        """Resolution cells (S, 3) in range [m], azimuth [rad], range rate [m/s]."""
        azimuth = self.column("cell_azimuth_deg", np.pi / 180)
        return np.stack([self.column("cell_range"), azimuth, self.column("cell_rate")], -1)

    def scan(self, scene: Scene, rng: np.random.Generator) -> tuple[Scan, Origin]:
        """Detections (M,) of all sensors at one instant, without padding, and the origin of each.

        Raises:
            ValueError: a scene that is not finite, or whose bodies do not fit together.
        """
        check_scene(scene)
        at = Mounted.on(scene.ego.platform, self.column("mount"))
        pose, velocity = at
        fan = self._fan if self.compiled and available() else None
        if fan is not None and (seen := look(fan, pose, scene)) is not None:
            counts = self._counts(seen.expected, self.column("count_shape")[:, None], rng)
            parts: tuple[Returns, ...] = (self._wheeled(seen.returns(scene, counts, velocity, rng), scene, at, rng),)
            if len(scene.walls):
                parts += (self._off_walls(scene.walls, seen.rail(self._beams(pose), scene.walls), at, rng),)
            return self._measured(scene, at, parts, seen.expected, seen.share, rng)
        edges = outline_edges(scene.bodies.outline)
        elements, visible, rail = illuminate(
            self._beams(pose), edges, scene.bodies.owner, len(scene.objects.id), scene.walls
        )
        expected, shape = self.expected(visible), self.column("count_shape")[:, None]
        if self._aspects is not None:
            sides = shown(scene.objects.pose, pose[:, None, :2])
            expected = self._expected_by_aspect(self._aspects, visible, sides, scene.objects.kind)
            shape = interpolated(self._aspects["count_shape"], sides)  # (RAD.31)
        counts = self._counts(expected, shape, rng)
        vehicles = vehicle_returns(self._body_figures, scene, elements, edges, counts, at, rng)
        vehicles = self._wheeled(vehicles, scene, at, rng)
        walls = self._off_walls(scene.walls, rail, at, rng)
        around = [
            roadside_returns(sensor.roadside, s, sensor.model, scene, pose[s], velocity[s], elements, rng)
            for s, sensor in enumerate(self.sensors)
            if sensor.roadside is not None
        ]
        parts = (vehicles, walls, *around)
        if self.ghosts is not None:
            parts += (
                draw_ghosts(self.ghosts, Rig(pose, velocity, *self._ghost_columns), scene, edges, elements, rail, rng),
            )
        return self._measured(scene, at, parts, expected, visible.share, rng)

    def _wheeled(self, returns: Returns, scene: Scene, at: Mounted, rng: np.random.Generator) -> Returns:
        share = self.column("wheels")
        return with_wheels(returns, share, scene.bodies, at, rng) if share.any() else returns

    def _off_walls(self, walls: NDArray, rail: Illuminated, at: Mounted, rng: np.random.Generator) -> Returns:
        density, falloff = self.column("static_density"), self.column("count_falloff")
        return wall_returns(density, falloff, walls, rail, at, rng)

    def _measured(
        self, scene: Scene, at: Mounted, parts: tuple[Returns, ...], expected: NDArray, share: NDArray,
        rng: np.random.Generator,
    ) -> tuple[Scan, Origin]:  # fmt: skip
        """The scan of true returns: cells, noise, false alarms; expected and share (S, N) go into the origin."""
        true = join(parts)
        merged, number = merge_cells(true, self.cells[true.sensor])
        sigma = self.sigma[merged.sensor] / (number ** self.column("cell_power")[merged.sensor])[:, None]  # (RAD.39)
        seen = merged._replace(polar=add_noise(merged.polar, sigma, rng))
        alarms = false_alarms(self.column("clutter"), self.column("max_range"),
                              self.column("fov_deg", np.pi / 180), self.column("max_rate"), rng)  # fmt: skip
        got, due = join((seen, alarms)), self.due(scene.time, scene.dt)
        got = got if due.all() else rows(got, due[got.sensor])
        got = got._replace(polar=fold_rates(got.polar, self.column("fold_rate")[got.sensor]))
        s = got.sensor
        mask, platform = np.ones(len(s), bool), scene.ego.platform
        scan = Scan(got.polar, mask, at.pose[s], at.velocity[s], self.sigma[s], s, platform, due)
        visible = share[due].max(0, initial=0.0)
        return scan, Origin(got.object, got.body, got.edge, got.kind, expected[due].sum(0), visible)

    def due(self, time: float, dt: float) -> NDArray:
        """Mask (S,) of the sensors that measure in a scan at `time` [s], dt [s] after the one before."""
        rate, phase = self.column("rate"), self.column("phase")
        with np.errstate(invalid="ignore"):
            now, before = (np.floor(t * rate - phase + 1e-6) for t in (time, time - max(dt, 2e-6)))  # (RAD.25)
        return np.isinf(rate) | (now > before)  # (RAD.25)

    @cached_property
    def _rays(self) -> tuple[NDArray, NDArray, NDArray]:
        """Sensor (B,) and azimuth (B,) [rad] of all rays, and their spacing (S,) [rad]."""
        count = [len(sensor.azimuths) for sensor in self.sensors]
        azimuth = np.concatenate([sensor.azimuths for sensor in self.sensors])
        return np.repeat(np.arange(len(count)), count), azimuth, self.column("fov_deg", np.pi / 180) / count

    def _beams(self, pose: NDArray) -> Beams:
        """The rays of all sensors at poses (S, 3)."""
        sensor, azimuth, spacing = self._rays
        return Beams(pose, sensor, pose[sensor, 2] + azimuth, spacing, self.column("max_range"))

    @cached_property
    def _ghost_columns(self) -> tuple[NDArray, ...]:
        """What ghosts need to know of the sensors, wherever they are: the fields of `Rig` after the first two."""
        column = self.column
        count = np.stack([column(name) for name in ("count_at_15m", "count_falloff", "count_max")])
        count[[0, 2]] *= column("detection_probability")  # (RAD.10)
        return column("max_range"), count, column("count_shape"), column("depth_contour"), self._rays[2]

    def expected(self, visible: Visible) -> NDArray:
        """Expected detections (S, N) of every object by every sensor, occlusion included, before cells merge any."""
        return _expected(self.models, visible)

    def _expected_by_aspect(self, p: Parameters, visible: Visible, sides: NDArray, kinds: tuple[str, ...]) -> NDArray:
        """Expected detections (S, N) of objects that show the shares (S, N, 3) of their sides."""
        unlimited = _expected([replace(m, count_max=np.inf) for m in self.models], visible)
        limit = self.column("detection_probability")  # (RAD.10)
        return np.where(visible.chord > 0, mean_counts(p, unlimited, visible.share, sides, kinds, limit), 0.0)

    def _counts(self, expected: NDArray, shape: NDArray, rng: np.random.Generator) -> NDArray:
        """Numbers of detections (S, N) in this scan, of count shapes (S, N) or (S, 1)."""
        p = self.column("detection_probability")[:, None]
        mean = expected / np.where(p > 0, p, 1.0)
        counts = draw_counts(mean, shape, rng)  # (RAD.11)
        return np.where(rng.random(expected.shape) < p, counts, 0)  # (RAD.12)


def _expected(models: Sequence[SensorModel], visible: Visible) -> NDArray:
    """Expected detections (S, N) by the data sheets of S sensors, 0 of what is not visible."""
    seen = visible.chord > 0
    nearest = np.where(seen, visible.nearest, 1.0)
    rate = [m.expected_count(r, c) for m, r, c in zip(models, nearest, visible.chord, strict=True)]  # (RAD.9)
    return np.where(seen, rate, 0.0)
