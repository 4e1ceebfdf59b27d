"""The measures of a drive and of a pair of drives: units, which side they belong to, which way is better."""

from typing import NamedTuple

RISK, LOSS, OVERALL = "risk", "loss", "overall"


class Measure(NamedTuple):
    """One number of a drive, or of a drive beside another one of the same seed."""

    key: str  # column of `drives.parquet`; of a pair: see `pairs`
    label: str
    unit: str
    digits: int
    side: str
    better: int  # 1: more is better, -1: less is better

    @property
    def title(self) -> str:
        """Name with its unit."""
        return self.label if self.unit == "1" else f"{self.label} [{self.unit}]"


MEASURES = (
    Measure("J", "J", "s", 2, OVERALL, 1),
    Measure("collided", "collisions", "1", 2, RISK, -1),
    Measure("drac_max", "max DRAC", "m/s^2", 2, RISK, -1),
    Measure("tit", "TIT", "s^2", 2, RISK, -1),
    Measure("ttc_min", "min TTC", "s", 2, RISK, 1),
    Measure("headway_min", "min headway", "s", 2, RISK, 1),
    Measure("progress", "progress", "m", 1, LOSS, 1),
    Measure("brake_max", "max braking", "m/s^2", 2, LOSS, -1),
    Measure("jerk", "jerk", "m/s^3", 2, LOSS, -1),
)
PAIRED = (  # only of a drive beside another one
    Measure("extra_braking", "extra braking", "m/s", 2, LOSS, -1),
    Measure("speed_difference", "speed difference", "m/s", 2, LOSS, -1),
    Measure("changed", "decisions changed", "%", 0, LOSS, -1),
)
KEYS = {m.key: m for m in (*MEASURES, *PAIRED)}
TABLE = ("J", "collided", "drac_max", "tit", "progress", "brake_max", "extra_braking", "changed")
BOTH_SIDES = ("tit", "progress")  # the measure of each side that tells trackers apart with the fewest seeds
TRACKING = {  # errors of the tracker in its own drive: label, unit
    "gospa": ("GOSPA", "m"), "rmse_position": ("position RMSE", "m"), "rmse_velocity": ("velocity RMSE", "m/s"),
    "rmse_length": ("length RMSE", "m"), "birth_delay": ("birth delay", "s"), "missed_percent": ("missed", "%"),
}  # fmt: skip
