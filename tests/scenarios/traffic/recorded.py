"""Small recordings of a straight road of three lanes, written in every layout."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

FOOT = 0.3048
LANES = (2.0, 5.7, 9.4)  # [m] lateral places, y to the right
LENGTH, WIDTH = 4.4, 1.8  # [m] of all but one
TRUCK, LONG, WIDE = 9, 12.0, 2.5  # a truck: which, and its length and width [m]

Row = tuple[float, int, float, float, int]  # time, id, x, y (to the right), lane


def traffic(rate: float = 10.0, seconds: float = 6.0, speed: float = 20.0, gap: float = 30.0) -> list[Row]:
    """Twelve vehicles at constant speed, four in each lane; ids 1, 4, 7, 10 in the left lane, rear to front."""
    rows = []
    for k in range(12):
        for f in range(round(seconds * rate) + 1):
            x = 20.0 + gap * (k // 3) + 5.0 * (k % 3) + speed * f / rate
            rows.append((f / rate, k + 1, x, LANES[k % 3], k % 3))
    return rows


def size(i: int) -> tuple[float, float]:
    """Length and width [m] of a vehicle."""
    return (LONG, WIDE) if i == TRUCK else (LENGTH, WIDTH)


def write(path: Path, header: str, rows: Iterable[Row], line: Callable[..., str]) -> Path:
    path.write_text("\n".join([header, *(line(*row) for row in rows)]) + "\n")
    return path


def own(path: Path, rows: Iterable[Row] | None = None) -> Path:
    """The own layout: y to the left."""
    return write(
        path, "time,id,x,y,length,width,lane", traffic() if rows is None else rows,
        lambda t, i, x, y, lane: f"{t:.2f},{i},{x!r},{-y!r},{size(i)[0]},{size(i)[1]},{lane}",
    )  # fmt: skip


def ngsim(path: Path, noise: float = 0.0) -> Path:
    """NGSIM: feet, the middle of the front, x across."""
    rng = np.random.default_rng(1)
    return write(
        path, "Vehicle_ID,Frame_ID,Local_X,Local_Y,v_length,v_Width,v_Class,Lane_ID", traffic(),
        lambda t, i, x, y, lane: ",".join(map(str, (
            i, round(10 * t), (y + noise * rng.standard_normal()) / FOOT,
            (x + size(i)[0] / 2 + noise * rng.standard_normal()) / FOOT,
            size(i)[0] / FOOT, size(i)[1] / FOOT, 3 if i == TRUCK else 2, lane + 1,
        ))),
    )  # fmt: skip


def high_d(path: Path) -> Path:
    """highD: 25 Hz, the upper left corner, length called width."""
    return write(
        path, "frame,id,x,y,width,height,xVelocity,yVelocity,laneId", traffic(rate=25.0),
        lambda t, i, x, y, lane: ",".join(map(str, (
            round(25 * t), i, x - size(i)[0] / 2, y - size(i)[1] / 2, *size(i), 20, 0, lane + 5,
        ))),
    )  # fmt: skip


def exi_d(path: Path) -> Path:
    """exiD: 25 Hz, degrees, y to the left; here a road that runs to the north-east."""
    a = np.pi / 4
    return write(
        path, "recordingId,trackId,frame,xCenter,yCenter,heading,width,length", traffic(rate=25.0),
        lambda t, i, x, y, lane: ",".join(map(str, (
            0, i, round(25 * t), x * np.cos(a) + y * np.sin(a), x * np.sin(a) - y * np.cos(a), 45.0, *size(i)[::-1],
        ))),
    )  # fmt: skip


def common_road(path: Path) -> Path:
    """CommonRoad: states in steps of 0.1 s, y to the left."""
    cars: dict[int, list[str]] = {}
    for t, i, x, y, _ in traffic():
        tag = "state" if t else "initialState"
        cars.setdefault(i, []).append(
            f"<{tag}><position><point><x>{x}</x><y>{-y}</y></point></position><orientation><exact>0.0</exact>"
            f"</orientation><time><exact>{round(10 * t)}</exact></time></{tag}>"
        )
    box = "<length>{}</length><width>{}</width>"
    text = "".join(
        f'<dynamicObstacle id="{i}"><type>{"truck" if i == TRUCK else "car"}</type><shape><rectangle>'
        f"{box.format(*size(i))}</rectangle></shape>"
        f"{states[0]}<trajectory>{''.join(states[1:])}</trajectory>"
        "</dynamicObstacle>"
        for i, states in cars.items()
    )
    path.write_text(f'<commonRoad commonRoadVersion="2020a" timeStepSize="0.1">{text}</commonRoad>')
    return path
