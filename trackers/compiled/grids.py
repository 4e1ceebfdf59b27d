"""Grids of size and offset, and what they say with the fleet; docs/methods/size-from-both-ends.md.

A (K, N) are log likelihoods of one axis of one body, p (K, N) likelihoods, greatest one near 1. A grid (8,) is first
size, step, first offset, span, and of the cells along the axis where they begin, their length, number, and how much
deeper the body must be seen.
"""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import compiled
from trackers.compiled.linear import bell
from trackers.compiled.linear import step as normal
from trackers.compiled.vector import exponentials, logarithms

VACATED, LEAST = -300.0, 1e-260  # `trackers.size.grid` has a smaller one, whose products are no normal numbers
UNLIKELY = 100.0  # [nat] as in `trackers.size.belief`


@compiled
def to_likelihood(A: NDArray, keep: float, p: NDArray) -> None:
    """(ENDS.12): p (K, N) of A (K, N), whose part `keep` is remembered."""
    a, top = A.reshape(-1), A[0, 0]
    y, work = np.empty(len(a)), np.empty(len(a), np.int64)
    for i in range(len(a)):
        top = max(top, a[i])
    for i in range(len(a)):
        y[i] = keep * (a[i] - top)
    exponentials(y, p.reshape(-1), work)


@compiled
def to_log(p: NDArray, A: NDArray) -> None:
    """The logarithms A (K, N) of p (K, N)."""
    work, part = np.empty(p.size, np.int64), np.empty(p.size, np.int64)
    logarithms(p.reshape(-1), A.reshape(-1), work, part)


@compiled
def forget(A: NDArray, keep: float, transition: NDArray, p: NDArray, A_new: NDArray) -> None:
    """(ENDS.12) to (ENDS.14): p (K, N) after the detections were forgotten and the offset spread, and its A_new."""
    before = np.empty(A.shape)
    to_likelihood(A, keep, before)
    np.dot(before, transition, p)
    flat = p.reshape(-1)
    for i in range(len(flat)):
        flat[i] = max(flat[i], LEAST)
    to_log(p, A_new)


@compiled
def sums(grid: NDArray, p: NDArray) -> NDArray:
    """Sums (K, 2) of p (K, N) over the offsets, and of p times the offsets."""
    over = np.ones((p.shape[1], 2))
    for n in range(p.shape[1]):
        over[n, 1] = grid[2] + grid[1] * n
    return np.dot(p, over)


@compiled
def grid_moments(grid: NDArray, p: NDArray, c: NDArray, of_row: NDArray, b: NDArray, of_size: NDArray) -> None:
    """(ENDS.18) to (ENDS.20) of sums of rows of p (K, N): b (5,) is size, its variance, offset, its variance, centre's.

    c (K,) says how often each row of p is in these sums, of_row (K, 2) are `sums` of them.
    """
    K, N = p.shape
    first_size, step, first_offset, of_offset = grid[0], grid[1], grid[2], np.dot(c, p)
    total = of_row[:, 0].sum()
    size = offset = size_var = offset_var = both = 0.0
    for k in range(K):
        of_size[k] = of_row[k, 0] / total
        size += of_size[k] * (first_size + step * k)
    for n in range(N):
        offset += of_offset[n] / total * (first_offset + step * n)
    for k in range(K):
        d = first_size + step * k - size
        size_var += of_size[k] * d**2
        both += (of_row[k, 1] / total - of_size[k] * offset) * d
    for n in range(N):
        offset_var += of_offset[n] / total * (first_offset + step * n - offset) ** 2
    cell = step**2 / 12
    b[0], b[1], b[2], b[3] = size, size_var + cell, offset, offset_var
    b[4] = offset_var + size_var / 4 - both + cell / 4


@compiled
def before(total: NDArray, depth: float, step: float) -> float:
    """How many detections lie before a depth [m], where total (D,) lie before the end of a cell of a step [m]."""
    cell = int(depth / step)
    part = depth / step - cell
    return (1 - part) * total[cell] + part * total[min(cell + 1, len(total) - 1)]


