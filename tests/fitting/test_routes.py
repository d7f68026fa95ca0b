"""fit() ends at the truth from a first guess at it or near it, where events move past samples and nodes lose memories.

Guards: fitting/routes.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Memory, System, solve
from pwsmooth.fitting import Record, fit
from pwsmooth.fitting.routes import _is_noise

x, v, T = sp.symbols("x v T", real=True)


def rested_block():
    F, k, c = sp.symbols("F k c", positive=True)
    system = System({x: v, v: -k * x - c * v - F * sp.sign(v)}, parameters={F: 0.3, k: 20.0, c: 0.05})
    return system, np.arange(0, 25, 0.05), {"x": 1.0, "v": 0.0}, ["x", "v"]


def thermostat():
    k, P, lo, hi = sp.symbols("k P lo hi", real=True)
    on = Memory("on", 1)
    events = [Event(T - hi, direction=1, update={on: 0}), Event(T - lo, direction=-1, update={on: 1})]
    values = {k: 0.12, P: 3.3, lo: 18.6, hi: 21.2}
    system = System({T: -k * (T - 5) + P * on}, parameters=values, events=events)
    return system, np.arange(0, 120, 0.5), {"T": 15.0, "on": 1}, []


def neuron():
    theta, current, tau = sp.symbols("theta current tau", positive=True)
    fire = Event(x - theta, direction=1, update={x: 0})
    values = {theta: 1.0, current: 1.5, tau: 2.0}
    return (
        System({x: (current - x) / tau}, parameters=values, events=[fire]),
        np.linspace(0, 20, 201),
        {"x": 0.0},
        [],
    )


def fitted(made, level, guess, seed=0, **options):
    """The fit, the true values, and the rms of the noise alone."""
    system, t, start, unknown = made()
    true = {p.name: value for p, value in system.parameters.items()}
    column = str(system.states[0])
    noise = level * np.random.default_rng(seed).normal(size=t.size)
    data = solve(system, (0, t[-1]), start, t_eval=t)[column] + noise
    known = start | ({"x": data[0]} if "x" in unknown else {})
    record = Record(t, {column: data}, x0=known, unknown=unknown)
    first = {name: value * factor for (name, value), factor in zip(true.items(), guess)}
    found = fit(system, record, first, **options)
    return found, true, float(np.sqrt(np.mean(noise**2))), found.rms[column]


# The noise's own share: of its rms the fit takes a part by its few unknowns, and adds none. Noise-free data are met to
# the error of the runs, 1e-9 of their size and what the record makes of it.
@pytest.mark.parametrize(
    "made, level, guess, seed",
    [
        (rested_block, 0.01, (1, 1, 1), 0),
        (rested_block, 0.01, (1.07, 0.93, 1.1), 1),
        (thermostat, 0.0, (1, 1, 1, 1), 0),
        (thermostat, 0.1, (1.003, 0.998, 1.002, 0.999), 1),
        (thermostat, 0.0, (1.02, 0.98, 0.99, 1.01), 0),
        (neuron, 0.0, (1.001, 1, 1), 0),
        (neuron, 0.0, (1.1, 1.4 / 1.5, 1.15), 0),
        (neuron, 0.01, (0.9, 1.1, 1.1), 2),
    ],
)
def test_a_guess_near_the_truth_leads_to_it(made, level, guess, seed):
    found, true, noise, rms = fitted(made, level, guess, seed)
    assert found.success and rms <= noise + 1e-7 * max(map(abs, true.values()))
    for name, value in true.items():
        assert abs(found.values[name] - value) <= 4.5 * found.errors[name] + 1e-7 * value


def test_a_first_guess_that_no_route_improves_is_returned_as_no_success():
    found, true, _, rms = fitted(rested_block, 0.0, (1, 1, 1), max_runs=2)
    assert rms < 1e-9 and found.values == pytest.approx(true)
    found, true, noise, rms = fitted(thermostat, 0.1, (1, 1, 1, 1), max_runs=1)
    assert found.values == pytest.approx(true) and rms == pytest.approx(noise) and not found.success


def test_data_without_noise_from_the_truth_are_a_success():
    system = System({x: v, v: -9.81 * sp.sin(x) - T / 50 * v - T / 5 * sp.sign(v)}, parameters={T: 1.0})
    t = np.arange(0, 40, 0.05)
    data = solve(system, (0, t[-1]), {"x": 2.0, "v": 0.0}, t_eval=t)["x"]
    found = fit(system, Record(t, {"x": data}, unknown=["v"], x0={"x": 2.0, "v": 0.0}), ["T"])
    assert found.success and found.rms["x"] < 1e-9


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_unit_of_time_decides_nothing(unit):
    F, k, c = sp.symbols("F k c", positive=True)
    values = {F: 0.3 / unit**2, k: 20.0 / unit**2, c: 0.05 / unit}
    system = System({x: v, v: -k * x - c * v - F * sp.sign(v)}, parameters=values)
    t = unit * np.arange(0, 10, 0.05)
    data = solve(system, (0, t[-1]), {"x": 1.0, "v": 0.0}, t_eval=t)["x"]
    noisy = data + 0.01 * np.random.default_rng(0).normal(size=t.size)
    guess = {str(p): 1.02 * value for p, value in values.items()}
    found = fit(system, Record(t, {"x": noisy}, unknown=["x", "v"], x0={"v": 0.0}), guess)
    assert found.success
    for p, value in values.items():
        assert abs(found.values[p.name] - value) < 4 * found.errors[p.name]


def test_a_minimum_that_no_other_route_confirms_is_no_success():
    found, _, noise, rms = fitted(thermostat, 0.0, (1.5, 0.7, 0.9, 1.1))
    assert rms < 1e-6 or not found.success


def test_noise_is_told_from_what_a_model_leaves():
    rng = np.random.default_rng(3)
    noise, t = rng.normal(size=400), np.linspace(0, 20, 400)
    jumps = np.where(np.arange(400) % 97 == 0, 9.0, 0.0)
    assert _is_noise(noise, None, 10.0) and _is_noise(noise, 1.0, 10.0)
    assert not _is_noise(noise, 0.7, 10.0)  # twice the variance that was given
    assert not _is_noise(noise + np.sin(t), None, 10.0) and not _is_noise(0.2 * noise + jumps, None, 10.0)
    assert _is_noise(np.full(400, 1e-9), None, 1.0)  # data without noise


def test_ctrl_c_on_another_route_keeps_the_best_of_all():
    seen = []

    def stop(at):
        seen.append(at)
        if [each.number for each in seen].count(0) == 2:  # the second route begins to tell
            raise KeyboardInterrupt

    found, true, noise, rms = fitted(rested_block, 0.01, (1, 1, 1), callback=stop)
    assert not found.success or rms <= noise
    assert rms <= 1.6 * noise
