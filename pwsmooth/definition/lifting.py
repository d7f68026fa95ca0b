"""Lifting: ordinary notation -> switches and the selections that they make.

    sign h                    ->  lambda
    Abs(a), Max(a, b), ...    ->  Select(lambda, a, -a), Select(lambda, a, b), ...
    Piecewise((a, x > y), (b, True))  ->  Select(lambda, a, b),  lambda the switch of x - y
    floor u                   ->  Select(lambda, even, odd),  lambda the switch of sin(pi u), which tells their parity
    u/sqrt(u^2 + w^2)         ->  the first component of the Disc of (u, w), in the rate of a velocity among them

Surfaces equal up to a constant factor are one switch. A product surface, sign(x*y), is taken factor by factor:
its zero set has a corner that no single multiplier describes. An inner switch inside an outer surface is a
part of that surface; where a sign jumps with an inner one that may be held, as that of x + sign x, it is one of each
side: Select(lambda, sign(x + 1), sign(x - 1)). Inside the branch of a Piecewise the condition that chose it holds, so
that the cases x > 0, x < 0 of one surface become one selection. Products of lifted functions stay as written.
Chain: primitives.py -> lifting (here) -> lowering.py -> system.py.
"""

from __future__ import annotations

from collections.abc import Callable

import sympy as sp
from sympy.core.relational import Relational

from .discs import LiftedDisc
from .model import BOTH, Select, Whole, core
from .pointwise import factor_between, fingerprint
from .primitives import Component, Disc, Memory, Reaction, Switch

# Functions of which a kink is lifted out: their series end where it does.
_ENDING = (sp.log, sp.asin, sp.acos, sp.atanh, sp.acosh)
# Written as quotients, so that only the poles of the quotient are singular.
_QUOTIENTS = {
    sp.cot: lambda u: sp.cos(u) / sp.sin(u),
    sp.sec: lambda u: 1 / sp.cos(u),
    sp.csc: lambda u: 1 / sp.sin(u),
    sp.coth: lambda u: sp.cosh(u) / sp.sinh(u),
    sp.sech: lambda u: 1 / sp.cosh(u),
    sp.csch: lambda u: 1 / sp.sinh(u),
}
_BY_FLOOR: dict[type, Callable[..., sp.Expr]] = {
    sp.floor: lambda floor, u: floor(u),
    sp.ceiling: lambda floor, u: -floor(-u),
    sp.frac: lambda floor, u: u - floor(u),
    sp.Mod: lambda floor, u, period: u - period * floor(u / period),
}
JUMPING = (sp.sign, sp.Heaviside, sp.Piecewise, Select, *_BY_FLOOR)
_MOST_INSIDE = 3  # switches with which a surface jumps and whose sides are told apart: eight surfaces
_ROUNDING = 2e-15  # of what a sum's terms add up to in size
_UNSUPPORTED = (sp.DiracDelta, sp.re, sp.im, sp.conjugate, sp.arg)


