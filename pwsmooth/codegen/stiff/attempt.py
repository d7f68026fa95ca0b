"""One attempt at a Radau step, written out for one small model and one order.

    radau(t, h, ratio, eta, kappa, rtol, again, p, x, f, weight, newton_weight, surf, poly, Z, J, core) -> int

The arithmetic of kernels.stiff.radau.attempt (which serves every model) in one piece: predicted stages, Jacobian,
elimination, Newton iterations, error estimate, gate. Between them nothing goes through memory, and constants are
immediate: several times less work than loops over n and s. Returns what kernels.stiff.radau.attempt returns, and
overwrites the same arrays and numbers of the Core.
"""

from __future__ import annotations

from ...kernels.stiff import tables as T
from ...kernels.stiff.rules import DOUBLINGS, LONGEST_PREDICTION, MAX_NEWTON, REACH, THETA
from ...kernels.stiff.state import Core
from .linear import Elimination, elimination_lines, real_substitution_lines, substitution_lines
from .text import StiffCode

# Beyond this many states the vectors no longer fit into registers.
MOST_STATES = 6
ARGUMENTS = (
    "t: D, h: D, ratio: D, eta: D, kappa: D, rtol: D, again: I, p: P, x: P, f: P, weight: P, nweight: P, "
    "surf: P, poly: P, Z: P, J: P, core: P"
)


def possible(code: StiffCode, rates, surfaces, elimination: Elimination, n: int) -> bool:
    """Whether the model allows it: few states, and no branches that differ from lane to lane."""
    return n <= MOST_STATES and elimination.worthwhile and code.vectors([*rates, *surfaces])


