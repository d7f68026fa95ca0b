"""Force and moment of a flat contact that slides and spins, by elliptic integrals (Farkas et al., PRL 90, 248302)."""

import numpy as np
from scipy.special import ellipe, ellipk, ellipkm1


def of_a_disc(ratio):
    """|F|/F_c and M/(F_c R) at u = |v|/(R omega), by elliptic integrals."""
    if ratio <= 1:
        E, K = ellipe(ratio**2), ellipkm1((1 - ratio) * (1 + ratio))
        rest = 0 if ratio == 1 else (1 - ratio**2) * K
        return 4 * ((1 + ratio**2) * E - rest) / (3 * np.pi * ratio), 4 * ((4 - 2 * ratio**2) * E - rest) / (
            9 * np.pi
        )
    m = ratio**-2
    E, K = ellipe(m), ellipk(m)
    return (
        4 * ((1 + ratio**2) * E - (ratio**2 - 1) * K) / (3 * np.pi),
        4 * ratio * ((4 - 2 * ratio**2) * E + (2 * ratio**2 - 5 + 3 * m) * K) / (9 * np.pi),
    )


def of_a_ring(ratio):
    """The same of a thin ring."""
    s = ratio + 1
    J, K = s * ellipe(4 * ratio / s**2), ellipkm1(((ratio - 1) / s) ** 2) / s
    rest = 0 if ratio == 1 else (ratio**2 - 1) * K
    return (J + rest) / (np.pi * ratio), (J - rest) / np.pi
