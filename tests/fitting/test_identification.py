"""fit() recovers parameters and unknown starts of any system from records, with exact slopes and honest errors.

Guards: fitting/.
"""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Drive, Event, Memory, System, solve
from pwsmooth.fitting import Record, compare, fit, fit_law
from pwsmooth.laws import friction
from pwsmooth.scenes import (
    block_on_belt,
    force_driven,
    friction_oscillator,
    position_control,
)

TIMES = np.linspace(0, 40, 401)
NOISE = 0.01
TRUE = {"rho": 3.0, "beta": 0.1, "F_c": 1.0, "spring": 3.1, "damper": 0.1}
GUESS = {"rho": 2.2, "beta": 0.15, "F_c": 1.3, "spring": 2.7, "damper": 0.2}


@pytest.fixture(scope="module")
def oscillator():
    return friction_oscillator(friction.HiddenStatic(rho=3.0, beta=0.1))


@pytest.fixture(scope="module")
def displacement(oscillator):
    clean = oscillator.solve((0, 40), t_eval=TIMES)["y"]
    return clean + NOISE * np.random.default_rng(4).normal(size=TIMES.size)


@pytest.fixture(scope="module")
def found(oscillator, displacement):
    return fit(oscillator, Record(TIMES, {"y": displacement}, unknown=["y", "v"]), GUESS)


def within(fit, true, errors=4.0):
    return all(abs(fit.values[name] - value) < errors * fit.errors[name] for name, value in true.items())


def block(F=0.5, k=1.5):
    x, v = sp.symbols("x v", real=True)
    strength, spring = sp.symbols("F k", positive=True)
    return System({x: v, v: -spring * x - strength * sp.sign(v)}, parameters={strength: F, spring: k})


# ---- what comes out


def test_five_parameters_and_the_start_of_an_oscillator_from_its_displacement_alone(found):
    assert found.success and within(found, TRUE)
    assert found.rms["y"] == pytest.approx(NOISE, rel=0.15)
    assert found.noise["y"] == pytest.approx(found.rms["y"] / math.sqrt(1 - 7 / 401), rel=1e-6)
    for name, value in {"y": 0.5, "v": 0.3}.items():
        assert abs(found.starts[0][name] - value) < 4 * found.start_errors[0][name]
    assert found.errors["spring"] < 0.002 * TRUE["spring"] and found.errors["F_c"] < 0.02
    assert len(found._problem.experiments[0].nodes) == 19


def test_errors_are_the_spread_over_seeds(oscillator):
    clean = oscillator.solve((0, 40), t_eval=TIMES)["y"]
    off = []
    for seed in range(12):
        data = clean + NOISE * np.random.default_rng(seed).normal(size=TIMES.size)
        one = fit(oscillator, Record(TIMES, {"y": data}, noise=NOISE), TRUE, intervals=1)
        off.append([(one.values[name] - value) / one.errors[name] for name, value in TRUE.items()])
    # Sum of 60 squares of normal numbers, of which those of one seed are correlated: the mean is 1 within 4 deviations.
    assert 1 - 4 * math.sqrt(2 / 12) < np.mean(np.square(off)) < 1 + 4 * math.sqrt(2 / 12)
    assert np.abs(off).max() < 4


def test_the_jacobian_along_closed_gaps_is_that_of_differences(found):
    problem, z, at = found._problem, found._found.z, found._found.at
    exact = found._found.slopes.jacobian

    def residual(z):
        return problem.evaluate(z, at.nodes, every=10**6).residual  # every node is handed on: one shot

    for k in range(len(z)):
        one = np.eye(len(z))[k]
        first, second = ((residual(z + h * one) - residual(z - h * one)) / (2 * h) for h in (2e-4, 1e-4))
        richardson = (4 * second - first) / 3
        # Samples beside an instant that moves past them have a kink there.
        smooth = np.abs(second - first) < 1e-3 * np.abs(exact[:, k]).max()
        assert smooth.mean() > 0.9
        assert np.abs(richardson - exact[:, k])[smooth].max() < 1e-4 * np.abs(exact[:, k]).max()


