"""The slider-crank's first impact: until then slider and rod move freely, and no contact law matters.

The crank turns at 200 rpm; the rod is a free bar at its crank end, the slider stays where it is. The journal leaves
the centre of its bearing, and touches where it is one clearance away.
"""

import numpy as np
from scipy.integrate import solve_ivp

R, ROD, MASS, INERTIA, OMEGA = 0.05, 0.30, 1.130, 0.015300, 200 * 2 * np.pi / 60


def first_impact(clearance):
    """Time (s) of the first touch-down."""

    def rate(t, x):
        psi, turning, slider, speed = x
        phi = OMEGA * t
        pin = -(OMEGA**2) * R * np.array([np.cos(phi), np.sin(phi)])
        across = np.array([-np.sin(psi), np.cos(psi)])
        moment = -MASS * ROD / 2 * (pin @ across)
        return [turning, moment / (INERTIA + MASS * ROD**2 / 4), speed, 0.0]

    def gap(t, x):
        phi = OMEGA * t
        bearing = R * np.array([np.cos(phi), np.sin(phi)]) + ROD * np.array([np.cos(x[0]), np.sin(x[0])])
        away = np.array([x[2], 0.0]) - bearing
        return away @ away - clearance**2

    gap.terminal, gap.direction = True, 1
    start = [0.0, -R * OMEGA / ROD, R + ROD, 0.0]
    run = solve_ivp(rate, (0, 0.05), start, "DOP853", events=gap, rtol=1e-13, atol=1e-16, max_step=1e-4)
    return float(run.t_events[0][0])
