"""Taylor jets of a model with families while multipliers are solved: the general program of jets.py, in two passes.

Order k of every residual is found with all lambda_k = 0; it is linear in them, with the slopes G of order 0, so that

    [A_i  C_i] [lambda_i]     [g_i]
    [B_i  D  ] [lambda  ] = - [g  ]      A_i: multipliers of element i,  D: those of the whole

gives them: lambda from D - sum B_i Y_i, Y_i = A_i^-1 C_i, then lambda_i = -A_i^-1 g_i - Y_i lambda, in O(n). The second
pass makes order k of everything with them. (Where elements act on their neighbours' contacts: coupled.py.)
Returns 1 where A_i or the system of the whole is singular.

Chain: jets.py -> sliding (here) -> native.py.
"""

from __future__ import annotations

from ..graph.scalar import Writer
from ..graph.slopes import derivative
from .jets import FamilyJet
from .orders import FamilyOrderK
from .sections import Root, Sections


class FamilyGeneral(FamilyJet):
    """Writes `jet_general` of one template."""

    name, arguments = "jet_general", "t, x, mult, p, mask, K, stride, rows, scratch"

    def _solved(self) -> list[int]:
        return [j for j, m in enumerate(self.model.multipliers) if m.may_be_solved]

    def _residuals(self) -> list[int]:
        graph = self.graph
        self.unknowns = [graph.var("mult", j) for j in range(len(self.model.multipliers))]
        lay = self.layout
        solved = self._solved()
        self.whole = [j for j in solved if lay.multipliers[j] is None]
        self.own = {f: [j for j in solved if lay.multipliers[j] == f] for f in range(len(lay.periodic))}
        self.own = {f: js for f, js in self.own.items() if js}
        return [graph.expression(self.model.multipliers[j].residual) for j in solved]

    def residual(self, j: int) -> int:
        return self.residuals[self._solved().index(j)]

    def slope(self, i: int, j: int) -> int:
        return derivative(self.graph, self.residual(i), self.unknowns[j])

    def _multiplier_rows(self) -> list[int]:
        return self.unknowns

    def _frozen(self, i: int, rate: str) -> str:
        """While a switch slides on a state, that state's rate is 0 exactly, not to rounding."""
        for j in self._solved():
            here = self.h[j] == self.states[i] or (self.layout.patch and self._fixes(j, i))
            if (
                here
                and self.model.multipliers[j].kind == "switch"
                and self.layout.multipliers[j] == self.layout.states[i]
            ):
                return f"choose(on{j}, 0.0, {rate})"
        return rate

    def _fixes(self, j: int, i: int) -> bool:
        """Whether surface j is state i up to a factor and a constant. What rests must do so exactly: nothing is spent
        on an element of a patch whose motion is known for ever."""
        graph = self.graph
        variables = [
            graph.nodes[a] for a in graph.reach([self.h[j]], through=True) if graph.nodes[a].op == "var"
        ]
        constant = all(v.data == ("x", i) or v.data[0] == "p" for v in variables)
        return constant and graph.nodes[derivative(graph, self.h[j], self.states[i])].op == "num"

    # ---- order 0: slopes

    def _open_general(self, start: Writer) -> None:
        for j in self.whole:
            start.line(f"on{j} = {self.layout.place('mask', j, None)} != 0")
        for f, own in self.own.items():
            for j in own:
                start.line(f"any{j} = False")
            start.line(f"for i{f} in range(m{f}):")
            for j in own:
                start.line(f"    if {self.layout.place('mask', j, f)} != 0:")
                start.line(f"        any{j} = True")

    def block(self, f: int) -> str:
        """Text of the place of an element's matrix: entries, then lu_factor's pivots and lu_solve's right-hand side."""
        size = len(self.own[f])
        return f"A{f} + {size * size + 2 * size} * i{f}"

    def _more_scratch(self, f: int | None) -> tuple[str, int]:
        size = len(self.whole if f is None else self.own.get(f, ()))
        return ("D0" if f is None else f"A{f}"), size * size + 2 * size if f is None or size > 1 else 0

    def _factors(self) -> list[Root]:
        """Slopes of the residuals, and A_i with Y_i as soon as they are there."""
        roots = []
        for f, own in self.own.items():
            names = [(i, j) for i in own for j in (*own, *self.whole)] + [
                (i, j) for i in self.whole for j in own
            ]
            nodes = [self.slope(i, j) for i, j in names]
            roots.append(Root(nodes[0], f, lambda f=f: self._factor_lines(f), tuple(nodes[1:])))
        for i in self.whole:
            roots += [Root(self.slope(i, j), None, list) for j in self.whole]
        return roots

    def _value(self, i: int, j: int) -> str:
        return self.code.value(self.slope(i, j))

    def _factor_lines(self, f: int) -> list[str]:
        own, size = self.own[f], len(self.own[f])
        lines = []
        zero = self.graph.zero
        if size == 1:
            j = own[0]
            lines += [
                f"if on{j} and not abs({self._value(j, j)}) > 0.0:",
                "    return 1",
                f"{self.slot(f, 'A')} = choose(on{j}, 1.0 / {self._value(j, j)}, 0.0)",
            ]
        else:
            lines.append(f"b{f} = {self.block(f)}")
            for r, i in enumerate(own):
                for c, j in enumerate(own):
                    alone = "1.0" if i == j else "0.0"
                    at = f"rows[b{f} + {r * size + c}]"
                    lines.append(f"{at} = choose(on{i} and on{j}, {self._value(i, j)}, {alone})")
            lines += [f"if lu_factor(rows, b{f}, {size}) != 0:", "    return 1"]
            self.source.helpers |= {"lu_factor", "lu_solve"}
        for h in self.whole:
            for i in own:
                column = (
                    "0.0" if self.slope(i, h) == zero else f"choose(on{i} and on{h}, {self._value(i, h)}, 0.0)"
                )
                lines.append(f"y{i} = {column}")
                row = (
                    "0.0" if self.slope(h, i) == zero else f"choose(on{i} and on{h}, {self._value(h, i)}, 0.0)"
                )
                lines.append(f"{self.slot(f, f'B{h}x{i}')} = {row}")
            lines += self._apply(f, "y")
            lines += [f"{self.slot(f, f'Y{i}x{h}')} = y{i}" for i in own]
        return lines

    def _apply(self, f: int, name: str) -> list[str]:
        """Lines that replace the numbers y_i by A^-1 y."""
        own, size = self.own[f], len(self.own[f])
        if size == 1:
            return [f"{name}{own[0]} = {self.slot(f, 'A')} * {name}{own[0]}"]
        right = size * size + size
        return [
            f"b{f} = {self.block(f)}",
            *(f"rows[b{f} + {right + r}] = {name}{i}" for r, i in enumerate(own)),
            f"lu_solve(rows, b{f}, {size})",
            *(f"{name}{i} = rows[b{f} + {right + r}]" for r, i in enumerate(own)),
        ]

    def _factorise(self, start: Writer) -> None:
        """D - sum B_i Y_i, factorised."""
        size = len(self.whole)
        if not size:
            return
        for r, i in enumerate(self.whole):
            for c, j in enumerate(self.whole):
                alone = "1.0" if i == j else "0.0"
                start.line(f"rows[D0 + {r * size + c}] = choose(on{i} and on{j}, {self._value(i, j)}, {alone})")
        for f, own in self.own.items():
            start.line(f"for i{f} in range(m{f}):")
            for r, i in enumerate(self.whole):
                for c, j in enumerate(self.whole):
                    for e in own:
                        product = f"{self.slot(f, f'B{i}x{e}')} * {self.slot(f, f'Y{e}x{j}')}"
                        start.line(f"    rows[D0 + {r * size + c}] -= {product}")
        start.line(f"if lu_factor(rows, D0, {size}) != 0:")
        start.line("    return 1")
        self.source.helpers |= {"lu_factor", "lu_solve"}

    # ---- order k: multipliers

    def _solve(self, code: FamilyOrderK, loop: Writer, final: bool) -> None:
        """The first pass: residuals with lambda_k = 0, then the multipliers of this order."""
        scopes = [set(scope) for scope in code.scopes]
        code.solving = True
        roots = []
        for f, own in self.own.items():
            first, *others = [self.residual(j) for j in own]
            roots.append(Root(first, f, lambda f=f: self._element_lines(f), tuple(others)))
        for h in self.whole:
            roots.append(Root(self.residual(h), None, list))
        preamble = (lambda lines, f: self._preamble(lines, f, False)) if final else None
        for h in self.whole if self.own else ():
            loop.line(f"R{h} = 0.0")
        Sections(code, preamble).write(roots)
        self._solve_whole(loop, final)
        code.solving, code.scopes = False, scopes
        for h in self.whole:
            loop.line(f"k{self.unknowns[h]} = q{h}")
            code.scopes[0].add(self.unknowns[h])

    def _element_lines(self, f: int) -> list[str]:
        """u = A^-1 g of an element; without multipliers of the whole that is all."""
        own = self.own[f]
        lines = [f"y{j} = choose(on{j}, {self.code.coefficient(self.residual(j)) or '0.0'}, 0.0)" for j in own]
        lines += self._apply(f, "y")
        if not self.whole:
            return lines + [
                f"rows[{self.code.row(self.unknowns[j])} + k] = choose(on{j}, -y{j}, 0.0)" for j in own
            ]
        for j in own:
            lines.append(f"{self.slot(f, f'u{j}')} = y{j}")
            lines += [f"R{h} += {self.slot(f, f'B{h}x{j}')} * y{j}" for h in self.whole]
        return lines

    def _solve_whole(self, loop: Writer, final: bool) -> None:
        size = len(self.whole)
        if not size:
            return
        right = size * size + size
        for r, h in enumerate(self.whole):
            g = self.code.coefficient(self.residual(h)) or "0.0"
            rest = f"R{h} - ({g})" if self.own else f"-({g})"
            loop.line(f"rows[D0 + {right + r}] = choose(on{h}, {rest}, 0.0)")
        loop.line(f"lu_solve(rows, D0, {size})")
        for r, h in enumerate(self.whole):
            loop.line(f"q{h} = rows[D0 + {right + r}]")
        for f, own in self.own.items():
            loop.line(f"for i{f} in range(m{f}):")
            for j in own:
                back = " - ".join(
                    [f"-{self.slot(f, f'u{j}')}", *(f"{self.slot(f, f'Y{j}x{h}')} * q{h}" for h in self.whole)]
                )
                row = self.code.rows[self.unknowns[j]]
                place = self.row_place(row, f) if final else "0"
                mask = self.layout.place("mask", j, f)
                loop.line(f"    rows[{place} + k] = choose({mask} != 0, {back}, 0.0)")
