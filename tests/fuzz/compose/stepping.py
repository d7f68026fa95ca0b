"""The Runge-Kutta pair DOP853 in plain Python, written out for the number of states.

The coefficients, the choice of steps and the polynomials between are those of scipy, whose arrays would take four times
as long for a few states.
Chain: **stepping** -> reference.py.
"""

from __future__ import annotations

import math
from functools import cache

from scipy.integrate._ivp import dop853_coefficients as table

RTOL, ATOL = 1e-11, 1e-13
STAGES, POWERS = table.N_STAGES, table.INTERPOLATOR_POWER


def combined(row, i):
    """Text of the sum of a row of coefficients times the slopes of the state i."""
    return " + ".join(f"{float(c)!r}*k{s}_{i}" for s, c in enumerate(row) if c)


@cache
def written(n):
    """(step, dense) for n states.

    step(f, t, h, x, k) -> (state, slopes of all stages, error); dense(f, t, h, x, y, slopes) -> function of time.
    """
    each = range(n)

    def names(letter):
        return "".join(f"{letter}{i}, " for i in each)

    def stage(s, row, c):
        at = ", ".join(f"x{i} + h*({combined(row, i)})" for i in each)
        return f"    {names(f'k{s}_')} = slopes{s} = f(t + {float(c)!r}*h, [{at}])"

    slopes = [", ".join(f"slopes{s}" for s in range(count)) for count in (STAGES + 1, table.N_STAGES_EXTENDED)]
    lines = ["def step(f, t, h, x, slopes0):", f"    {names('x')} = x", f"    {names('k0_')} = slopes0"]
    lines += [stage(s, table.A[s], table.C[s]) for s in range(1, STAGES)]
    lines += [f"    y{i} = x{i} + h*({combined(table.B, i)})" for i in each]
    lines += [
        f"    {names(f'k{STAGES}_')} = slopes{STAGES} = f(t + h, [{names('y')}])",
        "    fifth = third = 0.0",
    ]
    for i in each:
        lines.append(f"    size = {ATOL!r} + max(abs(x{i}), abs(y{i}))*{RTOL!r}")
        for name, row in (("fifth", table.E5), ("third", table.E3)):
            lines += [f"    error = ({combined(row, i)})/size", f"    {name} += error*error"]
    lines.append(f"    below = sqrt((fifth + 0.01*third)*{n})")
    lines.append(f"    return [{names('y')}], ({slopes[0]}), abs(h)*fifth/below if below else 0.0")
    lines += ["def dense(f, t, h, x, y, slopes):", f"    {names('x')} = x", f"    {names('y')} = y"]
    lines.append("    " + ", ".join(f"({names(f'k{s}_')})" for s in range(STAGES + 1)) + " = slopes")
    for s in range(STAGES + 1, table.N_STAGES_EXTENDED):
        lines.append(stage(s, table.A[s], table.C[s]))
    for i in each:
        lines.append(f"    F0_{i} = y{i} - x{i}")
        lines.append(f"    F1_{i} = h*k0_{i} - F0_{i}")
        lines.append(f"    F2_{i} = 2*F0_{i} - h*(k{STAGES}_{i} + k0_{i})")
        lines += [f"    F{r + 3}_{i} = h*({combined(row, i)})" for r, row in enumerate(table.D)]
    lines += ["    def at(s):", "        u = (s - t)/h", "        v = 1 - u"]
    values = []
    for i in each:
        text = "0"
        for power in reversed(range(POWERS)):
            text = f"{'uv'[power % 2]}*(F{power}_{i} + {text})"
        values.append(f"x{i} + {text}")
    lines += [f"        return [{', '.join(values)}]", "    return at"]
    space = {"sqrt": math.sqrt}
    exec("\n".join(lines), space)
    return space["step"], space["dense"]


class Steps:
    """Steps from a state to the time `end`, none longer than `longest`; `first` is the size of the first one."""

    def __init__(self, f, t, x, end, longest=math.inf, first=None):
        self.f, self.t, self.y, self.end, self.longest = f, t, x, end, longest
        self.step, self.dense = written(len(x))
        self.slopes = [f(t, x)]
        self.h = self.start() if first is None else first

    def start(self):
        """Size of the first step, by the second derivative."""

        def norm(values):
            return math.hypot(*(v / s for v, s in zip(values, sizes))) / math.sqrt(len(sizes))

        f, t, x, k = self.f, self.t, self.y, self.slopes[-1]
        sizes = [ATOL + abs(v) * RTOL for v in x]
        d0, d1 = norm(x), norm(k)
        h = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
        h = min(h, self.end - t)
        d2 = norm([b - a for a, b in zip(k, f(t + h, [a + h * b for a, b in zip(x, k)]))]) / h
        largest = max(d1, d2)
        longer = max(1e-6, h * 1e-3) if largest <= 1e-15 else (0.01 / largest) ** (1 / 8)
        return min(100 * h, longer, self.end - t, self.longest)

    def go(self):
        """Whether one more step is possible, which is then made: from `t_old` and `x` to `t` and `y`."""
        least, rejected = 10 * (math.nextafter(self.t, math.inf) - self.t), False
        self.h = min(max(self.h, least), self.longest)
        while self.h >= least:
            t = min(self.t + self.h, self.end)
            h = t - self.t
            y, slopes, error = self.step(self.f, self.t, h, self.y, self.slopes[-1])
            if error < 1:
                factor = min(10.0, 0.9 * error ** (-1 / 8)) if error else 10.0
                self.h = h * (min(1.0, factor) if rejected else factor)
                self.t_old, self.x, self.t, self.y, self.slopes = self.t, self.y, t, y, slopes
                return True
            self.h, rejected = h * max(0.2, 0.9 * error ** (-1 / 8)), True
        return False

    def polynomial(self):
        """The states within the last step, as a function of time."""
        return self.dense(self.f, self.t_old, self.t - self.t_old, self.x, self.y, self.slopes)
