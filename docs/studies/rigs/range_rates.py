"""Range rates of the radar that `imaging` is fitted to: docs/results/range-rates.json, for docs/radars.md.

The data are whole scans of M. Meyer, G. Kuschk, "Automotive Radar Dataset for Deep Learning Based 3D Object
Detection", EuRAD 2019 (CC BY-NC-SA 4.0); they stay outside this project. Its range rates come in equal steps and are
known up to a lap, the number of steps times the step; the ego's speed is not given and is fitted.
"""

from itertools import pairwise
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray

from studies.standing.statistics import STILL, spread
from testbed.command_line.terminal import console, user_input
from testbed.files import read_arrays, write_json

FASTEST, SLIP = 30.0, 1.0  # [m/s] of the radar, ahead and across, that are tried
ROUNDS, SHARP = 10, 0.05  # of the fit; [m/s] at which a detection counts half


class Steps(NamedTuple):
    """The grid that range rates lie on."""

    width: float  # [m/s] of a step
    number: int

    @property
    def lap(self) -> float:
        """Range rates [m/s] that differ by so much look alike."""
        return self.width * self.number

    def folded(self, rate: NDArray) -> NDArray:
        """Rates (...) [m/s] within half a lap of 0."""
        return (rate + self.lap / 2) % self.lap - self.lap / 2


def steps_of(rate: NDArray) -> Steps:
    """The grid of range rates (M,) [m/s] that all lie on one; ValueError where they do not."""
    values = np.unique(np.round(rate, 5))
    width = float(np.median(np.diff(values))) if len(values) > 1 else 0.0
    count = 1 + round(float(np.ptp(values)) / width) if width else 0
    if not width or np.abs(np.diff(values) / width - np.rint(np.diff(values) / width)).max() > 0.01:
        raise ValueError("data: range rates do not lie on a grid; give the whole scans of the extract")
    return Steps(float(np.ptp(values)) / (count - 1), count)


def rest_of(sight: NDArray, rate: NDArray, steps: Steps) -> NDArray:
    """Rates (M,) [m/s] less those of standing things along sight (M, 2), under the ego motion that explains most."""
    ahead = np.arange(-FASTEST, FASTEST, 0.1)
    fits = [np.sum(np.abs(steps.folded(rate + v * sight[:, 0])) < steps.width) for v in ahead]
    first = ahead[int(np.argmax(fits))]
    near = [np.array([first + dv, w]) for dv in np.arange(-0.3, 0.31, 0.05) for w in np.arange(-SLIP, SLIP, 0.05)]
    fits = [np.sum(np.abs(steps.folded(rate + sight @ v)) < steps.width) for v in near]
    v = near[int(np.argmax(fits))]
    for _ in range(ROUNDS):
        rest = steps.folded(rate + sight @ v)
        weight = np.where(np.abs(rest) < STILL, 1 / (1 + (rest / SHARP) ** 2), 0.0)
        v = v - np.linalg.solve((sight * weight[:, None]).T @ sight, (sight * weight[:, None]).T @ rest)
    return steps.folded(rate + sight @ v)


def measured(folder: Path) -> dict[str, float]:
    """Numbers of the page; ValueError, in one sentence, where there are no whole scans."""
    files = sorted(folder.glob("scans_*.npz"))
    if not files:
        raise ValueError(f"data: {folder} has no scans_*.npz; give the folder of the extract")
    arrays = read_arrays(files[0], ("points", "offsets"))
    points, offsets = arrays["points"].astype(float), arrays["offsets"]
    r = np.sqrt((points[:, :3] ** 2).sum(-1))
    sight, rate = points[:, :2] / r[:, None], points[:, 3]
    steps = steps_of(rate)
    rests = [rest_of(sight[a:b], rate[a:b], steps) for a, b in pairwise(offsets)]
    standing = [rest[np.abs(rest) < STILL] for rest in rests]
    low, high = np.quantile([spread(rest) for rest in standing], (0.25, 0.75))
    return {
        "scans": len(rests),
        "detections": len(rate),
        "standing": sum(map(len, standing)),
        "step": round(steps.width, 4),
        "steps": steps.number,
        "spread": round(spread(np.concatenate(standing)), 3),
        "spread_low": round(float(low), 3),
        "spread_high": round(float(high), 3),
    }


def main(
    data: Annotated[Path, typer.Argument(help="Folder with scans_*.npz of the real extract.")],
    out: Annotated[Path, typer.Option(help="The JSON file.")] = Path("docs/results/range-rates.json"),
) -> None:
    """How fine and how good the range rates are of the radar that `imaging` is fitted to, for docs/radars.md."""
    with user_input((OSError, ValueError)):
        write_json(out, measured(data))
    console.print(f"results  {out}", soft_wrap=True)
