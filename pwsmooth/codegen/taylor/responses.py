"""Jets of linear models with constant coefficients: a matrix in place of a recurrence.

Where every coefficient of the order-k recurrence is a parameter, the rows of a jet are linear in what the loop over
the orders starts from: the rates d, the functions l (a sine and its cosine) and the slopes z.

    x_i(t0 + s) = x_i + sum_j c_j R_ij(s),   c = (d, l, z) at t0,   R_ij = the rows' response to c = e_j

The responses depend on the parameters alone, and on the multipliers that stand still. They are made by the loop itself when these have changed and
kept in the program's own rows; a jet is then one small matrix product, in vectors, while the loop waits
at every order for the one before (a chain of dependent additions: four times as long at order 22).

Chain: jets.py -> the body of its program (this file) -> native.py, whose `combine` is the product.
"""

from __future__ import annotations

import re

from ..layout import SHORTEST_ROW
from .recurrences import AFFINE, CONSTANT, plain

MOST = 64  # responses: beyond, the product costs more than the recurrence
MOST_SOLVED = 3  # multipliers, each set of which has responses of its own


class Responses:
    """Writes the body of a program whose loop is linear with constant coefficients; see `find_responses`."""

    def __init__(self, program, order_k, loop, parameters, constants):
        # Places of what the coefficients are made of, and what tells which set of responses belongs to them.
        self.parameters = [f"p[{q}]" for q in parameters] + [f"mult[{j}]" for j in constants]
        self.sets = [f"on{j}" for j in range(len(program.unknowns))] + [f"mult[{j}] > 0.0" for j in constants]
        degrees = program.degrees
        moving = [i for i, x in enumerate(program.states) if degrees.of(x) not in (CONSTANT, AFFINE)]
        self.starts = [f"d{i}" for i in moving]
        self.starts += [f"l{a}" for a in sorted(order_k.carried)]
        # Slopes that something reads; the others stand in the loop as coefficients.
        read = {name for line in loop for name in re.findall(r"z\d+", line.partition(" = ")[2])}
        self.starts += [f"z{a}" for a in sorted(order_k.transient) if f"z{a}" in read]
        self.rows = [
            (row, "0.0" if node < 0 else order_k.value(node))
            for node, row in order_k.rows.items()
            if degrees.of(plain(node)) != CONSTANT and node not in program.given
        ]
        self.key = 2 + len(self.parameters)  # order, usable, parameters

    @property
    def count(self) -> int:
        """Responses of one set, a row each."""
        return len(self.rows) * len(self.starts)

    @property
    def each(self) -> int:
        """Rows of one set and its key."""
        return self.count - (-self.key // SHORTEST_ROW)

    @property
    def size(self) -> int:
        """Rows of all sets: one for each subset of the multipliers that is solved, or of their sides."""
        return 2 ** len(self.sets) * self.each

    def body(self, base: int, loop: list[str]) -> list[str]:
        """Lines that replace the loop over the orders; the responses stand from the program's own row `base` on."""
        count = len(self.starts)
        lines = []
        write = lines.append
        write(f"    key = scratch + {base} * stride")
        for j, chosen in enumerate(self.sets):
            write(f"    if {chosen}:")
            write(f"        key += {2**j * self.each} * stride")
        write(f"    table = key + {self.each - self.count} * stride")
        same = [f"rows[key + {2 + i}] == {place}" for i, place in enumerate(self.parameters)]
        write(f"    tried = {' and '.join(['rows[key] == K', *same])}")
        write("    whole = 8 * ((K + 8) // 8)")  # products are made by blocks of eight
        write("    usable = tried and rows[key + 1] == 1.0 and stride >= whole")
        for j, name in enumerate(self.starts):
            write(f"    a{j} = {name}")
        # 0 times an infinity would spread over all orders, and over those beyond the last.
        write(f"    finite = 0.0 * ({' + '.join(f'a{j}' for j in range(count))}) == 0.0")
        write("    if not (usable and finite):")
        write("        first = 0")
        write("        if tried:")
        write(f"            first = {count}")
        write(f"        for j in range(first, {count + 1}):")
        for j, name in enumerate(self.starts):
            write(f"            {name} = choose(j == {count}, a{j}, choose(j == {j}, 1.0, 0.0))")
        write("            for k in range(1, K + 1):")
        write("                inv = 1.0 / k")
        lines += ["        " + line for line in loop]
        write(f"            if j < {count}:")
        write(f"                for i in range({len(self.rows)}):")
        write(f"                    rows[table + (i * {count} + j) * stride] = 0.0")
        write("                    if stride >= whole:")
        write("                        for k in range(K + 1, whole):")
        write(f"                            rows[table + (i * {count} + j) * stride + k] = 0.0")
        write("                for k in range(1, K + 1):")
        for i, (row, _) in enumerate(self.rows):
            write(f"                    rows[table + ({i * count} + j) * stride + k] = rows[o{row} + k]")
        write("        if not tried:")
        write("            rows[key] = K")
        write("            last = 0.0")
        write(f"            for j in range({self.count}):")
        write("                last += 0.0 * rows[table + j * stride + K]")
        write("            rows[key + 1] = choose(last == 0.0, 1.0, 0.0)")
        for i, place in enumerate(self.parameters):
            write(f"            rows[key + {2 + i}] = {place}")
        write("            usable = last == 0.0 and stride >= whole")
        write("    if usable and finite:")
        for i, (row, value) in enumerate(self.rows):
            starts = ", ".join(f"a{j}" for j in range(count))
            write(f"        combine(rows, o{row}, {value}, table + {i * count} * stride, stride, K, {starts})")
        write("    return 0")
        return lines


def find_responses(program, order_k, loop, roots) -> Responses | None:
    """The Responses of a program, or None where it has a coefficient that is more than parameters."""
    if len(program.unknowns) > MOST_SOLVED or order_k.products:
        return None
    graph, degrees = program.graph, program.degrees
    coefficients: list[int] = []

    def slope_is_fixed(node: int) -> bool:
        """Whether the slope of an affine node is made of parameters; they join the coefficients."""
        op, args, data = graph.nodes[node]
        if op == "var":
            if data[0] == "x":
                coefficients.append(degrees.rates[data[1]])
            return True
        coefficients.extend(a for a in args if degrees.of(a) != AFFINE)
        return all(slope_is_fixed(a) for a in args if degrees.of(a) == AFFINE)

    for node in order_k.needed(roots):
        degree = degrees.of(node)
        if degree == CONSTANT:
            continue
        if node in program.given:
            return None
        op, args, data = graph.nodes[node]
        if op == "mul" or op == "div":
            fixed = [a for a in args if degrees.of(a) == CONSTANT]
            if not fixed or (op == "div" and args[1] not in fixed):
                return None
            coefficients += fixed
        elif op == "fun":
            if degrees.of(args[0]) != AFFINE or data not in ("sin", "cos", "exp", "sinh", "cosh"):
                return None
            slope_is_fixed(args[0])
        elif op not in ("var", "sum"):
            return None
    if any(graph.variables(a, kind) for a in coefficients for kind in ("t", "x")):
        return None
    parameters, constants = (
        sorted({q for a in coefficients for q in graph.variables(a, kind)}) for kind in ("p", "mult")
    )
    if len(constants) > (0 if program.general else MOST_SOLVED):
        return None
    made = Responses(program, order_k, loop, parameters, constants)
    return made if 0 < made.count <= MOST and made.starts else None
