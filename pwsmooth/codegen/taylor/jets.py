"""Taylor jets of a model: x(t + s) = sum x_k s^k, orders 0..K in one call, K chosen at run time.

    jet_slip(t, x, mult, p, K, stride, rows, scratch) -> 0           every multiplier constant
    jet_general(t, x, mult, p, mask, K, stride, rows, scratch) -> 0  masked multipliers solve g = 0 order by order

rows[r*stride + k] holds order k of row r: the states first, in the general program the multipliers next, then
what products need; `surface_rows` names the rows of the surfaces. From rows[scratch] on stands what the program keeps
for itself, behind the rows of every program: what reads a row in blocks of eight wants zeros behind its orders.

Sliding: at order k everything is evaluated with lambda_k = 0, then G lambda_k = -g_k is solved (G = dg/dlambda
at order 0, factorised once) and S lambda_k added to every node, S = d node/d lambda at order 0: exact, because
lambda_k enters order k of any smooth expression linearly, with the slope at order 0.

Returns 1 where G is singular, 2 (slip) where a selection meets a multiplier that is neither 1 nor -1.

Chain: Graph (dag.py) -> recurrences.py -> text (this file) -> cache.py -> kernels.
"""

from __future__ import annotations

from typing import Any

from ...definition.model import Model
from ..fields import Source, surfaces
from ..graph.dag import Graph
from ..graph.scalar import Writer
from ..graph.slopes import derivative
from ..jacobian import flow_entries, linearised
from ..layout import SHORTEST_ROW
from ..machine.sums import LANES
from .recurrences import AFFINE, CONSTANT, Degrees, NoRecurrence, OrderK, OrderZero, bits, label, plain, rewrite
from .responses import Responses, find_responses
from .simplify import simplify


