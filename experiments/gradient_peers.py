"""Gradients of piecewise-smooth motions by other tools, as a careful user of each writes them.

    Motion                a scene in plain notation: slip with a side, stick, what a wall does, one number at the end
    Variational           heyoka: Taylor steps on the variational equations of every smooth piece; the jumps of the
                          derivatives at events (saltation) are written by hand, in NumPy
    events                diffrax: a solve to each event, whose time it differentiates, in a scan of as many pieces
    bare                  diffrax on the right-hand side with its sign, the usual way to differentiate a simulator
    stopped, differences  SciPy's DOP853 stopped at events (pwsmooth.compare), and central differences of any run

Nothing here shares code with the package's derivatives.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy as sp

# One thread for XLA, as for everybody else. Read when JAX is first imported.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

SIDE = sp.Symbol("side", real=True)
COOLDOWN = 1e-6  # s, of heyoka's events: a slip begins with a double zero, for which it would deduce infinity
AGAIN = 1e-9  # s, within which a wall struck again is this double zero


@dataclass(frozen=True)
class Motion:
    """x' = slip(t, x, p, side) until `wall` falls through zero, side after side, or `stick` until |lam| = 1.

    With `reset` the wall gives states new values and there are no sides.
    """

    time: sp.Symbol
    parameters: dict
    start: dict
    end: float
    slip: dict
    wall: sp.Expr  # times SIDE it is positive before it is met
    names: tuple[sp.Symbol, ...]  # by what is differentiated: parameters and states
    cost: sp.Expr  # of the states at the end
    stick: dict | None = None
    lam: sp.Expr | None = None  # the multiplier of the stick
    reset: dict = field(default_factory=dict)
    side: int = 1  # at the start

    @property
    def values(self) -> np.ndarray:
        return np.array([float((self.parameters | self.start)[s]) for s in self.names])

    def split(self, q: Any) -> tuple[list, list]:
        """The start and the parameters at these values of the names."""
        changed = dict(zip(self.names, q))
        return [changed.get(s, v) for s, v in self.start.items()], [
            changed.get(s, v) for s, v in self.parameters.items()
        ]

    @property
    def arguments(self) -> tuple:
        return self.time, list(self.start), list(self.parameters), SIDE

    @property
    def accelerations(self) -> list[sp.Expr]:
        """Rate of the wall with either side: it holds the motion if the first is negative, the second positive."""
        rate = sum(self.wall.diff(x) * f for x, f in self.slip.items())
        return [rate.subs(SIDE, side) for side in (1, -1)]

    def pieces(self) -> list[tuple[list, sp.Expr]]:
        """(rates, margin) of slip and of stick."""
        made = [(list(self.slip.values()), SIDE * self.wall)]
        return made + ([(list(self.stick.values()), 1 - self.lam**2)] if self.stick else [])


# ---- heyoka


class Variational:
    """Gradient of the cost by forward variational equations; `plainly` integrates without them."""

    def __init__(self, motion: Motion, tol: float, plainly: bool = False) -> None:
        import heyoka as hy

        hy.set_logger_level_critical()
        self.hy, self.motion, self.plainly = hy, motion, plainly
        n, names = len(motion.start), list(motion.names)
        states = hy.make_vars(*(f"x{i}" for i in range(n)))
        pars = {s: hy.par[k] for k, s in enumerate([*motion.parameters, SIDE])}
        symbols = {motion.time: hy.time, **dict(zip(motion.start, states)), **pars}
        self.integrators, self.functions = [], []
        for rates, margin in motion.pieces():
            system = list(zip(states, [hy.from_sympy(binary(f), symbols) for f in rates]))
            if not plainly:
                system = hy.var_ode_sys(system, args=[symbols[s] for s in names])
            event = hy.t_event(
                hy.from_sympy(binary(margin), symbols), direction=hy.event_direction.negative, cooldown=COOLDOWN
            )
            size = n if plainly else n * (1 + len(names))
            self.integrators.append(
                hy.taylor_adaptive(
                    system, [0.0] * size, tol=tol, fast_math=True, t_events=[event], compact_mode=size > 60
                )
            )
            p, x = list(motion.parameters), list(motion.start)
            slopes = [margin.diff(motion.time), [margin.diff(s) for s in x], [margin.diff(s) for s in names]]
            self.functions.append(sp.lambdify(motion.arguments, [rates, *slopes], cse=True))
        changed = [motion.reset.get(s, s) for s in motion.start]
        self.jump = sp.lambdify(
            motion.arguments,
            [changed, [[e.diff(s) for s in x] for e in changed],
             [[e.diff(s) if s in p else 0 for s in names] for e in changed]],
        )  # fmt: skip
        self.sides = sp.lambdify(motion.arguments, motion.accelerations, cse=True)
        self.lam = sp.lambdify(motion.arguments, motion.lam) if motion.stick else None
        self.at_end = sp.lambdify(motion.arguments, [motion.cost, [motion.cost.diff(s) for s in x]])
        self.own = np.array([s in motion.parameters for s in names])
        self.events = 0

    def __call__(self, q: np.ndarray) -> Any:
        """(cost, gradient), or the cost alone."""
        motion, hy = self.motion, self.hy
        x0, p = motion.split(q)
        n, k = len(x0), len(motion.names)
        x, moved = np.array(x0, float), np.zeros((n, k))
        for column, s in enumerate(motion.names):
            if s in motion.start:
                moved[list(motion.start).index(s), column] = 1.0
        t, side, piece, slipped, self.events = 0.0, motion.side, 0, -1.0, 0
        last: tuple = ()
        while True:
            ta = self.integrators[piece]
            ta.time = t
            ta.state[:n] = x
            if not self.plainly:
                ta.state[n:] = moved.ravel()
            ta.pars[:] = [*p, side][: len(ta.pars)]
            # The double zero with which a slip begins may be found again: then the event's cooldown has to stay.
            if last != (piece, t):
                ta.reset_cooldowns()
            outcome = ta.propagate_until(motion.end)[0]
            t, last = ta.time, (piece, ta.time)
            x = ta.state[:n].copy()
            if not self.plainly:
                moved = ta.state[n:].reshape(n, k).copy()
            if outcome == hy.taylor_outcome.time_limit:
                value, slope = self.at_end(t, x, p, side)
                return value if self.plainly else (value, np.array(slope, float) @ moved)
            if piece == 0 and t - slipped < AGAIN:
                continue
            self.events += 1
            before, since = piece, side
            if motion.reset:
                x_after, by_x, by_p = self.jump(t, x, p, side)
            elif piece:
                side, piece, slipped = (1 if self.lam(t, x, p, side) > 0 else -1), 0, t
            else:
                # Sides decide as Filippov has it; the rest of the event's tolerance is taken off.
                above, below = self.sides(t, x, p, side)
                x[list(motion.start).index(motion.wall)] = 0.0
                piece = 1 if motion.stick and above < 0 < below else 0
                side = side if piece else -side
            if not self.plainly:
                rates, by_t, by_state, by_name = self.functions[before](t, x, p, since)
                rates, by_state = np.array(rates, float), np.array(by_state, float)
                dt = -(by_state @ moved + np.where(self.own, by_name, 0.0)) / (by_state @ rates + by_t)
                moved += np.outer(rates, dt)
                if motion.reset:
                    moved, x = np.array(by_x, float) @ moved + np.array(by_p, float), np.array(x_after, float)
                moved -= np.outer(np.array(self.functions[piece](t, x, p, side)[0], float), dt)
            elif motion.reset:
                x = np.array(x_after, float)


def binary(e: sp.Expr) -> sp.Expr:
    """Fractions as floating-point numbers, which is what heyoka takes."""
    return sp.sympify(e).replace(lambda a: a.is_Rational and not a.is_Integer, lambda a: sp.Float(float(a)))


# ---- diffrax


def jax_numpy() -> Any:
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp

    return jnp


def _made(motion: Motion, expressions: Any) -> Any:
    """(t, x, p, side) -> array."""
    jnp = jax_numpy()
    function = sp.lambdify(motion.arguments, list(map(sp.sympify, expressions)), modules="jax", cse=True)
    return lambda t, x, p, side: jnp.stack([jnp.asarray(e, float) for e in function(t, list(x), list(p), side)])


def _adjoint(dfx: Any, how: str) -> Any:
    return dfx.ForwardMode() if how == "forward" else dfx.RecursiveCheckpointAdjoint()


def _differentiated(jax: Any, cost: Any, how: str) -> Any:
    """Compiled (q, *rest) -> value, or value and gradient."""
    if how == "plain":
        return jax.jit(cost)
    if how == "reverse":
        return jax.jit(jax.value_and_grad(cost))

    def forward(q, *rest):
        unit = jax.numpy.eye(len(q))
        value, slopes = jax.vmap(lambda d: jax.jvp(lambda at: cost(at, *rest), (q,), (d,)), out_axes=(None, 0))(
            unit
        )
        return value, slopes

    return jax.jit(forward)


def events(motion: Motion, count: int, how: str, most: int = 256) -> Any:
    """diffrax with its event: (q, rtol, atol, longest step) -> cost, gradient; `how` is "plain", "forward", "reverse".

    `count` events are known beforehand, so that no piece is computed in vain.
    """
    import diffrax as dfx
    import jax
    import optimistix as optx

    jnp = jax_numpy()
    x0 = list(motion.start)
    (slip, wall), *rest = motion.pieces()
    slips, walls = _made(motion, slip), _made(motion, [wall])
    stick = _made(motion, rest[0][0]) if rest else None
    bound = _made(motion, [rest[0][1], motion.lam]) if rest else None
    sides = _made(motion, motion.accelerations)
    jump = _made(motion, [motion.reset.get(s, s) for s in x0]) if motion.reset else None
    place = None if motion.reset else x0.index(motion.wall)
    at_end = _made(motion, [motion.cost])

    def rates(t, x, args):
        p, side, _ = args
        free = slips(t, x, p, side)
        return jnp.where(side == 0, stick(t, x, p, side), free) if stick else free

    def margin(t, y, args, **_):
        p, side, begin = args
        value = walls(t, y, p, side)[0]
        if stick:
            value = jnp.where(side == 0, bound(t, y, p, side)[0], value)
        # The start lies on the wall, on either side of it to rounding.
        return jnp.where(t <= begin, 1e-300, value)

    def after(t, x, p, side):
        if jump:
            return jump(t, x, p, side), side
        above, below = sides(t, x, p, side)
        landed = x.at[place].set(0.0)
        new = jnp.where((above < 0) & (below > 0), 0.0, -side) if stick else -side
        if stick:
            new = jnp.where(side == 0, jnp.sign(bound(t, x, p, side)[1]), new)
        return landed, new

    event = dfx.Event(margin, optx.Newton(1e-13, 1e-13, optx.rms_norm), direction=False)
    term, solver, adjoint = dfx.ODETerm(rates), dfx.Dopri8(), _adjoint(dfx, how)

    def cost(q, rtol, atol, longest):
        start, p = motion.split(q)
        p = jnp.stack([jnp.asarray(v, float) for v in p])
        control = dfx.PIDController(rtol=rtol, atol=atol, dtmax=longest)

        def piece(carry, _):
            t, x, side = carry
            out = dfx.diffeqsolve(
                term, solver, t, motion.end, None, x, (p, side, t), stepsize_controller=control, event=event,
                max_steps=most, adjoint=adjoint, throw=False, saveat=dfx.SaveAt(t1=True),
            )  # fmt: skip
            t, x = out.ts[-1], out.ys[-1]
            moved, new = after(t, x, p, side)
            hit = t < motion.end
            return (t, jnp.where(hit, moved, x), jnp.where(hit, new, side)), None

        first = (jnp.asarray(0.0), jnp.stack([jnp.asarray(v, float) for v in start]), float(motion.side))
        (t, x, side), _ = jax.lax.scan(piece, first, length=count + 1)
        return at_end(t, x, p, side)[0]

    return _differentiated(jax, cost, how)


def bare(motion: Motion, how: str, steps: int | None = None, most: int = 16384) -> Any:
    """diffrax over the sign as it stands: (q, rtol, atol), adaptive; with `steps` equal ones tolerances say nothing."""
    import diffrax as dfx
    import jax

    jnp = jax_numpy()
    slips, at_end = _made(motion, motion.slip.values()), _made(motion, [motion.cost])
    wall = _made(motion, [motion.wall])
    term = dfx.ODETerm(lambda t, x, p: slips(t, x, p, jnp.sign(wall(t, x, p, 0.0)[0])))

    def cost(q, rtol, atol):
        start, p = motion.split(q)
        p, x = (jnp.stack([jnp.asarray(v, float) for v in values]) for values in (p, start))
        control = dfx.ConstantStepSize() if steps else dfx.PIDController(rtol=rtol, atol=atol)
        out = dfx.diffeqsolve(
            term, dfx.Tsit5(), 0.0, motion.end, motion.end / steps if steps else None, x, p,
            stepsize_controller=control, max_steps=steps + 1 if steps else most, adjoint=_adjoint(dfx, how),
            throw=False, saveat=dfx.SaveAt(t1=True),
        )  # fmt: skip
        good = out.result == dfx.RESULTS.successful
        return jnp.where(good, at_end(motion.end, out.ys[-1], p, 0.0)[0], jnp.nan)

    return _differentiated(jax, cost, how)


# ---- SciPy, and differences of anything


def stopped(system: Any, motion: Motion, **options: Any) -> Any:
    """q -> cost by SciPy's DOP853, stopped at every event; compiled right-hand side, parameters as arguments."""
    from pwsmooth.compare.efficiency.plain import plain
    from pwsmooth.compare.efficiency.restarting import restarted

    functions = plain(system, tuple(s.name for s in motion.parameters))
    cost = sp.lambdify([list(motion.start)], motion.cost)
    order = [s.name for s in system.model.parameters]

    def run(q):
        start, p = motion.split(q)
        values = dict(zip((s.name for s in motion.parameters), p))
        x = np.array([*start, *(values[name] for name in order)], float)
        return cost(restarted(functions, (0.0, motion.end), x, **options)[0][: len(start)])

    return run


def differences(run: Any, q: np.ndarray, share: float) -> np.ndarray:
    """Central, with steps of a share of each value."""
    found = np.empty(len(q))
    for k, step in enumerate(share * np.where(q == 0, 1.0, np.abs(q))):
        high, low = q.copy(), q.copy()
        high[k] += step
        low[k] -= step
        found[k] = (run(high) - run(low)) / (high[k] - low[k])
    return found