class Lifting:
    """Lifts the expressions of one system; collects the switches that it meets.

    `dynamic` symbols make a surface move: time, states, unknowns and reactions. Memories and parameters do not, so that
    conditions on them stay `Piecewise`. `user_switches` come first: their names win over those of lifted functions.
    `stand_ins` says what stands for symbols that are expressions, as those of drives. Two switches of a user's on one
    surface are one, unless the field is nonlinear in one (`bent`), as laws of static friction are. The rates of
    `jumping` symbols may jump, so that the motion may be held where surfaces of these are 0. `solved` says what some
    unknowns are that jump with what stands in their equations.
    """

    def __init__(self, dynamic, user_switches=(), stand_ins=None, bent=(), jumping=(), solved=None):
        self.dynamic, self._jumping = frozenset(dynamic), frozenset(jumping)
        self._solved: dict[sp.Symbol, sp.Expr] = dict(solved or {})
        self.switches: dict[sp.Symbol, sp.Expr] = {}  # multiplier -> lifted surface, the inner ones first
        self.notation: dict[sp.Symbol, Switch] = {}  # multiplier -> its switch as the user would write it
        self.discs: dict[Disc, LiftedDisc] = {}
        self._directions: dict[
            sp.Expr, tuple[Disc, tuple]
        ] = {}  # sum of squares -> its disc, (base, component) of each
        self._kinks: set[Select] = set()  # selections whose branches agree on their surface
        self._written: dict[Select, sp.Expr] = {}  # ... and the notation that they come from
        self._by_surface: dict[sp.Expr, tuple[int, sp.Symbol]] = {}
        self._by_fingerprint: dict[tuple, list[sp.Symbol]] = {}
        self._symbols: dict[sp.Symbol, sp.Expr] = dict(stand_ins or {})  # a user's symbol -> what stands for it
        self._memo: dict[tuple, sp.Basic] = {}
        self._may_register, self._at_instant = True, False
        # Multiplier -> its value where its surface stays at 0, as conditions say, or an expression of its sign.
        self.at_zero: dict[sp.Symbol, int | sp.Expr] = {}
        self._given: set[sp.Symbol] = set()
        self._bent: set[sp.Symbol] = set(bent)  # such switches, and the multipliers that stand for them
        for switch in user_switches:
            self._given |= self._symbol(switch).free_symbols

    def __call__(self, expr, *, new_switches=True, at_instant=False):
        """The lifted form of an expression or condition.

        With `new_switches` false (outputs, updates, guards: what is evaluated, not followed), only surfaces that the
        field has already are lifted; anything else becomes a Piecewise. With `at_instant` (updates, guards) what is 0
        within rounding is 0: signs and conditions there are those of 0, whatever multiplier holds the motion.
        """
        self._may_register, self._at_instant = new_switches, at_instant
        # For sympy a Symbol is a Boolean too.
        is_condition = isinstance(expr, sp.logic.boolalg.Boolean) and not expr.is_Symbol
        lift = self._condition if is_condition else self._lift
        return lift(expr, {})

    # ---- expressions; `sides` maps multipliers to the value +1 or -1 that the enclosing branch implies

    def _lift(self, e, sides):
        if e.is_Symbol:
            return self._symbol(e)
        if not e.args:
            return e
        key = (e, frozenset(sides.items()), self._may_register, self._at_instant)
        if key not in self._memo:
            self._memo[key] = self._node(e, sides)
        return self._memo[key]

    def _node(self, e, sides):
        if self._directions and (found := self._direction(e)) is not None:
            return self._lift(found, sides)
        if isinstance(e, sp.Piecewise):
            return self._piecewise(e, sides)
        if isinstance(e, (sp.Max, sp.Min)):
            found = self._of_steps(e.func, [self._lift(a, sides) for a in e.args], sides)
            if found is not None:
                return found
            return self._noted(self._extremum(e, sides), e)
        if isinstance(e, Select):  # already lifted by hand
            return Select(*(self._lift(a, sides) for a in e.args))
        args = [self._lift(a, sides) for a in e.args]
        if isinstance(e, (sp.Abs, sp.Function)) and (found := self._of_steps(e.func, args, sides)) is not None:
            return found
        if isinstance(e, sp.sign):
            return self._sign(args[0], sides)
        if isinstance(e, sp.Abs):
            return self._noted(self._kink(args[0], args[0], -args[0], sides), e)
        if isinstance(e, sp.Heaviside):
            return self._choose(args[0], _const(sp.S.One), _const(sp.S.Zero), sides, at_zero=_const(args[1]))
        if e.func in _QUOTIENTS:
            return self._lift(_QUOTIENTS[e.func](*args), sides)
        if isinstance(e, sp.atan2):
            return self._angle(args[0], args[1], sides)
        if e.func in _BY_FLOOR:
            moves = any(self._moves(a) for a in args)
            return _BY_FLOOR[e.func](lambda u: self._floor(u, sides) if moves else Whole(u - sp.S.Half), *args)
        if isinstance(e, _UNSUPPORTED) and any(self._moves(a) for a in args):
            raise ValueError(
                f"{e} stands in the system, but {e.func.__name__} cannot be lifted. Declare symbols "
                "real=True; for what changes by steps use a Memory with an Event."
            )
        if e.is_Mul:
            return self._product(args)
        if e.is_Pow and args[0].is_negative and not args[1].is_integer:
            # What sympy makes of cos(pi sign(y)): between -1 and 1 it is no power.
            return sp.cos(sp.pi * args[1]) * (-args[0]) ** args[1]
        if (e.is_Pow and not args[1].is_integer) or isinstance(e, _ENDING):
            return self._inside_kinks(e.func, args)
        if e.is_Pow and args[1].is_negative and self._kinks.intersection(sp.Mul.make_args(args[0])):
            return self._inside_kinks(e.func, args)  # 1/|u|
        return e.func(*args)

    def _symbol(self, s):
        """What stands for a user's symbol: primitives become plain symbols, a Switch its multiplier."""
        if s not in self._symbols:
            if isinstance(s, Component):
                self._disc(s.disc)
            self._symbols[s] = self._switch(s) if isinstance(s, Switch) else plain(s)
        return self._symbols[s]

    def _switch(self, switch):
        keep, self._may_register = self._may_register, True
        surface = self._lift(switch.surface, {})
        self._may_register = keep
        if not self._moves(surface):
            raise ValueError(
                f"`surface` of Switch {switch.name!r} is {switch.surface}, in which no state, no time stands: "
                "it is constant between events. Use a Piecewise on the parameter or Memory instead."
            )
        found = self._find(surface)
        apart = found is not None and self._bent & {switch, found[1]}
        if found is None or apart:
            found = 1, self._register(surface, switch)
        if switch in self._bent:
            self._bent.add(found[1])
        return found[0] * found[1]

    def take_directions(self, equations):
        """Makes discs of the directions v/|v| in `equations`, pairs of a symbol and what its rate says.

        Where the symbol is one of the components: of friction, not of what pulls to a centre.
        """
        for x, e in equations:
            for power in sorted(e.atoms(sp.Pow), key=sp.default_sort_key):
                parts = _squares(power.base) if power.exp == -sp.S.Half else None
                if parts is None or power.base in self._directions or x not in power.base.free_symbols:
                    continue
                if not all(self._moves(base) for base, _ in parts):
                    continue
                disc = Disc(
                    f"dir({', '.join(str(base) for base, _ in parts)})", [root * base for base, root in parts]
                )
                places = tuple((base, lam / root) for (base, root), lam in zip(parts, disc, strict=True))
                self._directions[power.base] = disc, places
        for _, e in equations:
            for node in sp.preorder_traversal(e):
                for power in (node, *node.args):
                    # What is no direction times something has a pole, and stays one.
                    pole = power.is_Pow and power.exp == -sp.S.Half and power.base in self._directions
                    if pole and not (node.is_Mul and self._direction(node) is not None) and power is not node:
                        del self._directions[power.base]

    def _direction(self, e):
        """What stands for |v| and for a product with 1/|v|; None where `e` is neither, or no multiple of one."""
        if e.is_Pow and e.base in self._directions and e.exp.is_positive and (2 * e.exp).is_odd:
            return self._directions[e.base][0].size ** (2 * e.exp)
        inverse = next(
            (f for f in e.args if f.is_Pow and f.exp == -sp.S.Half and f.base in self._directions), None
        )
        if not e.is_Mul or inverse is None:
            return None
        places, terms = self._directions[inverse.base][1], []
        others = [f for f in e.args if f is not inverse]
        for base, lam in places:
            for f in others:
                if f in (base, -base):
                    return sp.Mul(*(g for g in others if g is not f)) * (lam if f == base else -lam)
        for term in sp.Add.make_args(sp.expand_mul(sp.Mul(*others))):
            base, lam = next(((b, lam) for b, lam in places if b in sp.Mul.make_args(term)), (None, None))
            if base is None:
                return None
            terms.append(term / base * lam)
        return sp.Add(*terms)

    def _disc(self, disc):
        """Registers a disc with its surfaces lifted."""
        if disc in self.discs:
            return
        for other in self.discs:
            if other.name == disc.name:
                raise ValueError(
                    f"two discs are named {disc.name!r}, with the surfaces {other.surfaces} and {disc.surfaces}; give "
                    "each its own name."
                )
        if any(isinstance(s, Component) for h in disc.surfaces for s in h.free_symbols):
            raise ValueError(
                f"`surfaces` of Disc {disc.name!r} are {disc.surfaces}, in which the multiplier of a disc stands: give "
                "velocities as expressions of time and states."
            )
        keep, self._may_register = self._may_register, True
        surfaces = tuple(self._lift(h, {}) for h in disc.surfaces)
        self._may_register = keep
        if still := [h for h in surfaces if not self._moves(h)]:
            raise ValueError(
                f"`surfaces` of Disc {disc.name!r} contain {still[0]}, in which no state, no time stands: it is "
                "constant between events. Give expressions of time and states."
            )
        self.discs[disc] = LiftedDisc(
            sp.Symbol(disc.name, real=True), tuple(map(plain, disc.components)), surfaces
        )

    def _sign(self, h, sides):
        factors = (
            None if h.free_symbols & self.dynamic and self._inside(self._written_out(h)) else self._factors(h)
        )
        if factors is None:
            return self._choose(h, _const(sp.S.One), _const(-sp.S.One), sides, at_zero=_const(sp.S.Zero))
        result = sp.S.One
        self._note_at_zero(*factors, sp.S.Zero)
        for surface in factors[1]:
            if isinstance(surface, tuple):
                orientation, lam = surface
                side = _side(lam) if self._at_instant else lam
                result *= orientation * sides.get(lam, side)
            else:
                result *= sp.Piecewise((1, surface > 0), (-1, surface < 0), (0, True), evaluate=False)
        return factors[0] * result

    def _of_steps(self, function, args, sides):
        """A function of what jumps between constants, with its value on each side; None for others.

        Between two sides it goes straight: |Piecewise((-1, y < 0), (1, True))| is 1, and not 0 on the way. What has a
        value on the surface stays, a sign or a Switch, and so does another function than Abs, Max and Min where it
        jumps.
        """
        free = set().union(*(a.free_symbols for a in args))
        if any(
            s in self.switches
            for a in args
            for s in a.xreplace(dict.fromkeys(a.atoms(Select), sp.S.Zero)).free_symbols
        ):
            return None
        steps = sorted(free & self.switches.keys(), key=lambda s: s.name)
        if not steps or free & (self.dynamic | self._given):
            return None
        lam, *_ = steps
        ways = [sides[lam]] if lam in sides else [1, -1]
        branches = [
            self._lift(function(*(a.xreplace({lam: sp.Integer(s)}) for a in args)), sides | {lam: s})
            for s in ways
        ]
        if len(branches) == 1 or branches[0] == branches[1]:
            return branches[0]
        return Select(lam, *branches) if function in (sp.Abs, sp.Max, sp.Min) else None

    def _noted(self, result, e):
        if isinstance(result, Select):
            self._written[result] = e
        return result

    def _kink(self, h, above, below, sides):
        """above if h > 0 else below, where both agree on h = 0."""
        result = self._choose(h, _const(above), _const(below), sides, jumps=False)
        self._kinks.update(result.atoms(Select))
        return result

    def _as_kink(self, result):
        if isinstance(result, Select):
            self._kinks.add(result)
        return result

    def _extremum(self, e, sides):
        side = 1 if isinstance(e, sp.Max) else -1
        first, *rest = (self._lift(a, sides) for a in e.args)
        for other in rest:
            first = self._larger(first, other, side, sides)
        return first

    def _larger(self, a, b, side, sides):
        """The larger (side 1) or smaller (side -1) of two lifted expressions."""
        # Max(-L, Min(L, x)): where Min gives L the larger one is known, so that the surfaces are those of
        # x - L and x + L, and no selection stands in them.
        for inner, other in ((a, b), (b, a)):
            if inner in self._kinks:
                lam, *branches = inner.args
                known = [_order(branch, other) for branch in branches]
                if any(known):
                    pick = [
                        (branch if order == side else other) if order
                        else self._larger(branch, other, side, sides | {lam: sign})
                        for branch, order, sign in zip(branches, known, (1, -1), strict=True)
                    ]  # fmt: skip
                    return self._as_kink(Select(lam, *pick))
        return self._kink(side * (a - b), a, b, sides)

    def _product(self, args):
        # Heaviside(delta)*delta**1.5 selects the product: the other factors may be undefined where it is 0.
        for i, a in enumerate(args):
            others = args[:i] + args[i + 1 :]
            if isinstance(a, sp.Piecewise) and any(branch == 0 for branch, _ in a.args):
                cases = ((b if b == 0 else self._product([b, *others]), c) for b, c in a.args)
                return sp.Piecewise(*cases, evaluate=False)
            if isinstance(a, Select) and 0 in a.args[1:]:
                result = Select(a.args[0], *(b if b == 0 else self._product([b, *others]) for b in a.args[1:]))
                return self._as_kink(result) if a in self._kinks else result
        for a in args:
            if isinstance(a, Select) and a.args[0] in self.switches:
                result = self._quotient(a.args[0], args)
                if result is not None:
                    return result
        return sp.Mul(*args)

    def _quotient(self, lam, args):
        """A product with powers of |h| and of h, of which one is negative: u/|u| and the like; None if it is none.

        In each branch |h| = h or -h, so that the powers are one, of what is positive there.
        """
        surface = core(self.switches[lam])
        branches = []
        for side in (1, -1):
            factors = [f for a in args for f in sp.Mul.make_args(_branch(a, lam, side))]
            sign = side if surface[0] > 0 else -side  # of the core in this branch
            power, coefficient, rest, lowest = sp.S.Zero, sp.S.One, [], sp.S.Zero
            for factor in factors:
                base, exponent = factor.as_base_exp()
                c, inner = core(base)
                if inner == surface[1] and (exponent.is_integer or c * sign > 0):
                    power, coefficient = power + exponent, coefficient * (c * sign) ** exponent
                    lowest = exponent if exponent.is_negative else lowest
                else:
                    rest.append(factor)
            if lowest == 0 and side == 1:
                return None
            branches.append(sp.Mul(coefficient, (sign * surface[1]) ** power, *rest))
        if branches[0].is_number and branches[0] == -branches[1]:
            return branches[0] * lam
        return Select(lam, *branches)

    def _angle(self, y, x, sides):
        """atan2 by the tangent of half the angle: smooth but for the jump of 2 pi across y = 0, x < 0."""
        r = sp.sqrt(_without_cosines(x**2 + y**2))
        return self._choose(
            x,
            _const(2 * sp.atan(y / (r + x))),
            lambda sides: sp.pi * self._sign(y, sides) - 2 * sp.atan(y / (r - x)),
            sides,
        )

    def _floor(self, u, sides):
        """floor u, from the parity of the integer below: a rounding of u beside an integer changes nothing.

        What u jumps by may be even: its sides are told apart by u itself, not by the wave.
        """
        written_out = self._written_out(u)
        lam = self._inside(written_out)
        if lam is not None:
            ways = (sides[lam],) * 2 if lam in sides else (1, -1)
            told = (self._floor(written_out.xreplace({lam: sp.Integer(s)}), sides | {lam: s}) for s in ways)
            return Select(lam, *told)
        wave = sp.sin(sp.pi * u)
        if not self._may_register and self._find(wave) is None:
            return sp.floor(u + (self._rounding(u + 1) if self._at_instant else 0))
        even, odd = (2 * Whole((u - parity - sp.S.Half) / 2) + parity for parity in (0, 1))
        # At the integer n the floor is n, as above it: cos(pi n) is the side of the wave there.
        return self._choose(
            wave, _const(even), _const(odd), sides, at_zero=_const(Whole(u)), meant=sp.cos(sp.pi * u)
        )

    def _inside_kinks(self, func, args):
        """A root or logarithm of Max(0, d) is taken of the active branch: its series at 0 does not exist."""
        kinks = [s for s in sorted(args[0].atoms(Select), key=sp.default_sort_key) if s in self._kinks]
        if not kinks:
            return func(*args)
        outer = max(kinks, key=lambda s: s.count_ops())
        lam, above, below = outer.args
        inside = [self._inside_kinks(func, [args[0].xreplace({outer: b}), *args[1:]]) for b in (above, below)]
        # The root of -5 stands where no motion comes: of |Min(x, 5)| where that is negative and 5.
        real = [branch for branch in inside if branch.is_extended_real is not False]
        return real[0] if len(real) == 1 else self._as_kink(Select(lam, *inside))

    def _piecewise(self, e, sides):
        cases = list(e.args)

        def case(i):
            if i == len(cases):
                return _const(sp.nan)
            branch, condition = cases[i]
            return lambda sides: self._decide(
                condition, lambda sides: self._lift(branch, sides), case(i + 1), sides
            )

        result = case(0)(sides)
        if result.has(sp.nan):
            raise ValueError(f"{e} has no value where none of its conditions holds; add a branch (…, True).")
        return result

    # ---- conditions

    def _decide(self, condition, yes, no, sides):
        """yes(sides) if the condition holds, else no(sides)."""
        if condition in (sp.true, sp.false):
            return yes(sides) if condition == sp.true else no(sides)
        if isinstance(condition, sp.Not):
            return self._decide(condition.args[0], no, yes, sides)
        if isinstance(condition, (sp.And, sp.Or)):
            # Conditions on memories and parameters come first: they stay a Piecewise around the selection.
            first, *rest = sorted(condition.args, key=lambda c: self._moves(c))
            others = condition.func(*rest)
            if isinstance(condition, sp.And):
                return self._decide(first, lambda g: self._decide(others, yes, no, g), no, sides)
            return self._decide(first, yes, lambda g: self._decide(others, yes, no, g), sides)
        if not isinstance(condition, Relational):
            return self._decide(sp.to_nnf(condition, simplify=False), yes, no, sides)
        if isinstance(condition, (sp.Lt, sp.Le)):
            return self._decide(condition.negated, no, yes, sides)
        left, right = (self._lift(a, sides) for a in condition.args)
        difference = left - right
        if not self._moves(difference) and not difference.is_number and not self._at_instant:
            lifted = condition.func(left, right)
            return sp.Piecewise((yes(sides), lifted), (no(sides), True), evaluate=False)
        if isinstance(condition, (sp.Gt, sp.Ge)):
            return self._choose(difference, yes, no, sides, at_zero=yes if isinstance(condition, sp.Ge) else no)
        equal, unequal = (yes, no) if isinstance(condition, sp.Eq) else (no, yes)
        if difference.free_symbols & self.dynamic and self._may_register:
            raise ValueError(
                f"the condition {condition} holds only on a surface. What acts on the surface alone is a "
                "hidden term: write it with a Switch, such as 1 - lam**2; a jump there is an Event."
            )
        return self._choose(difference, unequal, unequal, sides, at_zero=equal)

    def _condition(self, condition, sides):
        """A condition that stays one: its sides lifted, what is 0 within rounding as 0."""
        if isinstance(condition, Relational):
            left, right = (self._lift(a, sides) for a in condition.args)
            h, cases = left - right, (_const(sp.S.One), _const(sp.S.Zero))
            alone = all(f.is_Symbol or f.is_number for f in sp.Mul.make_args(h))  # a state at rest is 0 exactly
            if self._moves(h) and not alone and self._factors(h) is not None:
                return sp.Gt(self._decide(condition, *cases, sides), sp.S.Half, evaluate=False)
            within = self._rounding(h)
            return _holds(condition.func, h, within) if within != 0 else condition.func(left, right)
        if condition in (sp.true, sp.false) or not condition.args:
            return condition
        return condition.func(*(self._condition(c, sides) for c in condition.args))

    # ---- surfaces

    def _choose(self, h, above, below, sides, at_zero=None, jumps=True, meant=None):
        """above(sides) where h > 0, below(sides) where h < 0; `at_zero` for what is 0 and stays there, on the side of
        the sign of `meant`. Without `jumps` both agree where h = 0."""
        if meant is None and at_zero is not None:
            meant = sp.Integer((at_zero is above) - (at_zero is below))
        if h.is_number:
            return (above if h > 0 else below if h < 0 else at_zero or below)(sides)
        written_out = self._written_out(h) if jumps else h
        lam = self._inside(written_out, jumps)
        if lam is not None:
            h = written_out
            above_, below_ = (
                self._choose(
                    h.xreplace({lam: sp.Integer(side)}),
                    above,
                    below,
                    sides | {lam: side},
                    at_zero,
                    jumps,
                    None if meant is None else meant.xreplace({lam: sp.Integer(side)}),
                )  # fmt: skip
                for side in ((sides[lam],) * 2 if lam in sides else (1, -1))
            )
            return Select(lam, above_, below_)
        factors = self._factors(h) if self._moves(h) or not self._at_instant else None
        if factors is None:
            return self._pointwise(h, above, below, at_zero or below, sides)
        sign, surfaces = factors
        self._note_at_zero(sign, surfaces, meant)
        return self._by_factors(sign, surfaces, above, below, at_zero, sides)

    def _inside(self, h, jumps=True):
        """A switch whose sides are to be told apart before those of h: with which h takes one of finitely many values,
        as that of sign(x) > 0, or, for what `jumps` with h, jumps where it may be held. None if there is none."""
        inner = sorted((s for s in h.free_symbols if s in self.switches), key=lambda s: s.name)
        if not inner or self._at_instant:
            return None
        if not h.free_symbols & self.dynamic:
            return inner[0]
        if not jumps:
            return None
        found = [lam for lam in inner if lam not in self._given and self._jumps(h, lam)]
        return found[0] if 0 < len(found) <= _MOST_INSIDE else None

    def _written_out(self, h):
        """h, with what its unknowns are in their place where it jumps with what stands in their equations."""
        found = h
        for _ in range(len(self._solved) if not self._at_instant else 0):
            inside = [u for u in found.free_symbols if u in self._solved]
            if not inside:
                break
            found = found.xreplace({u: self._lift(self._solved[u], {}) for u in inside})
        return found if found is not h and self._inside(found) is not None else h

    def _jumps(self, h, lam):
        """Whether h jumps on the surface of a switch, of a symbol whose rate may jump."""
        surface = self.switches[lam]
        difference = h.xreplace({lam: sp.S.One}) - h.xreplace({lam: sp.S.NegativeOne})
        for x in sorted(surface.free_symbols & self._jumping, key=lambda s: s.name):
            slope = surface.diff(x)
            if not slope.free_symbols & (self.dynamic | self.switches.keys()) and slope != 0:
                return difference.xreplace({x: sp.expand(x - surface / slope)}).expand() != 0
        return False

    def _pointwise(self, h, above, below, at_zero, sides):
        """`_choose` by the value of h alone."""
        within = self._rounding(h) if self._at_instant else sp.S.Zero
        if above is below:
            cases = [(above, _holds(sp.Ne, h, within)), (at_zero, True)]
        elif at_zero is above or at_zero is below:
            cases = [(above, _holds(sp.Ge if at_zero is above else sp.Gt, h, within)), (below, True)]
        else:
            cases = [(above, _holds(sp.Gt, h, within)), (below, _holds(sp.Lt, h, within)), (at_zero, True)]
        return sp.Piecewise(*((branch(sides), condition) for branch, condition in cases), evaluate=False)

    def _rounding(self, h):
        """What h may be off by where its parts are right to rounding: t - t0 - 0.003, t/T - 3, sin(pi t)."""
        if not self._moves(h):
            return sp.S.Zero  # memories and parameters are what they were set to
        terms = sp.Add.make_args(h)
        sizes = [sp.Abs(term) for term in terms] if len(terms) > 1 or h.atoms(sp.floor) else []
        for term in terms:
            sizes += [sp.Abs(term.coeff(wave) * wave.args[0]) for wave in term.atoms(sp.sin, sp.cos)]
        return _ROUNDING * sp.Add(*sizes)

    def _note_at_zero(self, sign, surfaces, meant):
        """Notes which side is meant (that of the sign of `meant`, 0 neither) where the surface of one switch is 0 and
        stays."""
        if meant is not None and self._may_register and len(surfaces) == 1 and isinstance(surfaces[0], tuple):
            orientation, lam = surfaces[0]
            side = sign * orientation * meant
            known = self.at_zero.setdefault(lam, int(side) if side.is_number else side)
            alike = known == side or (
                side.free_symbols and known != BOTH and factor_between(side, sp.S(known)) > 0
            )
            self.at_zero[lam] = known if alike else BOTH

    def _by_factors(self, sign, surfaces, above, below, at_zero, sides):
        if not surfaces:
            return (above if sign > 0 else below)(sides)
        first, *rest = surfaces
        if not isinstance(first, tuple):
            branches = [self._by_factors(s * sign, rest, above, below, at_zero, sides) for s in (1, -1)]
            return sp.Piecewise((branches[0], first > 0), (branches[1], True), evaluate=False)
        orientation, lam = first
        if lam in sides:
            return self._by_factors(sign * orientation * sides[lam], rest, above, below, at_zero, sides)
        up, down = (
            self._by_factors(side * sign * orientation, rest, above, below, at_zero, sides | {lam: side})
            for side in (1, -1)
        )
        if not self._at_instant or at_zero is None:
            return Select(lam, up, down)
        on = at_zero(sides)
        if on in (up, down):
            return sp.Piecewise((up, lam >= 1 if on == down else lam > -1), (down, True), evaluate=False)
        return sp.Piecewise((up, lam >= 1), (down, lam <= -1), (on, True), evaluate=False)

    def _refuse_components(self, h):
        lams = {lam for disc in self.discs.values() for lam in disc.components}
        if inside := sorted(map(str, h.free_symbols & lams)):
            raise ValueError(
                f"{inside[0]} stands in the surface or condition {h}: where the field switches is told by time and "
                "states, not by a multiplier. Write it with the surfaces of the disc."
            )

    def _factors(self, h):
        """sign h as (sign, factors): (orientation, multiplier) of a surface, or a constant of unknown sign.

        None if a factor is no known surface and no new one may be made.
        """
        self._refuse_components(h)
        sign, factors = 1, []
        for factor in sp.Mul.make_args(h):
            if factor.is_Pow:
                base, exponent = factor.args
                if exponent.is_integer is False:
                    continue  # a real root is positive
                if exponent.is_even:
                    continue
                if exponent.is_odd:
                    factor = base
            if factor.is_nonnegative or factor.is_nonpositive:
                sign = -sign if factor.is_nonpositive else sign
            elif self._moves(factor):
                found = self._find(factor)
                if found is None and not self._may_register:
                    return None
                factors.append(found or self._lifted_switch(factor))
            else:
                factors.append(factor)
        return sign, factors

    def _find(self, h):
        """(orientation, multiplier) of a known surface equal to h up to a constant factor, or None."""
        if h not in self._by_surface:
            key = fingerprint(h, h.free_symbols - self.dynamic - self.switches.keys())
            for lam in self._by_fingerprint.get(key, ()):
                orientation = self._orientation(h, self.switches[lam])
                if orientation is not None:
                    self._by_surface[h] = (orientation, lam)
                    break
            else:
                return None
        return self._by_surface[h]

    def _orientation(self, h, known):
        if sign := factor_between(h, known):
            return sign
        # The factor depends on parameters: its sign has to be known for all their values. (A factor that is
        # only known to be >= 0 counts as positive: where it is 0 there is no surface.)
        factor = sp.cancel(h / known)
        if not self._moves(factor) and (factor.is_nonnegative or factor.is_nonpositive):
            return -1 if factor.is_nonpositive else 1
        return None

    def _lifted_switch(self, h):
        orientation = -1 if h.could_extract_minus_sign() else 1
        h = orientation * h
        written = h.xreplace(self._written)
        name = f"sgn({written})"
        if len(name) > 40 or written.has(Select):
            name = f"sgn{len(self.switches) + 1}"
        return orientation, self._register(h, Switch(name, written))

    def _register(self, h, switch):
        lam = plain(switch)
        if lam in self.switches:
            raise ValueError(
                f"two switches are named {switch.name!r}, with the surfaces {self.notation[lam].surface} and "
                f"{switch.surface}; give each its own name."
            )
        self.switches[lam], self.notation[lam] = h, switch
        self._by_surface.setdefault(h, (1, lam))
        key = fingerprint(h, h.free_symbols - self.dynamic - self.switches.keys())
        if key is not None:
            self._by_fingerprint.setdefault(key, []).append(lam)
        return lam

    def _moves(self, e):
        """Does an expression, lifted or not, change between events?"""
        return any(s in self.dynamic or isinstance(s, Switch) or s in self.switches for s in e.free_symbols)


