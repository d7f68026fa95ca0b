"""Taylor coefficients of a smoothed model, written out order by order: the explicit half of the stiff path.

x_(k+1) = f_k / (k+1), and f_k from the coefficients of order <= k of every operation. Written out in scalars,
so that nothing is loaded or looped over: this, and not the method, is what beats a general Taylor code.
"""

from __future__ import annotations

from pwsmooth.codegen.stiff.graph import Graph, operands

LOW, HIGH = 12, 16  # the orders that the step loop asks for
# Beyond this many products of the HIGH order the text takes longer to compile than it will ever save.
MOST_PRODUCTS = 4000
_KINDS = {"num", "par", "time", "state", "add", "mul", "div", "sqrt", "rsqrt", "pow"}
_FUNCTIONS = {"exp", "log", "sin", "cos", "sinh", "cosh", "tanh", "erf", "atan"}


def _sum(terms: list[str], late: int) -> str:
    """Text of a sum: two running sums of the early terms, then the last `late` ones, which wait for new
    values."""
    early, rest = terms[: len(terms) - late], terms[len(terms) - late :]
    if len(early) < 4:
        return " + ".join(terms)
    half = len(early) // 2
    return " + ".join([f"(({' + '.join(early[:half])}) + ({' + '.join(early[half:])}))", *rest])


def _newest_last(k: int) -> list[int]:
    return [*range(2, k), *([1, k] if k > 1 else [1])]