class JetProgram:
    """Writes one program; its text ends with the layout, NROWS and SURFACE_ROWS (-1 where there is none)."""

    def __init__(
        self,
        model: Model,
        general: bool,
        parameters: int | None = None,
        given: bool = False,
        lanes: int = 0,
    ):
        """With `parameters`, the number of those by which is differentiated, the Jacobians have rows as well.

        `given`: the rows of the states and, in the general program, of the multipliers stand there already. Then so
        many `lanes` deviations can have rows behind those: of the states, and of the multipliers that belong to them,
        where the parameters deviate by what stands behind them.
        """
        self.model, self.general, self.given, self.lanes = model, general, [], lanes
        self.graph = graph = Graph(model, by_element=parameters is None and not given)
        n, m = len(model.states), len(model.multipliers)
        x, lam = ([graph.var(name, i) for i in range(count)] for name, count in (("x", n), ("mult", m)))
        self.states, self.unknowns = x, lam if general else []
        rates = [graph.expression(e) for e in model.rhs]
        residuals = [graph.expression(mult.condition) for mult in model.multipliers] if general else []
        h = surfaces(graph)
        nodes = rewrite(graph, rates + h + residuals)
        rates, h, residuals = nodes[:n], nodes[n : n + len(h)], nodes[n + len(h) :]
        # While switch j slides on a state, that state's rate is 0 exactly, not to rounding; so is that of its speed
        # where it slides to second order, and of the speed of a closed contact's gap.
        self.frozen: dict[int, list[int]] = {}
        entries = []
        if parameters is not None:
            entries = flow_entries(graph, rates, residuals, m if general else 0, parameters)
        moving = rates
        if given:
            self.given, self.states, self.unknowns = [*x, *self.unknowns], [], []
            rates, residuals = [], []
        if lanes:
            self.states, self.unknowns = (
                [graph.var(name, count + i) for i in range(count)]
                for name, count in (("x", n), ("mult", m if general else 0))
            )
            q = [graph.var("p", len(model.parameters) + i) for i in range(parameters)]
            rates, residuals = linearised(graph, entries, self.states, self.unknowns, q)
            moving, entries = moving + rates, []
        known = {"known": (n, m)} if given else {}
        nodes = [*moving, *h, *residuals, *(node for *_, node in entries)]
        nodes = simplify(graph, nodes, Degrees(graph, moving, general, **known))
        moving, nodes = nodes[: len(moving)], nodes[len(moving) :]
        self.h, nodes = nodes[: len(h)], nodes[len(h) :]
        self.rates = moving[len(moving) - len(rates) :]
        self.residuals, slopes = nodes[: len(residuals)], nodes[len(residuals) :]
        self.entries = [(*place, node) for (*place, _), node in zip(entries, slopes, strict=True)]
        holders = (*model.multipliers, *model.events)
        self.has_surface = [s.surface is not None and not given for s in holders]
        self.degrees = Degrees(graph, moving, general, **known)
        self.source = Source()
        self.responses: Responses | None = None
        for j, mult in enumerate(model.multipliers if general else ()):
            if mult.kind != "algebraic" and self.h[j] in x:
                i = x.index(self.h[j])
                if mult.kind in ("switch", "component") and mult.second is None:
                    self.frozen.setdefault(i, []).append(j)
                elif moving[i] in x:
                    self.frozen.setdefault(x.index(moving[i]), []).append(j)

    def solved(self, j: int) -> str:
        """Whether selections by multiplier j take their affine form: it is solved for, or held between its bounds."""
        return f"between{j}"

    def write(self) -> str:
        graph, degrees = self.graph, self.degrees
        known = [*self.given, *self.states, *self.unknowns]
        roots = [
            *self.rates,
            *(h for h, has in zip(self.h, self.has_surface, strict=True) if has),
            *self.residuals,
            *(node for *_, node in self.entries),
        ]
        loop = Writer(2)
        order_k = OrderK(graph, loop, degrees, self.solved)
        reached = {*graph.reach(roots), *order_k.needed(roots)}
        self.read = [node for node in self.given if node in reached and degrees.of(node) != CONSTANT]
        for node in known:
            order_k.row(node)
        surface_rows = []
        for node, has in zip(self.h, self.has_surface, strict=True):
            if has:
                order_k.row(node)
            surface_rows.append(order_k.rows[node] if has else -1)
        for *_, node in self.entries:
            order_k.row(node)
        corrections = self._order(order_k, loop, roots)
        unrolled = bool(order_k.products)
        if unrolled:
            for _ in range(LANES - 1):
                loop.line("if k == K:")
                loop.line("    return 0")
                loop.line("k += 1")
                loop.line("inv = 1.0 / k")
                order_k.next_place()
                self._order(order_k, loop, roots)

        start = Writer(1)
        order_0 = OrderZero(graph, start, degrees, self.solved, order_k.reciprocals)
        # States first: their rows are needed even where only a branch that is not taken reads them.
        everywhere = [*known, *roots]
        self._open(start, order_0, everywhere)
        # Before them the constant rates, which are the slopes of affine states.
        order_0.emit([r for x, r in zip(self.states, self.rates, strict=True) if degrees.of(x) == AFFINE])
        order_0.emit(everywhere)
        # Rows and carried values that no root needs at order 0 (slopes of affine states).
        order_0.emit([a for a in order_k.rows if a >= 0 and a not in self.inside])
        scratch = 4 * len(order_k.products)
        if self.unknowns:
            scratch = self._factor(order_0, start, corrections, scratch)
        if self.given and self.unknowns:
            self._correct(order_k, start, "v")
        self._open_rows(order_k, start)

        body = Writer(1)
        body.lines = self._declarations(start, loop) + start.lines
        self.responses = find_responses(self, order_k, loop.lines, roots)
        own = -(-scratch // SHORTEST_ROW)
        if self.responses:
            body.lines += self.responses.body(own, loop.lines)
            own += self.responses.size
        else:
            # Without products all orders are alike; with products they come in unrolled blocks of four.
            body.line(
                f"for q in range((K + {LANES - 1}) // {LANES}):" if unrolled else "for k in range(1, K + 1):"
            )
            body.indent = 2
            if unrolled:
                body.line(f"k = {LANES} * q + 1")
                for line in order_k.block_sums():
                    body.line(line)
            body.line("inv = 1.0 / k")
            body.indent = 1
            body.lines += loop.lines
            body.line("return 0")
        self.source.helpers |= order_0.helpers | order_k.helpers
        name = "jet_general" if self.general else "jet_slip"
        mask = "mask, " if self.general else ""
        self.source.function(name, f"t, x, mult, p, {mask}K, stride, rows, scratch", body, returns="I")
        rows = {"NROWS": len(order_k.rows), "OWN_ROWS": own, "SURFACE_ROWS": tuple(surface_rows)}
        self.source.constants = {**rows, "FLAT_ROWS": order_k.flat_rows(), "FUSES": True}
        self.source.constants["BY_RESPONSES"] = bool(self.responses)
        if self.given:
            self.source.constants["READ_ROWS"] = tuple(order_k.rows[node] for node in self.read)
        if self.lanes:
            self.source.constants["LANES"] = self.lanes
        self.source.constants["ENTRIES"] = tuple(
            (*place, order_k.rows[node], int(degrees.of(node) == CONSTANT)) for *place, node in self.entries
        )
        return self.source.text()

    # ---- before the loop ----

    def _open(self, start: Writer, order_0: OrderZero, roots) -> None:
        reached = order_0.needed(roots)
        everything = set(self.graph.reach(roots))
        self.inside = everything - reached  # nodes that only a branch needs
        if self.general:
            for j in range(len(self.model.multipliers)):
                start.line(f"on{j} = mask[{j}] != 0")
                start.line(f"between{j} = on{j} or not abs(mult[{j}]) == 1.0")
            return
        for j in sorted({self.graph.nodes[a].data for a in everything if self.graph.nodes[a].op == "sel"}):
            start.line(f"if mult[{j}] != 1.0 and mult[{j}] != -1.0:")
            start.line("    return 2")

    def _declarations(self, start: Writer, loop: Writer) -> list[str]:
        """First values of the locals that only a branch sets: some are stored or corrected outside it."""
        names = {}
        for lines, depth in ((start.lines, 4), (loop.lines, 8)):
            for line in lines:
                text = line.strip()
                name = text.split(" = ")[0]
                deep = len(line) - len(text) > depth
                if deep and " = " in text and name.isalnum() and name[0] in "vsrkS":
                    number = name[1:]
                    node = self.graph.nodes[int(number)].op if name[0] == "v" and number.isdigit() else ""
                    names[name] = "False" if node in ("rel", "and", "or", "not") else "0.0"
        return [f"    {name} = {first}" for name, first in sorted(names.items())]

    def _open_rows(self, order_k: OrderK, start: Writer) -> None:
        for node, row in order_k.rows.items():
            start.line(f"o{row} = {row} * stride")
            if node in self.given:
                continue
            start.line(f"rows[o{row}] = {'0.0' if node < 0 else order_k.value(node)}")
            if self.degrees.of(plain(node)) == CONSTANT:
                start.line("for k in range(1, K + 1):")
                start.line(f"    rows[o{row} + k] = 0.0")
        for node in sorted(order_k.transient):
            start.line(f"z{node} = s{node}")
        for node in sorted(order_k.carried):
            start.line(f"l{node} = {order_k.value(node)}")
        for i, rate in enumerate(self.rates):
            if self.degrees.of(self.states[i]) not in (CONSTANT, AFFINE):
                start.line(f"d{i} = {self._frozen(i, order_k.value(rate))}")

    def _factor(self, order_0: OrderZero, start: Writer, corrections, offset: int) -> int:
        """Slopes S of the nodes to correct and the factorised G; returns the end of the scratch numbers."""
        graph = self.graph
        single = {c[0] for c in self.components() if len(c) == 1}
        for j, unknown in enumerate(self.unknowns):
            slopes = {
                node: derivative(graph, node, unknown)
                for node, moving in corrections.items()
                if moving >> j & 1
            }
            slopes = {node: d for node, d in slopes.items() if graph.value(d) != 0.0}
            pivot = derivative(graph, self.residuals[j], unknown)
            for node in slopes:
                start.line(f"S{node}x{j} = 0.0")
            if j in single:
                start.line(f"G{j} = 0.0")
            start.line(f"if on{j}:")
            start.indent += 1
            order_0.scopes.append(set())
            order_0.emit([*slopes.values(), pivot])
            for node, d in slopes.items():
                start.line(f"S{node}x{j} = {order_0.name(d)}")
            if j in single:
                start.line(f"if not abs({order_0.name(pivot)}) > 0.0:")
                start.line("    return 1")
                start.line(f"G{j} = -1.0 / {order_0.name(pivot)}")
            order_0.scopes.pop()
            start.indent -= 1
        for component in self.components():
            size = len(component)
            if size == 1:
                continue
            start.line(" or ".join(f"on{j}" for j in component).join(("if ", ":")))
            start.indent += 1
            order_0.scopes.append(set())
            for r, i in enumerate(component):
                for c, j in enumerate(component):
                    at = f"rows[scratch + {offset + r * size + c}]"
                    node = derivative(graph, self.residuals[i], self.unknowns[j])
                    start.line(f"{at} = {'1.0' if i == j else '0.0'}")
                    if node == graph.zero and i != j:
                        continue
                    start.line(f"if on{i} and on{j}:" if i != j else f"if on{i}:")
                    start.indent += 1
                    order_0.scopes.append(set())
                    order_0.emit([node])
                    start.line(f"{at} = {order_0.name(node)}")
                    order_0.scopes.pop()
                    start.indent -= 1
            start.line(f"if lu_factor(rows, scratch + {offset}, {size}) != 0:")
            start.line("    return 1")
            order_0.scopes.pop()
            start.indent -= 1
            offset += size * size + 2 * size
        return offset

    def components(self) -> list[list[int]]:
        """Multipliers in groups that solve together: connected blocks of the pattern of G."""
        m = len(self.unknowns)
        label = list(range(m))
        for i in range(m):
            moving = self.degrees.pair(self.residuals[i])[1]
            for j in bits(moving):
                low, high = sorted((label[i], label[j]))
                label = [low if c == high else c for c in label]
        return [[j for j in range(m) if label[j] == c] for c in sorted(set(label))]

    # ---- inside the loop ----

    def _order(self, order_k: OrderK, loop: Writer, roots) -> dict[int, int]:
        """Write one order; returns the nodes that solved multipliers correct."""
        self._state_coefficients(order_k, loop)
        order_k.emit(roots)
        corrections = self._correct(order_k, loop) if self.unknowns else {}
        self._close_order(order_k, loop)
        return corrections

    def _state_coefficients(self, order_k: OrderK, loop: Writer) -> None:
        for node in self.read:
            loop.line(f"k{node} = rows[{order_k.row(node)} + k]")
            order_k.scopes[0].add(node)
        for i, node in enumerate(self.states):
            if self.degrees.of(node) in (CONSTANT, AFFINE):
                order_k.coefficient(node)
            else:
                loop.line(f"k{node} = d{i} * inv")
                order_k.scopes[0].add(node)

    def _correct(self, order_k: OrderK, loop: Writer, letter: str = "k") -> dict[int, int]:
        """Solve for lambda_k, add S lambda_k; returns the corrected nodes and what they move with.

        With the letter v of their values the same at order 0, where lambda_0 is no number that is known already.
        """
        text = order_k.coefficient if letter == "k" else order_k.value
        offset = 4 * len(order_k.products)
        for node in self.unknowns:
            loop.line(f"{letter}{node} = 0.0")
        # A branch, not a selection: with nothing to solve the chain from order to order does not wait for it.
        loop.line(f"if {' or '.join(f'on{j}' for j in range(len(self.unknowns)))}:")
        loop.indent += 1
        for component in self.components():
            size = len(component)
            if size == 1:
                j = component[0]
                g = text(self.residuals[j]) or "0.0"
                loop.line(f"q{j} = choose(on{j}, G{j} * {g}, 0.0)")
                continue
            right = offset + size * size + size
            for j in component:
                loop.line(f"q{j} = 0.0")
            loop.line(" or ".join(f"on{j}" for j in component).join(("if ", ":")))
            loop.indent += 1
            for r, j in enumerate(component):
                g = text(self.residuals[j]) or "0.0"
                loop.line(f"rows[scratch + {right + r}] = choose(on{j}, -({g}), 0.0)")
            loop.line(f"lu_solve(rows, scratch + {offset}, {size})")
            for r, j in enumerate(component):
                loop.line(f"q{j} = rows[scratch + {right + r}]")
            loop.indent -= 1
            self.source.helpers |= {"lu_factor", "lu_solve"}
            offset += size * size + 2 * size
        stored = {*map(plain, order_k.rows), *order_k.carried, *self.rates}
        corrections = {}
        for node in sorted(stored):
            moving = self.degrees.pair(node)[1]
            if not moving or self.graph.nodes[node].op == "num":
                continue
            if node in self.states:
                continue  # order k of a state comes from order k-1 of its rate
            corrections[node] = moving
            terms = [
                f"S{node}x{j} * q{j}"
                for j in bits(moving)
                if self.graph.value(derivative(self.graph, node, self.unknowns[j])) != 0.0
            ]
            if node in self.unknowns:
                loop.line(f"{letter}{node} = q{self.unknowns.index(node)}")
            elif terms:
                loop.line(f"{letter}{node} += {' + '.join(terms)}")
        loop.indent -= 1
        return corrections

    def _close_order(self, order_k: OrderK, loop: Writer) -> None:
        """Store the rows and carry what the next order needs."""
        for node, row in order_k.rows.items():
            if self.degrees.of(plain(node)) != CONSTANT and node not in self.given:
                loop.line(f"rows[o{row} + k] = {order_k.last_value(node)}")
        for node in sorted(order_k.carried):
            loop.line(f"l{node} = {order_k.coefficient(node) or '0.0'}")
        for i, rate in enumerate(self.rates):
            if self.degrees.of(self.states[i]) not in (CONSTANT, AFFINE):
                loop.line(f"d{i} = {self._frozen(i, order_k.coefficient(rate) or '0.0')}")
        if order_k.order < LANES - 1:
            for operand in sorted({u for pair in order_k.products for u in pair}):
                loop.line(f"c{order_k.order + 1}{label(operand)} = {order_k.last_value(operand)}")
        if order_k.order == 0:
            for node in sorted(order_k.transient):
                loop.line(f"z{node} = 0.0")  # an affine node has no order above 1

    def _frozen(self, i: int, rate: str) -> str:
        for j in self.frozen.get(i, []):
            rate = f"choose(on{j}, 0.0, {rate})"
        return rate


def write_jets(model: Model, **options: Any) -> dict[str, str]:
    """Sources {"slip": text, "general": text}, the second only with multipliers; `options` as of JetProgram.

    Without recurrences there is one text without a program, so that the text cache remembers it.
    """
    try:
        return {
            name: JetProgram(model, name == "general", **options).write()
            for name in (("slip", "general") if model.multipliers else ("slip",))
        }
    except NoRecurrence as reason:
        return {"none": f"# no jets: {reason}\n"}
