"""Taylor jets of a family whose contacts act on each other: those that are solved for are one system of equations.

    sum_j G_ij R_j = - g_i     over all contacts that are closed, of elements and between neighbours

As sliding.py, but that the matrix of an element is none of its own: what is solved for is numbered along the elements,
and the system of these numbers is made and factored once. It is as large as what is closed, not as the family.
Chain: sliding.py -> coupled (here) -> native.py.
"""

from __future__ import annotations

from ..graph.scalar import Writer
from ..graph.slopes import derivative
from ..layout import neighbour
from .sections import Root
from .sliding import FamilyGeneral

MOST = 128  # multipliers that are solved for together


class FamilyCoupled(FamilyGeneral):
    """Writes `jet_general` of one template whose elements act on their neighbours' multipliers."""

    def _more_scratch(self, f: int | None) -> tuple[str, int]:
        return ("D0", MOST * (MOST + 2)) if f is None else (f"A{f}", 0)

    def _cells(self, f: int) -> list[tuple[int, int, int, int]]:
        """(row, column, offset of the column's element, slope) of what is not 0."""
        graph, own, found = self.graph, self.own[f], []
        for i in own:
            for j, offset in graph.places(self.residual(i), "mult"):
                if j in own:
                    variable = graph.make("var", (), ("mult", j, offset)) if offset else self.unknowns[j]
                    found.append((i, j, offset, derivative(graph, self.residual(i), variable)))
        return [cell for cell in found if cell[3] != graph.zero]

    def _factors(self) -> list[Root]:
        roots = []
        for f in self.own:
            nodes = [slope for *_, slope in self._cells(f)]
            roots.append(Root(nodes[0], f, lambda f=f: self._keep_slopes(f), tuple(nodes[1:])))
        return roots

    def _keep_slopes(self, f: int) -> list[str]:
        return [f"{self._slope(f, i, j, o)} = {self.code.value(node)}" for i, j, o, node in self._cells(f)]

    def _slope(self, f: int, i: int, j: int, offset: int) -> str:
        return self.slot(f, f"G{i}x{j}x{offset}")

    def _solved_number(self, f: int, j: int, index: str = "") -> str:
        """Text of the number of a multiplier among those that are solved for."""
        return f"int({self.slot(f, f'N{j}', index)})"

    def _factorise(self, start: Writer) -> None:
        lay = self.layout
        start.line("cc = 0")
        for f, own in self.own.items():
            start.line(f"for i{f} in range(m{f}):")
            for j in own:
                start.line(f"    if {lay.place('mask', j, f)} != 0:")
                start.line(f"        {self.slot(f, f'N{j}')} = cc + 0.0")
                start.line("        cc += 1")
        start.line(f"if cc > {MOST}:")
        start.line("    return 1")
        start.line("right = D0 + cc * cc + cc")
        start.line("for cell in range(cc * cc):")
        start.line("    rows[D0 + cell] = 0.0")
        for f, own in self.own.items():
            start.line(f"for i{f} in range(m{f}):")
            cells = self._cells(f)
            for offset in sorted({o for _, _, o, _ in cells if o}):
                for line in lay.index_of_neighbour(f, offset):
                    start.line("    " + line)
            for i in own:
                start.line(f"    if {lay.place('mask', i, f)} != 0:")
                start.line(f"        here = D0 + {self._solved_number(f, i)} * cc")
                for row, j, offset, _ in cells:
                    if row != i:
                        continue
                    index = neighbour(f, offset) if offset else f"i{f}"
                    # Of a patch, what stands beside it is open: contacts that are closed are in it together.
                    start.line(f"        if {index} < m{f}:")
                    start.line(f"            if {lay.place('mask', j, f, offset)} != 0:")
                    place = f"rows[here + {self._solved_number(f, j, index)}]"
                    start.line(f"                {place} += {self._slope(f, i, j, offset)}")
        start.line("if lu_factor(rows, D0, cc) != 0:")
        start.line("    return 1")
        self.source.helpers |= {"lu_factor", "lu_solve"}

    def _solve_whole(self, loop: Writer, final: bool) -> None:
        loop.line("lu_solve(rows, D0, cc)")
        for f, own in self.own.items():
            loop.line(f"for i{f} in range(m{f}):")
            for j in own:
                place = self.row_place(self.code.rows[self.unknowns[j]], f) if final else "0"
                loop.line(f"    rows[{place} + k] = 0.0")
                loop.line(f"    if {self.layout.place('mask', j, f)} != 0:")
                loop.line(f"        rows[{place} + k] = rows[right + {self._solved_number(f, j)}]")

    def _element_lines(self, f: int) -> list[str]:
        lines = []
        for j in self.own[f]:
            g = self.code.coefficient(self.residual(j)) or "0.0"
            lines += [f"if on{j}:", f"    rows[right + {self._solved_number(f, j)}] = -({g})"]
        return lines