class Series:
    """Text of the coefficients of every node; `None` stands for a coefficient known to be zero."""

    def __init__(self, graph: Graph, roots: list[int], n: int):
        self.graph, self.roots, self.n = graph, roots, n
        self.order = graph.reachable(roots)
        self.affine = self._affine_nodes()
        self.zero: dict[tuple, bool] = {}
        self.lines: list[str] = []
        self.products = 0

    def supported(self) -> bool:
        ops = (self.graph.ops[a] for a in self.order)
        return all(op[0] in _KINDS or (op[0] == "fun" and op[1] in _FUNCTIONS) for op in ops)

    def _affine_nodes(self) -> set[int]:
        """Nodes of degree one in t: t itself, times and plus constants."""
        found = set()
        for a in self.order:
            op = self.graph.ops[a]
            if op[0] == "time":
                found.add(a)
            elif op[0] == "add" and all(self._constant(b) or b in found for b in operands(op)):
                found.add(a)
            elif op[0] == "mul" and {self._constant(b) or b in found for b in op[1:]} == {True}:
                if self._constant(op[1]) or self._constant(op[2]):
                    found.add(a)
        return {a for a in found if not self._constant(a)}

    def _constant(self, a) -> bool:
        return self.graph.level[a] == 0

    def c(self, a: int, k: int) -> str | None:
        """Name of coefficient k of node a."""
        if self._constant(a):
            op = self.graph.ops[a]
            if k > 0:
                return None
            return f"({op[1]!r})" if op[0] == "num" else f"n{a}"
        if a in self.affine and k > 1:
            return None
        return f"n{a}_{k}"

    def _convolution(self, a, b, k, start=0, stop=None) -> list[str]:
        """Terms a_j b_(k-j), j = start..stop."""
        terms = []
        for j in range(start, (k if stop is None else stop) + 1):
            x, y = self.c(a, j), self.c(b, k - j)
            if x and y:
                terms.append(f"{x} * {y}")
        self.products += len(terms)
        # The newest coefficients come last: all other terms are then under way before these are known.
        return terms[1:-1] + [terms[0], terms[-1]] if len(terms) > 2 else terms

    def _set(self, a, k, text) -> None:
        self.lines.append(f"    n{a}_{k} = {text or '0.0'}")

    def coefficient(self, a: int, k: int) -> None:
        """Append the lines that compute coefficient k of node a."""
        op = self.graph.ops[a]
        kind = op[0]
        if self._constant(a) or kind == "state" or (a in self.affine and k > 1):
            return
        if kind == "time":
            self._set(a, k, "t" if k == 0 else "1.0")
        elif kind == "add":
            terms = [(c, self.c(b, k)) for c, b in op[1] if self.c(b, k)]
            self.products += sum(abs(c) != 1.0 for c, _ in terms)
            text = " + ".join(x if c == 1.0 else f"{c!r} * {x}" for c, x in terms)
            self._set(a, k, text)
        elif kind == "mul":
            self._set(a, k, self._product(op[1], op[2], k))
        elif kind == "div":
            terms = self._convolution(a, op[2], k, 0, k - 1)
            if k == 0:
                self._set(a, 0, f"{self.c(op[1], 0)} / {self.c(op[2], 0)}")
                self.lines.append(f"    i{a} = 1.0 / {self.c(op[2], 0)}")
            else:
                known = f" - ({_sum(terms, 2)})" if terms else ""
                self._set(a, k, f"({self.c(op[1], k) or '0.0'}{known}) * i{a}")
        elif kind in ("sqrt", "rsqrt", "pow"):
            self._power(a, op, k)
        else:
            getattr(self, f"_{op[1]}")(a, op[2], k)

    def _product(self, a, b, k) -> str:
        if a != b:
            return _sum(self._convolution(a, b, k), 2)
        both = [(self.c(a, j), self.c(a, k - j)) for j in [*range(1, (k + 1) // 2), 0] if k > 0]
        pairs = [f"{x} * {y}" for x, y in both if x and y]
        self.products += len(pairs)
        text = f"2.0 * ({_sum(pairs, 1)})" if pairs else ""
        if k % 2 == 0 and self.c(a, k // 2):
            middle = f"{self.c(a, k // 2)} * {self.c(a, k // 2)}"
            text = f"{text} + {middle}" if text else middle
        return text

    def _power(self, a, op, k) -> None:
        """k b_0 y_k = sum_(j=1..k) (r j - (k - j)) b_j y_(k-j) for y = b^r."""
        b, r = op[1], {"sqrt": 0.5, "rsqrt": -0.5}.get(op[0])
        r = op[2] if r is None else r
        b0 = self.c(b, 0)
        if k == 0:
            text = {"sqrt": f"sqrt({b0})", "rsqrt": f"1.0 / sqrt({b0})"}.get(op[0], f"{b0} ** {r!r}")
            self._set(a, 0, text)
            self.lines.append(f"    i{a} = 1.0 / {b0}")
            return
        terms = []
        for j in _newest_last(k):
            if self.c(b, j):
                terms.append(f"{(r * j - (k - j)) / k!r} * {self.c(b, j)} * {self.c(a, k - j)}")
        self.products += 2 * len(terms)
        self._set(a, k, f"({_sum(terms, 2)}) * i{a}")

    def _chain(self, a, b, k, helper) -> str:
        """y_k = (1/k) sum_j j b_j w_(k-j) where y' = b' w; `helper(j)` names w_j."""
        terms = []
        for j in _newest_last(k):
            if self.c(b, j):
                factor = "" if j == k else f"{j / k!r} * "
                terms.append(f"{factor}{self.c(b, j)} * {helper(k - j)}")
        self.products += 2 * len(terms)
        return _sum(terms, 2)

    def _exp(self, a, b, k):
        self._set(a, k, f"exp({self.c(b, 0)})" if k == 0 else self._chain(a, b, k, lambda j: f"n{a}_{j}"))

    def _log(self, a, b, k):
        b0 = self.c(b, 0)
        if k == 0:
            self._set(a, 0, f"log({b0})")
            self.lines.append(f"    i{a} = 1.0 / {b0}")
            return
        terms = [f" - {j / k!r} * n{a}_{j} * {self.c(b, k - j)}" for j in range(1, k) if self.c(b, k - j)]
        self.products += 2 * len(terms)
        self._set(a, k, f"({self.c(b, k) or '0.0'}{''.join(terms)}) * i{a}")

    def _pair(self, a, b, k, own, other, sign):
        """Functions with y' = b' w, w' = sign b' y: sin and cos, sinh and cosh; w is kept as w<a>_k."""
        if k == 0:
            self._set(a, 0, f"{own}({self.c(b, 0)})")
            self.lines.append(f"    w{a}_0 = {'-' if own == 'cos' else ''}{other}({self.c(b, 0)})")
            return
        self._set(a, k, self._chain(a, b, k, lambda j: f"w{a}_{j}"))
        back = self._chain(a, b, k, lambda j: f"n{a}_{j}")
        self.lines.append(f"    w{a}_{k} = {sign}({back})")

    def _sin(self, a, b, k):
        self._pair(a, b, k, "sin", "cos", "-")

    def _cos(self, a, b, k):
        self._pair(a, b, k, "cos", "sin", "-")  # w = -sin b, w' = -b' cos b

    def _sinh(self, a, b, k):
        self._pair(a, b, k, "sinh", "cosh", "")

    def _cosh(self, a, b, k):
        self._pair(a, b, k, "cosh", "sinh", "")

    def _derivative_known(self, a, b, k, value, slope):
        """y' = b' w with w computed here: slope(j) appends w<a>_j."""
        self._set(a, k, f"{value}({self.c(b, 0)})" if k == 0 else self._chain(a, b, k, lambda j: f"w{a}_{j}"))
        slope(k)

    def _tanh(self, a, b, k):
        def slope(j):  # w = 1 - y^2
            # At order 0 from cosh: 1 - y*y has lost every digit where the layer is left behind.
            text = f"1.0 / cosh({self.c(b, 0)}) ** 2" if j == 0 else f"-({self._product(a, a, j)})"
            self.lines.append(f"    w{a}_{j} = {text}")

        self._derivative_known(a, b, k, "tanh", slope)

    def _erf(self, a, b, k):
        def slope(j):  # w = 2/sqrt(pi) exp(-b^2), w' = -(b^2)' w
            self.lines.append(f"    s{a}_{j} = {self._product(b, b, j) or '0.0'}")
            if j == 0:
                self.lines.append(f"    w{a}_0 = 1.1283791670955126 * exp(-s{a}_0)")
                return
            terms = " + ".join(f"{i / j!r} * s{a}_{i} * w{a}_{j - i}" for i in range(1, j + 1))
            self.products += 2 * j
            self.lines.append(f"    w{a}_{j} = -({terms})")

        self._derivative_known(a, b, k, "erf", slope)

    def _atan(self, a, b, k):
        def slope(j):  # w = 1/(1 + b^2)
            square = self._product(b, b, j) or "0.0"
            self.lines.append(f"    s{a}_{j} = {'1.0 + ' if j == 0 else ''}{square}")
            if j == 0:
                self.lines.append(f"    w{a}_0 = 1.0 / s{a}_0")
                return
            terms = " + ".join(f"s{a}_{i} * w{a}_{j - i}" for i in range(1, j + 1))
            self.products += j
            self.lines.append(f"    w{a}_{j} = -({terms}) * w{a}_0")

        self._derivative_known(a, b, k, "atan", slope)

    def write(self, constants) -> list[str]:
        """Body of taylor(t, x, p, K, stride, rows): orders 0..K of the states, K = LOW or HIGH, and of each
        further root (surfaces that are no states) in the rows after them. `constants(a)` is the line of a
        node of level 0.
        """
        state = {self.graph.node("state", i): i for i in range(self.n)}
        for a in self.order:
            if self._constant(a) and self.graph.ops[a][0] != "num":
                self.lines += constants(a)
        for a, i in state.items():
            self.lines.append(f"    n{a}_0 = x[{i}]")
        rates, extra = self.roots[: self.n], self.roots[self.n :]
        for k in range(HIGH + 1):
            for a in self.order:
                self.coefficient(a, k)
            if k < HIGH:
                for a, i in state.items():
                    rate = self.c(rates[i], k)
                    factor = "" if k == 0 else f" * {1.0 / (k + 1)!r}"
                    self.lines.append(f"    n{a}_{k + 1} = {rate + factor if rate else '0.0'}")
            if k == LOW or k == HIGH:
                first = 0 if k == LOW else LOW + 1
                for j in range(first, k + 1):
                    self.lines += [f"    rows[{i} * stride + {j}] = n{a}_{j}" for a, i in state.items()]
                    for q, b in enumerate(extra):
                        self.lines.append(f"    rows[{self.n + q} * stride + {j}] = {self.c(b, j) or '0.0'}")
            if k == LOW:
                self.lines += [f"    if K <= {LOW}:", "        return"]
        return self.lines
