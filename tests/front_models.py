"""Systems that several tests of the symbolic front look at."""

import sympy as sp

from pwsmooth import Event, Memory, Switch, System, Unilateral

t, x, y, v, z = sp.symbols("t x y v z", real=True)
rho, beta, k, c, N, sigma, omega = sp.symbols("rho beta k c N sigma omega", nonnegative=True)
lam = Switch("lam", v)
PARAMETERS = {rho: 3, beta: 0.1, k: 3.1, c: 0.1, N: 1, sigma: 2.4, omega: 1}
RATES = {
    y: v,
    v: -sigma * sp.sin(omega * t) - k * y - c * v - N * lam * (1 + rho * z),
    z: (1 - lam**2 - z) / beta,
}


def oscillator(**changes):
    options = {"time": t, "parameters": PARAMETERS, "outputs": {"mu": lam * (1 + rho * z)}} | changes
    return System(options.pop("rates", RATES), **options)


def regularity(system):
    return {m.symbol.name: m.regularity for m in system.model.multipliers if m.kind == "switch"}


def lugre():
    F_c, F_s, s0, s1, s2, v_s, u = sp.symbols("F_c F_s sigma_0 sigma_1 sigma_2 v_s u", positive=True)
    zdot = v - s0 * sp.Abs(v) / (F_c + (F_s - F_c) * sp.exp(-((v / v_s) ** 2))) * z
    values = {s0: 1e5, s1: 316.23, s2: 0.4, F_c: 1, F_s: 1.5, v_s: 1e-3, u: 1}
    return System({x: v, v: u - s0 * z - s1 * zdot - s2 * v, z: zdot}, parameters=values)


def elastoplastic():
    F_c, F_s, s0, v_s, z_ba, z_max = sp.symbols("F_c F_s sigma_0 v_s z_ba z_max", positive=True)
    size, middle, width = sp.Abs(z), (z_max + z_ba) / 2, z_max - z_ba
    alpha = sp.Piecewise(
        (0, sp.Or(sp.Ne(sp.sign(z), sp.sign(v)), size <= z_ba)),
        ((1 + sp.sin(sp.pi * (size - middle) / width)) / 2, size < z_max),
        (1, True),
    )
    g = F_c + (F_s - F_c) * sp.exp(-((v / v_s) ** 2))
    values = {F_c: 1, F_s: 1.5, s0: 1e5, v_s: 1e-3, z_ba: 13e-6, z_max: 15e-6}
    return System({v: -s0 * z, z: v * (1 - alpha * sp.sign(v) * z * s0 / g)}, parameters=values)


def gms():
    """A generalised Maxwell-slip element on a mass: a flag, guards, the order of event and switch."""
    kappa, C, share, F_c, F_s, v_s, damping = sp.symbols("kappa C share F_c F_s v_s damping", positive=True)
    stuck = Memory("stuck", 1)
    s = F_c + (F_s - F_c) * sp.exp(-((v / v_s) ** 2))
    zdot = sp.Piecewise((v, sp.Eq(stuck, 1)), (C / kappa * (share * sp.sign(v) - kappa * z / s), True))
    force = kappa * z + damping * zdot
    return System(
        {x: v, v: 2 * sp.cos(t) - force, z: zdot},
        time=t,
        parameters={kappa: 2.5, C: 50, share: 0.1, F_c: 1, F_s: 2, v_s: 8, damping: 0.01},
        outputs={"force": force},
        events=[
            Event(sp.Abs(kappa * z) - share * s, direction=1, update={stuck: 0}, name="slip",
                  when=sp.And(sp.Eq(stuck, 1), z * v > 0)),
            Event(v, when=sp.Eq(stuck, 0), update={stuck: 1}, name="stick"),
        ],
    )  # fmt: skip


def hertz():
    """Hertz contact with a damping factor from the impact speed, latched at touch-down."""
    K, eta, m = sp.symbols("K eta m", positive=True)
    speed = Memory("speed", 1.0, positive=True)
    force = sp.Piecewise((K * y**1.5 * (1 + eta * v / speed), y > 0), (0, True))
    return System(
        {y: v, v: 9.81 - force / m},
        parameters={K: 1e11, eta: 0.4, m: 1},
        outputs={"force": force},
        events=[Event(y, direction=1, update={speed: sp.Max(v, 1e-6)}, name="touch-down")],
    )


def ball(restitution):
    e = sp.Symbol("e", real=True)
    return System({y: v, v: -1 + Unilateral(y, restitution=e).reaction}, parameters={e: restitution})
