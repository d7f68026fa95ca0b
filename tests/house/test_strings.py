"""Text is data: at no door is it run. Every door that takes text or passes it on gets text that would plant a file."""

import math
import time
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols
from typer.testing import CliRunner

import pwsmooth
import pwsmooth.door.checks
from pwsmooth import (
    Algebraic,
    Diffusion,
    Event,
    Family,
    Kicks,
    Memory,
    Switch,
    System,
    Unilateral,
    scenes,
    studies,
)
from pwsmooth.analysis.lyapunov import lyapunov_exponents
from pwsmooth.analysis.maps.sections import Section, Stroboscopic
from pwsmooth.analysis.maps.symmetry import symmetry_matrix
from pwsmooth.analysis.sticking import regions as sticking
from pwsmooth.cli import app
from pwsmooth.definition.sigmoids import sigmoid
from pwsmooth.door import formula
from pwsmooth.laws import Joint
from pwsmooth.laws.contact import Hertz
from pwsmooth.laws.friction import Coulomb, Dahl

t, x, v, k, omega = sp.symbols("t x v k omega", real=True)
SYSTEM = System({x: v, v: sp.cos(omega * t) - k * x - v / 5}, time=t, parameters={k: 1, omega: 1})
FREE = System({x: v, v: (1 - x**2) * v - x})
START = {x: 1, v: 0}
CLOCK = "__import__('pathlib').Path({path!r}).touch()"
lam, z = sp.symbols("lam z", real=True)
elements = Family(3)
(member,) = elements.symbols("m")


def orbit(**given):
    return pwsmooth.find_orbit(SYSTEM, START, pwsmooth.Strobe(**{"period": 2 * sp.pi, **given}))


def pendulum():
    q = dynamicsymbols("q")
    lagrange = LagrangesMethod(k * q.diff() ** 2 / 2 + sp.cos(q), [q])
    lagrange.form_lagranges_equations()
    return lagrange


def sweep(**given):
    usual = {
        "x0": START,
        "seen": pwsmooth.Strobe(2 * sp.pi),
        "transient": 1,
        "periods": 1,
        "measures": ["period"],
    }
    return pwsmooth.sweep(SYSTEM, {"k": [1.0]}, **usual | given)


