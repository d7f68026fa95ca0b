"""Malformed calls: every public callable, every argument, values that it cannot take. `python -m tests.fuzz.doors`

A call with one bad argument is either accepted, because the value is one after all (True is 1), or refused: by a
ValueError or TypeError that names the argument. Any other exception, a refusal without the name, a call that takes over
five seconds of processor time, and a signal are findings. Case number i of a seed is always the same call.

    python -m tests.fuzz.doors --cases 12000 --seed 1
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import decimal
import fractions
import functools
import inspect
import math
import multiprocessing
import os
import random
import re
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import sympy as sp

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))

import public_names

import pwsmooth
from pwsmooth import Diffusion, Event, Family, Kicks, Switch, System, costs, scenes, solve, studies
from pwsmooth.analysis.continuation import Steps
from pwsmooth.analysis.maps import sections
from pwsmooth.analysis.sticking import regions as sticking
from pwsmooth.explorer import opening
from pwsmooth.fitting import Record, fit
from pwsmooth.laws import Joint, contact, friction
from pwsmooth.paths.derivatives.of_solution import NoDerivative
from pwsmooth.scenes import sketch
from pwsmooth.studies import Work, make_plan, study

SECONDS = 5.0  # of processor time in a call
t, x, v, k, z = sp.symbols("t x v k z", real=True)
# Seconds of work each, or no doors of a model: comparisons, figures, pictures.
NO_DOORS = (
    "pwsmooth.compare",
    "pwsmooth.plotting",
    "pwsmooth.costs.for_jax",
    "pwsmooth.costs.for_torch",
)


# Made by the package, or bases to derive from: their arguments come from inside, or are any names.
INSIDE = {
    "pwsmooth.diagrams.BifurcationSet", "pwsmooth.diagrams.Diagram",
    "pwsmooth.Solution", "pwsmooth.results.records.EventLog",
    "pwsmooth.fitting.Combination", "pwsmooth.fitting.Comparison", "pwsmooth.fitting.Fit",
    "pwsmooth.fitting.Identifiability",
    "pwsmooth.fitting.Iteration", "pwsmooth.fitting.Profile", "pwsmooth.costs.Evaluation", "pwsmooth.costs.Gradient",
    "pwsmooth.costs.Minimum", "pwsmooth.costs.Quantity",
    "pwsmooth.paths.derivatives.Derivatives", "pwsmooth.paths.derivatives.EventDerivative",
    "pwsmooth.paths.derivatives.NoDerivative",
    "pwsmooth.laws.law", "pwsmooth.studies.Amplitude", "pwsmooth.studies.Extremes", "pwsmooth.studies.Statistics",
}  # fmt: skip


class _Mute:
    """Something that cannot even be shown."""

    def __repr__(self):
        raise RuntimeError("no words")


BAD = {
    "None": lambda: None,
    "True": lambda: True,
    "''": lambda: "",
    "'abc'": lambda: "abc",
    "'1+'": lambda: "1+",
    "'nan'": lambda: "nan",
    "bytes": lambda: b"abc",
    "nan": lambda: math.nan,
    "inf": lambda: math.inf,
    "-inf": lambda: -math.inf,
    "-1": lambda: -1,
    "0": lambda: 0,
    "0.5": lambda: 0.5,
    "-0.0": lambda: -0.0,
    "10**400": lambda: 10**400,
    "-10**5000": lambda: -(10**5000),
    "2**70": lambda: 2**70,
    "1e308": lambda: 1e308,
    "1e-320": lambda: 1e-320,
    "1j": lambda: 1j,
    "[]": lambda: [],
    "()": lambda: (),
    "{}": lambda: {},
    "set": lambda: {1, 2},
    "object": object,
    "mute": _Mute,
    "[nan]": lambda: [math.nan],
    "['a']": lambda: ["a"],
    "ragged": lambda: [[1, 2], [3]],
    "empty array": lambda: np.array([]),
    "matrix": lambda: np.zeros((2, 3)),
    "text array": lambda: np.array("abc"),
    "oo": lambda: sp.oo,
    "sp.nan": lambda: sp.nan,
    "zoo": lambda: sp.zoo,
    "I": lambda: sp.I,
    "stranger": lambda: sp.Symbol("stranger"),
    "dummy": lambda: sp.Dummy("x"),
    "f(t)": lambda: sp.Function("f")(t),
    "relation": lambda: sp.Gt(x, 0),
    "sp.Matrix": lambda: sp.Matrix([[1, x]]),
    "class": lambda: int,
    "lambda": lambda: lambda *a: a,
    "Decimal nan": lambda: decimal.Decimal("nan"),
    "Decimal snan": lambda: decimal.Decimal("sNaN"),
    "Fraction": lambda: fractions.Fraction(1, 3),
    "range": lambda: range(3),
    "generator": lambda: (i for i in (1, 2)),
    "{'q': 1}": lambda: {"q": 1},
    "{1: 2}": lambda: {1: 2},
    "{x: nan}": lambda: {x: math.nan},
    "{'x': 'b'}": lambda: {"x": "b"},
    "[None]": lambda: [None],
    "module": lambda: math,
    "huge list": lambda: [10**400, 1],
    "datetime64": lambda: np.datetime64("2020-01-01"),
    "recursive": lambda: _recursive(),
    "float32": lambda: np.float32(2.5),
}


def _recursive():
    value = []
    value.append(value)
    return value


@functools.cache
def subjects():
    """Name -> (callable, arguments that it takes)."""
    drive = 2 * sp.pi
    system = System(
        {x: v, v: sp.cos(t) - k * x - v / 5 - sp.sign(v) / 4}, time=t, parameters={k: 1}, outputs={"a": x + v}
    )
    free = System({x: v, v: (1 - x**2) * v - x})
    hidden = System(
        {v: -Switch("lam", v) * (1 + z) - x, x: v, z: (1 - Switch("lam", v) ** 2 - z) / k}, parameters={k: 1}
    )
    start = {"x": 1.0, "v": 0.1}
    short = {"max_steps": 3000}
    smooth = system.smoothed(1e-2)
    opening.serve = lambda explorer: None  # show=True is a value: no page is opened while doors are tried
    run = solve(system, (0, 3), start, dense_output=True)
    scene = scenes.friction_oscillator(friction.Coulomb(), t_span=(0, 1))
    orbit = pwsmooth.find_orbit(system, start, seen=pwsmooth.Strobe(drive), transient=20)
    jump = Event(every=1, update={x: k * x * (1 - x) - z * x})
    logistic = pwsmooth.find_orbit(
        System({x: 0 * x}, time=t, parameters={k: 2.9, z: 0}, events=[jump]), {x: 0.6}, seen=pwsmooth.Strobe(1)
    )
    (flip,) = pwsmooth.follow(logistic, {k: 3.1}).of_kind("flip")
    mapped = System({x: 0 * x}, time=t, parameters={k: 2.9, z: 0}, events=[jump])
    pulled = System({x: k / 4 - Switch("lam", x)}, parameters={k: 1})
    wave = System({x: v, v: (k - x**2) * v - x}, parameters={k: -0.5})
    (hopf,) = pwsmooth.follow(pwsmooth.find_equilibrium(wave, {x: 0, v: 0}), {k: 0.5}).of_kind("Hopf")
    record = Record(np.linspace(0, 1, 9), {"x": np.linspace(1, 1.1, 9)}, x0=start)
    fitted = fit(system, record, ["k"], max_runs=2)
    strobe = sections.Stroboscopic(system, drive, options=short)
    section = sections.Section(free, surface=v, direction=-1, options=short)
    elements = Family(3)
    (member,) = elements.symbols("m")
    kicks = Kicks(0.01, every=0.5, on="v")
    white = Diffusion({v: 0.1}, step=1 / 16)
    times = np.linspace(0, 1, 21)
    many = {
        "x0": start,
        "seen": pwsmooth.Strobe(drive),
        "transient": 1,
        "periods": 2,
        "measures": ["period"],
        **short,
    }
    motion = np.sin(6 * times)
    word = {"velocity": v}
    out = tempfile.mkdtemp()
    path = Path(out) / "study.toml"
    path.write_text("[system]\nscene = 'friction_oscillator'\nlaw = 'Coulomb'\n[axes]\nspring = [1.0]\n")
    loaded = study.read_study(path)
    saved = str(Path(out) / "saved.zarr")
    seen = pwsmooth.Strobe(1, phase=0.5)
    few, kept = Steps(max_points=20), Work(store=saved)
    pwsmooth.diagram(mapped, {k: (2.5, 2.9)}, {"x": 0.6}, seen, values=2, steps=few, work=kept)
    saddle = pwsmooth.find_equilibrium(System({x: v, v: x}), {x: 0, v: 0})
    through = System({x: 1, v: -x, z: -v - Switch("lam", z)})
    stored = str(Path(out) / "stored.zarr")
    pwsmooth.sweep(system, {"k": [1.0]}, x0=start, t_span=(0, 1), measures=["counts"], work=Work(store=stored))
    given = {
        "System": dict(
            rates={x: v, v: -k * x}, time=t, parameters={k: 1}, outputs={"a": x}, events=[Event(x - 9)]
        ),
        "explore": dict(
            system_or_scene=system,
            x0=start,
            t_span=(0, 3),
            seen=pwsmooth.Strobe(drive),
            ranges={k: (1, 2)},
            noise=kicks,
            show=False,
        ),
        "Solution": None,
        "Outcome": None,
        "Switch": dict(name="lam", surface=v),
        "Disc": dict(name="lam", surfaces=(v, x)),
        "Histogram": dict(of="waiting", edges=[0.0, 1.0, 2.0]),
        "SlipHistogram": dict(of="area", edges=[1.0, 2.0, 3.0]),
        "Activity": dict(every=1.0),
        "Memory": dict(name="m", initial=1.0),
        "Unilateral": dict(gap=x, restitution=0.5, name="R"),
        "Algebraic": dict(unknown="a", residual=sp.Symbol("a") + x),
        "Event": dict(surface=x, update={x: 1}),
        "Family": dict(n=3),
        "Kicks": dict(size=0.1, every=1, on="v"),
        "Diffusion": dict(amplitude={v: 0.1}, step=0.5, parameters={}),
        "solve": dict(
            system=system,
            t_span=(0, 1),
            x0=start,
            t_eval=[0.5],
            parameters={k: 2},
            atol=1e-12,
            rtol=1e-9,
            **short,
        ),
        "ensemble": dict(system=free, t_span=(0, 1), x0=start, noise=white, count=2, **short),
        "sweep": dict(
            system=system, axes={"k": [1.0, 2.0]}, units={"k": "N/m"}, rtol=1e-9, method="auto", **many
        ),
        "Strobe": dict(period=drive, phase=0.5, symmetry={x: -x, v: -v}),
        "Return": dict(section=v, direction=-1, longest=20.0),
        "find_orbit": dict(
            system=system, x0=start, seen=pwsmooth.Strobe(drive, symmetry={x: -x, v: -v}), rtol=1e-12, **short
        ),
        "follow": dict(start=orbit, over={k: 1.01}, steps=Steps(max_points=5)),
        "find_equilibrium": dict(system=pulled, x0={"x": 0.2}, sides={"lam": 0}),
        "equilibria": dict(system=pulled, box={"x": (-1.0, 1.0)}, sides={"lam": 0}, starts=8),
        "manifold": dict(saddle=saddle, kind="stable", length=0.5, box={x: (-2, 2), v: (-2, 2)}, max_points=50),
        "sliding_portrait": dict(
            system=through, switch="lam", box={x: (-1.0, 1.0), v: (-1.0, 1.0)}, at={}, points=5
        ),
        "make_plan": dict(system=system, axes={"k": [1.0, 2.0]}, units={"k": "N/m"}, **many),
        "studies.refine": dict(
            plan=make_plan(system, {"k": [1.0, 2.0]}, **many),
            order=[1, 0],
            max_seconds=1.0,
            settle=1e-6,
        ),
        "studies.SweepPlan": None,  # of make_plan
        "Sketch": dict(shapes=[sketch.Ball("b", x, 0, 1)], bounds=(-1, 1, -1, 1), note="n"),
        "chain_of_blocks": dict(positions=["x", "v"], spacing=1.0, switches=["l", "m"]),
        "Arrow": dict(name="a", x=x, y=0, dx=v, dy=1),
        "Ball": dict(name="a", x=x, y=0, radius=1.0, angle=v, phase="l"),
        "Bar": dict(name="a", x_1=0, y_1=0, x_2=x, y_2=v, width=0.1),
        "Belt": dict(name="a", x_1=0, y_1=0, x_2=x, y_2=v, travel=t, mark=0.1),
        "Block": dict(name="a", x=x, y=0, width=1.0, height=0.5, angle=v, phase="l"),
        "Clearance": dict(name="a", x=x, y=0, radius=1.0),
        "Ground": dict(name="a", x_1=0, y_1=0, x_2=x, y_2=v),
        "sketch.Joint": dict(name="a", x=x, y=0, radius=1.0),
        "Shape": dict(name="a"),
        "Spring": dict(name="a", x_1=0, y_1=0, x_2=x, y_2=v, width=0.1),
        "refine_basins": dict(
            system=system,
            axes={"x": [0.0, 1.0]},
            seen=pwsmooth.Strobe(drive),
            x0={"v": 0.0},
            transient=5,
            max_count=2,
            max_seconds=1.0,
            **short,
        ),
        "studies.Cost": dict(name="J", cost=costs.final(x), unit="m"),
        "studies.read_store": dict(path=stored),
        "cycle_from": dict(hopf=hopf, amplitude=0.05, **short),
        "lyapunov_exponents": dict(system=system, x0=start, time=5.0, rtol=1e-9, **short),
        "basins": dict(
            system=system,
            axes={"x": [0.0, 1.0]},
            seen=pwsmooth.Strobe(drive),
            x0={"v": 0.0},
            transient=5,
            max_count=2,
            **short,
        ),
        "orbit_diagram": dict(
            system=system,
            parameter=k,
            values=[1.0, 2.0],
            x0=start,
            seen=pwsmooth.Strobe(drive),
            transient=3,
            keep=2,
            **short,
        ),
        "diagram": dict(
            system=mapped,
            over={k: (2.5, 2.9)},
            x0={"x": 0.6},
            seen=pwsmooth.Strobe(1, phase=0.5),
            values=2,
            steps=Steps(max_points=20),
            **short,
        ),
        "diagram over two": (
            pwsmooth.diagram,
            dict(
                system=mapped,
                over={k: (2.5, 2.9), z: (-0.1, 0.1)},
                x0={"x": 0.6},
                seen=pwsmooth.Strobe(1, phase=0.5),
                values=2,
                steps=Steps(max_points=20),
                lines={z: [0.0]},
                **short,
            ),
        ),
        "Steps": dict(first=0.01, longest=0.1, shortest=1e-6, max_points=5),
        "Work": dict(workers=2, chunk=3, store=stored, progress=False),
        "read_diagram": dict(path=saved),
        "capture_threshold": dict(rho=3.0, ratio=1.0),
        "critical_ratio": dict(rho=3.0),
        "follow over two": (
            pwsmooth.follow,
            dict(start=flip, over={k: (2.5, 3.5), z: (-0.5, 0.5)}, virtual=False, steps=Steps(max_points=3)),
        ),
        "branch_off": dict(bifurcation=flip, amplitude=0.05),
        "change_between": dict(one=orbit, other=orbit),
        "same_itinerary": dict(one=orbit, other=orbit),
        "largest_exponent": dict(solution=run),
        "refine": dict(map_=strobe, x0=start),
        "Section": dict(system=free, surface=v, options=short),
        "Stroboscopic": dict(system=system, period=drive, options=short),
        "word_of": dict(solution=run),
        "StickingRegion": dict(drive=sp.S(1), stiffness=sp.S(2), load=sp.S(1), coefficient=sp.S(1)),
        "fold": dict(gamma=1 - z**2, lam=z, rho=3),
        "linear_sticking": dict(drive=0, stiffness=1, load=1),
        "nonlinear_sticking": dict(drive=0, stiffness=1, load=1, gamma=1 - z**2, lam=z, rho=3),
        "variations": dict(solution=run, parameters=["k"]),
        "fit": dict(system=system, records=record, by=["k"], max_runs=2),
        "fit_law": dict(
            law=friction.Coulomb(sigma2=0.1),
            t=times,
            motion=motion,
            force=np.sign(motion),
            kind="velocity",
            max_runs=2,
        ),
        "fit.compare": dict(fits={"one": fitted}),
        "Record": dict(t=times, values={"x": np.cos(times)}, noise=0.1, x0=start, unknown=["v"]),
        "laws.Joint": dict(v=v),
        "law": None,
        "parameter": dict(default=1.0, unit="N", meaning="force"),
        "Pieces": dict(force=v),
        "composite_modulus": dict(E_1=1e9, nu_1=0.3),
        "contact_duration": dict(stiffness=1.0, exponent=1.5, mass=1.0, speed=1.0),
        "damping_factor": dict(name="hunt-crossley", c_r=0.5),
        "effective_restitution": dict(name="hunt-crossley", c_r=0.5),
        "exact_eta": dict(e=0.5),
        "hertz_stiffness": dict(E_star=1e9, R_1=0.1),
        "journal_stiffness": dict(E_star=1e9, R_B=0.02, R_J=0.01),
        "maximal_indentation": dict(stiffness=1.0, exponent=1.5, mass=1.0, speed=1.0),
        "phase_curve": dict(eta=0.5, s=0.5),
        "restitution": dict(eta=0.5),
        "Factor": None,
        "RealTime": None,
        "real_time": dict(law=friction.Coulomb()),
        "clip": dict(x=0.5, limit=1.0),
        "dio_defect": dict(y=0.0, w=0.5),
        "max_of_dio": dict(A=1.0, B=1.0, c=1.0),
        "sat_of_sgn": dict(x=0.5, limit=1.0, sigma=1.0),
        "sgn_defect": dict(y=0.5, w=0.5, limit=1.0),
        "EventLog": None,
        "Scene": dict(name="s", system=system, start=start, t_span=(0, 1)),
        "Drive": dict(times=times, values=motion),
        "assemble": dict(
            rates={x: v, v: -x}, pieces=friction.Dahl().attach(velocity=v), start={x: 0.0, v: 1.0}
        ),
        "force_driven": dict(law=friction.Coulomb(), force=sp.sin(scenes.t)),
        "pressed_block": dict(law=contact.KelvinVoigt(), force=sp.sin(scenes.t)),
        "prescribed_motion": dict(law=friction.Dahl(), position=sp.sin(scenes.t)),
        "grazing_amplitude": dict(d=1.0, k=1.0, c=0.5, m=1.0, omega=0.8),
        "slider_crank": {},
        "clearance_joint": dict(e=(x, v), rate=(z, k), c=1e-3, R_B=0.01, R_J=0.009, normal=contact.Hertz()),
        "sigmoid": dict(name="tanh"),
        "Sigmoid": None,
        "Function": dict(function=len, names="a"),
        "Window": None,
        "Measure": None,
        "measure_from_text": dict(text="points(x)"),
        "Period": {},
        "Points": {},
        "LiuImpact": dict(E_star=1e9, length=0.01, clearance=1e-3),
        "ResidualHuntCrossley": {},
    }
    cost = costs.final(x) + costs.integral(x * v)
    given |= {
        "Objective": dict(system=system, cost=cost, t_span=(0, 1), x0=start, by=["k", "x"]),
        "value_and_gradient": dict(system=system, cost=cost, t_span=(0, 1), x0=start, by=["k"]),
        "minimise": dict(
            system=system,
            cost=cost,
            t_span=(0, 1),
            x0=start,
            by=["k"],
            bounds={"k": (0.5, 2.0)},
            constraints=[costs.final(x) >= 0.1],
            max_evaluations=3,
        ),
        "Control": dict(name="u", times=[0.0, 1.0, 2.0], values=[1.0, 2.0], degree=0),
        "at": dict(expression=x, time=1.0),
        "at_event": dict(expression=x, switch="lam", kind="stick", number=0, after=True),
        "duration": dict(switch="lam"),
        "event_time": dict(switch="lam", kind="stick", number=0),
        "final": dict(expression=x),
        "integral": dict(expression=x),
        "largest": dict(expression=x, start=0.0, end=1.0),
        "smallest": dict(expression=x, start=0.0, end=1.0),
        "misfit": dict(expression=x, times=times, values=motion, sigma=0.1),
    }
    for name in ("Amplitude", "Extremes", "Statistics"):
        given[name] = None  # *names
    for name in INSIDE:
        if name.startswith(("pwsmooth.fitting", "pwsmooth.costs", "pwsmooth.paths.derivatives.of_solution")):
            given[name.rsplit(".", 1)[1]] = None
    for scene_name in (
        "block_on_belt",
        "friction_oscillator",
        "position_control",
        "block_train",
        "block_lattice",
    ):
        given[scene_name] = dict(law=friction.Coulomb())
    for scene_name in ("incline", "billiard_ball", "bristle_bot", "caster"):
        given[scene_name] = dict(law=friction.Coulomb())
    given |= {
        "element_cloud": dict(law=friction.MaxwellSlip(), position=sp.sin(scenes.t)),
        "shaken_plate": dict(law=friction.Coulomb(), plate=(sp.sin(scenes.t), 0), lift=sp.cos(scenes.t)),
        "planar_oscillator": dict(law=friction.Coulomb(), force=(sp.sin(scenes.t), 0)),
        "pulled_block": dict(law=friction.Coulomb(), path=(scenes.t, 0), plate=(0, sp.sin(scenes.t))),
        "spinning_disc": dict(law=friction.LimitEllipsoid()),
        "gripped_bar": dict(law=friction.LimitEllipsoid(), grip=100 - scenes.t),
        "stacked_plates": dict(law=friction.Coulomb(), ground=friction.Coulomb(), force=(scenes.t, 0)),
    }
    for scene_name in ("falling_ball", "free_impact", "impact_oscillator"):
        given[scene_name] = dict(law=contact.KelvinVoigt())
    found = {}
    for full, value in public_names.public_names().items():
        if not callable(value) or full.startswith(NO_DOORS) or type(value).__name__ == "GenericAlias":
            continue
        short_name = full.rsplit(".", 1)[1]
        name = next((n for n in (".".join(full.rsplit(".", 2)[1:]), short_name) if n in given), None)
        if (
            isinstance(value, type)
            and name is None
            and "Parameters\n" not in (value.__doc__ or "")
            and value.__init__ is object.__init__
        ):
            continue
        arguments = given[name] if name else {}
        if (
            arguments is None
            or isinstance(value, type)
            and "Parameters\n" not in (value.__doc__ or "")
            and not name
        ):
            if not _is_law(value):
                continue  # what the package makes and users read
        found[full] = value, arguments
    methods = {
        "System.smoothed": (system.smoothed, dict(eps=1e-2)),
        "System.with_parameters": (system.with_parameters, dict(parameters={k: 2})),
        "System.layered": (hidden.layered, dict(ratios={z: 1.0}, eps_ratio={"lam": 1.0}, time_constant={z: k})),
        "System.initial_state": (system.initial_state, dict(x0=start)),
        "System.from_functions": (
            System.from_functions,
            dict(
                f=lambda t, x, lam, p: (-p[0] * lam[0],),
                states="a",
                surfaces={"lam": lambda t, x, p: x[0]},
                parameters={"k": 1.0},
                events=[Event(lambda t, x, p: x[0] - 9)],
            ),
        ),
        "solve smoothed": (solve, dict(system=smooth, t_span=(0, 0.1), x0=start, **short)),
        "solve stiff": (solve, dict(system=free, t_span=(0, 1), x0=start, method="stiff", **short)),
        "solve kicked": (solve, dict(system=system, t_span=(0, 1), x0=start, noise=kicks, **short)),
        "sweep span": (
            pwsmooth.sweep,
            dict(
                system=system,
                axes={"x": [1.0]},
                x0={"v": 0},
                t_span=(0, 1),
                measure_from=0.5,
                measures=["counts"],
                **short,
            ),
        ),
        "sweep noise": (
            pwsmooth.sweep,
            dict(
                system=system,
                axes={"seed": [1]},
                x0=start,
                t_span=(0, 1),
                noise=kicks,
                measures=["points"],
                **short,
            ),
        ),
        "ensemble kicks": (
            studies.ensemble,
            dict(system=free, t_span=(0, 1), x0=start, noise=kicks, count=2, **short),
        ),
        "follow equilibrium": (
            pwsmooth.follow,
            dict(start=pwsmooth.find_equilibrium(pulled, {"x": 0.2}), over={k: 5}, steps=Steps(max_points=5)),
        ),
        "find_orbit section": (
            pwsmooth.find_orbit,
            dict(system=free, x0=start, seen=pwsmooth.Return(v, direction=-1), count=1, **short),
        ),
        "sweep section": (
            pwsmooth.sweep,
            dict(
                system=free,
                axes={"x": [1.0, 2.0]},
                x0=start,
                seen=pwsmooth.Return(v, direction=-1, longest=20.0),
                transient=2,
                periods=2,
                measures=["period", "points"],
                **short,
            ),
        ),
        "basins section": (
            pwsmooth.basins,
            dict(
                system=free,
                axes={"x": [1.0]},
                x0={"v": 0.0},
                seen=pwsmooth.Return(v, direction=-1, longest=20.0),
                transient=5,
                max_count=2,
                **short,
            ),
        ),
        "orbit_diagram carried": (
            studies.orbit_diagram,
            dict(
                system=system,
                parameter=k,
                values=[1.0],
                x0=start,
                seen=pwsmooth.Strobe(drive),
                transient=3,
                keep=2,
                carry=True,
                **short,
            ),
        ),
        "Family.sum": (elements.sum, dict(expr=member)),
        "Family.symbols": (elements.symbols, dict(names="a b")),
        "Family.neighbour": (elements.neighbour, dict(member=member, offset=1, outside=0)),
        "Family.memory": (elements.memory, dict(name="q", initial=1)),
        "Solution.__call__": (run, dict(t=1.0, name="x")),
        "Solution.sample": (run.sample, dict(points=50, names=["x", "a"], chord=0.1, scale={"x": 1.0})),
        "Solution.to_dataframe": (run.to_dataframe, dict(n=3)),
        "Solution.event_times": (run.event_times, dict(kind="stick")),
        "Sketch.pose": (sketch.Sketch([sketch.Ball("b", x, 0, 1)]).pose, dict(solution=run, times=[0.0, 1.0])),
        "Solution.animate": (
            run.animate,
            dict(
                sketch=sketch.Sketch([sketch.Ball("b", x, 0, 1)]),
                path=str(Path(out) / "a.gif"),
                fps=2,
                seconds=1.0,
                t_span=(0, 1),
                names=["x"],
            ),
        ),
        "SweepPlan.values": (make_plan(system, {"k": [1.0, 2.0]}, **many).values, dict(indices=[1])),
        "Scene.solve": (scene.solve, dict(t_span=(0, 1), x0=None, **short)),
        "Scene.observe": (scene.observe, dict(solution=scene.solve())),
        "Law.attach": (friction.Coulomb().attach, word | dict(normal=1 + x**2, time=t, name="a")),
        "Law.steady_force": (friction.Coulomb().steady_force, dict(velocity=[1.0])),
        "Stroboscopic.__call__": (strobe, dict(x=start)),
        "Stroboscopic.iterate": (strobe.iterate, dict(x=start, count=2, discard=1)),
        "Stroboscopic.at_phase": (strobe.at_phase, dict(phase=0.1)),
        "Stroboscopic.with_parameters": (strobe.with_parameters, dict(values={k: 2})),
        "Section.iterate": (section.iterate, dict(x=start, count=2, discard=1)),
        "StickingRegion.condition": (sticking.linear_sticking(0, 1, 1).condition, dict(y=x)),
        "PeriodicOrbit.solution": (orbit.solution, dict(periods=1, **short)),
        "Joint.state": (Joint(v).state, dict(name="a", start=1.0, scale=1.0)),
        "Joint.memory": (Joint(v).memory, dict(name="a", initial=1.0)),
        "Joint.deflection": (Joint(v).deflection, dict(name="a", scale=1.0, family=elements)),
        "Joint.switch": (Joint(v).switch, dict(name="a", surface=v)),
        "Joint.family": (Joint(v).family, dict(n=3)),
        "run_study": (
            study.run_study,
            dict(path=path, out=out, resume=True, workers=1, progress=False, names={}, allow_code=False),
        ),
        "read_study": (study.read_study, dict(path=path)),
        "arguments_of": (study.arguments_of, dict(study=loaded, names=study.Names())),
    }
    return found | methods


def _is_law(value):
    from pwsmooth.laws import Law

    return isinstance(value, type) and issubclass(value, Law) and value is not Law


def _arguments(function, given):
    """Names of what can be given: the signature's, and what of the options behind ** is listed."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return list(given)
    named = [
        p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY, p.POSITIONAL_ONLY)
    ]
    return list(dict.fromkeys([*(n for n in named if n != "self"), *given]))