def test_many_intervals_and_one_meet_in_the_same_minimum(oscillator, displacement, found):
    one = fit(oscillator, Record(TIMES, {"y": displacement}, unknown=["y", "v"]), GUESS, intervals=1)
    assert one.bic == pytest.approx(found.bic, abs=1e-3)
    for name in TRUE:
        assert one.values[name] == pytest.approx(found.values[name], abs=0.01 * found.errors[name])


def test_a_long_stick_slip_record_needs_intervals():
    law = friction.LuGre(sigma0=1e3, sigma1=30.0, F_s=1.5, F_c=1.0, v_s=0.05)
    belt = block_on_belt(law, t_span=(0, 100))
    t = np.linspace(0, 100, 501)
    data = belt.solve(t_eval=t)["elongation"] + 0.003 * np.random.default_rng(1).normal(size=t.size)
    record = Record(t, {"elongation": data}, noise=0.003)
    guess = {"spring": 1.7, "F_s": 1.3, "F_c": 1.1, "v_s": 0.06}
    cut, whole = (fit(belt, record, guess, intervals=k, max_runs=40) for k in (None, 1))
    assert cut.success and cut.chi2 / cut.samples < 1.2
    assert within(cut, {"spring": 2.0, "F_s": 1.5, "F_c": 1.0, "v_s": 0.05})
    assert whole.chi2 / whole.samples > 10


def test_a_controlled_motion_gives_the_law_of_its_friction():
    gains = {"k_p": (40, 10, 20), "k_d": (1, 1, 0.5), "k_i": (20, 5, 5), "target": (0.2, 0.1, 1.0)}
    true = dict(sigma0=100.0, sigma1=10.0, sigma2=0.4, F_c=1.0, F_s=1.5, v_s=0.1)
    scene = position_control(friction.LuGre(**true), t_span=(0, 20))
    t, rng, records = np.linspace(0, 20, 401), np.random.default_rng(7), []
    for i in range(3):
        own = {name: values[i] for name, values in gains.items()}
        x = scene.solve(parameters=own, t_eval=t)["x"]
        level = 0.01 * np.ptp(x)
        records.append(Record(t, {"x": x + level * rng.normal(size=t.size)}, noise=level, parameters=own))
    one = fit(scene, records, {name: 1.2 * value for name, value in true.items()})
    assert one.success and within(one, true) and one.chi2 / one.samples == pytest.approx(1, abs=0.15)
    assert len(one.identifiability(0.5).known) == 6
    shuffled = fit(scene, records[::-1], one.values)
    assert shuffled.bic == pytest.approx(one.bic, abs=1e-3)


def test_samples_may_be_missing_and_columns_have_noise_of_their_own():
    t = np.linspace(0, 6, 121)
    run = solve(block(), (0, 6), {"x": 3, "v": 0.4}, t_eval=t)
    rng = np.random.default_rng(2)
    x, v = run["x"] + 0.01 * rng.normal(size=t.size), run["v"] + 0.1 * rng.normal(size=t.size)
    x[rng.random(t.size) < 0.5], v[:60] = np.nan, np.nan
    one = fit(block(0.3, 2.0), Record(t, {"x": x, "v": v}, x0={"x": 3, "v": 0.4}), ["F", "k"])
    assert one.success and within(one, {"F": 0.5, "k": 1.5})
    assert one.samples == np.isfinite(x).sum() + 61
    assert one.noise["x"] == pytest.approx(0.01, rel=0.4) and one.noise["v"] == pytest.approx(0.1, rel=0.4)
    assert len(one.predicted("v")) == t.size
    there = np.isfinite(v)
    assert np.abs(one.predicted("v")[there] - run["v"][there]).max() < 0.05


