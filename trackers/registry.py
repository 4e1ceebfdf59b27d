"""TRACKERS: the table of filters and layers from which `build` makes multi-object trackers."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any

from trackers.composed import Composed, composed, place_of
from trackers.dra import DataRegion
from trackers.filter import Filter
from trackers.htg.learned import HTGLearned, HTGMoment
from trackers.htg.map import HTGMap
from trackers.htg.online import HTGOnline
from trackers.lookup import check_types, find_own, is_own, look_up, parameters_of, parse, with_parameters
from trackers.multi.association import Association
from trackers.multi.ground import GroundTest
from trackers.multi.reidentification import Reidentification
from trackers.multi.tracker import MultiObjectTracker
from trackers.pmht import AdaptiveSpline, Learner, SplinePmht, Walk
from trackers.random_matrix.adaptation import GaussNewton
from trackers.random_matrix.feldmann import RandomMatrix
from trackers.random_matrix.koch import Koch
from trackers.random_matrix.virtual_measurements import VirtualMeasurements
from trackers.scan import SensorModel


@dataclass(frozen=True)
class Entry:
    """One tracker: its filter with its parameters, and where it comes from."""

    name: str
    filter: Any  # a Filter
    source: str  # paper, and the page of its method
    layers: Mapping[str, Any] = field(default_factory=dict)  # parameters of its `MultiObjectTracker`


KOCH = Koch(rate_weight=0.3)  # the weight of the other filters
VMM = VirtualMeasurements(KOCH, GaussNewton(gain=0.1, damping=0.3))  # few detections a scan: small steps
SPLINE = SplinePmht(
    "surround-car+surround-truck",
    walk=Walk(speed=0.4, yaw_rate=0.026, size=1e-3),  # motorway at 15 Hz
    position_std=(0.05, 0.1),
    outward=1.0,
    doubt=0.9,
)
DRA = DataRegion(models=("cv",), prior="uniform", parameters="alone", centre_std=0.4)  # as in rm-vmm
DRA_IMM = replace(DRA, models=("cv", "ca", "ct"), parameters="road", form="soft")  # as good here, and cheaper

OURS = MappingProxyType(
    {
        "ground": GroundTest(),
        "edge_sigmas": 1.0,
        "as_whole": True,
        "association": Association(static_inside=(0.5, 1.2), fades=0.25),
        "reidentification": Reidentification(hidden=0.6),
    }
)

TRACKERS: Mapping[str, Entry] = MappingProxyType(
    {
        e.name: e
        for e in (
            Entry("rm-feldmann", RandomMatrix(), "Feldmann et al. (2011), as in Xia et al. (2020), eq. (13)-(15)"),
            Entry("rm-feldmann-matched", RandomMatrix(rho=0.55), "the same, rho matched to detections on the outline"),
            Entry("rm-surface", RandomMatrix(surface=0.85), "ours: rm-feldmann, centred behind the visible side"),
            Entry(
                "rm-koch", KOCH, "Koch (2008), innovation corrected, with range rates; docs/methods/random-matrices.md"
            ),
            Entry("rm-vmm", VMM, "Hoher et al. (2022) on rm-koch, Gauss-Newton; docs/methods/virtual-measurements.md"),
            Entry(
                "htg-rm",
                HTGOnline(rounds=1),
                "Xia et al. (2020), bounds from each scan; docs/methods/hierarchical-truncated-gaussians.md",
            ),
            Entry("htg-rm-learned", HTGLearned(), "Xia et al. (2020), literal update on learned tables"),
            Entry(
                "htg-rm-learned-n",
                HTGLearned("surround-car+surround-truck", n_count=True, iterations=20),
                "the same, repaired: converged, and counting detections only, not pseudo-measurements",
            ),
            Entry("htg-mm", HTGMoment(), "ours: moment-matched update on learned tables"),
            Entry(
                "htg-map",
                HTGMap(shape_std=(0.1, 0.15)),
                "ours: maximum a posteriori update on learned tables, by Fisher scoring",
            ),
            Entry(
                "dra",
                DRA,
                "data-region association of Xu et al. (2023), one motion model; docs/methods/data-regions.md",
            ),
            Entry("dra-imm", DRA_IMM, "the same with interacting motion models"),
            Entry(
                "edra-imm",
                replace(DRA_IMM, prior="rays"),
                "the same with a prior of the regions from the sensor's rays",
            ),
            Entry(
                "pmht-spline",
                SPLINE,
                "Yao et al. (2021): ellipses on a B-spline, weighed by visibility; docs/methods/spline-pmht.md",
            ),
            Entry(
                "pmht-spline-adaptive",
                AdaptiveSpline(Learner(SPLINE)),
                "the same, its contour learned on the way, and its class",
            ),
            Entry(
                "imm-htg",
                composed(HTGMap(shape_std=(0.03, 0.05)), size="ends", motion=True),  # the size has its own uncertainty
                "ours: htg-map for the place, motion modes and size from both ends around it; docs/layers.md",
                OURS,
            ),
            Entry(
                "imm-spline",
                composed(SPLINE, size="ends", motion=True),
                "ours: the same around pmht-spline, which has a contour",
                OURS,
            ),
        )
    }
)

LAYERS = frozenset(f.name for f in fields(MultiObjectTracker)) - {"filter", "sensors", "road"}
WORDS = frozenset({"size", "motion", "compiled"})  # parameters of `composed`


def find(name: str, **parameters: Any) -> Filter:
    """The filter of that name, or of MODULE:OBJECT, with some parameters changed.

    Of a composed one, parameters are those of its filter of the place, and `size` and `motion`; its size reads
    detections by a default data sheet until `on(sensors)` gives it those of the sensors.

    >>> find("rm-feldmann", sigma=0.3).sigma
    0.3

    Raises:
        LookupError: no such tracker; the nearest name is suggested.
        TypeError: the filter has no such parameter.

    """
    if is_own(name, TRACKERS):
        return with_parameters(find_own(name, TRACKERS, "tracker"), name, parameters)
    filter = look_up(name, TRACKERS, "tracker").filter
    _check_known(name, parameters, [*parameters_of(place_of(filter)), *sorted(WORDS)], parameters)
    return _changed(filter, name, parameters)


def build(text: str, sensors: Sequence[SensorModel], **parameters: Any) -> Any:
    """The multi-object tracker over the filter of a name, `NAME`, `NAME:key=value,key=value` or `MODULE:OBJECT:...`.

    A parameter is one of the filter, or `size` or `motion` of `composed`, or else one of `MultiObjectTracker`. An
    OBJECT is a filter, a class or function that makes one, or that makes an object with `start` and `step`, which is
    returned as it is; where it has a parameter `sensors`, it gets the data sheets.

    >>> build("rm-feldmann:sigma=0.3,prune_below=0.01", (SensorModel(),)).filter.sigma
    0.3

    Raises:
        LookupError: no such tracker; the nearest name is suggested.
        TypeError: neither the filter nor the multi-object tracker has such a parameter (ValueError: in the text).
        ValueError: a text that does not read like this, a value that cannot be, or an OBJECT that is no filter.

    """
    name, written = parse(text)
    if written.get("size") is False:  # `size=off` is a word here, not a switch
        written["size"] = "off"
    wanted = {**written, **parameters}
    if is_own(name, TRACKERS):
        return _built(find_own(name, TRACKERS, "tracker"), name, wanted, tuple(sensors))
    entry = look_up(name, TRACKERS, "tracker")
    own = {key: wanted[key] for key in wanted if key in LAYERS and key not in parameters_of(place_of(entry.filter))}
    _check_known(name, wanted, [*parameters_of(place_of(entry.filter)), *sorted(WORDS | LAYERS)], parameters)
    check_types(MultiObjectTracker, name, own)
    filter = _changed(entry.filter, name, {key: value for key, value in wanted.items() if key not in own})
    layers = {**entry.layers, **own}
    if wanted.get("size") == "off":
        layers.pop("ground", None)  # a filter that holds its own size takes the other part of a divided track in again
    return MultiObjectTracker(filter, tuple(sensors), **layers)


def _built(found: Any, name: str, wanted: Mapping[str, Any], sensors: tuple[SensorModel, ...]) -> Any:
    """The multi-object tracker of a user's object."""
    known = parameters_of(found)
    layers = {key: value for key, value in wanted.items() if key in LAYERS | WORDS and key not in known}
    mine = {key: value for key, value in wanted.items() if key not in layers}
    if "sensors" in known and not hasattr(found, "sensors"):  # an object, or a default, has its own
        mine.setdefault("sensors", sensors)
    made = with_parameters(found, name, mine)
    if all(hasattr(made, verb) for verb in ("start", "step")):
        if layers:
            raise ValueError(f"{name} is a whole tracker, which has no parameter {', '.join(layers)}; drop it")
        return made
    if missing := [verb for verb in ("init", "predict", "update", "estimate") if not hasattr(made, verb)]:
        raise ValueError(
            f"tracker {name!r} is {made!r}, which has no {', '.join(missing)}; a filter has init, predict, update and "
            "estimate, a tracker has start and step"
        )
    words = {key: layers.pop(key) for key in WORDS & layers.keys()}
    check_types(MultiObjectTracker, name, layers)
    check_types(composed, name, words)
    return MultiObjectTracker(composed(made, **words), sensors, **layers)


def _changed(filter: Any, name: str, parameters: Mapping[str, Any]) -> Any:
    """The filter with other parameters, and with other parts around it."""
    words = {key: parameters[key] for key in WORDS & parameters.keys()}
    mine = {key: value for key, value in parameters.items() if key not in words}
    check_types(place_of(filter), name, mine)
    check_types(composed, name, words)
    if isinstance(filter, Composed):
        has = {"size": "ends" if filter.size else "off", "motion": filter.motion is not None}
        words = has | {"compiled": filter.compiled} | words
    return composed(replace(place_of(filter), **mine), **words)


def _check_known(name: str, wanted: Collection[str], known: Collection[str], typed: Collection[str]) -> None:
    """Raise TypeError for an unknown parameter that was passed in Python (typed), ValueError for one in a text."""
    if unknown := {*wanted} - {*known}:
        fault = TypeError if unknown & {*typed} else ValueError
        raise fault(f"{name} has no parameter {', '.join(sorted(unknown))}; it has {', '.join(known)}")