def case(seed, i):
    """(name of the callable, argument, name of the bad value, the call)."""
    choose = random.Random(f"{seed} {i}")
    name = choose.choice(list(subjects()))
    function, given = subjects()[name]
    arguments = _arguments(function, given)
    if not arguments:
        return case(f"{seed}'", i)
    argument, kind = choose.choice(arguments), choose.choice(list(BAD))
    bad, shape = BAD[kind](), ""
    good = given.get(argument)
    # Now and then the bad value stands inside of a good one.
    if isinstance(good, (dict, list, tuple)) and good and choose.random() < 0.5:
        if isinstance(good, dict):
            key = choose.choice(list(good))
            shape, bad = f" for {key}", {**good, key: bad}
        elif isinstance(good, (list, tuple)):
            place = choose.randrange(len(good))
            shape, bad = f" at {place}", [*good[:place], bad, *good[place + 1 :]]
    return name, argument, kind + shape, functools.partial(function, **{**given, argument: bad})


def judged(seed, i):
    """(verdict, description) of a case: accepted, named, unnamed, or the name of another exception."""
    name, argument, kind, call = case(seed, i)
    words = f"{name}({argument}={kind})"
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            call()
    except (ValueError, TypeError) as error:
        found = re.search(rf"(?<!\w){re.escape(argument)}(?!\w)", str(error))
        return ("named" if found else "unnamed"), f"{words}: {type(error).__name__}: {str(error)[:200]}"
    except NoDerivative:  # a run of any length is one, and a bound on its steps ends it: the call was taken
        return "accepted", words
    except Exception as error:
        return type(error).__name__, f"{words}: {str(error)[:200]}"
    return "accepted", words


