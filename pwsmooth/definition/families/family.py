"""Family: n elements of one kind, for multistate laws and spring-block chains.

    dz_i/dt = q(z_i, z_{i+1}, z_{i-1}, kappa_i, ...),   i = 1, ..., n;     sums over i in any rate

An element is written once, with member symbols. From a few elements on the System lowers that one element and the
generated code loops over all (one_element.py); below, and for what has no template, the n elements are written out.
Chain: primitives.py -> family (here) -> expansion.py -> system.py.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass

import numpy as np
import sympy as sp

from ...door import checks
from ..primitives import Component, Memory, Reaction, Switch


@checks.door()
@dataclass(frozen=True)
class Family:
    """A number of elements of one kind, written once.

    Parameters
    ----------
    n : int
        Number of elements, at least 1.
    periodic : bool
        The neighbour of the last element is the first one.
    name : str
        Tells families of the same size apart.

    Raises
    ------
    ValueError
        `n` is no integer >= 1.

    Notes
    -----
    From 8 elements on one element is lowered and the generated code loops over all, so that n does not matter for the
    time to set up. Contacts and friction between neighbours by a table, elements that act on each other's multipliers
    otherwise, hidden terms on surfaces that slide (but for static friction), vector switches (`Disc`) and switches that
    can slide to second order (relays on positions) have no template: their elements are written out, as are those of
    layered views with a layer of their own (ratios other than infinity). Smoothed views are looped, with all of these
    but one: a layer around what a sum is in. In large families an event costs its neighbourhood alone: see `solve`.

    Ten Maxwell-slip elements in parallel, each with its own stiffness and strength:

    >>> x, v = sp.symbols("x v", real=True)
    >>> elements = Family(10)
    >>> (f,) = elements.symbols("f")
    >>> kappa, strength = elements.symbols("kappa strength", positive=True)
    >>> rates = {f: kappa*v*sp.Heaviside(strength - f*sp.sign(v)), v: -x - elements.sum(f), x: v}
    >>> values = {kappa: [2.5/i for i in range(1, 11)], strength: 0.2}

    A ring of eight elements, each driven by the one before:

    >>> ring = Family(8, periodic=True)
    >>> (y,) = ring.symbols("y")
    >>> system = System({y: ring.neighbour(y, -1) - y})
    >>> solution = solve(system, (0, 60), {y: [8.0, 0, 0, 0, 0, 0, 0, 0]})
    >>> print(f"{solution.x[:, -1].min():.6f} to {solution.x[:, -1].max():.6f}")
    1.000000 to 1.000000
    """

    n: int
    periodic: bool = False
    name: str = "element"

    def __post_init__(self):
        checks.fields(self, n=checks.integer(1, 10**7), periodic=checks.flag, name=checks.name)

    @checks.door(checks.ASSUMPTIONS)
    def symbols(self, names, **assumptions):
        """Symbols of the element: states, parameters or unknowns, by what the System makes of them.

        Parameters
        ----------
        names : str
            Separated by spaces or commas.
        **assumptions
            As of `sympy.symbols`; real by default.

        Returns
        -------
        tuple of Member
            One for each name; it stands for the symbols of all elements.
        """
        assumptions = {"real": True} | assumptions
        names = checks.name(names, "`names`")
        return tuple(Member(name, self, **assumptions) for name in names.replace(",", " ").split())

    def at(self, member, place):
        """The symbol of one element, or of several: to start it, to look at it, to couple it with what is no element.

        Parameters
        ----------
        member : Member
            A symbol of this family, or a memory.
        place : int or slice
            1, ..., n, as in the names of the symbols; -1, ..., -n from the end. A slice counts so too, both ends
            included.

        Returns
        -------
        Symbol, or tuple of Symbol
            As they stand in `System.states`.

        Raises
        ------
        ValueError, TypeError
            A symbol of another family; a place that the family does not have.

        The last of four masses pulls at a weight:

        >>> import sympy as sp
        >>> chain = Family(4)
        >>> (x,) = chain.symbols("x")
        >>> chain.at(x, -1), chain.at(x, slice(2, 3))
        (x_4, (x_2, x_3))
        """
        if not isinstance(member, (Member, MemberMemory)) or member.family != self:
            raise TypeError(f"`member` is {checks.shown(member)}; give a symbol of this family.")
        if isinstance(place, slice):
            first = 1 if place.start is None else self._place(place.start)
            last = self.n if place.stop is None else self._place(place.stop)
            step = 1 if place.step is None else checks.whole(place.step, "the step of `place`", 1)
            return tuple(member.of_element(k - 1) for k in range(first, last + 1, step))
        return member.of_element(self._place(place) - 1)

    def _place(self, place):
        place = checks.whole(place, "`place`", -self.n, self.n)
        if place == 0:
            raise ValueError(f"`place` is 0; give 1 to {self.n}, or -1 to {-self.n} from the end.")
        return place if place > 0 else self.n + 1 + place

    @checks.door(name=checks.name)
    def memory(self, name, initial=0.0):
        """A Memory of the element.

        Parameters
        ----------
        name : str
            Its name, to which the number of the element is added.
        initial : float
            Value at the start of every element, in the unit that the model gives it.

        Returns
        -------
        MemberMemory
            It stands for the memories of all elements.
        """
        return MemberMemory(name, initial, self)

    @property
    def index(self):
        """The number i = 1, ..., n of the element, as a symbol."""
        return Member("i", self, integer=True, positive=True)

    def neighbour(self, member, offset, outside=None):
        """The member `offset` places further along the chain.

        Parameters
        ----------
        member : Member, MemberMemory, Switch or Reaction
            A symbol of this family, a memory, or the multiplier of a switch or a contact of its elements.
        offset : int
            Places; negative ones are before.
        outside : Expr, optional
            What stands for it beyond an end of the chain; by default the member itself, which makes the ends
            free (differences vanish there), and 0 for a multiplier. A contact, an event or a switch whose surface
            then reads nothing of the neighbour is none of that element.

        Returns
        -------
        Member or OfNeighbour
            To stand in the rates of the element, in the surface of a contact, an event or a switch.

        Raises
        ------
        ValueError, TypeError
            `outside` in a periodic family; a symbol of another one.
        """
        held = isinstance(member, MemberMemory | Switch | Reaction)
        held = held and {m.family for m in members(member)} == {self}
        if not held and (not isinstance(member, Member) or member.family != self):
            raise TypeError(f"`member` is {checks.shown(member)}; give a symbol of this family.")
        offset = checks.whole(offset, "`offset`", -self.n, self.n)
        if self.periodic and outside is not None:
            raise ValueError("`outside` has no meaning in a periodic family, which has no ends.")
        free = sp.S.Zero if isinstance(member, (Switch, Reaction)) else member
        outside = free if outside is None else checks.expression(outside, "`outside`")
        if held:
            return OfNeighbour(member, self, offset, outside)
        if member.links is not None:
            raise ValueError(f"`member` is {member}, a neighbour by a table; take the element's own symbol.")
        return Member(member.name, self, member.offset + offset, outside, **member._assumptions_orig)

    def links(self, neighbours):
        """Neighbours by a table: a lattice, a random graph, any couplings that are no chain.

        Parameters
        ----------
        neighbours : array_like of int, shape (n, d), or sparse matrix, shape (n, n), dimensionless
            Numbers 1, ..., n of the d neighbours of each element, an element's own number where it has fewer; of a
            sparse matrix those of the entries in its row.

        Returns
        -------
        Links
            `links.sum(lambda at: k * (at(x) - x))` stands in the rates of the element.

        Raises
        ------
        ValueError, TypeError
            A number that no element has.

        >>> triangle = Family(3)
        >>> (x,) = triangle.symbols("x")
        >>> triangle.links([[2, 3], [3, 1], [1, 2]]).sum(lambda at: at(x) - x)
        -2*x + x[link 1] + x[link 2]
        """
        if hasattr(neighbours, "tocsr"):
            neighbours = _table_of(neighbours.tocsr(), self.n)
        table = checks.array(neighbours, "`neighbours`")
        if (
            table.ndim != 2
            or table.shape[0] != self.n
            or table.shape[1] == 0
            or not (table == np.floor(table)).all()
        ):
            raise ValueError(
                f"`neighbours` has the shape {table.shape}; give a row of whole numbers for each of {self.n} elements."
            )
        if table.min() < 1 or table.max() > self.n:
            wrong = table[(table < 1) | (table > self.n)][0]
            raise ValueError(f"`neighbours` names element {wrong:g}; the family has 1 to {self.n}.")
        return Links(self, table.astype(np.int64) - 1)

    def lattice(self, shape, periodic=False):
        """The nearest neighbours in a rectangular lattice of the elements, numbered row by row.

        Parameters
        ----------
        shape : sequence of int
            Elements along each axis; their product is n.
        periodic : bool
            Whether opposite faces are joined; else faces are free.

        Returns
        -------
        Links
            As of `links`: 2 for each axis.

        Raises
        ------
        ValueError
            A shape of another number of elements.

        >>> plate = Family(6)
        >>> (x,) = plate.symbols("x")
        >>> plate.lattice((2, 3)).sum(lambda at: at(x) - x)
        -4*x + x[link 1] + x[link 2] + x[link 3] + x[link 4]
        """
        shape = tuple(checks.whole(k, "`shape`", 1) for k in shape)
        if math.prod(shape) != self.n:
            raise ValueError(
                f"`shape` {shape} has {math.prod(shape)} places; give one for each of {self.n} elements."
            )
        checks.flag(periodic, "`periodic`")
        own = np.arange(self.n).reshape(shape)
        columns = []
        for axis in range(len(shape)):
            for step in (-1, 1):
                beside = np.roll(own, step, axis)
                if not periodic:
                    face = [slice(None)] * len(shape)
                    face[axis] = slice(0, 1) if step == 1 else slice(-1, None)
                    beside[tuple(face)] = own[tuple(face)]
                columns.append(beside.ravel())
        return Links(self, np.stack(columns, axis=1))

    def sum(self, expr):
        """The sum of an expression over all elements.

        Parameters
        ----------
        expr : Expr
            With members of the family; without any it is taken n times.

        Returns
        -------
        Expr
            To stand in the rates of any state.
        """
        expr = checks.expression(expr, "`expr` of a sum")
        return MemberSum(expr) if members(expr) else self.n * expr


def _table_of(matrix, n):
    """Neighbours 1, ..., n of the elements by the rows of a sparse matrix."""
    if matrix.shape != (n, n):
        raise ValueError(f"`neighbours` has the shape {matrix.shape}; give a matrix of {n} rows and columns.")
    counts = np.diff(matrix.indptr)
    table = np.repeat(np.arange(1, n + 1)[:, None], max(int(counts.max(initial=0)), 1), axis=1)
    column = np.arange(len(matrix.indices)) - np.repeat(matrix.indptr[:-1], counts)
    table[np.repeat(np.arange(n), counts), column] = matrix.indices + 1
    return table


class Links:
    """Neighbours of elements by a table; made by `Family.links` and `Family.lattice`.

    Attributes
    ----------
    family : Family
    table : ndarray of int, shape (n, d)
        Numbers 0, ..., n - 1 of the neighbours; an element's own number where it has fewer.
    """

    def __init__(self, family, table):
        self.family, self.table = family, np.ascontiguousarray(table)
        self.table.flags.writeable = False
        self._content = hashlib.sha256(self.table.tobytes()).hexdigest()[:16]

    def __eq__(self, other):
        return isinstance(other, Links) and (self.family, self._content) == (other.family, other._content)

    def __hash__(self):
        return hash((self.family, self._content))

    def neighbour(self, member, k):
        """The member of the k-th neighbour.

        Parameters
        ----------
        member : Member
            A symbol of the family.
        k : int
            Column of the table, 1 to d.

        Returns
        -------
        Member
            To stand in the rates of the element.

        Raises
        ------
        ValueError, TypeError
            No such column; a symbol of another family.
        """
        if not isinstance(member, Member) or member.family != self.family or member.offset or member.links:
            raise TypeError(f"`member` is {checks.shown(member)}; give a symbol of the family.")
        k = checks.whole(k, "`k`", 1, self.table.shape[1])
        return Member(member.name, self.family, k, member, self, **member._assumptions_orig)

    def sum(self, term):
        """The sum of a term over the neighbours of the element.

        Parameters
        ----------
        term : callable
            term(at) -> Expr, where `at(member)` is the member of a neighbour. It must vanish for the element itself,
            which stands for neighbours that it does not have.

        Returns
        -------
        Expr
            To stand in the rates of the element.
        """
        return sp.Add(
            *(term(lambda member, k=k: self.neighbour(member, k)) for k in range(1, self.table.shape[1] + 1))
        )


class Member(sp.Symbol):
    """A symbol of every element of a family; made by `Family.symbols` and `Family.neighbour`.

    Of a neighbour by a table, `offset` is the column of its `links`.
    """

    __slots__ = ("family", "links", "offset", "outside")

    def __new__(cls, name, family, offset=0, outside=None, links=None, **assumptions):
        self = sp.Symbol.__xnew__(cls, name, **assumptions)
        self.family, self.offset, self.outside, self.links = family, offset, outside, links
        return self

    def __getnewargs_ex__(self):
        return (self.name, self.family, self.offset, self.outside, self.links), self._assumptions_orig

    def _hashable_content(self):
        family = (self.family.name, self.family.n, self.family.periodic)
        outside = sp.S.NaN if self.outside is None else self.outside
        # sympy compares what is equal but not the same entry by entry, and None with nothing.
        links = self.links._content if self.links else ""
        return (*super()._hashable_content(), *family, self.offset, outside, links)

    def sort_key(self, order=None):
        """A neighbour has the name of the member itself: the offset decides in which order they are printed."""
        one = sp.S.One
        return self.class_key(), (3, (self.name, self.family.name, self.offset)), one.sort_key(), one

    def _sympystr(self, printer):
        if self.links is not None:
            return f"{self.name}[link {self.offset}]"
        return self.name if not self.offset else f"{self.name}[{self.offset:+d}]"

    def of_element(self, k):
        """The plain symbol of element k = 0, ..., n - 1, or what stands for it outside of the chain."""
        if self.links is not None:
            k = int(self.links.table[k, self.offset - 1])
        else:
            k += self.offset
        if self.family.periodic:
            k %= self.family.n
        elif not 0 <= k < self.family.n:
            return None
        if self.name == "i" and self.is_integer:
            return sp.Integer(k + 1)
        return sp.Symbol(f"{self.name}_{k + 1}", **self._assumptions_orig)


class MemberMemory(Memory):
    """A Memory of every element of a family; made by `Family.memory`."""

    __slots__ = ("family",)

    def __new__(cls, name, initial, family):
        self = Memory.__new__(cls, name, initial)
        self.family = family
        return self

    def __getnewargs_ex__(self):
        return (self.name, self.initial, self.family), {}

    def _hashable_content(self):
        return (*super()._hashable_content(), self.family.name, self.family.n, self.family.periodic)

    def of_element(self, k):
        return Memory(f"{self.name}_{k + 1}", self.initial)


class OfNeighbour(sp.Symbol):
    """A memory or a multiplier of a neighbour; made by `Family.neighbour`."""

    __slots__ = ("family", "of", "offset", "outside")

    def __new__(cls, of, family, offset, outside):
        self = sp.Symbol.__xnew__(cls, f"{of.name}[{offset:+d}]", real=True)
        self.of, self.family, self.offset, self.outside = of, family, offset, outside
        return self

    def __getnewargs_ex__(self):
        return (self.of, self.family, self.offset, self.outside), {}

    def _hashable_content(self):
        return (*super()._hashable_content(), self.of, self.family.n, self.family.periodic, self.outside)


class MemberSum(sp.Function):
    """A sum over all elements of the family of the members inside; made by `Family.sum`."""

    nargs = 1


def members(e):
    """Members outside of sums, also those inside of surfaces and gaps."""
    if isinstance(e, MemberSum):
        return set()
    if isinstance(e, (Member, MemberMemory, OfNeighbour)):
        return {e}
    if isinstance(e, Switch):
        return members(e.surface)
    if isinstance(e, Reaction):
        return members(e.gap) | members(e.restitution)
    if isinstance(e, Component):
        return set().union(*map(members, e.disc.surfaces))
    return set().union(*(members(a) for a in e.args)) if e.args else set()


def involved(e):
    """Do members stand in an expression, sums and surfaces included?"""
    for s in e.free_symbols:
        if isinstance(s, (Member, MemberMemory, OfNeighbour)):
            return True
        if any(involved(getattr(s, a)) for a in ("surface", "gap", "restitution") if hasattr(s, a)):
            return True
        if isinstance(s, Component) and any(map(involved, s.disc.surfaces)):
            return True
    return False


def family_of(*expressions):
    """The one family whose members stand in the expressions, or None."""
    families = {m.family for e in expressions for m in members(e)}
    if len(families) > 1:
        names = ", ".join(sorted(f.name for f in families))
        raise ValueError(f"members of several families ({names}) stand in one equation; sum over one of them.")
    return families.pop() if families else None
