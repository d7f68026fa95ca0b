"""Discs in notation, laws, mechanisms, views and files; what they refuse, by name.

Guards: definition/discs.py.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth import Disc, Drive, Event, Solution, Strobe, System, Unilateral, solve, sweep
from pwsmooth.laws.friction import (
    GMS,
    XKY,
    BlimanSorine,
    BoucWen,
    Coulomb,
    Dahl,
    Elastoplastic,
    ElastoplasticFixed,
    HiddenStatic,
    LuGre,
    MaxwellSlip,
    MultistateXKY,
    StaticKinetic,
    StribeckFriction,
)
from pwsmooth.scenes import assemble, prescribed_motion, t

x, y, z, u, v, w = sp.symbols("x y z u v w", real=True)
lam = Disc("lam", (u, v))


def test_a_block_thrown_on_a_plane_stops_and_stays():
    speed = sp.sqrt(u**2 + v**2)
    written, given = (
        solve(System({x: u, y: v, u: -first / 2, v: -second / 2}), (0, 4), {x: 0, y: 0, u: 0.6, v: 0.8})
        for first, second in ((u / speed, v / speed), lam)
    )
    for run in (written, given):
        assert [event.kind for event in run.events] == ["stick"]
        assert run.events[0].time == pytest.approx(2, abs=1e-12)
        assert run.x[:2, -1] == pytest.approx([0.6, 0.8], abs=1e-11)
        assert not run.x[2:, -1].any()


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (lambda s: -(u - 1) / s, lambda s: -v / s),  # over a belt
        (lambda s: -(u - 1) * sp.exp(-s) / s, lambda s: -v * sp.exp(-s) / s - s * v),
    ],
)
def test_a_direction_in_ordinary_notation_is_a_disc(first, second):
    s = sp.sqrt((u - 1) ** 2 + v**2)
    system = System({u: first(s), v: second(s)})
    (disc,) = system.discs
    assert set(disc.surfaces) == {u - 1, v}
    run = solve(system, (0, 20), {u: 1.3, v: 0.4})
    assert run.itinerary[-1].startswith("stick") and run.x[:, -1] == pytest.approx([1, 0], abs=1e-12)


def test_a_direction_to_a_centre_is_no_friction():
    r = sp.sqrt(x**2 + y**2)
    spring = System({x: u, y: v, u: -(r - 1) * x / r, v: -(r - 1) * y / r})
    assert spring.discs == () and any(event.singular for event in spring.model.events)
    mixed = System({u: -(u + 1) / sp.sqrt(u**2 + v**2), v: -v / sp.sqrt(u**2 + v**2)})
    assert mixed.discs == ()


bristle = {"sigma0": 50.0, "sigma1": 1.0, "sigma2": 0.1, "v_s": 0.1}
PLANAR = [
    Coulomb(),
    StaticKinetic(F_s=1.3),
    StribeckFriction(F_s=1.3, v_s=0.1),
    HiddenStatic(rho=1.0, beta=0.3),
    Dahl(sigma0=50.0),
    LuGre(**bristle),
    Elastoplastic(**bristle, z_ba=0.012),
    ElastoplasticFixed(**bristle, z_ba=0.012, z_max=0.025),
    XKY(kappa=50.0, sigma=1.0, v_s=0.1, sigma2=0.1),
    MultistateXKY(kappa=(50.0, 20.0, 5.0), sigma=0.5, share=(0.4, 0.3, 0.3), F_s=1.3, v_s=0.1),
    MaxwellSlip(kappa=(50.0, 20.0, 5.0), strength=(0.4, 0.3, 0.3)),
    GMS(kappa=(50.0, 20.0, 5.0), share=(0.4, 0.3, 0.3), F_s=1.3, v_s=0.1, C=20.0, sigma=0.1),
    BoucWen(k=20.0, beta=300.0, gamma=100.0, alpha=0.2, n=2),
]


def on_springs(law, push, start=(0.0, 0.0, 0.0, 0.0), parameters=None):
    """The run of a mass on springs with the law, under a push with components."""
    pieces = law.attach(velocity=(u, v), position=(x, y))
    rates = {x: u, y: v, u: push[0] - x - pieces.force[0], v: push[1] - y - pieces.force[1]}
    start = dict(zip(rates, map(float, start), strict=True))
    system, first, _ = assemble(rates, pieces, time=t, x0=start, parameters=parameters)
    return solve(system, (0, 8), first, rtol=1e-11, atol=1e-13)


def pushed(law, sine, cosine, start):
    """The same under the push sine sin(t) + cosine cos(0.7 t): one model, whatever these two vectors are."""
    a, b = sp.symbols("sine_x sine_y", real=True), sp.symbols("cosine_x cosine_y", real=True)
    push = [a[i] * sp.sin(t) + b[i] * sp.cos(0.7 * t) for i in range(2)]
    return on_springs(law, push, start, dict(zip((*a, *b), map(float, (*sine, *cosine)), strict=True)))


@pytest.mark.parametrize("law", PLANAR, ids=lambda law: type(law).__name__)
def test_a_law_in_the_plane_is_the_scalar_one_along_a_line(law):
    push, angle = 2 * sp.sin(t), 0.7
    both = pushed(law, [2 * np.cos(angle), 2 * np.sin(angle)], [0, 0], [0, 0, 0, 0])
    pieces = law.attach(velocity=u, position=x)
    line, first, _ = assemble({x: u, u: push - x - pieces.force}, pieces, time=t, x0={x: 0, u: 0})
    one = solve(line, (0, 8), first, rtol=1e-11, atol=1e-13)
    if both.system.discs and both.system.model.multipliers[0].regularity == "sliding":
        times = [[(e.kind, round(e.time, 8)) for e in run.events] for run in (both, one)]
        assert times[0] == times[1] and times[0]
    assert both["x"][-1] == pytest.approx(one["x"][-1] * np.cos(angle), abs=1e-9)
    assert both["y"][-1] == pytest.approx(one["x"][-1] * np.sin(angle), abs=1e-9)


@pytest.mark.parametrize("law", PLANAR, ids=lambda law: type(law).__name__)
def test_a_turned_frame_sees_the_same_motion(law):
    sine, cosine, start = np.array([2.5, 0]), np.array([0, 1.8]), np.array([0.3, -0.2, 0.5, 0.1])
    angle = 0.9
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    one = pushed(law, sine, cosine, start)
    turned = pushed(law, turn @ sine, turn @ cosine, np.kron(np.eye(2), turn) @ start)
    # Not the kinks: elastoplastic bristles tend to one of theirs, and meet it by rounding.
    events = [[e for e in run.events if e.kind != "crossing"] for run in (one, turned)]
    assert [e.kind for e in events[0]] == [e.kind for e in events[1]]
    assert [e.time for e in events[0]] == pytest.approx([e.time for e in events[1]], abs=1e-8)
    for pair in (slice(0, 2), slice(2, 4)):
        assert turn @ one.x[pair, -1] == pytest.approx(turned.x[pair, -1], abs=1e-9)


@pytest.mark.parametrize(
    "stiff",
    [
        lambda k: Dahl(sigma0=k),
        lambda k: LuGre(sigma0=k, sigma1=k**0.5, sigma2=0.0, F_s=1.0),
        lambda k: XKY(kappa=k, sigma=k**0.5, sigma2=0.0, F_s=1.0),
        lambda k: MaxwellSlip(kappa=(k,), strength=(1.0,)),
        lambda k: Elastoplastic(sigma0=k, sigma1=k**0.5, sigma2=0.0, F_s=1.0, z_ba=0.9 / k),
    ],
    ids=["Dahl", "LuGre", "XKY", "MaxwellSlip", "Elastoplastic"],
)
def test_stiff_bristles_tend_to_the_disc(stiff):
    push = (1.6 * sp.cos(t / 4), 0.8 * sp.sin(t / 4))
    start = (0.3, 0.1, 0.5, -0.4)
    exact = on_springs(Coulomb(), push, start)
    assert "stick" in [e.kind for e in exact.events]
    off = [np.abs(on_springs(stiff(k), push, start).x[:2, -1] - exact.x[:2, -1]).max() for k in (1e2, 1e3)]
    # Deflections are F_c/k, and the micro-damping of LuGre's kind lags by sigma1/k = 1/sqrt(k).
    assert off[1] < 1.05 * off[0] / np.sqrt(10) and off[1] < 0.02


@pytest.mark.parametrize("radius", [0.01, 0.05, 0.3])
def test_bristles_on_a_circle_lag_as_their_closed_forms_say(radius):
    """|F|/F_c = 1/sqrt(1 + 1/(sigma rho)^2) and the lag of Dahl's; LuGre's Z = V/(sigma0 V/g + i omega)."""
    sigma, omega = 20.0, 3.0
    speed = radius * omega
    motion = tuple(radius * e for e in (sp.sin(omega * t), -sp.cos(omega * t)))
    velocity = tuple(e.diff(t) for e in motion)
    stribeck = LuGre(sigma0=sigma, sigma1=2.0, sigma2=0.3, v_s=0.4)
    for law in (Dahl(sigma0=sigma), stribeck):
        rig = prescribed_motion(law, velocity=velocity, t_span=(0, 60 / speed / sigma))
        force = complex(*(rig.solve(rtol=1e-11)[f"force_{axis}"][-1] for axis in "xy"))
        level = 1.0 if law is not stribeck else 1 + 0.5 * np.exp(-((speed / 0.4) ** 2))
        z = speed / (sigma * speed / level + 1j * omega)
        if law is stribeck:
            expected = sigma * z + 2.0 * 1j * omega * z + 0.3 * speed
        else:
            expected = np.exp(-1j * np.arctan(1 / (sigma * radius))) / np.sqrt(1 + 1 / (sigma * radius) ** 2)
        assert force * np.exp(-1j * omega * rig.t_span[1]) == pytest.approx(expected, abs=1e-9)


def test_a_record_of_a_motion_in_the_plane_does_what_the_motion_does():
    times = np.linspace(0, 4, 801)
    motion = (sp.sin(3 * t) / 50, (1 - sp.cos(2 * t)) / 40)
    ends = []
    for change in (lambda e: e, lambda e: Drive(times, sp.lambdify(t, e, "numpy")(times))):
        for given in ({"position": motion}, {"velocity": tuple(e.diff(t) for e in motion)}):
            given = {name: tuple(map(change, parts)) for name, parts in given.items()}
            run = prescribed_motion(Dahl(sigma0=50.0), **given, t_span=(0, 4), work=True).solve()
            ends.append([run[name][-1] for name in ("position_x", "velocity_y", "force_x", "force_y", "work")])
    assert np.ptp(ends, axis=0).max() < 1e-6


def test_biaxial_hysteresis_is_that_of_park_wen_and_ang_along_lines_and_knows_no_axes_on_curves():
    """Their equations, as printed in Wen, Appl. Mech. Rev. 42 (1989) 39, by SciPy."""
    law = BoucWen(k=1.0, beta=300.0, gamma=100.0, n=2)

    def ends(across, angle):
        """z at the end by both, turned back by the angle."""
        straight = (0.3 * sp.cos(2 * t), across * sp.sin(3 * t))
        c, s = np.cos(angle), np.sin(angle)
        motion = (c * straight[0] - s * straight[1], s * straight[0] + c * straight[1])
        w = sp.lambdify(t, motion, "numpy")

        def printed(time, z):
            v = np.array(w(time))
            return v - z * (300 * np.abs(v * z).sum() + 100 * v @ z)

        rig = prescribed_motion(law, velocity=motion, t_span=(0, 3)).solve()
        theirs = solve_ivp(printed, (0, 3), [0, 0], rtol=1e-9, atol=1e-12, max_step=0.01).y[:, -1]
        ours = np.array([rig["force_x"][-1], rig["force_y"][-1]])
        back = np.array([[c, s], [-s, c]])
        return back @ ours, back @ theirs

    for angle in (0.0, 0.5):
        assert np.subtract(*ends(0.0, angle)) == pytest.approx([0, 0], abs=1e-6)
    (ours, theirs), (turned, other) = ends(0.3, 0.0), ends(0.3, 0.5)
    assert ours == pytest.approx(turned, abs=1e-8)
    assert np.abs(theirs - other).max() > 1e-5  # a thousand times ours


def test_a_mass_matrix_unsolved_and_solved_give_the_same_events():
    M = sp.Matrix([[2, sp.Rational(1, 2)], [sp.Rational(1, 2), 1]])
    for rho in (0, 2):
        force = {
            u: 1.9 * sp.cos(t / 4) - x - lam[0] * (1 + rho * (1 - lam.square)),
            v: sp.sin(t / 4) - y - lam[1] * (1 + rho * (1 - lam.square)),
        }
        solved = M.inv() * sp.Matrix(list(force.values()))
        systems = (
            System({x: u, y: v}, mass_matrix=M, forcing=force, time=t),
            System({x: u, y: v, u: solved[0], v: solved[1]}, time=t),
        )
        runs = [solve(s, (0, 20), {x: 0.3, y: 0.1, u: 0.5, v: -0.4}, rtol=1e-11, atol=1e-13) for s in systems]
        kinds = [[e.kind for e in run.events] for run in runs]
        assert kinds[0] == kinds[1] and len(kinds[0]) >= 2
        assert runs[0].event_times() == pytest.approx(runs[1].event_times(), abs=1e-9)


def test_a_hopping_block_slides_only_while_it_is_on_the_floor():
    floor = Unilateral(z, restitution=0.5, name="R")
    R = floor.reaction
    block = System({x: u, y: v, z: w, u: -R * lam[0] / 50, v: -R * lam[1] / 50, w: R - 1})
    start = {x: 0, y: 0, z: 1, u: 0.3, v: 0.4, w: 0}
    run = solve(block, (0, 30), start)
    assert run.itinerary[-1] == "stick (lam sliding), contact (R) closed"
    # Bounces and all, the floor gives what gravity takes: a friction of 1/50 of that stops 0.5 at t = 25.
    assert run.event_times("stick")[-1] == pytest.approx(25, abs=1e-8)
    dropped = solve(block, (0, 20), start | {u: 0, v: 0})
    assert not dropped.x[:2].any()


def test_kicks_and_resets_take_a_stick_off():
    kicked = System({u: -lam[0] / 2, v: -lam[1] / 2}, events=[Event(every=3, update={u: u + 1})], time=t)
    run = solve(kicked, (0, 8.5), {u: 0, v: 0})
    assert [(e.kind, e.time) for e in run.events if e.switch == "lam"] == [
        ("slip by reset", 3), ("stick", pytest.approx(5)), ("slip by reset", 6), ("stick", pytest.approx(8)),
    ]  # fmt: skip


def test_the_smoothed_view_tends_to_the_exact_motion():
    system = System({x: u, y: v, u: 1.6 * sp.cos(t / 4) - x - lam[0], v: sp.sin(t / 4) - y - lam[1]}, time=t)
    start = {x: 0.3, y: 0.1, u: 0.5, v: -0.4}
    exact = solve(system, (0, 10), start, rtol=1e-11, atol=1e-13).x[:2, -1]
    off = [
        np.abs(solve(system.smoothed({lam: eps}), (0, 10), start).x[:2, -1] - exact).max()
        for eps in (1e-2, 1e-4)
    ]
    assert off[1] < 0.05 * off[0] and off[1] < 1e-3


def test_a_solution_with_a_disc_is_saved_and_found_again(tmp_path):
    system = System({u: 0.2 - lam[0] / 2, v: -lam[1] / 2})
    run = solve(system, (0, 4), {u: 0.6, v: 0.8}, dense_output=True)
    run.save(tmp_path / "disc.npz")
    again = Solution.load(tmp_path / "disc.npz")
    assert again.system.discs == (lam,) and again.itinerary == run.itinerary
    assert (
        again(0.3, "lam_x")
        == run(0.3, "lam_x")
        == pytest.approx(run(0.3, "u") / np.hypot(*run(0.3)), abs=1e-12)
    )
    assert run["lam_x"][-1] == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Disc("lam", (u,)), "it is a Switch"),
        (lambda: Disc("lam", (u, v, x, y)), "are 4; give two or three"),
        (lambda: Disc("lam", (u, u)), "twice"),
        (lambda: Disc("lam", (u, sp.Integer(1))), "the constant 1"),
        (lambda: System({x: u, y: v, u: -Disc("p", (x, y))[0], v: -Disc("p", (x, y))[1]}), "cannot hold"),
        (lambda: System({u: -lam[0], v: -x, x: u}), "cannot hold"),
        (lambda: System({u: -lam[0], v: -Disc("lam", (u, v - 1))[1]}), "two discs are named 'lam'"),
        (lambda: System({u: -lam[0] * sp.sign(lam[1] - x), v: -lam[1], x: u}), "stands in the surface"),
        (lambda: System({u: -(lam[0] ** 3), v: -lam[1]}, convention="filippov"), "no disc"),
        (lambda: System({u: -lam[0], v: -lam[1]}).smoothed(1e-3, "tanh"), "0/0"),
        (lambda: BlimanSorine().attach(velocity=(u, v)), "a law of one velocity"),
        (lambda: BoucWen().attach(velocity=(u, v), position=(x, y)), "`n` of BoucWen is 1"),
        (lambda: BoucWen(n=2).attach(velocity=(u, v), position=x), "`position` has 1 components"),
    ],
)  # fmt: skip
def test_what_is_refused_says_why(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_sweep_counts_the_sticks_of_a_disc():
    k = sp.Symbol("k", positive=True)
    force = [1.6 * sp.cos(t / 4) - k * x - lam[0], 0.25 * sp.sin(t / 4) - y - lam[1]]
    forced = System({x: u, y: v, u: force[0], v: force[1]}, time=t, parameters={k: 1})
    start = {x: 0.3, y: 0.1, u: 0.5, v: -0.4}
    options = dict(x0=start, seen=Strobe(8 * sp.pi), transient=30, periods=10)
    data = sweep(forced, {"k": [1, 1.2]}, measures=["sticks", "itinerary"], **options)
    assert data.sticks.values.tolist() == [2, 2] and data.itinerary.values.tolist() == ["0 + 0 +"] * 2


def test_what_a_disc_does_not_have_is_said_before_anything_runs():
    system, start = System({u: 0.2 - lam[0] / 2, v: -lam[1] / 2}), {u: 0.6, v: 0.8}
    with pytest.raises(ValueError, match="is a disc"):
        solve(system, (0, 1), start, method="stiff")
    with pytest.raises(ValueError, match="Integrate forward"):
        solve(system, (1, 0), start)
