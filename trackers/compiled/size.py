"""What one scan says of length and width of one object; docs/methods/size-from-both-ends.md, sections 1 to 4.

Axis 0 is the length, axis 1 the width; vectors of detections are in the axes of the box, whose size is (2,).
"""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.grids import flip, multiply, roll
from trackers.compiled.jit import compiled
from trackers.compiled.linear import bell, wrap
from trackers.compiled.shade import hides
from trackers.compiled.tables import POSE, RANGE, SENSOR, SIZE_ACROSS, SIZE_ALONG, UX, UY
from trackers.compiled.vector import exponentials, logarithms
from trackers.shade import Shade

WIDER = 1.0  # [m] as in `trackers.size.hidden`
FAR, ROLLED_ABOVE = 2.5, 0.75  # as in `trackers.size.posterior`
SIDE, BESIDE = math.sin(math.radians(10.0)), 0.5  # as in `trackers.size.evidence` and `.posterior`
ACROSS = 10  # places, as in `trackers.size.evidence`
LEAST_SHOWN, LEAST = 0.05, 1e-300  # as in `trackers.size.evidence` and `.grid`
NOTHING = 1e-9  # as in `trackers.size.visible`
SHADED = 0.98  # as in `trackers.size.hidden`


@compiled
def in_view(x: float, y: float, box: NDArray, pose: NDArray, max_range: float, fov: float) -> bool:
    """(ENDS.7): whether a sensor sees the point x, y of the axes of a box (3,)."""
    cos, sin = math.cos(box[2]), math.sin(box[2])
    dx, dy = box[0] + cos * x - sin * y - pose[0], box[1] + sin * x + cos * y - pose[1]
    return math.hypot(dx, dy) < max_range and abs(wrap(math.atan2(dy, dx) - pose[2])) < fov / 2


@compiled
def blurred(z: NDArray, sight: NDArray, size: NDArray, fov: float) -> float:
    """(ENDS.49): the field of view, wider by as much as the noise of a detection z hides where its body ends."""
    half = 0.5 * (abs(sight[1]) * size[0] + abs(sight[0]) * size[1])
    noise = z[SIZE_ACROSS] ** 2
    return fov + 2 * z[SIZE_ACROSS] / max(z[RANGE], 1e-9) * noise / max(noise + half**2 / 3, 1e-9)


@compiled
def cut_off(box: NDArray, size: NDArray, pose: NDArray, max_range: float, fov: float) -> bool:
    """Whether range or field of view of a sensor may cut off a part of the body."""
    for a in (-0.5, 0.5):
        for b in (-0.5, 0.5):
            x, y = a * (size[0] + 2 * WIDER), b * (size[1] + 2 * WIDER)
            if not in_view(x, y, box, pose, max_range, fov):
                return True
    return False


@compiled
def in_the_shade(
    shade: Shade, s: int, row: int, anchor: NDArray, size: NDArray, place: NDArray, box: NDArray, pose: NDArray,
    grid: NDArray, visible: NDArray,
) -> bool:  # fmt: skip
    """Whether other tracks hide the side that faces a sensor at `place`, and how much is visible (C,) of its cells."""
    if not len(shade.row):
        return False
    first, step, C = grid[4], grid[5], len(visible)
    cos, sin, y = math.cos(box[2]), math.sin(box[2]), min(max(place[1], -size[1] / 2), size[1] / 2)
    azimuth, distance = np.empty(C), np.empty(C)
    for c in range(C):
        x = anchor[0] * (size[0] / 2 - (first + step * c + step / 2))
        dx, dy = box[0] + cos * x - sin * y - pose[0], box[1] + sin * x + cos * y - pose[1]
        azimuth[c], distance[c] = math.atan2(dy, dx) - pose[2], math.hypot(dx, dy)
    hides(shade, s, row, azimuth, distance, 0.0, visible)
    return visible.min() < SHADED