class Attempt:
    """Text of one order, of the `parts` that functions.py gives every text of a model."""

    def __init__(self, parts, m, n):
        code = self.code = parts.code
        self.m, self.stages, self.n = m, 3 + 2 * m, n
        self.rates, self.jacobian, self.pattern = parts.rates, parts.jacobian, sorted(parts.pattern)
        self.surfaces, self.surface_state, self.slopes = parts.surfaces, parts.surface_state, parts.slopes
        self.elimination = parts.elimination
        self.lines, self._add = code.writer.lines, code.write

    def write(self) -> None:
        """Append the function."""
        self.code.function("radau", ARGUMENTS, "I")
        self._setting()
        self._prediction()
        self._matrix()
        self._newton()
        self._error()
        self._gate()
        self._acceptance()

    def _each(self, *lines: str, indent: int = 1) -> None:
        """The lines for every state, with @ replaced by its index."""
        for i in range(self.n):
            self._add(*(line.replace("@", str(i)) for line in lines), indent=indent)

    def _report(self, indent: int = 1, **values: str) -> None:
        """Write fields of the Core."""
        self._add(*(f"core[{Core.members[name].at}] = {text}" for name, text in values.items()), indent=indent)

    def _sum(self, table, source: str, lanes) -> str:
        """sum_l table[l] * (lane lanes[l] of source), as two sums that do not wait for each other."""
        terms = [
            f"{_constant(table[l])} * spread({source}, {lane})" for l, lane in zip(range(self.stages), lanes)
        ]
        half = (len(terms) + 1) // 2
        return f"({' + '.join(terms[:half])}) + ({' + '.join(terms[half:])})"

    def _setting(self) -> None:
        """Everything of parameters and of time alone."""
        code, graph = self.code, self.code.graph
        self._add("inverse = 1.0 / h", f"times = {_constant(T.NODES[self.m])} * h + t")
        self._each("x@ = x[@]")
        code.parameter_operations([*self.rates, *self.jacobian, *self.surfaces])
        self.of_time = {a for a in graph.reach([*self.rates, *self.surfaces]) if graph.grade(a) == 1}
        if self.of_time:
            code.vector_operations(sorted(self.of_time), {}, "times", "")

    def _prediction(self) -> None:
        """The last collocation polynomial beyond its end, Z and W = V^-1 Z; zero where it would reach too far."""
        s, m = self.stages, self.m
        self._add(f"if ratio < {LONGEST_PREDICTION[m]!r}:", f"    tau = {_constant(T.NODES[m])} * ratio")
        for i in range(self.n):
            text = f"tau * poly[{8 * i + s - 1}]"
            for j in range(s - 2, -1, -1):
                text = f"tau * (poly[{8 * i + j}] + {text})"
            self._add(f"Z{i} = {text}", indent=2)
            self._add(f"W{i} = {self._sum(T.TO_W[m], f'Z{i}', range(s))}", indent=2)
        self._add("else:")
        self._each("Z@ = splat8(0.0)", "W@ = splat8(0.0)", indent=2)

    def _matrix(self) -> None:
        """J at the predicted middle stage, and the elimination of (mu/h) I - J."""
        code, m, middle = self.code, self.m, 1 + self.m
        self._add(f"middle = t + {float(T.NODES[m, middle])!r} * h")
        self._each(f"y@ = x@ + lane(Z@, {middle})")
        graph = code.graph
        constants = {a for a in graph.reach(self.jacobian) if graph.grade(a) == 0}
        code.prefix = "j_"
        code.point(self.jacobian, [f"j{i}_{j}" for i, j in self.pattern], time="middle", states="y%d",
                known=constants)  # fmt: skip
        code.prefix = "n"
        self._add(*(f"J[{k}] = j{i}_{j}" for k, (i, j) in enumerate(self.pattern)))
        self._add(f"mr = {_constant(T.MU[m, :4])} * inverse", f"mi = {_constant(T.MU[m, 4:])} * inverse")
        lines, self.entries = elimination_lines(self.n, set(self.pattern), self.elimination)
        self.lines += lines

    def _newton(self) -> None:
        m, n, code = self.m, self.n, self.code
        self._add("before = 0.0", "theta = 0.0", "iterations = 0", "failed = 1",
                  f"for it in range({MAX_NEWTON}):")  # fmt: skip
        self._add("iterations = it + 1", indent=2)
        self._each("X@ = Z@ + x@", indent=2)
        code.vector_operations(self.rates, self.of_time, "times", "X%d", indent=2)
        for i, a in enumerate(self.rates):
            self._add(f"F{i} = {code.vector(a)}", f"b{i} = {self._sum(T.TO_W[m], f'F{i}', range(8))}", indent=2)
        self._each("wr = low4(W@)", "wi = high4(W@)", "r@ = low4(b@) - (mr * wr - mi * wi)",
                   "q@ = high4(b@) - (mr * wi + mi * wr)", indent=2)  # fmt: skip
        self.lines += substitution_lines(self.elimination, self.entries, " " * 8)
        for i in range(n):
            self._add(f"c{i} = join8(r{i}, q{i})", f"W{i} = W{i} + c{i}",
                      f"s{i} = {self._sum(T.TO_Z[m], f'c{i}', T.WLANE[m])}", f"Z{i} = Z{i} + s{i}",
                      indent=2)  # fmt: skip
        norm = "vabs(s0) * nweight[0]"
        for i in range(1, n):
            norm = f"vmax({norm}, vabs(s{i}) * nweight[{i}])"
        self._add(f"norm = largest8({norm})", indent=2)
        self._add(
            "if not norm < 1e300:",
            "    theta = 2.0",
            "    break",
            "if it == 0:",
            "    if eta * norm <= kappa:",
            "        failed = 0",
            "        break",
            "else:",
            "    theta = norm / before",
            # theta/(1 - theta) norm <= kappa, without a division that the decision would wait for.
            "    if norm * norm <= kappa * (before - norm):",
            "        failed = 0",
            "        break",
            "    if not theta < 0.99:",
            # Increments at rounding level no longer shrink: that is as converged as it gets.
            "        if norm < 0.1 * kappa:",
            "            failed = 0",
            "        break",
            "    left = theta",
            *["    left = left * left"] * DOUBLINGS,
            "    if left * norm * norm > kappa * (before - norm):",
            "        break",
            "before = norm",
            indent=2,
        )
        self._add("if iterations > 1 and theta < 0.99:", "    eta = theta / (1.0 - theta)")
        self._report(iterations="iterations", eta="eta", theta="theta", again="0.0")
        self._add("if failed == 1:", "    return 1")

    def _error(self) -> None:
        """The embedded estimate and its size; where asked for, filtered once more."""
        code, graph = self.code, self.code.graph
        self._each(f"e@ = total8({_constant(T.ERROR[self.m])} * Z@) * inverse", "g@ = f[@] + e@")
        self.lines += real_substitution_lines(self.elimination, self.entries, "    ")
        self._size("    ")
        self._add("if not size < 1.0:", "    if again == 1:")
        self._each("y@ = x@ + g@", indent=3)
        code.prefix = "m_"
        constants = {a for a in graph.reach(self.rates) if graph.grade(a) == 0}
        targets = [f"g{i}" for i in range(self.n)]
        code.point(self.rates, targets, states="y%d", indent=3, known=constants)
        code.prefix = "n"
        self._each("g@ = g@ + e@", indent=3)
        self.lines += real_substitution_lines(self.elimination, self.entries, " " * 12)
        self._size(" " * 12)
        self._report(again="1.0", indent=3)
        self._report(error="size")
        self._add("if not size < 1.0:", "    return 2")

    def _size(self, indent: str) -> None:
        """Largest error in units of its tolerance, rule R1 included; nan if any is."""
        lines, first = ["size = 0.0"], 3 * len(self.surfaces)
        sizes = [f"abs(g{i}) * weight[{i}]" for i in range(self.n)]
        for j, state in enumerate(self.surface_state):
            layer = f"(rtol * (surf[{3 * j + 2}] + abs(surf[{3 * j}])))"
            along = " + ".join(f"surf[{first + k}] * g{i}" for k, i in enumerate(self.slopes[j])) or "0.0"
            first += len(self.slopes[j])
            sizes.append(f"abs({f'g{state}' if state >= 0 else along}) / {layer}")
        for text in sizes:
            lines += [f"part = {text}", "if not part <= size:", "    size = part"]
        self.lines += [indent + line for line in lines]

    def _gate(self) -> None:
        """Rule R3 at every stage."""
        code = self.code
        self._add("gate = 0.0")
        self._each("X@ = Z@ + x@")
        code.prefix = "h_"
        for j, (root, state) in enumerate(zip(self.surfaces, self.surface_state, strict=True)):
            if state < 0:
                # Nodes of the parameters and of time alone were computed for all.
                code.prefix = "n"
                times = [a for a in code.graph.reach([root]) if code.graph.grade(a) == 1]
                code.prefix = f"h{j}_"
                self._add(*(f"h{j}_{a} = n{a}" for a in times))
                code.vector_operations([root], self.of_time, "times", "X%d")
            value = code.vector(root) if state < 0 else f"X{state}"
            self._add(
                f"distance = surf[{3 * j}]",
                "side = 1.0 if distance > 0.0 else -1.0",
                # Lanes without a stage stand at the start of the step.
                f"far = largest8((distance - {value}) * side)",
                f"allowed = {THETA!r} * (abs(distance) + {REACH!r} * surf[{3 * j + 2}])",
                "if far > allowed:",
                "    part = min(0.7, max(0.2, 0.9 * allowed / far))",
                "    if gate == 0.0 or part < gate:",
                "        gate = part",
            )
        code.prefix = "n"
        self._report(gate="gate")
        self._add("if gate > 0.0:", "    return 3")

    def _acceptance(self) -> None:
        """The end of the step, its polynomial and the slope of that there, which serves as the next f."""
        m, s = self.m, self.stages
        for i in range(self.n):
            self._add(
                f"b{i} = {self._sum(T.PREDICT[m], f'Z{i}', range(s))}",
                f"store8(poly, {8 * i}, b{i})",
                f"f[{i}] = lane(b{i}, 0) * inverse",
                f"x[{i}] = x{i} + lane(Z{i}, {s - 1})",
                f"store8(Z, {8 * i}, Z{i})",
            )
        self._add("return 0")


def _constant(values) -> str:
    name = "V8" if len(values) == 8 else "H4"
    return f"{name}({', '.join(repr(float(v)) for v in values)})"