def test_a_record_may_have_a_drive_of_its_own():
    t = np.linspace(0, 4, 81)
    law, true = friction.Coulomb(F_c=0.4, sigma2=0.2), {"F_c": 0.4, "sigma2": 0.2}
    scenes = [force_driven(law, Drive(t, a * np.cos(w * t)), m=1.5) for a, w in ((1.0, 1.0), (1.5, 2.0))]
    records = [Record(t, {"v": s.solve(t_eval=t)["v"]}, noise=1e-3, system=s) for s in scenes]
    one = fit(scenes[0], records, {"F_c": 0.6, "sigma2": 0.1})
    assert {name: one.values[name] for name in true} == pytest.approx(true, rel=1e-6)


def test_memories_are_handed_on_between_intervals():
    x, v = sp.symbols("x v", real=True)
    c = sp.Symbol("c", positive=True)
    m = Memory("turns", 0)
    system = System(
        {x: v, v: -x - c * v * (1 + m)}, parameters={c: 0.05}, events=[Event(v, update={m: m + 1}, direction=1)]
    )
    t = np.linspace(0, 20, 201)
    data = solve(system.with_parameters({"c": 0.03}), (0, 20), {"x": 1, "v": 0}, t_eval=t)["x"]
    one = fit(system, Record(t, {"x": data}, noise=1e-3, x0={"x": 1, "v": 0}), ["c"], intervals=8)
    assert one.success and one.values["c"] == pytest.approx(0.03, rel=1e-7)


def test_bounds_hold_and_are_told():
    t = np.linspace(0, 6, 61)
    x = solve(block(), (0, 6), {"x": 3, "v": 0}, t_eval=t)["x"]
    record = Record(t, {"x": x}, noise=0.01, x0={"x": 3, "v": 0})
    one = fit(block(0.3, 2.0), record, ["F", "k"], bounds={"k": (1.6, 3.0)})
    assert one.values["k"] == pytest.approx(1.6, rel=1e-9) and math.isnan(one.errors["k"])
    assert "k = 1.6, at its bound" in repr(one) and math.isfinite(one.errors["F"])


def test_a_prior_counts_as_much_as_its_error_says():
    t = np.linspace(0, 6, 61)
    x = solve(block(), (0, 6), {"x": 3, "v": 0}, t_eval=t)["x"] + 0.02 * np.random.default_rng(3).normal(
        size=t.size
    )
    record = Record(t, {"x": x}, noise=0.02, x0={"x": 3, "v": 0})
    free = fit(block(), record, ["k"])
    error = free.errors["k"]
    held = fit(block(), record, ["k"], priors={"k": (free.values["k"] + error, error)})
    # Two measurements with the same error: their mean, and an error smaller by the root of 2, up to curvature.
    assert held.values["k"] == pytest.approx(free.values["k"] + error / 2, abs=0.02 * error)
    assert held.errors["k"] == pytest.approx(error / math.sqrt(2), rel=0.02)


def test_only_the_ratio_of_what_enters_as_a_ratio_is_identifiable():
    x, v = sp.symbols("x v", real=True)
    m, k, F = sp.symbols("m k F", positive=True)
    system = System({x: v, v: (-k * x - F * sp.sign(v)) / m}, parameters={m: 1, k: 1.5, F: 0.5})
    t = np.linspace(0, 6, 61)
    data = solve(system, (0, 6), {"x": 3, "v": 0}, t_eval=t)["x"]
    one = fit(system, Record(t, {"x": data}, noise=0.01, x0={"x": 3, "v": 0}), {"m": 1.5, "k": 2.0, "F": 0.6})
    (free,) = one.identifiability().free
    assert free.words == "m * k * F" and math.isinf(free.error)
    assert [math.isinf(error) for error in one.errors.values()] == [True] * 3
    assert one.values["k"] / one.values["m"] == pytest.approx(1.5, rel=1e-5)
    assert "fix 1 of the parameters" in repr(one.identifiability())