@compiled
def room(
    axis: int, anchor: NDArray, size: NDArray, place: NDArray, box: NDArray, pose: NDArray, max_range: float,
    fov: float, grid: NDArray, near: NDArray, far: NDArray, visible: NDArray, near_room: NDArray, far_room: NDArray,
) -> float:  # fmt: skip
    """(ENDS.7), (ENDS.8): what the sensor sees up to each end, near_room (N,) and far_room (K + N - 1,), and its share.

    near (C, N) and far (C, K + N - 1) are the length of each cell before each end, visible (C,) is how much of each
    cell others leave.
    """
    first, step, C, deeper = grid[4], grid[5], int(grid[6]), int(grid[7])
    seen, share, other = np.empty(C, np.bool_), 0.0, 1 - axis
    aside = min(max(place[other], -size[other] / 2), size[other] / 2)
    for c in range(C):
        at = anchor[axis] * (size[axis] / 2 - (first + step * c + step / 2))
        x, y = (at, aside) if axis == 0 else (aside, at)
        seen[c] = in_view(x, y, box, pose, max_range, fov)
    for c in range(C - deeper):
        seen[c] &= seen[c + deeper]  # (ENDS.8)
    shown = np.zeros(C)
    for c in range(C):
        if seen[c]:
            edge, shown[c] = first + step * c, visible[c]
            share += visible[c] * (min(max(size[axis] - edge, 0.0), step) - min(max(-edge, 0.0), step))
    np.dot(shown, near, near_room)
    np.dot(shown, far, far_room)
    return share / size[axis] if share > NOTHING * size[axis] else 0.0


@compiled
def seen_end(front: float, box: NDArray, size: NDArray, z: NDArray, sight: NDArray, sheet: NDArray) -> float:
    """Share of the detections z whose sensors have some of an end in view, +1 the front, -1 the rear."""
    seen = 0
    for i in range(len(z)):
        s = sheet[int(z[i, SENSOR])]
        fov = blurred(z[i], sight[i], size, s[1])
        for k in range(ACROSS):
            y = 0.45 * size[1] * (2 * k / (ACROSS - 1) - 1)
            if in_view(front * size[0] / 2, y, box, z[i, POSE : POSE + 3], s[0], fov):
                seen += 1
                break
    return seen / len(z)


@compiled
def face_anchor(
    A_l: NDArray, A_w: NDArray, grid_l: NDArray, grid_w: NDArray, size: NDArray, place: NDArray, anchor: NDArray,
    unsure: bool, box: NDArray, z: NDArray, sight: NDArray, sheet: NDArray,
) -> None:  # fmt: skip
    """(ENDS.11), (ENDS.23), (ENDS.43): anchor (2,) of a body that sensors at the mean place (2,) face, and its grids.

    In place; unsure is whether its length is, box (3,) its pose, z its detections.
    """
    for a in range(2):
        before = anchor[a]
        if abs(place[a]) > size[a] / 2 or before == 0:
            anchor[a] = -1.0 if place[a] < 0 else 1.0
        open = a == 0 and unsure and abs(place[0]) > FAR * size[0]
        if open and seen_end(anchor[0], box, size, z, sight, sheet) == 0:
            anchor[0] *= -1 if seen_end(-anchor[0], box, size, z, sight, sheet) >= 0.5 else 1  # (ENDS.43)
        if anchor[a] * before < 0:
            if a == 0:
                flip(A_l, grid_l, size[0])
            else:
                flip(A_w, grid_w, size[1])


@compiled
def totals(A: NDArray, out: NDArray) -> None:
    """Logarithms (K,) of the sums of exp A (K, N) over the offsets."""
    K, N = A.shape
    less, p, work = np.empty(A.shape), np.empty(A.shape), np.empty(K * N, np.int64)
    for k in range(K):
        out[k] = A[k].max()
        for n in range(N):
            less[k, n] = A[k, n] - out[k]
    exponentials(less.reshape(-1), p.reshape(-1), work)
    for k in range(K):
        out[k] += math.log(p[k].sum())


@compiled
def add(A: NDArray, p: NDArray, weight: float, sharper: float, part: float, cut: bool) -> None:
    """(ENDS.9), (ENDS.10), (ENDS.39): A (K, N) in place, with the logarithm of p (K, N) times a weight.

    Offsets given the size count `sharper` times as often; the greatest value is 0.
    """
    K, N = p.shape
    log, work, top = np.empty(p.shape), np.empty(K * N, np.int64), -np.inf
    logarithms(p.reshape(-1), log.reshape(-1), work, np.empty(K * N, np.int64))
    given, of_new, of_given = np.empty(p.shape), np.zeros(K), np.zeros(K)
    for k in range(K):
        for n in range(N):
            if cut:
                log[k, n] = max(part * log[k, n], log[k - 1, n]) if k else part * log[k, n]
            given[k, n] = A[k, n] + sharper * (weight * log[k, n])
            A[k, n] += weight * log[k, n]
    if sharper > 1:
        totals(A, of_new)
        totals(given, of_given)
        for k in range(K):
            for n in range(N):
                A[k, n] = given[k, n] + of_new[k] - of_given[k]  # (ENDS.39)
    for k in range(K):
        for n in range(N):
            top = max(top, A[k, n])
    for k in range(K):
        for n in range(N):
            A[k, n] -= top


