"""LuGre's classic scenes, and what its bristles do under small cyclic forces beside laws that do not drift."""

import numpy as np
import sympy as sp

from paper_figures.claims import Claim
from paper_figures.sources import EXPECTED, IDENTITY, closed_form, computed
from pwsmooth.laws import friction
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.scenes import block_on_belt, force_driven, position_control, prescribed_motion, t

NAME = "lugre"
TITLE = "LuGre's classic scenes: presliding, stick-slip, lag, break-away, hunting, drift"
CAPTION = """
LuGre's law with the standard parameters (1e5 N/m, 316 N s/m, 0.4 N s/m, 1 and 1.5 N, 1 mm/s) and 1 kg. (a) Presliding
under a slow force of +-1.425 N; (b) stick-slip of a block pulled by a spring of 2 N/m at 0.1 m/s, dashed: the two-level
Coulomb law with the same forces; (c) frictional lag, v = (1.5 + cos Omega t) mm/s; (d) largest force before break-away
(v = 20 mm/s) against the rate of the force; (e) hunting under PID control; (f) displacement under the cyclic force
0.75 + 0.5 sin(2 pi t) N: LuGre and Dahl (0.5 + 0.3 sin, F_c = 1 N) drift, the elastoplastic law and XKY do not.
The scenes are those of Canudas de Wit et al. 1995; numbers of the source column are an independent computation's.
"""


# tests/reference/bristles.py (LSODA): displacements of (a) in um at WHEN; period in s, largest velocity in m/s of (b);
# ends of the limit cycle of (e) in m; drift a cycle of LuGre and displacement of the others in (f), in um.
WHEN, DISPLACED = (10, 15, 35, 40, 60, 65), (44.8579, 45.3119, -9.5635, -10.0174, 44.8579, 45.3119)
STICK_SLIP, HUNTING = (6.3627, 0.36982), (0.93602, 1.06391)
DRIFT, STILL = 17.5035, 7.4005


def swing(force, pieces):
    """A piecewise linear drive through (time, force)."""
    cases = [
        (
            sp.nsimplify(b) + (t - sp.nsimplify(a)) * sp.nsimplify((d - b) / (c - a), rational=True),
            t < sp.nsimplify(c),
        )
        for (a, b), (c, d) in zip(pieces, pieces[1:])
    ]
    return sp.Piecewise(*cases, (sp.nsimplify(pieces[-1][1]), True))


def presliding():
    """Force-driven mass below the break-away force."""
    q = 1.425
    corners = [(0, 0), (10, q), (15, q), (35, -q), (40, -q), (60, q), (65, q)]
    run = force_driven(friction.LuGre(), swing(q, corners), t_span=(0, 65)).solve(dense_output=True)
    return require(run)


def require(run):
    """The run, or an error with what happened."""
    if not run.success:
        raise RuntimeError(f"The run did not finish: {run.message}")
    return run


def lag(Omega):
    """Velocity and force over the third period."""
    period = 2 * np.pi / Omega
    speed = sp.Rational(1, 1000) * (sp.Rational(3, 2) + sp.cos(sp.Float(Omega) * t))
    run = require(
        prescribed_motion(friction.LuGre(), velocity=speed, t_span=(0, 3 * period)).solve(dense_output=True)
    )
    times = np.linspace(2 * period, 3 * period, 1001)
    return run(times, "velocity"), run(times, "force")


def break_away(rate):
    """Largest friction force before 20 mm/s."""
    run = require(force_driven(friction.LuGre(), rate * t, t_span=(0, 2 / rate + 0.1)).solve(dense_output=True))
    times = np.linspace(0, run.t[-1], 40001)
    moved = times[np.argmax(run(times, "v") > 0.02)]
    return float(run(times[times <= moved], "friction").max())


def drift():
    """Law -> displacement at the end of every cycle (m)."""
    cycles = np.arange(21.0)
    found = {}
    for name, law, mean, size in (
        ("LuGre", friction.LuGre(), 0.75, 0.5),
        ("Dahl", friction.Dahl(), 0.5, 0.3),
        ("elastoplastic", friction.ElastoplasticFixed(), 0.75, 0.5),
        ("XKY", friction.XKY(), 0.75, 0.5),
    ):
        drive = mean + size * sp.sin(2 * sp.pi * t)
        run = require(force_driven(law, drive, t_span=(0, 20)).solve(dense_output=True))
        found[name] = run(cycles, "x")
    return cycles, found