DOORS = {
    "period of sweep": lambda s: sweep(seen=pwsmooth.Strobe(s)),
    "axes of sweep": lambda s: pwsmooth.sweep(SYSTEM, {s: [1.0]}, seen=pwsmooth.Strobe(1)),
    "values of an axis": lambda s: pwsmooth.sweep(SYSTEM, {"k": [s]}, seen=pwsmooth.Strobe(1)),
    "start of sweep": lambda s: sweep(x0={"x": s, "v": 0}),
    "measures": lambda s: sweep(measures=[s]),
    "quantities of a measure": lambda s: sweep(measures=[f"amplitude({s})"]),
    "units": lambda s: sweep(units={"x": s}),
    "noise of sweep": lambda s: sweep(noise=s),
    "period of basins": lambda s: pwsmooth.basins(SYSTEM, {"x": [1.0]}, pwsmooth.Strobe(s), x0={"v": 0}),
    "period of orbit_diagram": lambda s: studies.orbit_diagram(SYSTEM, "k", [1.0], START, pwsmooth.Strobe(s)),
    "period of a carried diagram": lambda s: studies.orbit_diagram(
        SYSTEM, "k", [1.0], START, pwsmooth.Strobe(s), carry=True
    ),
    "parameter of orbit_diagram": lambda s: studies.orbit_diagram(SYSTEM, s, [1.0], START, pwsmooth.Strobe(1)),
    "period of find_orbit": lambda s: orbit(period=s),
    "section": lambda s: pwsmooth.find_orbit(FREE, START, seen=pwsmooth.Return(s)),
    "symmetry": lambda s: orbit(symmetry={x: s, v: -v}),
    "key of a symmetry": lambda s: orbit(symmetry={s: -x, v: -v}),
    "symmetry_matrix": lambda s: symmetry_matrix(SYSTEM, {x: s}, 1.0),
    "Stroboscopic": lambda s: Stroboscopic(SYSTEM, s),
    "Section": lambda s: Section(FREE, surface=s),
    "x0": lambda s: pwsmooth.solve(SYSTEM, (0, 1), {"x": s, "v": 0}),
    "t_span": lambda s: pwsmooth.solve(SYSTEM, (0, s), START),
    "parameters of solve": lambda s: pwsmooth.solve(SYSTEM, (0, 1), START, parameters={k: s}),
    "name of a parameter": lambda s: pwsmooth.solve(SYSTEM, (0, 1), START, parameters={s: 1}),
    "tolerances": lambda s: pwsmooth.solve(SYSTEM, (0, 1), START, rtol=s),
    "method": lambda s: pwsmooth.solve(SYSTEM, (0, 1), START, method=s),
    "time of exponents": lambda s: lyapunov_exponents(SYSTEM, START, s),
    "rates": lambda s: System({x: s}),
    "a state's name": lambda s: pwsmooth.solve(System({s: -1}), (0, 1), [1])[s],
    "outputs": lambda s: System({x: -x}, outputs={"a": s}),
    "an output's name": lambda s: pwsmooth.solve(System({x: -x}, outputs={s: x}), (0, 1), [1])[s],
    "values of System": lambda s: System({x: -k * x}, parameters={k: s}),
    "time": lambda s: System({x: -x}, time=s),
    "convention": lambda s: System({x: -x}, convention=s),
    "smoothed": lambda s: System({x: -sp.sign(x)}).smoothed(s),
    "sigmoid": lambda s: System({x: -sp.sign(x)}).smoothed(1e-3, s),
    "ratios": lambda s: System({x: -Switch("lam", x) - z, z: (1 - z) / k}, parameters={k: 1}).layered({"z": s}),
    "time_constant": lambda s: System({x: -Switch("lam", x) - z, z: (1 - z) / k}, parameters={k: 1}).layered(
        {"z": 1}, time_constant={"z": s}
    ),
    "surface of Switch": lambda s: Switch("lam", s),
    "name of Switch": lambda s: pwsmooth.solve(System({x: -Switch(s, x)}), (0, 2), [1])[s],
    "initial of Memory": lambda s: Memory("m", s),
    "gap": lambda s: Unilateral(s),
    "restitution": lambda s: Unilateral(x, s),
    "residual": lambda s: Algebraic("a", s),
    "surface of Event": lambda s: Event(s),
    "every": lambda s: Event(every=s),
    "at": lambda s: Event(at=s),
    "one of at": lambda s: Event(at=[1, s]),
    "when": lambda s: Event(x, when=s),
    "update": lambda s: Event(x, update={x: s}),
    "Family.sum": lambda s: elements.sum(s),
    "Family.symbols": lambda s: elements.symbols(s),
    "outside": lambda s: elements.neighbour(member, 1, outside=s),
    "size of Kicks": lambda s: Kicks({"x": s}, every=1),
    "states of Kicks": lambda s: pwsmooth.solve(SYSTEM, (0, 1), START, noise=Kicks(1, every=1, on=s)),
    "amplitude": lambda s: Diffusion({"x": s}, step=0.1),
    "parameters of Diffusion": lambda s: Diffusion({x: k}, step=0.1, parameters={k: s}),
    "fold": lambda s: sticking.fold(s, lam, 3),
    "rho of fold": lambda s: sticking.fold(1 - lam**2, lam, s),
    "lam of fold": lambda s: sticking.fold(1 - lam**2, s, 3),
    "linear_sticking": lambda s: sticking.linear_sticking(s, 1, 1).condition(x),
    "nonlinear_sticking": lambda s: sticking.nonlinear_sticking(0, s, 1, 1 - lam**2, lam, 3),
    "StickingRegion": lambda s: sticking.StickingRegion(sp.S(0), sp.S(1), s, sp.S(1)).condition(x),
    "condition": lambda s: sticking.linear_sticking(0, 1, 1).condition(s),
    "Joint": lambda s: Joint(s),
    "load of Joint": lambda s: Joint(v, load=s),
    "attach": lambda s: Dahl().attach(velocity=v, position=s),
    "steady of a law": lambda s: Coulomb().steady(s, SimpleNamespace(F_c=1, sigma2=0)),
    "function of a sigmoid": lambda s: sigmoid("tanh").function(s),
    "slope of a sigmoid": lambda s: sigmoid("erf").slope(s),
    "inverse of a sigmoid": lambda s: sigmoid(2 / sp.pi * sp.atan(x)).inverse(s),
    "from_mechanics": lambda s: System.from_mechanics(s),
    "from_functions": lambda s: System.from_functions(s, "x"),
    "states of functions": lambda s: System.from_functions(lambda t, x, lam, p: (1.0,), s),
    "friction of a mechanism": lambda s: System.from_mechanics(pendulum(), friction={s: Coulomb()}),
    "values of a mechanism": lambda s: System.from_mechanics(pendulum(), parameters={k: s}),
    "contacts of a mechanism": lambda s: System.from_mechanics(pendulum(), contacts=[s]),
    "name of attach": lambda s: Dahl().attach(velocity=v, name=s),
    "values of a law": lambda s: Coulomb(F_c=s),
    "position": lambda s: scenes.prescribed_motion(Dahl(), position=s),
    "parameters of a drive": lambda s: scenes.prescribed_motion(Dahl(), position=k * scenes.t, parameters={k: s}),
    "parameters of a constant drive": lambda s: scenes.prescribed_motion(Dahl(), velocity=k, parameters={k: s}),
    "force": lambda s: scenes.force_driven(Coulomb(), s),
    "normal": lambda s: scenes.force_driven(Coulomb(), 1, normal=s),
    "parameters of a force": lambda s: scenes.force_driven(Coulomb(), k, parameters={k: s}),
    "start of assemble": lambda s: scenes.assemble({x: v}, Dahl().attach(velocity=v), x0={x: s, v: 1}),
    "start of a scene": lambda s: scenes.friction_oscillator(Coulomb(), x0=(s, 0)),
    "parameters of a scene": lambda s: scenes.pressed_block(Hertz(), k, parameters={k: s}),
}  # fmt: skip