@compiled
def loosen(A: NDArray, grid: NDArray, share: float, birth_std: float) -> None:
    """(ENDS.42): A (K, N) in place, of a share of whose probability the offset is that of a new object."""
    K, N = A.shape
    top, born, p = A.max(), np.empty(N), np.empty(N)
    for n in range(N):
        born[n] = math.exp(-0.5 * ((grid[2] + grid[1] * n) / birth_std) ** 2)
    born /= born.sum()
    for k in range(K):
        for n in range(N):
            p[n] = math.exp(A[k, n] - top)
        total = p.sum()
        for n in range(N):
            A[k, n] = math.log(max(p[n] + share * (total * born[n] - p[n]), LEAST)) + top


@compiled
def moved_back(
    was: NDArray, box: NDArray, z: NDArray, sheet: NDArray, std: NDArray, reach: NDArray, xy: NDArray, place: NDArray
) -> NDArray:
    """(ENDS.38): the box (3,) moved towards its place was (2,) before the scan; xy and place (M, 2) in it, in place.

    reach (2,) is the most of that, std (M, 2) the noise of the detections with the roughness of their surface.
    """
    M, cos, sin, back = len(z), math.cos(box[2]), math.sin(box[2]), np.empty(2)
    dx, dy = was[0] - box[0], was[1] - box[1]
    body = (cos * dx + sin * dy, cos * dy - sin * dx)
    for a in range(2):
        noise = 0.0
        for i in range(M):
            noise += max(std[i, a] ** 2 - sheet[int(z[i, SENSOR]), 13] ** 2, 0.0)
        most = min(math.sqrt(noise) / M, reach[a])
        back[a] = min(max(body[a], -most), most)
        for i in range(M):
            xy[i, a] -= back[a]
            place[i, a] -= back[a]
    at = box.copy()
    at[0] += cos * back[0] - sin * back[1]
    at[1] += sin * back[0] + cos * back[1]
    return at


@compiled
def in_box(
    box: NDArray, z: NDArray, sheet: NDArray, xy: NDArray, sight: NDArray, place: NDArray, std: NDArray
) -> tuple[int, int]:
    """(ENDS.6): places, lines of sight, places of the sensor and noise (M, 2) in the axes of a box (3,).

    Returns the numbers of detections that were made off the axis, and from beside the body.
    """
    cos, sin, off_axis, beside = math.cos(box[2]), math.sin(box[2]), 0, 0
    for i in range(len(z)):
        ux, uy, dx, dy = z[i, UX], z[i, UY], z[i, POSE] - box[0], z[i, POSE + 1] - box[1]
        sight[i, 0], sight[i, 1] = cos * ux + sin * uy, cos * uy - sin * ux
        place[i, 0], place[i, 1] = cos * dx + sin * dy, cos * dy - sin * dx
        off_axis += 1 if abs(sight[i, 1]) > SIDE else 0
        beside += 1 if abs(sight[i, 1]) > BESIDE else 0
        for a in range(2):
            xy[i, a] = place[i, a] + z[i, RANGE] * sight[i, a]
            var = (z[i, SIZE_ALONG] * sight[i, a]) ** 2 + (z[i, SIZE_ACROSS] * sight[i, 1 - a]) ** 2
            std[i, a] = math.sqrt(var + sheet[int(z[i, SENSOR]), 13] ** 2)
    return off_axis, beside


