"""The animation of a run: its pictures, their number, and what they show."""

import numpy as np
import pytest
from PIL import Image

from testbed.log.review_page import animation
from testbed.log.review_page.contents import contents
from tests.testbed.log import log_runs

STEPS = 31  # two seconds


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return log_runs.write(tmp_path_factory.mktemp("animation") / "run.rrd", steps=STEPS)


def pixels_of(image, color):
    wanted = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)])
    return int((np.abs(np.asarray(image.convert("RGB")).astype(int) - wanted).max(-1) < 12).sum())


def test_every_fifth_of_a_second_is_a_picture_that_lasts_as_long(log, tmp_path):
    with Image.open(animation.write(log, tmp_path / "deep" / "run.gif")) as gif:
        assert (gif.n_frames, gif.size) == (11, (animation.WIDE, animation.HIGH))
        assert gif.info["duration"] == 200
        first = gif.convert("RGB")
        gif.seek(10)
        assert np.any(np.asarray(first) != np.asarray(gif.convert("RGB")))


def test_a_picture_shows_ego_tracks_and_detections_in_their_colours(log):
    data = contents(log)
    image = animation.picture(data, 5)
    for color in ("#ffffff", *(tracker["color"] for tracker in data["trackers"]), data["kinds"][0]["color"]):
        assert pixels_of(image, color) > 5, color
    middle = image.crop(
        (round(animation.WIDE * animation.AT) - 20, animation.HIGH // 2 - 12, 360, animation.HIGH // 2 + 12)
    )
    assert pixels_of(middle, "#ffffff") > 20  # the ego


def test_other_files_and_logs_without_a_scene_are_refused(log, tmp_path):
    with pytest.raises(ValueError, match=r"an animation is a \.gif file"):
        animation.write(log, tmp_path / "a.png")
    numbers = log_runs.write(tmp_path / "numbers.rrd", steps=3, level="metrics")
    with pytest.raises(ValueError, match="holds numbers only"):
        animation.write(numbers, tmp_path / "a.gif")
