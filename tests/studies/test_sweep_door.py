"""Bad input to sweep() is refused at the door, in words that name the argument and the remedy."""

import pytest
import sympy as sp
from friction_oscillator import coulomb, hidden, omega

from pwsmooth import Strobe, System, sweep
from pwsmooth.studies import Extremes, Function, Work

DRIVE = 2 * sp.pi / omega
GOOD = dict(axes={"sigma": [1.2, 2.4]}, x0={"y": 0.5, "v": 0.3}, seen=Strobe(DRIVE))
x, a, every = sp.symbols("x a every", positive=True)


@pytest.mark.parametrize(
    "change, words",
    [
        (dict(axes={}), ["no axes", "points"]),
        (dict(axes=[1, 2]), ["`axes`", "dict"]),
        (dict(axes={"sigmaa": [1]}), ["sigmaa", "no parameter", "sigma"]),
        (dict(axes={"sigma": []}), ["sigma", "at least one"]),
        (dict(axes={"sigma": [[1, 2]]}), ["sigma", "one-dimensional"]),
        (dict(axes={"sigma": ["a"]}), ["sigma", "numbers"]),
        (dict(axes={"sigma": [1, float("nan")]}), ["sigma", "nan", "finite"]),
        (dict(axes={"sigma": [1, -1]}), ["sigma", "-1", "nonnegative"]),
        (dict(axes={"sigma": [1, 1]}), ["sigma", "twice"]),
        (dict(axes={"sigma": [1]}, points={"sigma": [2]}), ["sigma", "twice"]),
        (dict(axes=None, points={"sigma": [1, 2], "k": [1]}), ["2", "1", "k", "axes="]),
        (dict(axes={"seed": [1, 2]}), ["seed", "noise="]),
        (dict(x0={"y": 1}), ["x0", "v"]),
        (dict(seen=DRIVE), ["`seen` is 2*pi/omega", "Strobe(period)"]),
        (dict(seen=Strobe("2*pi/omga")), ["omga", "Names are"]),
        (dict(seen=Strobe("2*pi/(")), ["`period`", "formula"]),
        (dict(seen=None), ["Strobe(period)", "t_span"]),
        (dict(t_span=(0, 1)), ["not both"]),
        (dict(seen=Strobe(DRIVE, phase=0.5), axes={"t": [0, 1]}), ["`seen` has a phase", "start time"]),
        (dict(seen=None, t_span=(0, 1), measure_from=2), ["`measure_from`", "2"]),
        (dict(transient=-1), ["`transient`", "-1"]),
        (dict(periods=0), ["`periods`", "0"]),
        (dict(measures=["stick"]), ["'stick'", "sticks"]),
        (dict(measures=["sticks(y)"]), ["takes no names"]),
        (dict(measures=["amplitude(w)"]), ["'w'", "y, v"]),
        (dict(measures=["points(lam)"]), ["'lam'", "no state"]),
        (dict(measures=["amplitude"]), ["Amplitude", "name"]),
        (dict(measures=[3]), ["3", "measures"]),
        (dict(measures=[lambda s: 1.0, Function(lambda s: 2.0)]), ["two measures", "value"]),
        (dict(measures=[Function(len, names="sigma")]), ["sigma", "axis"]),
        (dict(units=["m"]), ["`units`", "dict"]),
        (dict(rtol=2), ["`rtol`", "2"]),
        (dict(order=3), ["`order`", "3"]),
        (dict(method="radau5"), ["radau5", "taylor"]),
        (dict(dense_output=True), ["dense_output", "no argument"]),
        (dict(work=2), ["`work` is 2", "Work(...)"]),
    ],
)
def test_refusals_name_the_argument_and_the_remedy(change, words):
    arguments = GOOD | change
    with pytest.raises((ValueError, TypeError)) as caught:
        sweep(coulomb(), arguments.pop("axes"), **arguments)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    "given, words",
    [
        (dict(workers=0), ["`workers` of Work", "0"]),
        (dict(chunk=1.5), ["`chunk` of Work", "1.5"]),
        (dict(executor=3), ["`executor`", "Executor"]),
    ],
)
def test_work_that_cannot_be_done_is_refused(given, words):
    with pytest.raises((ValueError, TypeError)) as caught:
        Work(**given)
    for word in words:
        assert word in str(caught.value)


def test_no_system_is_refused():
    with pytest.raises(TypeError, match="give a System"):
        sweep(lambda t, x: x, {"a": [1]}, t_span=(0, 1))


def test_sticks_of_what_cannot_stick_are_refused():
    with pytest.raises(ValueError, match="nothing in this system can stick"):
        sweep(System({x: -a * x}, parameters={a: 1}), {"a": [1]}, x0={"x": 1}, t_span=(0, 1), measures="sticks")
    with pytest.raises(ValueError, match="no sticks to count"):
        sweep(hidden().smoothed(eps=0.1), **(GOOD | dict(x0={"y": 0, "v": 0, "z": 0})))


def test_values_that_a_parameter_must_not_have_are_refused_before_anything_runs():
    with pytest.raises(ValueError, match="divides by"):
        sweep(
            hidden(),
            {"beta": [0.1, 0.0]},
            x0={"y": 0, "v": 0, "z": 0},
            seen=Strobe(DRIVE),
            measures=Extremes("y"),
        )
