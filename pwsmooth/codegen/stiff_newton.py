"""One Newton iteration of a Radau step, written out for one small model: rates, change of basis, elimination,
norm.

    newton8(m, t8, c, x, p, mu, lu, Z, W, F, R, weight) -> norm of the increment, in units of the tolerance

The same arithmetic as kernels.stiff_radau.newton in one piece: the vectors of 8 lanes stay in registers,
where the general iteration, which does not know n, moves each through memory several times.
"""

from __future__ import annotations

from pwsmooth.codegen.stiff_linear import Elimination, solve_lines
from pwsmooth.codegen.stiff_text import Writer

# Beyond this many states the vectors no longer fit into registers.
MOST_STATES = 6


def write_newton(
    writer: Writer, rates: list[int], hoisted: dict[int, int], elimination: Elimination, n: int
) -> None:
    """Append newton8 to the text, if the model allows it."""
    if n > MOST_STATES or not elimination.worthwhile or not writer.vectors(rates, hoisted):
        return
    arguments = "m, t, c, x, p, mu, lu, Z, W, F, R, weight"
    writer.function("newton8", arguments, "_i, " + ", ".join(["_d"] * 11), result="_f")
    states = range(n)
    lines = writer.lines
    for i in states:
        lines += [f"    Z{i} = load8(Z, {8 * i})", f"    X{i} = Z{i} + x[{i}]"]
    writer.vector_operations(rates, hoisted, "X%d")
    for i, a in enumerate(rates):
        lines.append(f"    store8(F, {8 * i}, {writer.vector(a)})")
    lines.append("    stages = 3 + 2 * m")
    lines += [f"    a{i} = splat8(0.0)" for i in states]
    lines += ["    for l in range(stages):", "        row = load8(TO_W, 64 * m + 8 * l)"]
    lines += [f"        a{i} = a{i} + row * F[{8 * i} + l]" for i in states]
    lines.append("    mr, mi = load4(mu, 0), load4(mu, 4)")
    for i in states:
        lines += [
            f"    W{i} = load8(W, {8 * i})",
            f"    wr{i}, wi{i} = low4(W{i}), high4(W{i})",
            f"    r{i} = low4(a{i}) - (mr * wr{i} - mi * wi{i})",
            f"    q{i} = high4(a{i}) - (mr * wi{i} + mi * wr{i})",
        ]
    # Loads and stores of the right-hand side are what solve does besides; here it is in registers.
    lines += solve_lines(n, elimination)[n : -2 * n]
    for i in states:
        lines += [
            f"    d{i} = join8(r{i}, q{i})",
            f"    store8(R, {8 * i}, d{i})",
            f"    store8(W, {8 * i}, W{i} + d{i})",
        ]
    lines += [f"    s{i} = splat8(0.0)" for i in states]
    lines += ["    for l in range(stages):", "        row, e = load8(TO_Z, 64 * m + 8 * l), WLANE[m, l]"]
    lines += [f"        s{i} = s{i} + row * R[{8 * i} + e]" for i in states]
    lines.append("    top = vabs(s0) * weight[0]")
    lines += [f"    store8(Z, {8 * i}, Z{i} + s{i})" for i in states]
    lines += [f"    top = vmax(top, vabs(s{i}) * weight[{i}])" for i in states[1:]]
    lines.append("    return largest8(top)")
