"""No bad value passes a door: what is refused names the argument, and the generator of malformed calls agrees."""

import enum
import functools
import importlib.util
import inspect
import math
import re
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import pwsmooth
from pwsmooth import (
    Diffusion,
    Disc,
    Drive,
    Event,
    Family,
    Return,
    Strobe,
    Switch,
    System,
    Unilateral,
    basins,
    costs,
    diagram,
    find_orbit,
    scenes,
    solve,
    sweep,
)
from pwsmooth.analysis.lyapunov import lyapunov_exponents
from pwsmooth.analysis.maps.sections import Section, Stroboscopic
from pwsmooth.door import checks
from pwsmooth.fitting import fit_law
from pwsmooth.laws.catalogue import known_laws
from pwsmooth.laws.contact import Hertz
from pwsmooth.laws.friction import Coulomb, Dahl
from pwsmooth.scenes import Scene, block_on_belt, force_driven, prescribed_motion
from pwsmooth.studies import Period, Points, Work, ensemble, make_plan, orbit_diagram

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))

import public_names

t, x, v, k = sp.symbols("t x v k", real=True)
T = 2 * sp.pi
START = {"x": 1.0, "v": 0.1}
BLOCK = System({x: v, v: sp.cos(t) - k * x - v / 5 - sp.sign(v) / 4}, time=t, parameters={k: 1})


def swept(**given):
    return sweep(
        BLOCK, {"k": [2.0, 3.0]}, **{"x0": START, "seen": Strobe(T), "transient": 1, "periods": 1} | given
    )


# Each of them was accepted without a word, ran for ever, or ended in an error that named nothing.
REFUSED = {
    "noise of sweep": ("noise", lambda: swept(noise=0.1)),
    "measure_from beside a period": ("measure_from", lambda: swept(measure_from="abc")),
    "start_time nan": ("start_time", lambda: lyapunov_exponents(BLOCK, START, 10.0, start_time=math.nan)),
    "start_time inf": ("start_time", lambda: lyapunov_exponents(BLOCK, START, 10.0, start_time=math.inf)),
    "start_time without digits": ("start_time", lambda: lyapunov_exponents(BLOCK, START, 10.0, start_time=1e308)),
    "time beyond digits": ("time", lambda: lyapunov_exponents(BLOCK, START, 2**70, max_steps=20_000)),
    "tol nan": ("tol", lambda: basins(BLOCK, {"x": [1.0]}, Strobe(T), x0={"v": 0}, tol=math.nan)),
    "tol negative": ("tol", lambda: basins(BLOCK, {"x": [1.0]}, Strobe(T), x0={"v": 0}, tol=-1)),
    "tol inf": ("tol", lambda: basins(BLOCK, {"x": [1.0]}, Strobe(T), x0={"v": 0}, tol=math.inf)),
    "direction": ("direction", lambda: Return(x, direction="abc")),
    "carry": ("carry", lambda: orbit_diagram(BLOCK, k, [1.0], START, Strobe(T), carry="abc")),
    "period of a rig": ("period", lambda: prescribed_motion(Dahl(), position=sp.sin(t), period="abc")),
    "work of a rig": ("work", lambda: prescribed_motion(Dahl(), position=sp.sin(t), work="abc")),
    "c None": ("c", lambda: block_on_belt(Coulomb(), c=None)),
    "c text": ("c", lambda: block_on_belt(Coulomb(), c="")),
    "c list": ("c", lambda: block_on_belt(Coulomb(), c=[])),
    "t_span text": ("t_span", lambda: block_on_belt(Coulomb(), t_span="abc")),
    "t_span empty": ("t_span", lambda: block_on_belt(Coulomb()).solve(t_span="")),
    "parameters of a diffusion": ("parameters", lambda: Diffusion({x: 1}, step=0.1, parameters={"zz": 1})),
    "terminal": ("terminal", lambda: Event(x, terminal="abc")),
    "copies": ("n", lambda: Family(10**400)),
    "a number beyond floats": ("rtol", lambda: solve(BLOCK, (0, 1), START, rtol=10**400)),
    "a state beyond floats": ("x0", lambda: solve(BLOCK, (0, 1), {"x": 10**400, "v": 0})),
    "a span beyond floats": ("t_span", lambda: solve(BLOCK, (0, 10**400), START)),
    "an expression beyond floats": ("rates", lambda: System({x: -(10**5000)})),
    "periods beyond memory": ("periods", lambda: swept(periods=2**60)),
    "max_count of Period": ("max_count", lambda: Period(max_count="abc")),
    "last of Points": ("last", lambda: Points("x", last=-1)),
    "law of a scene": ("law", lambda: force_driven("Coulomb", 1)),
    "x0 of a Scene": ("x0", lambda: Scene("s", BLOCK, 5, (0, 1))),
    "times of a Drive": ("times", lambda: Drive("abc", [1, 2, 3, 4])),
    "a name where times stand": ("t", lambda: solve(BLOCK, (0, 1), START, dense_output=True)("x")),
    "a name that is none": ("name", lambda: solve(BLOCK, (0, 1), START, dense_output=True)(0.5, "mu")),
}  # fmt: skip