@compiled
def with_loads(grid: NDArray, of_length: NDArray, loads: NDArray, behind: NDArray) -> NDArray:
    """(ENDS.47): probabilities (C, K) of the lengths given the class, and what detections behind (2, D) say of loads.

    loads (B, 7) are class, share, part, and logarithms of ratios as of `Load.log_ratios`.
    """
    if not behind.any():
        return of_length
    p, total, K = of_length.copy(), behind.copy(), of_length.shape[1]
    for h in range(2):
        for i in range(1, total.shape[1]):
            total[h, i] += total[h, i - 1]
    log_q, q, work, whole = np.empty(K), np.empty(K), np.empty(K, np.int64), np.empty((2, K))
    for h in range(2):
        for k in range(K):
            whole[h, k] = before(total[h], grid[0] + grid[1] * k, grid[1])
    for load in loads:
        log_q[:] = 0.0
        for h in range(2):
            for k in range(K if total[h, -1] > 0 else 0):
                shown = before(total[h], load[2] * (grid[0] + grid[1] * k), grid[1])
                log_q[k] += load[3 + h] * shown + load[5 + h] * (whole[h, k] - shown)
        exponentials(np.minimum(np.maximum(log_q, -UNLIKELY), UNLIKELY), q, work)
        for k in range(K):
            p[int(load[0]), k] *= 1 + load[1] * (q[k] - 1)
    return p


@compiled
def believe(
    grid_l: NDArray, grid_w: NDArray, shares: NDArray, fleet: NDArray, of_width: NDArray, loads: NDArray,
    bends: NDArray, at: NDArray, p: NDArray, q: NDArray, behind: NDArray, bent: float, b: NDArray, length: NDArray,
    width: NDArray, kind: NDArray,
) -> None:  # fmt: skip
    """(ENDS.16) to (ENDS.20), (ENDS.33), (ENDS.47): belief b (5, 2), length (K,), width (K',), kind (C,) of p and q.

    shares (C,), fleet (C, K) and of_width (C, K') are those of the fleet; loads and behind as in `with_loads`;
    bends (B', 2) have class and share, bent is the probability of that, and at (B', K) says where on the grid of L_k
    a load of it ends.
    """
    of_length, D = with_loads(grid_l, fleet, loads, behind), len(bends) if bent > 0 else 0
    K, W, C = len(p), len(q), len(shares)
    l, w, fit_l, fit_w, total = sums(grid_l, p), sums(grid_w, q), np.zeros(C), np.zeros(C), 0.0
    for c in range(C):
        for k in range(K):
            fit_l[c] += l[k, 0] * of_length[c, k]  # (ENDS.16)
        for k in range(W):
            fit_w[c] += w[k, 0] * of_width[c, k]
    for d in range(D):
        c, straight = int(bends[d, 0]), fit_l[int(bends[d, 0])]
        fit_l[c] -= bends[d, 1] * bent * straight
        for k in range(K):
            i = int(at[d, k])
            shorter = l[i, 0] + (at[d, k] - i) * (l[min(i + 1, K - 1), 0] - l[i, 0])
            fit_l[c] += bends[d, 1] * bent * shorter * fleet[c, k]  # (ENDS.33)
    for c in range(C):
        kind[c] = shares[c] * fit_l[c] * fit_w[c]
        total += kind[c]
    in_l, in_w, joint_l, joint_w = np.zeros(K), np.zeros(W), np.empty((K, 2)), np.empty((W, 2))
    for k in range(K):
        for c in range(C):
            in_l[k] += shares[c] * fit_w[c] * of_length[c, k]  # (ENDS.17)
        joint_l[k, 0], joint_l[k, 1] = l[k, 0] * in_l[k], l[k, 1] * in_l[k]
    for k in range(W):
        for c in range(C):
            in_w[k] += shares[c] * fit_l[c] * of_width[c, k]  # (ENDS.17)
        joint_w[k, 0], joint_w[k, 1] = w[k, 0] * in_w[k], w[k, 1] * in_w[k]
    for d in range(D):
        c = int(bends[d, 0])
        for k in range(K):
            h = bends[d, 1] * bent * shares[c] * fit_w[c]
            i = int(at[d, k])
            j, f = min(i + 1, K - 1), at[d, k] - i
            for a in range(2):
                shorter = (1 - f) * l[i, a] + f * l[j, a]
                joint_l[k, a] += h * (fleet[c, k] * shorter - of_length[c, k] * l[k, a])  # (ENDS.33)
            in_l[i] += h * (1 - f) * fleet[c, k]
            in_l[j] += h * f * fleet[c, k]
            in_l[k] -= h * of_length[c, k]
    for c in range(C):
        kind[c] /= total
    of_axis = np.empty((2, 5))
    grid_moments(grid_l, p, in_l, joint_l, of_axis[0], length)
    grid_moments(grid_w, q, in_w, joint_w, of_axis[1], width)
    for i in range(5):
        b[i, 0], b[i, 1] = of_axis[0, i], of_axis[1, i]


