"""Bars of card dra_imm, section 16: RMSE of position and velocity by stage, within the card's bands."""

import numpy as np
import pytest

from testbed.papers import xu2023
from testbed.papers.xu2023_trials import Course, Trace, track

RUNS = 50
NEAR, REAL = Course("near", xu2023.NEAR), Course("near, extent follows", xu2023.NEAR, follows=True)
# (position, band, velocity, band) for CV, CA, CT
BARS = {
    ("DRA(CV), S", NEAR): ((0.327, 0.090, 0.100, 0.019), (0.658, 0.137, 0.850, 0.122), (3.916, 0.392, 3.544, 0.354)),
    ("DRA-IMM, S", NEAR): ((0.282, 0.103, 0.087, 0.011), (0.281, 0.107, 0.164, 0.016), (1.746, 0.211, 2.321, 0.232)),
    ("EDRA-IMM, S", NEAR): ((0.225, 0.068, 0.084, 0.011), (0.223, 0.075, 0.166, 0.017), (1.810, 0.212, 2.374, 0.237)),
    ("literal", NEAR): ((0.077, 0.008, 0.055, 0.005), (0.078, 0.009, 0.145, 0.014), (0.093, 0.012, 0.198, 0.020)),
    ("recommended", REAL): (
        (0.073, 0.025, 0.055, 0.006),
        (0.125, 0.020, 0.264, 0.026),
        (0.085, 0.015, 0.179, 0.018),
    ),
}
IOU = {"DRA(CV), S": (0.71, 0.57, 0.07), "DRA-IMM, S": (0.70, 0.69, 0.22), "EDRA-IMM, S": (0.72, 0.70, 0.22)}
IOU |= {"literal": (0.88, 0.89, 0.89), "recommended": (0.93, 0.91, 0.92)}


@pytest.mark.slow
@pytest.mark.parametrize(("method", "course"), BARS)
def test_the_card_s_bars_are_reached(method, course):
    steps = track(xu2023.METHODS[method], course, RUNS, 1)
    trace = Trace(*(np.stack(field) for field in zip(*steps, strict=True)))
    assert np.sqrt(trace.position).max() < 50
    for stage, bar, iou in zip(xu2023.STAGES, BARS[method, course], IOU[method], strict=True):
        assert xu2023.rmse(trace.position, stage) == pytest.approx(bar[0], abs=bar[1])
        assert xu2023.rmse(trace.velocity, stage) == pytest.approx(bar[2], abs=bar[3])
        within = 0.03 if method in ("literal", "recommended") else 0.06
        assert trace.iou[xu2023.stage_mask(stage)].mean() == pytest.approx(iou, abs=within)
