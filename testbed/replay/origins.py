"""Which detections are of which vehicle of truth: as the table says, else those within its box, grown a little."""

import numpy as np
from numpy.typing import NDArray

from sensors.origin import CLUTTER, CONTOUR, Origin
from testbed.replay.loaded import Loaded
from testbed.replay.truth import There, Truth
from trackers.geometry import to_frame
from trackers.scan import Scan

GROWN = 0.5  # [m] on each side of a box
NONE = "-"  # in place of an id
NOT_SAID = -2


def said_objects(table: Loaded, names: NDArray, truth: Truth) -> NDArray:
    """Id (N,) in scenes of the object of each detection by its name (N,), -1 for none, NOT_SAID where it is empty.

    Raises ValueError, in one sentence, for a name that the truth does not have.
    """
    known = {"": NOT_SAID, NONE: -1, **truth.numbers}
    different, of = np.unique(names, return_inverse=True)
    number = np.array([known.get(name, NOT_SAID - 1) for name in different.tolist()], int)[of]
    if truth.span is not None:
        what = "the table truth has no vehicle"
        wrong = number < NOT_SAID
        table.check(
            "object", wrong, lambda row: f"{what} {str(names[row])!r}", f"write its id there, or {NONE} for none"
        )
    return np.maximum(number, NOT_SAID)


def origin_of(scan: Scan, there: There, said: NDArray, kind: NDArray) -> Origin:
    """The origin of the M detections of a scan.

    said (M,) are the ids of objects, see `said_objects`; kind (M,) is -1 where the table does not say it.
    """
    given = said != NOT_SAID
    owner = np.full(len(said), -1) if given.all() else owners_by_place(there.objects.pose, there.objects.size, scan.xy)
    row_of = {number: row for row, number in enumerate(there.objects.id.tolist())}
    owner = np.where(given, np.array([row_of.get(number, -1) for number in said.tolist()], int), owner)
    count = np.bincount(owner[owner >= 0], minlength=len(there.objects.id))
    return Origin(
        object=owner,
        body=np.where(owner >= 0, np.searchsorted(there.bodies.owner, owner), -1),
        edge=np.full(len(owner), -1),
        kind=np.where(kind >= 0, kind, np.where(owner >= 0, CONTOUR, CLUTTER)),
        expected=np.where(np.isnan(there.expected), count, there.expected),
        visible=np.where(np.isnan(there.visible), count > 0, there.visible),
    )


def owners_by_place(pose: NDArray, size: NDArray, xy: NDArray) -> NDArray:
    """Row (M,) of the grown box, of N poses (N, 3) and sizes (N, 2), that holds each detection (M, 2) [m].

    Of several the one that it is most inside; -1 for none.
    """
    if not len(pose) or not len(xy):
        return np.full(len(xy), -1)
    local = to_frame(pose, np.broadcast_to(xy, (len(pose), *xy.shape)))
    outside = (np.abs(local) - size[:, None] / 2).max(-1)  # (N, M) [m]
    return np.where(outside.min(0) <= GROWN, outside.argmin(0), -1)
