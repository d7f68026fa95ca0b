"""The random numbers of the package's noise, computed anew from numpy's Philox."""

import math

import numpy as np

KICKS = 0x6B69636B


def words(seed, trajectory, counter):
    """Four uint64 of Philox4x64-10; numpy counts up before it draws."""
    a, b, c, d = (int(n) % 2**64 for n in counter)
    number = (a + (b << 64) + (c << 128) + (d << 192) - 1) % 2**256
    return np.random.Philox(key=seed + (trajectory << 64), counter=number).random_raw(4)


def draws(seed, trajectory, k, count, law):
    """`count` numbers of kick k."""
    found = []
    for first in range(0, count, 4):
        u = [(int(w >> np.uint64(11)) + 0.5) * 2.0**-53 for w in words(seed, trajectory, (k, first, 0, KICKS))]
        if law == "uniform":
            found += [2 * s - 1 for s in u]
        else:
            for r, a in ((u[0], u[1]), (u[2], u[3])):
                radius, angle = math.sqrt(-2 * math.log(r)), 2 * math.pi * a
                found += [radius * math.cos(angle), radius * math.sin(angle)]
    return found[:count]
