"""The metrics under their public name, as in `from testbed.metrics import gospa`; defined in `testbed.evaluation`."""

from testbed.evaluation.metrics import (
    CUTOFF,
    Gospa,
    box_iou,
    contour_iou,
    gaussian_wasserstein,
    gospa,
    gwd,
    gwd2,
    nees,
    nees_bounds,
    region_iou,
    rmse,
)

__all__ = (
    "CUTOFF", "Gospa", "box_iou", "contour_iou", "gaussian_wasserstein", "gospa", "gwd", "gwd2", "nees", "nees_bounds",
    "region_iou", "rmse",
)  # fmt: skip