@compiled
def multiply(
    grid: NDArray, eps: float, p: NDArray, depth: float, sigma: float, face: float, far: bool, least: float,
    behind: NDArray, rounding: NDArray, near_room: NDArray, far_room: NDArray, cut: bool, through: float,
) -> None:  # fmt: skip
    """(ENDS.2) to (ENDS.5): p (K, N) times the density of one detection, of which a part `face` is of a face.

    behind (2,) and rounding (2,) are mean and spread; near_room (N,) and far_room (K + N - 1,) what the sensor can see
    up to both ends, where its range, its field of view or others cut the body; of the rest of the part that is not of a
    face a share `through` is seen all the same.
    """
    K, N = p.shape
    first, step, first_offset = grid[0], grid[1], grid[2]
    noise, var = math.hypot(sigma, rounding[1]), sigma**2 + behind[1] ** 2
    height = (1 - eps) * face / math.sqrt(2 * math.pi * var)
    to_far, bump, to_anchor, floor = np.empty(K + N - 1), np.zeros(K + N - 1), np.empty(N), np.full(N, eps / grid[3])
    for i in range(K + N - 1):
        e = depth + first_offset - first + step * (i + 1 - K)  # (ENDS.2)
        to_far[i] = normal((e + rounding[0]) / noise)
        if far and face > 0:
            bump[i] = height * bell(-0.5 * (-e - behind[0]) ** 2 / var)  # (ENDS.4)
    for n in range(N):
        d = depth + first_offset + step * n
        to_anchor[n] = normal(d / sigma)
        if not far and face > 0:
            floor[n] += height * bell(-0.5 * (d - behind[0]) ** 2 / var)  # (ENDS.4)
    for k in range(K):
        length, s = max(first + step * k - rounding[0], least), K - 1 - k
        h, row, far_end, on_far = (1 - eps) * (1 - face) / length, p[k], to_far[s : s + N], bump[s : s + N]
        if cut:
            for n in range(N):
                seen = length / max(far_room[s + n] - near_room[n] - rounding[0], least)
                seen += through * (1 - seen)  # (ENDS.51)
                row[n] *= (to_anchor[n] - far_end[n]) * h * seen + floor[n] + on_far[n]  # (ENDS.5)
        else:
            for n in range(N):
                row[n] *= (to_anchor[n] - far_end[n]) * h + floor[n] + on_far[n]  # (ENDS.5)


@compiled
def flip(A: NDArray, grid: NDArray, size: float) -> None:
    """(ENDS.23): A (K, N) in place for the other end as the anchor of a box of this size."""
    K, N = A.shape
    p, top = np.zeros(A.shape), A.max()
    for k in range(K):
        for n in range(N):
            i = np.rint((grid[0] - size - 2 * grid[2]) / grid[1] + k - n)
            p[k, int(min(max(i, 0.0), N - 1.0))] += bell(A[k, n] - top)
    for k in range(K):
        for n in range(N):
            A[k, n] = math.log(max(p[k, n], LEAST))


@compiled
def roll(A: NDArray, steps: int) -> None:
    """(ENDS.22): A (K, N) in place about a box whose anchor end was moved out by whole steps."""
    K, N = A.shape
    before, top = A.copy(), A.max()
    for k in range(K):
        for n in range(N):
            A[k, n] = before[k, n + steps] if 0 <= n + steps < N else top + VACATED
