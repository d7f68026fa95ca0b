"""A Brownian path that belongs to its seed and not to the steps taken along it.

Over an interval of length h the pair (W, H), H = (1/h) int_0^h W(s) ds - W/2, is normal with variances h and h/12.
Given it, the halves follow the conditional law (J. Foster, T. Lyons, H. Oberhauser, SIAM J. Numer. Anal. 58, 2020)

    B = 3 H + sqrt(h)/2 z1,   A = 2 H - B/2,   C = sqrt(h/12) z2
    W1, W2 = (W + B)/2, (W - B)/2,   H1, H2 = (A + C)/2, (A - C)/2

so that W = W1 + W2 and H = (H1 + H2)/2 + (W1 - W2)/4. Every node of the tree of halves has its own random numbers:
a step that is refused is halved, and the two halves are still parts of the same path.
"""

import math

from ..machine.compiling import kernel
from .random import four_normals
from .state import ROOT, SPLIT


@kernel
def halved(length, times):
    """length / 2**times, exactly."""
    return length / float(1 << times)


@kernel
def begin_interval(N):
    """Puts the whole interval N.interval on top: level 0."""
    N.depth = 0
    N.position = 0
    wide, narrow = math.sqrt(N.step), math.sqrt(N.step / 12.0)
    for s in range(0, N.q, 2):
        a, b, c, d = four_normals(N.seed, N.trajectory, N.interval, 1, s, ROOT)
        N.increment[0, s] = wide * a
        N.area[0, s] = narrow * b
        if s + 1 < N.q:
            N.increment[0, s + 1] = wide * c
            N.area[0, s + 1] = narrow * d


@kernel
def _halve_source(N, level, s, z1, z2, h):
    w, area = N.increment[level, s], N.area[level, s]
    b = 3.0 * area + 0.5 * math.sqrt(h) * z1
    a = 2.0 * area - 0.5 * b
    c = math.sqrt(h / 12.0) * z2
    N.increment[level + 1, s] = 0.5 * (w + b)
    N.right_increment[level + 1, s] = 0.5 * (w - b)
    N.area[level + 1, s] = 0.5 * (a + c)
    N.right_area[level + 1, s] = 0.5 * (a - c)


@kernel
def halve(N):
    """Replaces the present part by its left half; the right one waits."""
    level = N.depth
    h = halved(N.step, level)
    node = (1 << level) + N.position
    for s in range(0, N.q, 2):
        a, b, c, d = four_normals(N.seed, N.trajectory, N.interval, node, s, SPLIT)
        _halve_source(N, level, s, a, b, h)
        if s + 1 < N.q:
            _halve_source(N, level, s + 1, c, d, h)
    N.depth = level + 1
    N.position *= 2


@kernel
def pass_on(N):
    """Goes on to the part after the present one: the right half that waits, or the next interval."""
    level, position = N.depth, N.position
    while level > 0 and position % 2 == 1:
        level -= 1
        position //= 2
    N.depth = level
    if level == 0:
        N.interval += 1
        begin_interval(N)
        return
    N.position = position + 1
    for s in range(N.q):
        N.increment[level, s] = N.right_increment[level, s]
        N.area[level, s] = N.right_area[level, s]


@kernel
def length_here(N):
    """Length of the present part."""
    return halved(N.step, N.depth)


@kernel
def end_time(N):
    """Time at the end of the present part; exactly a multiple of the step at the end of an interval."""
    last = N.position + 1
    whole = 1 << N.depth
    if last == whole:
        return N.step * float(N.interval + 1)
    return N.step * (float(N.interval) + float(last) / float(whole))