def test_a_profile_of_a_linear_problem_is_a_parabola():
    t = np.linspace(0, 3, 61)
    v = 1 + 0.5 * np.sin(t)
    force = 2 + 0.3 * v + 0.01 * np.random.default_rng(5).normal(size=t.size)
    one = fit_law(friction.Coulomb(F_c=1.9, sigma2=0.4), t, v, force, kind="velocity", noise=0.01)
    profile = one.profile("F_c", points=5, width=2.0)
    off = (profile.values - profile.best) / one.errors["F_c"]
    assert profile.excess == pytest.approx(off**2, abs=0.02)  # the coordinate is the logarithm
    low, high = profile.interval(0.95)
    assert (high - low) / 2 == pytest.approx(1.96 * one.errors["F_c"], rel=0.01)
    assert profile.plot().get_xlabel() == "F_c"
    assert one.profile("F_c", points=5, width=1.0).interval() == (-math.inf, math.inf)


# ---- how it goes


def test_ctrl_c_keeps_the_best_until_then(oscillator, displacement):
    seen = []

    def stop(at):
        seen.append(at)
        if at.number == 3:
            raise KeyboardInterrupt

    one = fit(oscillator, Record(TIMES, {"y": displacement}), GUESS, intervals=1, callback=stop)
    assert [at.number for at in seen] == [0, 1, 2, 3] and seen[3].misfit < 0.5 * seen[0].misfit
    assert not one.success and "Interrupted" in one.message
    assert one.values == {name: seen[3].values[name] for name in GUESS}


def test_progress_is_told_on_stderr(oscillator, displacement, capsys):
    fit(oscillator, Record(TIMES, {"y": displacement}), TRUE, progress=True)
    first, *others = capsys.readouterr().err.splitlines()
    assert first.startswith("fit: step 0, misfit ") and others


def test_a_fit_is_drawn_with_its_residual(found):
    panels = found.plot()
    assert [ax.get_ylabel() for ax in panels] == ["y", "fitted - measured\ny"]
    (points,) = panels[1].lines
    assert np.std(points.get_ydata()) == pytest.approx(found.rms["y"], rel=0.02)


def test_models_side_by_side_are_judged_on_the_same_data(oscillator, displacement, found):
    plain = friction_oscillator(friction.Coulomb())
    record = Record(TIMES, {"y": displacement}, unknown=["y", "v"])
    other = fit(plain, record, {"F_c": 1.2, "spring": 3.0, "damper": 0.1})
    side = compare({"Coulomb": other, "hidden": found})
    assert list(side.fits) == ["hidden", "Coulomb"]
    table = side.to_dataframe()
    assert table.loc["Coulomb", "bic"] - table.loc["hidden", "bic"] > 10
    assert table.loc["hidden", "quantities"] == 8 and "hidden" in repr(side)
    n, rms = 401, other.rms["y"]
    assert other.aic == pytest.approx(n * (math.log(2 * math.pi * rms**2) + 1) + 2 * 6, rel=1e-12)
    with pytest.raises(ValueError, match="different data"):
        compare({"a": found, "b": fit(plain, Record(TIMES, {"y": displacement + 1}), ["F_c"])})


def test_a_touch_without_a_derivative_is_told_and_the_fit_goes_on():
    x, v, y = sp.symbols("x v y", real=True)
    c = sp.Symbol("c", positive=True)
    # x touches 1 at pi/2 and stays below: what y feels there has no derivative.
    system = System({x: v, v: -x, y: c * (2 - sp.sign(x - 1))}, parameters={c: 0.5})
    t = np.linspace(0, 3, 31)
    record = Record(t, {"y": 2.1 * t}, noise=0.01, x0={"x": 0, "v": 1, "y": 0}, unknown=["v"])
    one = fit(system, record, ["c"], priors={"c": (0.7, 0.1)}, intervals=1)
    assert one.values["c"] == pytest.approx(0.7, rel=1e-3)
    assert one.problems and "no derivative" in repr(one)