def _work(pipe, seed):
    os.chdir(tempfile.mkdtemp())  # some texts that are given are good names of files
    subjects()
    pipe.send(None)
    while (i := pipe.recv()) is not None:
        pipe.send(judged(seed, i))


def _processor_time(pid):
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError):
        return time.monotonic()  # no /proc: wall time


def run(cases, seed, first=0, told=print):
    """Counter of verdicts, and the descriptions of all that is neither accepted nor named."""
    context = multiprocessing.get_context("spawn")
    counts, findings, process = collections.Counter(), [], None
    for i in range(first, first + cases):
        if process is None:
            pipe, other = context.Pipe()
            process = context.Process(target=_work, args=(other, seed), daemon=True)
            process.start()
            other.close()
            pipe.recv()
        pipe.send(i)
        begun, verdict = _processor_time(process.pid), None
        try:
            while verdict is None:
                if pipe.poll(0.5):
                    verdict, words = pipe.recv()
                elif _processor_time(process.pid) - begun > SECONDS:
                    verdict = "hang"
        except EOFError:
            verdict = "signal"
        if verdict in ("hang", "signal"):
            words = "{}({}={})".format(*case(seed, i)[:3])
            process.kill()
            process.join()
            process = None
        counts[verdict] += 1
        if verdict != "named" and verdict != "accepted":
            findings.append(f"{verdict} [{i}] {words}")
        if told and (i + 1 - first) % 1000 == 0:
            told(f"{i + 1 - first} cases: {dict(counts)}")
    if process is not None:
        pipe.send(None)
        process.join()
    return counts, findings


def _compile_all():
    """Every callable once as it is meant: a first compilation is no hang."""
    for function, given in subjects().values():
        with contextlib.suppress(Exception):
            function(**given)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=12000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--first", type=int, default=0, help="number of the first case: goes on where another run stopped"
    )
    asked = parser.parse_args()
    compiling = multiprocessing.get_context("spawn").Process(target=_compile_all)
    compiling.start()
    compiling.join()
    counts, findings = run(asked.cases, asked.seed, asked.first)
    print("\n".join(sorted(findings)))
    refused = counts["named"] + counts["unnamed"]
    print(f"{dict(counts)}; {100 * counts['named'] / max(1, refused):.1f} % of the refusals name the argument")
    return int(set(counts) > {"accepted", "named", "unnamed"} or counts["named"] < 0.97 * refused)


if __name__ == "__main__":
    sys.exit(main())
