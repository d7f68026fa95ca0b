"""Diffusions: dx = f(t, x, lambda) dt + G(t, x, lambda) dW, in Ito's sense, as the user gives them.

Chain: **this file** -> solve, ensemble -> diffusion_run.py -> lowering.py (symbols) -> kernels/noise/path.py.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from ..definition.families.between import NoTemplate
from ..definition.families.expansion import Expansion
from ..definition.families.template import MARK
from ..definition.one_element import OneElement
from ..door import checks

# Index of a state, source (a name, and 0 where each element has its own of that name), amplitude.
Entry = tuple[int, tuple[str, int | None], sp.Expr]


@checks.door()
@dataclass(frozen=True)
class Diffusion:
    """White noise that drives some states, with constant or state-dependent amplitude.

    Parameters
    ----------
    amplitude : mapping or Matrix
        State -> expression: each such state has a source of its own. State -> {source name: expression}: sources
        may be shared. A Matrix has one row a state, one column a source. Expressions in states, time, parameters
        and, of a smoothed view, switches; unit: that of the state over the root of time. The member of a `Family`
        stands for the states of all elements, each with a source of its own unless that is named, and its expression
        for that of each element.
    step : float, in units of time
        The interval of time, > 0, on whose multiples the path is given, and the longest step: short against the times
        over which the drift varies. Steps are halves, quarters, ... of it where the drift is faster, and beside
        surfaces. The start, the end and `t_eval` are multiples of it.
    seed, trajectory : int
        The Brownian path is a function of (seed, trajectory, step), whatever steps are taken along it.
    parameters : mapping of Symbol to float, optional
        Values of symbols that stand in the amplitude alone, in the units of the model.
    convention : {"ito", "stratonovich"}
        How the amplitude is meant.
    resolution : float, dimensionless
        Steps keep to `resolution` over the rate of the drift, and cross at most 2.5 `resolution` of a layer.
    level : int
        Every interval is halved at least so often: the same path, finer steps.
    finest : int
        Further halvings beside a surface on which the noise acts (a switch, an event).

    Raises
    ------
    ValueError, TypeError
        Here: sizes and integers out of range. In solve(): states or symbols that do not exist, an amplitude that
        cannot be differentiated by the states, columns that do not commute.

    Notes
    -----
    Between switches: strong order 1.5 and weak order 2 in the step where the amplitude is constant (Roessler's
    SRA1), strong and weak order 1 where it depends on the state (Milstein). Across a switch on whose surface the
    noise acts, the drift is discontinuous and the order falls: about 3/4 strong with equal steps; with one level
    of `finest` more for each level, so that the steps beside the surface shrink as the square, about 1 in the mean
    number of steps.

    An event on whose surface the noise acts happens where the path first meets that surface, also in the midst of a
    step: as a Brownian bridge does between the ends of the shortest steps, of step / 2**(level + finest). Its state is
    on the surface, and mean first passages are right to first order in the shortest step.

    Noise that acts on a switch's surface leaves no sticking at eps = 0: the path meets the surface in a set of
    times of measure zero, and terms hidden on it never act (a warning says so). Noise on other states leaves
    sticking as it is, and makes its end a first passage of the multiplier; how many of the short slips that follow
    such an end are seen depends on `step` and `finest`. Noise that acts on the surface of a `Disc` leaves no sticking
    either: lambda = h/|h|, with finer steps about h = 0. A disc that the noise leaves alone sticks and slips; a slip
    whose direction turns faster than the steps beside h = 0 (`finest`) has one lambda a step, that of its end.

    Source: Roessler, SIAM J. Numer. Anal. 48 (2010) 922-952 for SRA1; Milstein, Theory Probab. Appl. 19 (1974) 557-562;
    the orders across a switch were measured here.

    >>> x = sp.Symbol("x")
    >>> path = solve(System({x: -x}), (0, 1), {x: 0}, noise=Diffusion({x: 0.3}, step=1 / 64, seed=5))
    >>> len(path.t)
    65
    """

    amplitude: Any
    step: float
    seed: int = 0
    trajectory: int = 0
    parameters: Mapping[Any, float] = field(default_factory=dict)
    convention: str = "ito"
    resolution: float = 0.1
    level: int = 0
    finest: int = 6

    def __post_init__(self) -> None:
        set_to = functools.partial(object.__setattr__, self)
        set_to("step", checks.positive(self.step, "`step` of the diffusion"))
        set_to("resolution", checks.positive(self.resolution, "`resolution`"))
        if self.resolution > 0.5:
            raise ValueError(f"`resolution` is {self.resolution:g}; give a number up to 0.5, such as 0.1.")
        checks.fields(self, convention=checks.one_of("ito", "stratonovich"))
        for name in ("seed", "trajectory"):
            set_to(name, checks.exact_integer(getattr(self, name), f"`{name}`"))
        for name in ("level", "finest"):
            set_to(name, checks.whole(getattr(self, name), f"`{name}`", 0, 20))
        if not isinstance(self.amplitude, (Mapping, sp.MatrixBase)):
            raise TypeError(
                f"`amplitude` is {checks.shown(self.amplitude)}; give state -> expression, such as {{v: 0.1}}, or a "
                "sympy Matrix."
            )
        if isinstance(self.amplitude, Mapping):
            set_to("amplitude", {str(key): _entry(key, value) for key, value in self.amplitude.items()})
            if not self.amplitude:
                raise ValueError(
                    "`amplitude` is empty; name the states that the noise drives, such as {v: 0.1}."
                )
        set_to("parameters", checks.values(self.parameters, "`parameters` of the diffusion"))
        inside = {s.name for e in self._expressions() for s in e.free_symbols}
        if unknown := [name for name in self.parameters if name not in inside]:
            raise ValueError(
                f"`parameters` of the diffusion names {checks.listing(unknown)}, which is not in the amplitude; leave "
                "it out."
            )

    def _expressions(self) -> list[sp.Expr]:
        if isinstance(self.amplitude, sp.MatrixBase):
            return [checks.expression(e, "`amplitude`, an entry") for e in self.amplitude]
        return [e for row in self.amplitude.values() for e in row.values()]

    def entries(self, states: Sequence[sp.Symbol], groups: Mapping[str, Sequence[str]]) -> list[Entry]:
        """The entries of the amplitude that are not 0.

        Parameters
        ----------
        states : sequence of Symbol
            States of the view, in order.
        groups : mapping of str to sequence of str
            Names of a family's member in all elements.

        Returns
        -------
        list of (int, (str, None), Expr)
            Index of the state, name of the source, expression in the unit of the state over the root of time.

        Raises
        ------
        ValueError
            A state that the view does not have; a Matrix with another number of rows.
        """
        if isinstance(self.amplitude, sp.MatrixBase):
            if self.amplitude.rows != len(states):
                raise ValueError(
                    f"`amplitude` has {self.amplitude.rows} rows; this view has {len(states)} states "
                    f"({checks.listing(states)})."
                )
            rows, columns = self.amplitude.shape
            found = [(i, f"source {k + 1}", self.amplitude[i, k]) for i in range(rows) for k in range(columns)]
            return [(i, (source, None), e) for i, source, e in found if not e.is_zero]
        written, entries = Expansion(), []
        for name, source, e in self._written():
            members = groups.get(name)
            for k, own in enumerate(members or (name,)):
                i = states.index(checks.lookup(own, states, "`amplitude`", "state"))
                entries.append((
                    i, (own if source == name else source, None), written.element(e, k if members else None)
                ))  # fmt: skip
        return [entry for entry in entries if not entry[2].is_zero]

    def _written(self):
        """(state, source, expression) as given."""
        return [(name, source, e) for name, row in self.amplitude.items() for source, e in row.items()]

    def of_elements(self, states: Sequence[sp.Symbol], groups: Mapping[str, Sequence[str]]) -> list[Entry]:
        """The entries in the symbols of one element of each family, which stands for all.

        Parameters
        ----------
        states : sequence of Symbol
            States of one element and of the whole, in order.
        groups : mapping of str to sequence of str
            Names of a family's member in all elements.

        Returns
        -------
        list of (int, (str, int or None), Expr)
            As of `entries`; a source with a 0 is each element's own.

        Raises
        ------
        ValueError
            One element does not tell what the others do.
        """
        if isinstance(self.amplitude, sp.MatrixBase):
            raise NoTemplate("a row for each state")
        one, by_name, entries = OneElement(), {s.name: i for i, s in enumerate(states)}, []
        for name, source, e in self._written():
            member = name in groups
            block = by_name.get(f"{name}{MARK}" if member else name)
            if block is None:
                raise NoTemplate("the state of one element")
            own = 0 if member and source == name else None
            entries.append((block, (source, own), one.element(e, 0 if member else None)))
        return [entry for entry in entries if not entry[2].is_zero]

    def _prepared(self, system: Any) -> Any:
        """What drives this system; None where the amplitude is 0.

        Raises
        ------
        ValueError
            What a diffusion cannot drive.
        """
        from .diffusion_run import DiffusionRun

        run = DiffusionRun(system, self)
        return run if run.acts else None

    def __str__(self) -> str:
        if isinstance(self.amplitude, sp.MatrixBase):
            shown = str(self.amplitude.tolist())
        else:
            shown = ", ".join(
                f"{sp.sstr(e, full_prec=False)} dW[{source}] on {state}"
                for state, row in self.amplitude.items()
                for source, e in row.items()
            )
        values = "".join(f", {name} = {value:g}" for name, value in self.parameters.items())
        return (
            f"{self.convention} diffusion {shown}{values}, step {self.step:g}, seed {self.seed}, "
            f"trajectory {self.trajectory}"
        )


def _entry(state: Any, value: Any) -> dict[str, sp.Expr]:
    sources = value if isinstance(value, Mapping) else {str(state): value}
    return {
        str(source): checks.expression(e, f"`amplitude` of {state}, source {source}")
        for source, e in sources.items()
    }