@pytest.mark.parametrize("door", DOORS)
def test_text_is_not_run(door, tmp_path):
    planted = tmp_path / "planted"
    code = CLOCK.format(path=str(planted))
    for text in (code, f"({code}, 1)[1]", f"1 if {code} else 1", f"1); {code}; (1", np.str_(code)):
        try:
            DOORS[door](text)
        except (ValueError, TypeError, KeyError):
            pass  # a name that a model does not have is a KeyError of its solution
        assert not planted.exists(), text


SCENE = "[system]\nscene = 'block_on_belt'\nlaw = 'Coulomb'\n"
AXES = "[axes]\nspring = [1.0]\n"
STUDY = {
    "period": "seen = {{ period = {text} }}\n" + SCENE + AXES,
    "measures": "measures = [{text}]\n" + SCENE + AXES,
    "scene": "[system]\nscene = {text}\nlaw = 'Coulomb'\n" + AXES,
    "law": "[system]\nscene = 'block_on_belt'\nlaw = {text}\n" + AXES,
    "object": "[system]\nobject = {text}\n" + AXES,
    "arguments": SCENE + "arguments = {{ k = {text} }}\n" + AXES,
    "normal": SCENE + "arguments = {{ normal = {text} }}\n" + AXES,
    "kicks": SCENE + AXES + "[kicks]\nsize = {text}\non = 'v'\nevery = 1\n",
    "axes": SCENE + "[axes]\n{text} = [1.0]\n",
}


@pytest.mark.parametrize("key", STUDY)
def test_a_study_is_not_run(key, tmp_path):
    planted = tmp_path / "planted"
    (tmp_path / "evil.py").write_text(f"import pathlib\npathlib.Path({str(planted)!r}).touch()\nf = None\n")
    code = CLOCK.format(path=str(planted))
    texts = (code, "evil.py:f", "os:system", f"../{tmp_path.name}/evil.py:f", f"{tmp_path / 'evil.py'}:f")
    for text in texts:
        path = tmp_path / "study.toml"
        path.write_text(STUDY[key].format(text='"' + text.replace('"', '\\"') + '"'))
        result = CliRunner().invoke(app, ["sweep", str(path), "--out", str(tmp_path)])
        assert not planted.exists(), text
        assert result.exit_code == 2 and not isinstance(result.exception, Exception), result.output


def test_formulas_read_what_they_say():
    named = {"omega": omega}
    for text, value in {
        "2*pi/omega": 2 * sp.pi / omega, "-omega**2 + 1/3": -(omega**2) + sp.Rational(1, 3), "1e-3": sp.Float(1e-3),
        "(1 + 2)*omega": 3 * omega, "omega**-1": 1 / omega, "2**0.5": sp.Float(2) ** 0.5, "+oo": sp.oo,
    }.items():  # fmt: skip
        assert formula.read(text, named, "`period`") == value
    assert float(formula.read(repr(2 * math.pi), {}, "`period`")) == 2 * math.pi


@pytest.mark.parametrize(
    "text",
    ["", "omega", "f(1)", "a.b", "[1]", "1 < 2", "1 if 1 else 2", "lambda: 1", "'1'", "1j", "True", "x := 1", "1 // 2",
     "9**9**9**9", "2**10**10", "(" * 300 + "1" + ")" * 300, "1" * 2000, "1\x001", "1e5000*0", "…",
     "*".join(["9**300"] * 100), "1/0", "0**-1", "2**(2**0.5*1e9)", "(pi+1)**1000000", "oo**oo**9"],
)  # fmt: skip
def test_formulas_refuse_all_else_at_once(text):
    begun = time.process_time()
    with pytest.raises((ValueError, TypeError), match="`period`"):
        pwsmooth.door.checks.period(text, {})
    assert time.process_time() - begun < 1