@pytest.mark.parametrize("call", REFUSED)
def test_what_was_accepted_without_a_word_is_refused(call):
    name, bad = REFUSED[call]
    with pytest.raises((ValueError, TypeError), match=rf"`{name}`"):
        bad()


def test_an_event_of_time_beyond_all_floats_ends_a_run_and_not_python():
    for method in ("auto", "stiff"):
        free = System({x: -x}, time=t, events=[Event(every=1e-9, update={x: x})])
        assert not solve(free, (0, 1e300), {"x": 1}, method=method, max_steps=100).success


def calls_of(full, value):
    """(name, callable, what messages call it, one of its arguments) of a public name and of its methods."""
    if inspect.isfunction(value):
        yield full, value, value.__name__
    if not inspect.isclass(value) or issubclass(value, (tuple, BaseException, enum.Enum)):
        return
    if "Parameters\n" in (value.__doc__ or ""):
        yield full, value, value.__name__
    for name, member in public_names.members(value).items():
        if isinstance(member, (classmethod, staticmethod)):
            yield f"{full}.{name}", getattr(value, name), f"{value.__name__}.{name}"
        elif inspect.isfunction(member):
            builtin = next(base for base in value.__mro__ if base.__module__ == "builtins")
            one = builtin.__new__(value)
            yield f"{full}.{name}", functools.partial(member, one), f"{value.__name__}.{name}"