@compiled
def from_behind(
    grid: NDArray, depth: float, sigma: float, face: float, aslant: bool, across: float, length: float,
    face_std: NDArray, weight: float, behind: NDArray,
) -> None:  # fmt: skip
    """(ENDS.45): adds one detection of a depth [m] before the rear to those behind (2, D) along the body, in place.

    face is its probability to be of the rear, whose detections have mean and spread face_std (2,); across is the sine
    of its line of sight to the axis, aslant whether a side is in view.
    """
    cell = max(math.ceil(depth / grid[1]), 0)
    if cell < behind.shape[1]:
        even, var = (1 - face) / length, sigma**2 + face_std[1] ** 2
        on_face = face * bell(-0.5 * (depth - face_std[0]) ** 2 / var) / math.sqrt(2 * math.pi * var)
        square = max(1 - abs(across) / SIDE, 0.0) if aslant else 1.0
        behind[1 if aslant else 0, cell] += weight * square * even / max(even + on_face, LEAST)


@compiled
def read(
    A_l: NDArray, A_w: NDArray, behind: NDArray, anchor: NDArray, was: NDArray, after: NDArray, size: NDArray,
    whole: bool, z: NDArray, grid_l: NDArray, near_l: NDArray, far_l: NDArray, grid_w: NDArray, near_w: NDArray,
    far_w: NDArray, sheet: NDArray, settings: NDArray, stands: bool, length_var: float, shade: Shade, row: int,
) -> tuple[int, int]:  # fmt: skip
    """(ENDS.2) to (ENDS.11), (ENDS.38), (ENDS.39), (ENDS.45): grids A_l, A_w, behind (2, D) and anchor (2,) in place.

    z are detections of a box, was and after (3,) its pose before and after the scan, row its track.

    sheet (S, 15): max_range, fov, inside, grazing, weight, depth (2), rounding (2, 2), least_room (2), surface,
    slant.
    settings (10,): outliers, independent, part_weight, offset_share, spread of the offsets (2), standing, unseen_share,
    spread of the offset of the length at birth, open_above.
    Returns the numbers of detections that were made off the axis, and from beside the body.
    """
    M = len(z)
    xy, sight, place, std = np.empty((M, 2)), np.empty((M, 2)), np.empty((M, 2)), np.empty((M, 2))
    off_axis, beside = in_box(after, z, sheet, xy, sight, place, std)
    box, on_end = moved_back(was, after, z, sheet, std, settings[4:6], xy, place), np.zeros(2)
    middle = np.zeros(2)
    for i in range(M):
        for a in range(2):
            middle[a] += place[i, a] / M
    face_anchor(A_l, A_w, grid_l, grid_w, size, middle, anchor, length_var > settings[9] ** 2, box, z, sight, sheet)
    end, shown, cut, as_of = np.zeros((M, 2), np.int64), np.zeros((M, 2)), np.zeros(M, np.bool_), np.empty(M, np.int64)
    dark, whole_end = np.zeros(M, np.bool_), np.ones(int(grid_w[6]))
    N, W, D, V = near_l.shape[1], near_w.shape[1], far_l.shape[1], far_w.shape[1]
    rooms_l, rooms_fl, rooms_w, rooms_fw = np.empty((M, N)), np.empty((M, D)), np.empty((M, W)), np.empty((M, V))
    seen, ends, sides, weight, unseen = np.ones((M, 2)), 0.0, 0.0, 0.0, 0.0
    for i in range(M):
        s, first, pose = sheet[int(z[i, SENSOR])], i, z[i, POSE : POSE + 3]
        for j in range(i - 1, -1, -1):
            first = j if z[j, SENSOR] == z[i, SENSOR] else first
        as_of[i] = first
        if first < i:  # of the same sensor
            cut[i], dark[i], seen[i, 0], seen[i, 1] = cut[first], dark[first], seen[first, 0], seen[first, 1]
        else:
            fov, visible = blurred(z[i], sight[i], size, s[1]), np.ones(int(grid_l[6]))
            cut[i] = cut_off(box, size, pose, s[0], fov)
            dark[i] = abs(place[i, 1]) > size[1] / 2 and in_the_shade(
                shade, int(z[i, SENSOR]), row, anchor, size, place[i], box, pose, grid_l, visible
            )
            if not dark[i]:
                visible[:] = 1.0
            if cut[i] or dark[i]:
                seen[i, 1] = room(0, anchor, size, place[i], box, pose, s[0], fov, grid_l, near_l, far_l, visible,
                                  rooms_l[i], rooms_fl[i])  # fmt: skip
            if cut[i]:
                seen[i, 0] = room(1, anchor, size, place[i], box, pose, s[0], fov, grid_w, near_w, far_w, whole_end,
                                  rooms_w[i], rooms_fw[i])  # fmt: skip
        for a in range(2):
            beyond = anchor[a] * place[i, a]
            end[i, a] = 1 if beyond > size[a] / 2 else (-1 if beyond < -size[a] / 2 else 0)
            if end[i, a] != 0:
                shown[i, a] = abs(sight[i, a]) ** (1 - s[3]) * size[1 - a] * seen[i, a]  # (ENDS.4)
        unseen += 1 / M if seen[i, 0] < LEAST_SHOWN and end[i, 0] > 0 else 0.0
        facing = (abs(sight[i, 0]) ** (1 - s[3]) * size[1] if end[i, 0] != 0 else 0.0,
                  abs(sight[i, 1]) ** (1 - s[3]) * size[0] if end[i, 1] != 0 else 0.0)  # fmt: skip
        for a in range(2):
            on_end[a] += facing[a] / max(facing[0] + facing[1], 1e-9) / M
        ends += abs(sight[i, 0]) * size[1] if end[i, 0] != 0 else 0.0
        sides += abs(sight[i, 1]) * size[0] if end[i, 1] != 0 else 0.0
        weight += s[4] / M * min(1.0, settings[6 if stands else 1] / M)  # (ENDS.9)
    p, q, deep = np.ones(A_l.shape), np.ones(A_w.shape), np.empty((2, 2))
    for i in range(M):
        s, j = sheet[int(z[i, SENSOR])], as_of[i]
        total = shown[i, 0] + shown[i, 1]
        f = (1 - s[2]) / total if total > 0 else 0.0
        for a in range(2):
            deep[a] = s[5:7] * abs(sight[i, a]) ** s[14]  # (ENDS.52)
        through = s[2] * shown[i, 0] / total / (1 - f * shown[i, 0]) if dark[i] and total > 0 else 0.0  # (ENDS.51)
        multiply(grid_l, settings[0], p, size[0] / 2 - anchor[0] * xy[i, 0], std[i, 0], f * shown[i, 0],
                 end[i, 0] < 0, s[11], deep[0], s[7:9], rooms_l[j], rooms_fl[j], cut[i] or dark[i],
                 through)  # fmt: skip
        multiply(grid_w, settings[0], q, size[1] / 2 - anchor[1] * xy[i, 1], std[i, 1],
                 f * shown[i, 1], end[i, 1] < 0, s[12], deep[1], s[9:11], rooms_w[j], rooms_fw[j], cut[i],
                 0.0)  # fmt: skip
        if anchor[0] < 0 and end[i, 0] > 0:
            from_behind(grid_l, size[0] / 2 - anchor[0] * xy[i, 0], std[i, 0], f * shown[i, 0], end[i, 1] != 0,
                        sight[i, 1], size[0], deep[0], weight, behind)  # fmt: skip
    sharper = (max(1.0, settings[3] * (1 - on_end[0]) / weight), max(1.0, settings[3] * (1 - on_end[1]) / weight))
    if unseen > 0 and settings[7] > 0:
        loosen(A_l, grid_l, settings[7] * unseen, settings[8])
    add(A_l, p, weight, sharper[0], 1.0, False)
    add(A_w, q, weight, sharper[1], settings[2], not whole and sides < ends)
    return off_axis, beside


@compiled
def centre(
    A_l: NDArray, A_w: NDArray, step_l: float, step_w: float, anchor: NDArray, box: NDArray, size: NDArray,
    b: NDArray, shift: NDArray,
) -> None:  # fmt: skip
    """(ENDS.22): grids and belief b (5, 2) about the box that a pin will make of this one, and its shift (2,)."""
    body = np.empty(2)
    for a in range(2):
        step = step_l if a == 0 else step_w
        steps = np.rint(b[2, a] / step) if abs(b[2, a]) > ROLLED_ABOVE * step else 0.0
        if steps != 0:
            roll(A_l if a == 0 else A_w, int(steps))
        b[2, a] -= steps * step
        body[a] = anchor[a] * ((size[a] - b[0, a]) / 2 + steps * step)
    cos, sin = math.cos(box[2]), math.sin(box[2])
    shift[0], shift[1] = cos * body[0] - sin * body[1], sin * body[0] + cos * body[1]
