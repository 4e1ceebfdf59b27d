"""The run from above as a GIF, drawn from the contents of its page; no viewer is needed."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from testbed.files import atomic_file, check_target
from testbed.log import palette
from testbed.log.palette import css
from testbed.log.review import readable
from testbed.log.review_page.contents import CM, contents, ring_at

RATE = 5.0  # [1/s] pictures of the animation
WIDE, HIGH = 800, 260  # pixels
SCALE = 6.2  # [pixels/m]
AT = 0.42  # share of the width before which the ego is
COLORS = 48  # of the palette of the file

Drawn = dict[str, Any]


def write(log: str | Path, gif: str | Path) -> Path:
    """Write the animation of a log; raises OSError or ValueError, in one sentence, where that cannot be."""
    gif = Path(gif)
    if gif.suffix.lower() != ".gif":
        raise ValueError(f"an animation is a .gif file, got {gif}")
    check_target(gif)
    readable(log)
    data = contents(log)
    if not data["ego"]:
        raise ValueError(f"the log {log} holds numbers only; record it with --log full")
    wanted = np.arange(data["time"][0], data["time"][-1] + 1e-9, 1 / RATE)
    frames = np.minimum(np.searchsorted(data["time"], wanted - 1e-6), len(data["time"]) - 1)
    pictures = [picture(data, int(k)).quantize(COLORS, dither=Image.Dither.NONE) for k in frames]
    gif.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(gif) as file:
        pictures[0].save(
            file, "GIF", save_all=True, append_images=pictures[1:], duration=round(1000 / RATE), loop=0, optimize=True
        )
    return gif


def picture(data: Drawn, k: int) -> Image.Image:
    """Scan k of the run: road, detections, truth dimmed by what is visible, tracks of all trackers, time."""
    image = Image.new("RGB", (WIDE, HIGH), css(palette.GROUND))
    pen = ImageDraw.Draw(image)
    ego = np.array(data["ego"][k][1:3]) / CM
    _road(pen, data["road"], ego)
    for kind, flat in zip(data["kinds"], data["detections"][k], strict=True):
        for x, y in _on_screen(np.reshape(flat, (-1, 2)) / CM, ego):
            pen.ellipse((x - 1.5, y - 1.5, x + 1.5, y + 1.5), fill=kind["color"])
    for i, tracker in enumerate(data["trackers"]):
        for number, *where in data["trackers"][i]["tracks"][k]:
            _ring(pen, data, where, ego, tracker["color"], 2)
            x, y = _on_screen(np.array([where[1:3]]) / CM, ego)[0]
            pen.text((x + 16 * i, y + 9), str(number), fill=tracker["color"])
    for _, visible, *where in data["truth"][k]:
        color = palette.dimmed(palette.TRUTH, np.array([visible / 100]))[0]
        _ring(pen, data, where, ego, css(int(color)), 1)
    _ring(pen, data, data["ego"][k], ego, css(palette.EGO), 2)
    pen.text((8, HIGH - 18), f"{data['time'][k]:5.1f} s   {data['run']['scenario']}", fill=css(palette.TRUTH))
    _legend(pen, data)
    return image


def _legend(pen: ImageDraw.ImageDraw, data: Drawn) -> None:
    """Who is drawn in which colour, in the last line from the right."""
    words = [("ego", css(palette.EGO)), ("truth", css(palette.TRUTH))]
    words += [(tracker["name"], tracker["color"]) for tracker in data["trackers"]]
    used = [any(frame[i] for frame in data["detections"]) for i in range(len(data["kinds"]))]
    words += [(kind["name"], kind["color"]) for kind, there in zip(data["kinds"], used, strict=True) if there]
    x = WIDE - 8.0
    for word, color in reversed(words):
        x -= pen.textlength(word)
        pen.text((x, HIGH - 18), word, fill=color)
        x -= 14


def _on_screen(points: np.ndarray, ego: np.ndarray) -> np.ndarray:
    """Pixels (n, 2) of places (n, 2) [m]."""
    return (points - ego) * SCALE + np.array([AT * WIDE, HIGH / 2])


def _ring(pen: ImageDraw.ImageDraw, data: Drawn, place: Sequence[int], ego: np.ndarray, color: str, width: int) -> None:
    shape, x, y, turn = place
    pixels = _on_screen(ring_at(data["shapes"][shape], x, y, turn), ego)
    pen.line([*map(tuple, pixels.tolist())], fill=color, width=width)


def _road(pen: ImageDraw.ImageDraw, road: Drawn, ego: np.ndarray) -> None:
    def lines(flat: list[list[int]], color: int, width: list[int]) -> None:
        for line, wide in zip(flat, width, strict=True):
            pixels = _on_screen(np.reshape(line, (-1, 2)) / CM, ego)
            pen.line([*map(tuple, pixels.tolist())], fill=css(color), width=wide)

    lines(road["surface"], palette.SURFACE, [round(2 * h / CM * SCALE) for h in road["half"]])
    lines(road["lanes"], palette.LANE, [1] * len(road["lanes"]))
    lines(road["edges"], palette.EDGE, [1] * len(road["edges"]))