def with_an_argument(calls):
    for full, call, said in calls:
        arguments = inspect.signature(call).parameters.values()
        named = [p.name for p in arguments if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
        text = (call.func if isinstance(call, functools.partial) else call).__doc__ or ""
        if named and "For matplotlib's" not in text:  # any further name goes on to it
            yield full, (call, said, max(named, key=len))


# The door looks at names before all else.
FACE = dict(
    found
    for full, value in public_names.public_names().items()
    for found in with_an_argument(calls_of(full, value))
)


@pytest.mark.parametrize("name", FACE)
def test_a_misspelt_argument_is_refused_in_the_name_of_what_was_called(name):
    call, said, known = FACE[name]
    words = f"{said}() has no argument `{known}q`; did you mean `{known}`?"
    with pytest.raises(TypeError, match=f"^{re.escape(words)}$"):
        call(**{f"{known}q": None})


TOOLS = {
    "sweep": lambda **given: sweep(BLOCK, {"k": [2.0]}, x0=START, seen=Strobe(T), **given),
    "make_plan": lambda **given: make_plan(BLOCK, {"k": [2.0]}, x0=START, seen=Strobe(T), **given),
    "basins": lambda **given: basins(BLOCK, {"x": [1.0]}, Strobe(T), x0={"v": 0}, **given),
    "orbit_diagram": lambda **given: orbit_diagram(BLOCK, k, [1.0], START, Strobe(T), **given),
    "find_orbit": lambda **given: find_orbit(BLOCK, START, seen=Strobe(T), **given),
    "lyapunov_exponents": lambda **given: lyapunov_exponents(BLOCK, START, 10.0, **given),
    "diagram": lambda **given: diagram(BLOCK, {k: (1, 2)}, START, seen=Strobe(T), **given),
    "minimise": lambda **given: costs.minimise(BLOCK, costs.final(x), (0, 1), START, [k], **given),
    "fit_law": lambda **given: fit_law(Coulomb(), [0, 1], [0, 1], [0, 1], **given),
}


@pytest.mark.parametrize("option", ["t_eval", "dense_output", "by", "local", "threads", "foo"])
@pytest.mark.parametrize("tool", TOOLS)
def test_a_tool_refuses_by_name_what_it_cannot_pass_on_to_solve(tool, option):
    if option == "by" and tool in ("minimise", "fit_law"):
        return  # their own
    with pytest.raises(TypeError, match=rf"^{tool}\(\) has no argument `{option}`"):
        TOOLS[tool](**{option: None})


def test_parameters_of_a_tool_are_those_of_its_system():
    stiffer = BLOCK.with_parameters({k: 2})
    orbit = find_orbit(BLOCK, START, seen=Strobe(T), transient=20, parameters={k: 2})
    assert orbit.system.parameters == {k: 2}
    assert orbit.x.tolist() == find_orbit(stiffer, START, seen=Strobe(T), transient=20).x.tolist()
    again = {"x0": START, "seen": Strobe(T), "measures": ["amplitude(x)"], "transient": 2, "periods": 2}
    scene = Scene("block", BLOCK, START, (0, 1), 2 * math.pi)
    for subject in (BLOCK, scene):
        found = sweep(subject, {"v": [0.1]}, parameters={k: 2}, **again)
        assert found.equals(sweep(stiffer, {"v": [0.1]}, **again))
    with pytest.raises(ValueError, match="`work` is for independent runs"):
        orbit_diagram(BLOCK, k, [1.0], START, Strobe(T), carry=True, work=Work(workers=1))


def test_maps_refuse_options_that_would_pin_their_parameters():
    for make in (
        lambda: Stroboscopic(BLOCK, T, options={"parameters": {k: 2}}),
        lambda: Section(BLOCK, v, options={"parameters": {k: 2}}),
    ):
        with pytest.raises(
            ValueError, match=r"`options` of \w+ has 'parameters': give `system.with_parameters"
        ):
            make()


def test_names_of_other_tools_and_packages_lead_to_ours():
    for call, name in (
        (lambda: sweep(BLOCK, {"k": [1.0]}, start=START, seen=Strobe(T)), "x0"),
        (lambda: find_orbit(BLOCK, start=START, seen=Strobe(T)), "x0"),
        (lambda: find_orbit(BLOCK, START, period=T), "seen"),
        (lambda: diagram(BLOCK, {k: (1, 2)}, START, section=v), "seen"),
        (lambda: diagram(BLOCK, ranges={k: (1, 2)}), "over"),
        (lambda: diagram(BLOCK, {k: (1, 2)}, START, longest_step=0.1), "steps"),
        (lambda: sweep(BLOCK, {"k": [1.0]}, workers=2), "work"),
        (lambda: solve(BLOCK, (0, 1), y0=START), "x0"),
        (lambda: BLOCK.smoothed(epsilon=1e-3), "eps"),
        (lambda: Dahl(sigma_0=1), "sigma0"),
    ):
        with pytest.raises(TypeError, match=rf"did you mean `{name}`\?"):
            call()


def test_missing_and_surplus_arguments_are_named():
    for call, words in (
        (
            lambda: ensemble(BLOCK, (0, 1), START),
            "ensemble() needs `noise` (Kicks or Diffusion) and `count` (int)",
        ),
        (lambda: BLOCK.smoothed(), "System.smoothed() needs `eps`"),
        (lambda: force_driven(), "force_driven() needs `law` (Law)"),
        (
            lambda: solve(BLOCK, (0, 1), START, "rk"),
            "solve() takes 3 arguments without a name (system, t_span, x0)",
        ),
        (lambda: Coulomb(2.0), "Coulomb() takes its arguments by name"),
        (lambda: solve(BLOCK, (0, 1), START, x0=START), "solve() gets `x0` twice"),
    ):
        with pytest.raises(TypeError, match=re.escape(words)):
            call()


def test_a_scene_where_a_system_belongs_is_told_apart():
    scene = Scene("block", BLOCK, START, (0, 1))
    for call in (lambda: solve(scene, (0, 1), START), lambda: find_orbit(scene, START, seen=Strobe(T))):
        with pytest.raises(TypeError, match=r"`system` is a scene, 'block'; give its `system`"):
            call()


def test_numbers_are_not_read_from_text():
    for name, call in {
        "parameters": lambda: BLOCK.with_parameters({k: "3"}),
        "x0": lambda: solve(BLOCK, (0, 1), {"x": "1", "v": 0}),
        "t_span": lambda: solve(BLOCK, "01", START),
        "t_eval": lambda: solve(BLOCK, (0, 1), START, t_eval=["0.5"]),
        "atol": lambda: solve(BLOCK, (0, 1), START, atol="1e-3"),
        "rtol": lambda: solve(BLOCK, (0, 1), START, rtol="1e-3"),
        "axes": lambda: sweep(BLOCK, {"k": ["1", "2"]}, x0=START, seen=Strobe(T)),
        "times": lambda: Drive(["0", "1", "2", "3"], [0, 1, 2, 3]),
        "values": lambda: costs.misfit(x, [1], ["2"]),
        "sigma0` of Dahl": lambda: Dahl(sigma0="1e5"),
        "force": lambda: fit_law(Coulomb(), [0, 1, 2], [0, 1, 2], ["0", "1", "2"]),
    }.items():
        with pytest.raises(TypeError, match=f"`{name}"):
            call()


def test_a_python_function_where_a_formula_belongs_is_refused():
    with pytest.raises(
        TypeError, match=r"`surface` of an Event is a Python function of \(t, x\); give a formula"
    ):
        Event(lambda t, x: x)
    with pytest.raises(TypeError, match="`when` of an Event is a Python function"):
        Event(x, when=lambda x: True)
    assert callable(Event(lambda t, x, p: x[0]).surface)  # of a System of functions


def laws_that_do_not_fit():
    for name in scenes.__all__:
        takes = getattr(getattr(scenes, name), "tests", {}).get("law")
        for law in known_laws().values() if takes else ():
            if takes.why_not(law):
                yield getattr(scenes, name), law, takes


def test_scenes_refuse_laws_of_another_kind_by_the_filter_that_lists_ask():
    seen = set()
    for scene, law, takes in laws_that_do_not_fit():
        needed = {
            n: 1 for n, p in inspect.signature(scene).parameters.items() if p.default is p.empty and n != "law"
        }
        with pytest.raises((ValueError, TypeError)) as caught:
            scene(law=law(), **needed)
        if "`law`" in str(caught.value):  # another argument may be looked at before
            assert takes.why_not(law) in str(caught.value) and takes.names()[0] in str(caught.value)
            seen.add(scene.__name__)
    assert {"friction_oscillator", "falling_ball", "incline", "spinning_disc", "block_train"} <= seen
    for bad in (lambda: scenes.slider_crank(Coulomb()), lambda: scenes.slider_crank(None, Hertz())):
        with pytest.raises(ValueError, match="law where a (contact|friction) law belongs"):
            bad()


def test_what_stands_for_a_disc_or_a_contact_is_said():
    disc = Disc("lam", (x, v))
    with pytest.raises(TypeError, match=r"one of its components, disc\[0\] to disc\[1\]: lam_x, lam_y"):
        costs.duration(disc)
    with pytest.raises(TypeError, match="give its name, 'ground'"):
        costs.event_time(Unilateral(x, name="ground"))


def test_a_divisor_that_is_zero_names_its_parameter_and_the_view_only_where_one_is_fast():
    m, beta = sp.symbols("m beta", nonnegative=True)
    lam, z = Switch("lam", v), sp.Symbol("z", real=True)
    block = System({x: v, v: -(x + lam * (1 + z)) / m, z: (1 - lam**2 - z) / beta}, parameters={m: 1, beta: 1})
    with pytest.raises(ValueError) as caught:
        block.with_parameters({m: 0})
    assert "'m' is 0, and the rate of 'v' divides by m" in str(caught.value) and "layered" not in str(
        caught.value
    )
    with pytest.raises(ValueError, match=r"'beta' is 0.* system.layered\({z: sympy.oo}\)"):
        block.with_parameters({beta: 0})


def test_the_version_is_that_of_the_distribution():
    assert pwsmooth.__version__ == version("pwsmooth") and "__version__" in dir(pwsmooth)


def test_a_misspelt_public_name_is_led_to_the_one_that_was_meant():
    with pytest.raises(AttributeError, match=r"'find_orbits'. Did you mean 'find_orbit'\?"):
        pwsmooth.find_orbits  # noqa: B018


def test_errors_inside_a_call_are_not_taken_for_misfits():
    @checks.door()
    def outer(a):
        return inner()

    def inner(b):
        return b

    with pytest.raises(TypeError, match="missing 1 required positional argument: 'b'"):
        outer(1)


@functools.cache
def generator():
    path = Path(__file__).parents[1] / "fuzz" / "doors.py"
    spec = importlib.util.spec_from_file_location("doors", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_public_callable_with_arguments_is_in_the_generator():
    doors = generator()
    names = doors.public_names.public_names()
    asked = {
        name
        for name, value in names.items()
        if (inspect.isfunction(value) or inspect.isclass(value)) and "Parameters\n" in (value.__doc__ or "")
    }
    missing = {name for name in asked - set(doors.subjects()) if not name.startswith(doors.NO_DOORS)}
    assert missing <= doors.INSIDE, missing - doors.INSIDE


def test_malformed_calls_are_refused_by_name(tmp_path, monkeypatch):
    """The long mode is `python -m tests.fuzz.doors --cases 12000`."""
    monkeypatch.chdir(tmp_path)  # some texts that are given are good names of files
    doors = generator()
    verdicts = [doors.judged("suite", i) for i in range(600)]
    kinds = [kind for kind, _ in verdicts]
    known = ("named", "unnamed", "accepted")
    assert set(kinds) <= set(known), [words for kind, words in verdicts if kind not in known]
    assert kinds.count("named") >= 0.97 * (kinds.count("named") + kinds.count("unnamed"))


def test_messages_show_anything_in_few_words():
    class Mute:
        def __repr__(self):
            raise RuntimeError

    for value in (10**5000, Mute(), list(range(10**5)), "x" * 10**4, sum(sp.symbols("a:999")), np.zeros(10**4)):
        assert 0 < len(pwsmooth.door.checks.shown(value)) <= 210