def plain(symbol):
    """A primitive as the plain Symbol of the lowered model; other symbols as they are."""
    if isinstance(symbol, (Switch, Component, Memory, Reaction)):
        return sp.Symbol(symbol.name, **symbol._assumptions_orig)
    return symbol


def _squares(e):
    """(base, root of its coefficient) of every term of a sum of two or three squares; None where it is none."""
    parts = []
    for term in sp.Add.make_args(e):
        squares = [f for f in sp.Mul.make_args(term) if f.is_Pow and f.exp == 2]
        coefficient = term / squares[-1] if squares else sp.S.Zero
        if not coefficient.is_positive:
            return None
        parts.append((squares[-1].base, sp.sqrt(coefficient)))
    return parts if len(parts) in (2, 3) else None


def _branch(e, lam, side):
    """A lifted expression on one side of a switch, if it is a selection by it or its multiplier."""
    if isinstance(e, Select) and e.args[0] == lam:
        return e.args[1] if side > 0 else e.args[2]
    return sp.Integer(side) if e == lam else e


def _side(lam):
    """The sign of a switch's surface at an instant: 0 on it, whatever multiplier holds the motion there."""
    return sp.Piecewise((1, lam >= 1), (-1, lam <= -1), (0, True), evaluate=False)


def _holds(relation, h, within):
    """The condition h > 0, h >= 0, ... where h may be off by `within`."""
    if relation in (sp.Eq, sp.Ne):
        near = sp.And(h <= within, h >= -within)
        return near if relation is sp.Eq else sp.Not(near)
    return relation(h, within if relation in (sp.Gt, sp.Le) else -within)


def _order(a, b):
    """1 if a >= b for all values of the symbols, -1 if a <= b, 0 if that is not known."""
    difference = a - b
    return 1 if difference.is_nonnegative else -1 if difference.is_nonpositive else 0


def _without_cosines(e):
    """`e` with 1 - sin**2 for cos**2 where that makes it shorter: r**2 (cos**2 + sin**2) is r**2.

    Not `simplify`, which factorises: an angle of random expressions kept it busy for hours.
    """
    if not e.has(sp.cos) or e.count_ops() >= 60:
        return e
    shorter = e.expand().replace(lambda q: q.is_Pow and q.exp == 2 and isinstance(q.base, sp.cos),
                                 lambda q: 1 - sp.sin(*q.base.args) ** 2).expand()  # fmt: skip
    return shorter if shorter.count_ops() < e.count_ops() else e


def _const(expr):
    return lambda sides: expr