@pytest.mark.parametrize(
    "text",
    [
        "t,x,v\n0,1,0.5\n1,,0.25\n2,3,nan\n",
        "# taken by hand\n# t x v\n0 1 0.5\n1 nan 0.25\n2 3 NA\n",
        "t;x;v\n0;1;0,5\n1;;0,25\n2;3;\n",
        't\t"x"\tv\n0\t1\t0.5\n1\t\t0.25\n2\t3\t\n',
    ],
)
def test_a_record_is_read_from_a_file_with_gaps(text, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(text)
    for columns, time in (({"x": "x", "v": "v"}, "t"), ({"x": 1, "v": 2}, 0)):
        one = Record.from_csv(path, columns, time=time, noise=0.1, x0={"x": 1})
        assert one.t.tolist() == [0, 1, 2] and one.samples == 4 and one.noise["v"] == 0.1
        assert np.array_equal(one.values["x"], [1, np.nan, 3], equal_nan=True)
        assert np.array_equal(one.values["v"], [0.5, 0.25, np.nan], equal_nan=True)
    with pytest.raises(ValueError, match="no column 'y'; it has t, x, v"):
        Record.from_csv(path, {"y": "y"}, time="t")


@pytest.mark.parametrize(
    "change, said",
    [
        (dict(t=[0, 1, 1]), "does not increase"),
        (dict(values={"x": [1.0, 2.0]}), r"`values` of 'x' have the shape \(2,\)"),
        (dict(values={}), "`values` of Record is empty"),
        (dict(values={"x": [np.nan] * 3}), "nan everywhere"),
        (dict(noise=-1.0), "`noise` of Record is -1; give a number > 0"),
        (dict(noise={"w": 1.0}), "`noise` names w"),
        (dict(begin=0.5), "`begin` is 0.5, after the first sample at 0"),
    ],
)
def test_a_bad_record_is_named(change, said):
    with pytest.raises(ValueError, match=said):
        Record(**(dict(t=[0, 1, 2], values={"x": [1.0, 2.0, 3.0]}) | change))


@pytest.mark.parametrize(
    "record, options, said",
    [
        (dict(values={"y": np.zeros(9)}), {}, "`values` of a Record names 'y'; the system has x, v"),
        (dict(unknown=["z"]), {}, "`unknown` of a Record names 'z'"),
        (dict(x0={}, unknown=["v"]), {}, "`unknown` names v, neither measured"),
        ({}, dict(by=["G"]), "`by` names G; parameters of the system are F, k"),
        ({}, dict(by=[]), "`by` is empty"),
        ({}, dict(bounds={"k": (2, 1)}), r"`bounds` of k is \(2, 1\); give the lowest first"),
        ({}, dict(bounds={"k": (2, 3)}), "the first guess of 'k' is 1.5, outside of its `bounds`"),
        ({}, dict(bounds={"m": (2, 3)}), "`bounds` names 'm', which is not fitted"),
        ({}, dict(priors={"k": (1, 0)}), "`priors` of k, standard deviation is 0"),
        (dict(values={"x": [1.0] + 8 * [np.nan]}), {}, "one sample at the time it begins"),
    ],
)
def test_a_bad_call_is_named(record, options, said):
    given = dict(t=np.arange(9.0), values={"x": np.ones(9)}, x0={"x": 3, "v": 0}) | record
    with pytest.raises(ValueError, match=said):
        fit(block(), Record(**given), **(dict(by=["F", "k"]) | options))


def test_too_few_samples_are_refused():
    with pytest.raises(ValueError, match="2 samples cannot determine 2 unknowns"):
        fit(block(), Record([0, 1], {"x": [3, 2]}, x0={"x": 3, "v": 0}), ["F", "k"])
