"""Diffusions: exact laws, measured orders, one path for all steps, and what noise leaves of sticking.

Guards: kernels/noise/, noise/.
"""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad

from pwsmooth import Algebraic, Diffusion, Event, Family, Memory, Outcome, Switch, System, Unilateral, solve
from pwsmooth.studies import ensemble

t, x, y, v, w, z = sp.symbols("t x y v w z", real=True)
lam = Switch("lam", v)


def quiet(call, *arguments, **options):
    """A call whose warning, that noise on v leaves no sticking, is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return call(*arguments, **options)


def near(sample, expected, of=None):
    """Whether a mean lies within five standard errors of what is expected."""
    sample = np.asarray(sample)
    return abs(sample.mean() - expected) < 5 * sample.std() / math.sqrt(len(sample))


# ---- exact laws


def test_ornstein_uhlenbeck_has_its_moments():
    many = ensemble(System({x: -2 * x}), (0, 1), {x: 1}, Diffusion({x: 0.7}, 1 / 32, seed=1), 20_000)
    # A step of 1/32 moves them by 2e-4 (second order); the standard errors are above 1e-3.
    assert near(many.end[:, 0], math.exp(-2))
    assert near((many.end[:, 0] - math.exp(-2)) ** 2, 0.7**2 / 4 * (1 - math.exp(-4)))


def test_brownian_motion_with_dry_friction_has_its_stationary_law():
    # dv = -D0 sign(v) dt + sqrt(2 D) dW: density exp(-D0 |v|/D) D0/(2 D); relaxation time 4 D/D0^2 (P.-G. de Gennes,
    # J. Stat. Phys. 119, 2005): 12 of them from v = 0. Standard errors: 1/sqrt(count), 2.2/sqrt(count) of the means.
    d0, d = 2.0, 0.5
    noise = Diffusion({v: math.sqrt(2 * d)}, 1 / 32, seed=2, finest=5)
    many = quiet(ensemble, System({v: -d0 * lam}), (0, 6), {v: 0}, noise, 4000)
    assert near(np.abs(many.end[:, 0]), d / d0)
    assert near(many.end[:, 0] ** 2, 2 * (d / d0) ** 2)


def test_the_smoothed_one_has_the_law_of_its_potential():
    # dv = -tanh(v/eps) dt + s dW: density cosh(v/eps)^(-2 eps/s^2).
    eps, s = 0.2, 0.5
    system = System({v: -lam}).smoothed(eps=eps, sigmoid="tanh")
    many = ensemble(system, (0, 10), {v: 0}, Diffusion({v: s}, 1 / 16, seed=3), 4000)

    def moment(k):
        return quad(lambda a: a**k * math.cosh(a / eps) ** (-2 * eps / s**2), 0, 8)[0]

    assert near(many.end[:, 0] ** 2, moment(2) / moment(0))


def test_a_well_is_left_after_the_exact_mean_time():
    # From 0 over b in dx = -U' dt + s dW, U = x^2/2 - x^3/3: T = 2/s^2 int_0^b e^(2U(y)/s^2) int_-oo^y e^(-2U/s^2)
    # (C. Gardiner, Handbook of Stochastic Methods, 5.2.7); b is beyond the saddle at 1.
    s, b = 0.45, 1.3
    system = System({x: -x + x**2}, events=[Event(x - b, terminal=True)])
    many = ensemble(system, (0, 4000), {x: 0}, Diffusion({x: s}, 1, seed=4), 1500)  # U'' vanishes on the way
    assert set(many.outcomes) == {Outcome.TERMINATED}

    def weight(a, sign):
        return math.exp(sign * 2 / s**2 * (a**2 / 2 - a**3 / 3))

    exact = 2 / s**2 * quad(lambda u: weight(u, 1) * quad(lambda a: weight(a, -1), -4, u)[0], 0, b)[0]
    assert near(many.end_time, exact)


def test_noise_on_the_drive_leaves_sticking_and_ends_it_at_its_first_passage():
    # v' = w - lam with w = W: sticks until |w| = 1, which W reaches after the mean time 1.
    system = System({v: w - lam, w: 0 * w})
    times = []
    for k in range(400):
        run = solve(system, (0, 16), {v: 0, w: 0}, noise=Diffusion({w: 1}, 1 / 16, seed=5, trajectory=k))
        stuck = run.segments[0]
        assert stuck.status == (0,) and not run["v"][stuck.columns].any()
        assert abs(run["w"][stuck.last]) == pytest.approx(1, abs=0.2)
        times.append(stuck.end)
    # The last point before |w| = 1 is seen lies a step of 1/16/2^8 early at most: far below the standard error.
    assert near(times, 1.0)


# ---- orders


def strong_errors(system, start, amplitude, levels, count=1500, finest=None, reference=7):
    """(root mean square distance from the same path at a fine level, mean steps) at each level."""

    def end(level):
        own = finest(level) if finest else 8
        noise = Diffusion(amplitude, 1 / 8, seed=6, level=level, resolution=0.5, finest=own)
        many = quiet(ensemble, system, (0, 1), start, noise, count)
        return many.end, many.steps.mean()

    exact, _ = end(reference)
    found = [end(level) for level in levels]
    return np.array([math.sqrt(np.mean((e - exact) ** 2)) for e, _ in found]), np.array([c for _, c in found])


def slope(errors, sizes):
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def test_additive_noise_has_the_strong_order_three_halves():
    system = System({x: x - x**3 + sp.sin(3 * t)}, time=t)
    for amplitude in (0.8, 0.8 * sp.cos(4 * t)):
        errors, _ = strong_errors(system, {x: 0.3}, {x: amplitude}, (1, 2, 3, 4))
        # From above: part of the error is of the drift, of order 2.
        assert 1.4 < -slope(errors, 2.0 ** np.arange(4)) < 2.1


def test_state_dependent_noise_has_the_strong_order_one():
    errors, _ = strong_errors(System({x: sp.sin(x)}), {x: 1}, {x: sp.sqrt(1 + x**2) / 2}, (0, 1, 2, 3, 4))
    assert 0.9 < -slope(errors, 2.0 ** np.arange(5)) < 1.1


def test_two_commuting_sources_have_the_strong_order_one():
    system = System({x: -x, y: x - y})
    amplitude = {x: {"a": x / 2, "b": x / 3}, y: {"a": y / 2, "b": y / 3, "c": 0.0}}
    errors, _ = strong_errors(system, {x: 1, y: 2}, amplitude, (0, 1, 2, 3, 4))
    assert 0.9 < -slope(errors, 2.0 ** np.arange(5)) < 1.1


RELAY = (System({v: -lam}), {v: 0.1}, {v: 0.5}, (0, 1, 2, 3, 4))


def test_across_a_switch_equal_steps_have_the_strong_order_three_quarters():
    # Euler-Maruyama's there, for additive noise: A. Neuenkirch, M. Szoelgyenyi, arXiv:1904.07784.
    errors, _ = strong_errors(*RELAY, count=500, finest=lambda level: 0 if level < 7 else 7)
    assert 0.7 < -slope(errors, 2.0 ** np.arange(5)) < 0.95


def test_across_a_switch_finer_steps_beside_it_have_order_one_in_their_number():
    errors, steps = strong_errors(*RELAY, count=500, finest=lambda level: level)
    assert -slope(errors, steps) > 0.9


def weak_errors(system, start, amplitude, levels, of, count):
    """Bias of E of(x) at each level and its standard error, on common paths."""
    ends = {}
    for level in (*levels, 6):
        noise = Diffusion(amplitude, 1 / 4, seed=7, level=level, resolution=0.5)
        ends[level] = of(ensemble(system, (0, 1), start, noise, count).end[:, 0])
    differences = [ends[level] - ends[6] for level in levels]
    return np.array([d.mean() for d in differences]), np.array(
        [d.std() / math.sqrt(count) for d in differences]
    )


def test_additive_noise_has_the_weak_order_two():
    bias, error = weak_errors(System({x: -2 * x}), {x: 0}, {x: 0.5}, (0, 1, 2), np.square, 20_000)
    assert np.all(np.abs(bias) > 4 * error)  # seen above its sampling error
    assert 1.6 < -slope(np.abs(bias), 2.0 ** np.arange(3)) < 2.6


def test_state_dependent_noise_has_the_weak_order_one():
    bias, error = weak_errors(System({x: 0.5 * x}), {x: 1}, {x: x}, (0, 1, 2, 3), np.square, 40_000)
    assert np.all(np.abs(bias[:3]) > 4 * error[:3])
    assert 0.8 < -slope(np.abs(bias), 2.0 ** np.arange(4)) < 1.3


# ---- one path, to the bit


def test_the_path_belongs_to_its_seed_and_not_to_the_steps():
    # dx = w dt, dw = dW: one step gives W and its integral exactly, so that all levels agree up to rounding.
    system = System({x: w, w: 0 * w})
    ends = [
        solve(system, (0, 4), {x: 0, w: 0}, noise=Diffusion({w: 1}, 1 / 4, seed=8, level=level)).x[:, -1]
        for level in (0, 1, 5, 9)
    ]
    # 2^9 * 16 additions of numbers of size 4.
    assert np.abs(np.array(ends) - ends[0]).max() < 2**13 * 4 * np.finfo(float).eps


def test_the_path_is_brownian():
    system = System({x: w, w: 0 * w})
    many = ensemble(system, (0, 1), {x: 0, w: 0}, Diffusion({w: 1}, 1 / 4, seed=9, level=2), 20_000,
                    t_eval=[0.25, 0.5, 1])  # fmt: skip
    increments = np.diff(many["w"], axis=1, prepend=0)
    for k, length in enumerate((0.25, 0.25, 0.5)):
        assert near(increments[:, k], 0) and near(increments[:, k] ** 2, length)
    assert np.abs(np.corrcoef(increments.T) - np.eye(3)).max() < 5 / math.sqrt(20_000)
    assert near(many["x"][:, 2] ** 2, 1 / 3) and near(many["x"][:, 2] * many["w"][:, 2], 1 / 2)


def test_the_inside_of_an_interval_is_brownian_too():
    # int_0^1 W cos(2 pi t) dt = -int sin(2 pi t) dW / (2 pi) has the variance 1/(8 pi^2), most of it from inside the
    # interval; halved six times, the quadrature is good to (2 pi/64)^2/10 = 0.1 %, the standard error is 1 %.
    system = System({x: w * sp.cos(2 * sp.pi * t), w: 0 * w}, time=t)
    many = ensemble(system, (0, 1), {x: 0, w: 0}, Diffusion({w: 1}, 1, seed=18, level=6), 20_000)
    assert near(many.end[:, 0] ** 2, 1 / (8 * math.pi**2))


@pytest.mark.parametrize("convention", ["ito", "stratonovich"])
def test_geometric_brownian_motion_follows_its_path(convention):
    system = System({x: 0 * x, w: 0 * w})
    amplitude = {x: {"a": 0.5 * x}, w: {"a": 1}}
    noise = Diffusion(amplitude, 1 / 4, seed=10, level=8, convention=convention)
    run = solve(system, (0, 4), {x: 1, w: 0}, noise=noise)
    drift = 0 if convention == "stratonovich" else 0.125
    exact = np.exp(0.5 * run["w"] - drift * run.t)
    # Strong order 1 at h = 2^-10, error constant (s^2 h)^(1/2) s sqrt(T)-like: well below 1 %; the drift is 50 %.
    assert np.abs(run["x"] / exact - 1).max() < 1e-2


@pytest.mark.parametrize("view", ["exact", "smoothed"])
def test_an_amplitude_of_zero_leaves_the_deterministic_run_to_the_bit(view):
    system = System({x: v, v: -x - lam})
    system = system if view == "exact" else system.smoothed(eps=0.01)
    plain = solve(system, (0, 5), {x: 3, v: 0})
    for noise in (Diffusion({v: 0}, 1 / 8), Diffusion({v: x * sp.Symbol("D")}, 1 / 8, parameters={"D": 0})):
        noisy = solve(system, (0, 5), {x: 3, v: 0}, noise=noise)
        assert np.array_equal(plain.t, noisy.t) and np.array_equal(plain.x, noisy.x)


def test_an_ensemble_is_the_same_bits_however_it_is_cut():
    system = System({x: v, v: -x - lam + w, w: -w})
    noise = Diffusion({w: 0.8}, 1 / 16, seed=11)
    start = {x: 1, v: 0, w: 0}
    whole = ensemble(system, (0, 3), start, noise, 10, t_eval=[1, 2, 3])
    parts = [ensemble(system, (0, 3), start, replace(noise, trajectory=k), n, t_eval=[1, 2, 3])
             for k, n in ((7, 3), (0, 7))]  # fmt: skip
    assert np.array_equal(whole.x, np.concatenate([parts[1].x, parts[0].x]))
    for k in (0, 4):
        one = solve(system, (0, 3), start, noise=replace(noise, trajectory=k), t_eval=[1, 2, 3])
        assert np.array_equal(one.x, whole.x[k])
        assert one.cost["steps"] == whole.steps[k]


def test_a_run_cut_in_two_walks_the_path_of_the_whole_run():
    noise = Diffusion({x: 1}, 1 / 4, seed=12)
    system = System({x: 0 * x})
    whole = solve(system, (-1, 3), {x: 0}, noise=noise)
    first = solve(system, (-1, 1.25), {x: 0}, noise=noise)
    second = solve(system, (1.25, 3), {x: first["x"][-1]}, noise=noise)
    assert second["x"][-1] == whole["x"][-1]


# ---- switches


def test_noise_on_the_surface_warns_that_nothing_sticks():
    with pytest.warns(UserWarning, match="such a path does not stick"):
        run = solve(System({v: -lam}), (0, 1), {v: 0}, noise=Diffusion({v: 0.5}, 1 / 8))
    assert not (run.status == 0).any()


def test_nonlinear_sticking_ends_in_folds_under_a_noisy_drive():
    # mu = lam (1 + 3 (1 - lam^2)) has its folds at lam = 2/3, mu = 16/9.
    system = System({v: w - lam * (1 + 3 * (1 - lam**2)), w: sp.Rational(1, 2) + 0 * w})
    ends = set()
    for k in range(20):
        noise = Diffusion({w: 0.3}, 1 / 16, seed=13, trajectory=k)
        run = solve(system, (0, 16), {v: 0, w: 0}, noise=noise)
        ends |= {e.kind for e in run.events if e.kind.startswith("slip")}
        stuck = run.segments[0]
        assert stuck.status == (0,)
        # The path is located to 1/16/2^34 in time, where w moves by 0.3 sqrt(1/16/2^34) = 6e-7.
        assert abs(run["w"][stuck.last] - 16 / 9) < 5e-6
        assert abs(run["lam"][stuck.last] - 2 / 3) < 5e-3  # lambda tends to its fold as the root of that
    assert ends == {"slip by fold"}


def test_a_crossing_is_located_on_the_path():
    # x' = v crosses 0 where the drive, an integral of the noise, brings it: no noise acts on the surface itself.
    switch = Switch("side", x)
    system = System({x: v, v: -switch + w, w: 0 * w})
    run = solve(system, (0, 20), {x: 1, v: 0, w: 0}, noise=Diffusion({w: 0.2}, 1 / 16, seed=14))
    crossings = np.flatnonzero(np.diff(run.status[0]))
    assert len(crossings) > 3 and np.abs(run["x"][crossings]).max() == 0


def test_a_switch_in_the_amplitude_of_a_smoothed_view_is_its_sigmoid():
    noise = dict(step=1 / 16, seed=16)
    smooth = System({v: -lam}).smoothed(eps=0.5, sigmoid="tanh")
    by_name = solve(smooth, (0, 4), {v: 1}, noise=Diffusion({v: sp.sqrt(1 - lam**2) / 2}, **noise))
    own = System({v: -sp.tanh(2 * v)})
    by_hand = solve(own, (0, 4), {v: 1}, noise=Diffusion({v: sp.sqrt(1 - sp.tanh(2 * v) ** 2) / 2}, **noise))
    # Same path; steps may differ where the smoothed one keeps to its layer: order 1 in 1/16, as a bound.
    assert np.abs(by_name["v"] - by_hand["v"]).max() < 1 / 16


def test_an_algebraic_unknown_is_solved_along_the_path():
    a = sp.Symbol("a", real=True)
    implicit = System({x: a}, algebraic=[Algebraic(a, a + x + sp.tanh(a) / 2)])
    explicit = System({x: -sp.Rational(2, 3) * x})
    noise = Diffusion({x: 1e-3}, 1 / 16, seed=17)
    # Near 0, where tanh a = a up to a^3/3 = 1e-8.
    one, two = (solve(s, (0, 2), {x: 2e-3}, noise=noise)["x"] for s in (implicit, explicit))
    assert np.abs(one - two).max() < 1e-8


# ---- the door


@pytest.mark.parametrize(
    ("error", "arguments", "said"),
    [
        (ValueError, dict(amplitude={x: 1}, step=0), "`step` of the diffusion is 0"),
        (ValueError, dict(amplitude={}, step=1), "`amplitude` is empty"),
        (TypeError, dict(amplitude=0.1, step=1), "`amplitude` is 0.1"),
        (TypeError, dict(amplitude={x: "big"}, step=1), "`amplitude` of x"),
        (ValueError, dict(amplitude={x: sp.I * x}, step=1), "not a finite real expression"),
        (ValueError, dict(amplitude={x: 1}, step=1, seed=-3), "`seed` is -3"),
        (TypeError, dict(amplitude={x: 1}, step=1, seed=0.5), "`seed` is 0.5"),
        (ValueError, dict(amplitude={x: 1}, step=1, resolution=2), "`resolution` is 2"),
        (ValueError, dict(amplitude={x: 1}, step=1, level=21), "`level`"),
        (ValueError, dict(amplitude={x: 1}, step=1, convention="kinetic"), "choose one of ito, stratonovich"),
        (ValueError, dict(amplitude={x: 1}, step=1, parameters={"D": math.nan}), "give a finite number"),
    ],
)
def test_bad_diffusions_are_refused_where_they_are_made(error, arguments, said):
    with pytest.raises(error) as caught:
        Diffusion(**arguments)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("amplitude", "said"),
    [
        ({"q": 1}, "`amplitude` names 'q'"),
        ({x: sp.Symbol("D")}, "`amplitude` contains D"),
        ({x: sp.Abs(x)}, "has no derivative by the states everywhere"),
        ({x: {"a": v}, v: {"b": x}}, "the noise does not commute"),
        ({x: lam}, "which the system solves for while it sticks"),
        ({"latch": 1}, "which is a memory"),
        (sp.Matrix([[1], [2]]), "`amplitude` has 2 rows; this view has 3 states"),
    ],
)
def test_amplitudes_that_do_not_fit_the_system_are_refused(amplitude, said):
    latch = Memory("latch", 0)
    system = System({x: v, v: -lam - x}, events=[Event(x - 9, update={latch: 1})])
    with pytest.raises(ValueError) as caught:
        solve(system, (0, 1), {x: 0, v: 0}, noise=Diffusion(amplitude, 1 / 8))
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (dict(t_span=(0, 1.03)), "no multiple of the diffusion's `step`"),
        (dict(t_eval=[0.3]), "an entry of `t_eval` is 0.3"),
        (dict(dense_output=True), "a diffusion has no polynomials"),
        (dict(method="rk"), "a diffusion has its own"),
        (dict(order=12), "do not act on a diffusion"),
        (dict(max_step=0.1), "do not act on a diffusion"),
    ],
)
def test_options_that_a_diffusion_does_not_have_are_refused(options, said):
    with pytest.raises(ValueError) as caught:
        solve(System({x: -x}), **(dict(t_span=(0, 1), x0={x: 0}) | options), noise=Diffusion({x: 1}, 1 / 8))
    assert said in str(caught.value)


def test_contacts_and_instants_are_refused():
    floor = Unilateral(x, restitution=0.5)
    with pytest.raises(ValueError, match="a diffusion with contacts is not provided"):
        solve(System({x: v, v: -1 + floor.reaction}), (0, 1), {x: 1, v: 0}, noise=Diffusion({v: 1}, 1 / 8))
    with pytest.raises(ValueError, match="happens at given times"):
        solve(
            System({x: -x}, events=[Event(every=1, update={x: 1})]),
            (0, 1),
            {x: 1},
            noise=Diffusion({x: 1}, 1 / 8),
        )


def test_sliding_along_a_curved_surface_is_refused():
    ring = Switch("ring", x**2 + y**2 - 1)
    system = System({x: -y - x * ring, y: x - y * ring})
    with pytest.raises(ValueError, match="along the curved surface"):
        solve(system, (0, 1), {x: 2, y: 0}, noise=Diffusion({x: {"a": -y}, y: {"a": x}}, 1 / 8))


def test_a_blow_up_is_an_outcome_with_the_path_so_far():
    run = solve(System({x: x**3}), (0, 4), {x: 3}, noise=Diffusion({x: 1}, 1 / 8, seed=15))
    assert run.outcome in (Outcome.NOT_FINITE, Outcome.STEP_UNDERFLOW) and np.isfinite(run.x).all()
    assert solve(System({x: -x}), (0, 4), {x: 3}, noise=Diffusion({x: 1}, 1 / 8), max_steps=7).outcome is (
        Outcome.TOO_MANY_STEPS
    )


def test_a_member_of_a_family_stands_for_the_states_of_all_elements():
    n = 6
    family = Family(n, periodic=True)
    (x,) = family.symbols("x")
    (D,) = family.symbols("D", positive=True)
    values = np.linspace(0.1, 0.6, n)
    ring = System({x: family.neighbour(x, 1) - (2 + D) * x}, parameters={D: values.tolist()})
    own = solve(ring, (0, 1), {x: 0}, noise=Diffusion({x: D**2}, step=1 / 64, seed=4))
    each = {f"x_{k + 1}": values[k] ** 2 for k in range(n)}
    written = solve(ring, (0, 1), {x: 0}, noise=Diffusion(each, step=1 / 64, seed=4))
    assert np.allclose(own.x, written.x, rtol=0, atol=1e-13) and np.abs(own.x[:, -1]).min() > 1e-6
    # One source that is named drives all alike.
    common, alike = Diffusion({x: {"all": 0.3}}, step=1 / 64, seed=4), {"D": 0.2}
    end = solve(ring, (0, 1), {x: 0}, noise=common, parameters=alike).x[:, -1]
    assert np.ptp(end) < 1e-14 and abs(end[0]) > 1e-3
    with pytest.raises(ValueError, match="outside of its rates take a sum"):
        solve(ring, (0, 1), {x: 0}, noise=Diffusion({"x_1": D}, step=1 / 64))