def draw(fast):
    """Six panels."""
    figure = new_figure(5.8, 7.0)
    panels = figure.subplots(3, 2).reshape(2, 3)
    slow = presliding()
    times = np.linspace(0, 65, 2001)
    panels[0, 0].plot(1e6 * slow(times, "x"), slow(times, "drive"), color=COLOUR["right"])
    panels[0, 0].set(xlabel="displacement (µm)", ylabel="applied force (N)")
    panels[0, 0].set_title("(a) presliding")

    belt = require(block_on_belt(friction.LuGre()).solve(dense_output=True))
    ideal = require(block_on_belt(friction.StaticKinetic()).solve(dense_output=True))
    times = np.linspace(0, 35, 7001)
    panels[0, 1].plot(times, belt(times, "x"), color=COLOUR["right"], label="LuGre")
    panels[0, 1].plot(
        times,
        ideal(times, "x"),
        color=COLOUR["exact"],
        linewidth=0.9,
        linestyle=(0, (4, 2)),
        label="two-level Coulomb",
    )
    panels[0, 1].set(xlabel="time (s)", ylabel="displacement (m)", ylim=(-0.2, 4.7))
    panels[0, 1].set_title("(b) stick-slip")
    panels[0, 1].legend(loc="upper left")

    lags = {Omega: lag(Omega) for Omega in (1.0, 10.0, 25.0)}
    for (Omega, (v, force)), colour, dash in zip(lags.items(), ("right", "stick", "left"), ("-", "--", ":")):
        panels[0, 2].plot(1e3 * v, force, dash, color=COLOUR[colour], label=f"$\\Omega$ = {Omega:.0f} 1/s")
    panels[0, 2].set(xlabel="velocity (mm/s)", ylabel="force (N)")
    panels[0, 2].set_title("(c) frictional lag")
    panels[0, 2].legend()

    rates = np.array([1.0, 2.0, 5.0, 10.0, 20.0, 50.0])
    peaks = [break_away(sp.nsimplify(rate)) for rate in rates]
    panels[1, 0].semilogx(rates, peaks, "o-", color=COLOUR["right"])
    panels[1, 0].set(xlabel="rate of the force (N/s)", ylabel="break-away force (N)", ylim=(0.97, 1.5))
    panels[1, 0].set_title("(d) break-away")

    hunt = require(position_control(friction.LuGre()).solve(dense_output=True))
    times = np.linspace(0, 100, 5001)
    panels[1, 1].plot(times, hunt(times, "x"), color=COLOUR["right"])
    panels[1, 1].axhline(1, color=COLOUR["mark"], linewidth=0.6)
    panels[1, 1].set(xlabel="time (s)", ylabel="position (m)")
    panels[1, 1].set_title("(e) PID hunting")

    cycles, drifts = drift()
    looks = (("right", "-"), ("stick", "--"), ("left", "-"), ("exact", (0, (3, 2))))
    for (name, x), (colour, style) in zip(drifts.items(), looks):
        text = "Dahl, other force" if name == "Dahl" else name
        panels[1, 2].plot(cycles, 1e6 * x, color=COLOUR[colour], label=text, linestyle=style)
    panels[1, 2].set(xlabel="cycles of 1 s", ylabel="displacement (µm)", ylim=(-20, 560))
    panels[1, 2].set_title("(f) drift")
    panels[1, 2].legend()
    return figure, claims(slow, belt, ideal, lags, peaks, hunt, drifts)


def claims(slow, belt, ideal, lags, peaks, hunt, drifts):
    """Numbers of the independent computation beside ours."""
    found = [
        Claim.number(
            f"(a) displacement at {when} s (um)",
            value,
            1e6 * float(slow(when, "x")),
            0.01,
            **computed("tests/reference/bristles.py"),
        )
        for when, value in zip(WHEN, DISPLACED)
    ]
    times = np.linspace(0, 35, 350001)
    v = belt(times, "v")
    starts = times[1:][(v[1:] >= 0.05) & (v[:-1] < 0.05)]
    found.append(
        Claim.number(
            "(b) period of LuGre's stick-slip (s)",
            STICK_SLIP[0],
            float(np.diff(starts)[-1]),
            2e-4,
            **computed("tests/reference/bristles.py"),
        )
    )
    found.append(
        Claim.number(
            "(b) largest velocity (m/s)",
            STICK_SLIP[1],
            float(v.max()),
            2e-4,
            **computed("tests/reference/bristles.py"),
        )
    )
    found.append(
        Claim.number(
            "(b) period of the two-level law (s, closed form)",
            7.6113,
            float(np.diff(ideal.event_times("slip"))[-1]),
            1e-4,
            **closed_form(),
        )
    )
    areas = [abs(float(np.trapezoid(f, v))) for v, f in lags.values()]
    text = ", ".join(f"{1e6 * a:.1f}" for a in areas) + " uN m/s"
    grows = areas == sorted(areas)
    found.append(
        Claim("(c) the lag's loop grows with the frequency", "it grows", text, grows, "it does not", **EXPECTED)
    )
    found.append(
        Claim(
            "(d) the break-away force falls with the rate",
            "F_s towards F_c",
            ", ".join(f"{p:.3f}" for p in peaks) + " N",
            peaks == sorted(peaks, reverse=True),
            "it rises",
            **EXPECTED,
        )
    )
    times = np.linspace(50, 100, 50001)
    x = hunt(times, "x")
    found.append(
        Claim.number(
            "(e) lower end of the limit cycle (m)",
            HUNTING[0],
            float(x.min()),
            2e-4,
            **computed("tests/reference/bristles.py"),
        )
    )
    found.append(
        Claim.number(
            "(e) upper end of the limit cycle (m)",
            HUNTING[1],
            float(x.max()),
            2e-4,
            **computed("tests/reference/bristles.py"),
        )
    )
    found.append(
        Claim.number(
            "(f) drift of LuGre per cycle (um)",
            DRIFT,
            1e6 * float(np.diff(drifts["LuGre"])[-1]),
            0.001,
            **computed("tests/reference/bristles.py"),
        )
    )
    for name in ("elastoplastic", "XKY"):
        still = float(np.abs(np.diff(drifts[name])[-5:]).max())
        found.append(
            Claim(
                f"(f) drift of the {name} law per cycle",
                "0",
                f"{still:.1e} m",
                still < 1e-12,
                "it drifts",
                **IDENTITY,
            )
        )
        found.append(
            Claim.number(
                f"(f) displacement of the {name} law after 20 cycles (um)",
                STILL,
                1e6 * float(drifts[name][-1]),
                1e-4,
                **computed("tests/reference/bristles.py"),
            )
        )
    return found
