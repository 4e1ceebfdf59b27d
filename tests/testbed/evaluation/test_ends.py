"""Ends of objects that were hit."""

import numpy as np
import pytest

from sensors.origin import Origin
from sensors.scene import boxes_scene
from testbed.evaluation.ends import HITS, Ends


def scene_and_origin(owners, pose=((20.0, 0.0, np.pi / 2), (0.0, 30.0, 0.0))):
    scene = boxes_scene(np.array(pose), np.array([[10.0, 2.5], [4.0, 1.8]]))
    return scene.objects, Origin.empty(2)._replace(object=np.array(owners, int))


def test_an_end_counts_after_its_detections_and_both_ends_add_up():
    ends = Ends()
    objects, origin = scene_and_origin([0, 0, -1, 1])
    near_front = np.array([[20.3, 4.3], [19.0, -4.3], [20.0, 4.9], [0.0, 30.8]])  # front, rear, clutter, middle of 1
    for k in range(1, HITS + 1):
        found = ends.step(objects, origin, near_front)
        assert found.tolist() == [2 * (k >= HITS), 0]
    assert ends.step(*scene_and_origin([]), np.zeros((0, 2))).tolist() == [2, 0]  # it was hit, and stays so


@pytest.mark.parametrize(("along", "hit"), [(4.21, 1), (4.19, 0), (-4.21, 1), (0.0, 0)])
def test_an_end_reaches_a_share_of_the_length_and_a_slack_inwards(along, hit):
    ends = Ends()
    objects, origin = scene_and_origin([0] * HITS)
    assert ends.step(objects, origin, np.array([[20.0, along]] * HITS)).tolist() == [hit, 0]
