"""The tables of `testbed calibrate`: real beside simulated statistics, with intervals and verdicts.

A statistic is met where simulated / real is within 10 % of one. Its interval is the 90 % bootstrap interval of that
ratio over blocks of frames; both sides are drawn together, as they have the same vehicles.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.table import Table

import sensors
from studies.calibration.statistics import ASPECTS, BANDS, NAMES, groups, halves, read_real, simulate, statistics, sums

WITHIN = 0.1  # of the real statistic
LEVEL = 0.9
DRAWS = 400  # of the bootstrap
REPEAT = 4  # scans of each frame
SEED = 0
TITLES = (
    "facing half",
    "< 0.2 m",
    "< 0.4 m",
    "deeper",
    "outside",
    "rms u",
    "rms v",
    "median",
    "mean",
    "std",
)
SHARES = 7  # the first of NAMES; the others are counts
PAGES = {
    "range": ("all", *(f"{low:.0f}-{high:.0f} m" for low, high in BANDS)),
    "aspect": ASPECTS,
    "kind": ("van", "truck", "bus", "motorcycle"),
}
NOTE = "Marks: * simulated not within 10 % of real; ? the 90 % interval of their ratio has both verdicts in it"


class Compared(NamedTuple):
    """One group of vehicles: K statistics of the real and of the simulated ones."""

    vehicles: int
    real: NDArray  # (K,)
    simulated: NDArray  # (K,)
    low: NDArray  # (K,) of simulated / real
    high: NDArray  # (K,)

    @property
    def ratio(self) -> NDArray:
        """Simulated / real (K,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.simulated / self.real

    @property
    def met(self) -> NDArray:
        """Mask (K,) of statistics within 10 % of the real one."""
        return np.abs(self.ratio - 1) <= WITHIN

    @property
    def sure(self) -> NDArray:
        """Mask (K,) of verdicts on which the whole interval agrees."""
        inside = (self.low >= 1 - WITHIN) & (self.high <= 1 + WITHIN)
        return np.where(self.met, inside, (self.high < 1 - WITHIN) | (self.low > 1 + WITHIN))

    @property
    def marks(self) -> list[str]:
        """One mark a statistic: empty, `?`, `*?` or `*`, see NOTE."""
        return ["*" * (not m) + "?" * (not s) for m, s in zip(self.met, self.sure, strict=True)]


def compare(real: NDArray, simulated: NDArray, block: NDArray, draws: int, rng: np.random.Generator) -> Compared:
    """Statistics of N vehicles from sums (N, 8) and (R, N, 8) of R scans; block (N,) are the units of the bootstrap."""
    found, unit = np.unique(block, return_inverse=True)
    members = [np.flatnonzero(unit == k) for k in range(len(found))]
    ratio = np.full((draws, len(NAMES)), np.nan)
    for k in range(draws if len(found) > 1 else 0):
        rows = np.concatenate([members[i] for i in rng.integers(len(found), size=len(found))])
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio[k] = statistics(simulated[:, rows].reshape(-1, 8)) / statistics(real[rows])
    tail = 50 * (1 - LEVEL)
    usable = np.isfinite(ratio).all()  # a group of few vehicles has no interval
    low, high = np.percentile(ratio, [tail, 100 - tail], axis=0) if usable else np.full((2, len(NAMES)), np.nan)
    return Compared(len(real), statistics(real), statistics(simulated.reshape(-1, 8)), low, high)


def compared(
    data: Path | None = None, radar: str = "imaging", held_out: bool = True, repeat: int = REPEAT, draws: int = DRAWS
) -> dict[str, Compared]:
    """Every group that has vehicles in the half that is held out, or in the half that radars are fitted on."""
    real = halves(read_real(data))[held_out]
    rng = np.random.default_rng(SEED)
    twins = sums(simulate(sensors.find(radar), real, rng, repeat)).reshape(repeat, len(real.pose), -1)
    table, block = sums(real), real.block
    return {
        name: compare(table[rows], twins[:, rows], block[rows], draws, rng)
        for name, rows in groups(real).items()
        if rows.any()
    }


def cells(one: Compared) -> list[str]:
    """Real/simulated and mark of each statistic."""
    digits = [2] * SHARES + [0] * (len(NAMES) - SHARES)
    rows = zip(one.real, one.simulated, digits, one.marks, strict=True)
    return [
        f"{a:.{d}f}/{b:.{d}f}{mark}".replace("0.", ".") if d else f"{a:.0f}/{b:.0f}{mark}" for a, b, d, mark in rows
    ]


def tables(found: dict[str, Compared], radar: str = "imaging") -> list[Table]:
    """By range, by aspect and by kind, real/simulated, of groups that have vehicles; each fits 80 columns."""
    report = []
    for what, names in PAGES.items():
        shown = {name: found[name] for name in names if name in found}
        if not shown:
            continue
        title = f"{radar} on held-out {'vehicles' if what == 'kind' else 'cars'}, by {what}: real/simulated"
        table = Table(title=title, box=box.SIMPLE, padding=(0, 0, 0, 1), caption=NOTE)
        table.add_column("", no_wrap=True)
        for name in shown:
            table.add_column(name, justify="right")
        table.add_row("vehicles" if what == "kind" else "cars", *(str(one.vehicles) for one in shown.values()))
        columns = [cells(one) for one in shown.values()]
        for k, label in enumerate(TITLES):
            table.add_row(label, *(column[k] for column in columns))
        table.add_row("met", *(f"{one.met.sum()} of {len(NAMES)}" for one in shown.values()))
        report.append(table)
    return report


def report(data: Path | None = None, radar: str = "imaging", repeat: int = REPEAT, draws: int = DRAWS) -> list[Table]:
    """The tables of the held-out half."""
    return tables(compared(data, radar, repeat=repeat, draws=draws), radar)
