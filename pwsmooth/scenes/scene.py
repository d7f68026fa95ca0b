"""The contract of a scene: mechanism + law + drive as one System, with what figures, sweeps and charts need of it.

Chain: laws -> **scene** -> analysis, sweep, figures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..door import calls, checks
from ..door.describe import Described, Rows, listed, values
from ..laws import Pieces
from ..results.solution import Solution
from ..solving import solve
from ..system import System
from . import drive
from .sketch import Sketch

__all__ = ["Scene", "assemble"]

ATOL = 1e-12  # solve's own, for a state of size 1


@checks.door()
@dataclass(frozen=True, repr=False)
class Scene(Described):
    """A model ready to run: mechanism, law and drive as one System, with its start and its span.

    Parameters
    ----------
    name : str
        For titles.
    system : System
        The model.
    x0 : mapping of state name to float
        Initial state, in the units of the states.
    period : float, s, optional
        Period of the forcing; None if there is none.
    observables : mapping of str to (str or callable)
        Name -> output of the solution, or a function of the Solution.
    units : mapping of str to str
        Of states, outputs and parameters.
    note : str
        Source, and what is reconstructed.
    atol : mapping of str to float
        Absolute tolerances, in the unit of the state, of states whose usual size is far from 1; `solve` takes them
        unless it is given others.
    sketch : Sketch, optional
        The mechanism as shapes that move, for films and pages.

    >>> x, v = sp.symbols("x v", real=True)
    >>> scene = Scene("block", System({x: v, v: -x - sp.sign(v)}), {"x": 3.5, "v": 0.0}, (0, 10),
    ...               observables={"end": lambda s: s["x"][-1]})
    >>> solution = scene.solve()
    >>> round(float(scene.observe(solution)["end"]), 9)
    -0.5
    """

    name: str
    system: System
    x0: Mapping[str, float]
    t_span: tuple[float, float]
    period: float | None = None
    observables: Mapping[str, str | Callable[[Solution], Any]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    atol: Mapping[str, float] = field(default_factory=dict)
    sketch: Sketch | None = None

    def __post_init__(self) -> None:
        checks.fields(
            self, name=checks.name, system=checks.system, x0=checks.mapping, t_span=checks.span,
            period=checks.optional(checks.positive), observables=checks.mapping, units=checks.mapping,
            note=checks.name, atol=checks.mapping,
            sketch=checks.optional(checks.instance(Sketch, "a Sketch of shapes")),
        )  # fmt: skip

    def _described(self) -> tuple[str, Rows]:
        _, of_system = self.system._described()
        return f"Scene: {self.name}", {
            "span": [f"{self.t_span[0]:.9g} to {self.t_span[1]:.9g}"],
            "period": [] if self.period is None else [f"{self.period:.9g}"],
            "x0": values(self.x0, self.x0.values()),
            "observables": listed(list(self.observables)),
            "note": [self.note] if self.note else [],
            **dict(of_system),
        }.items()

    @checks.door(calls.SOLVE)
    def solve(self, t_span: Any = None, x0: Any = None, **options: Any) -> Solution:
        """Solve the system from `x0` over `t_span`; both may be replaced.

        Parameters
        ----------
        t_span : (float, float), s, optional
            Another span.
        x0 : mapping or sequence of float, length n, optional
            Another start, in the units of the states.

        Returns
        -------
        Solution
            With the scene's absolute tolerances, unless `atol` is given.
        """
        if self.atol:
            options.setdefault("atol", [self.atol.get(s.name, ATOL) for s in self.system.states])
        solution = solve(
            self.system, self.t_span if t_span is None else t_span, self.x0 if x0 is None else x0, **options
        )
        solution.sketch = self.sketch
        return solution

    @checks.door(solution=checks.instance(Solution, "a Solution, as solve() gives it"))
    def observe(self, solution: Solution) -> dict[str, Any]:
        """The observables of a solution of this scene.

        Parameters
        ----------
        solution : Solution
            Of this scene's system.

        Returns
        -------
        dict of str to ndarray
            Arrays over the solution's times, shape (nt,), in the scene's `units`, or what the functions return.
        """
        return {
            name: what(solution) if callable(what) else solution[what]
            for name, what in self.observables.items()
        }


def scene_of(
    name, law, t_span, rates, pieces, observed, *, period=None, units=None, note=None, sketch=None, **parts
):
    """The scene of a law: its system, assembled for the start of the span, with the observables named alike."""
    system, start, atol = assemble(rates, pieces, time=drive.t, begin=t_span[0], **parts)
    return Scene(
        f"{name}, {type(law).__name__}", system, start, (t_span[0], t_span[1]), period, {n: n for n in observed},
        law.units() if units is None else units, note or law.source, atol, sketch,
    )  # fmt: skip


@checks.door(
    rates=checks.mapping, x0=checks.mapping, begin=checks.number,
    **dict.fromkeys(("parameters", "outputs"), checks.optional(checks.mapping)),
    **dict.fromkeys(("events", "contacts", "algebraic"), checks.several),
)  # fmt: skip
def assemble(
    rates: Mapping[Any, Any],
    pieces: Pieces | Iterable[Pieces],
    *,
    time: Any = None,
    x0: Mapping[Any, float],
    parameters: Mapping[Any, Any] | None = None,
    outputs: Mapping[str, Any] | None = None,
    events: Iterable[Any] = (),
    contacts: Iterable[Any] = (),
    algebraic: Iterable[Any] = (),
    drives: Mapping[Any, Any] | None = None,
    begin: float = 0.0,
) -> tuple[System, dict[str, float], dict[str, float]]:
    """A System of a mechanism's own equations and the pieces of its laws.

    Parameters
    ----------
    rates : mapping of state to Expr
        The mechanism's own equations.
    pieces : Pieces or iterable of Pieces
        What laws brought to its joints.
    time : Symbol, optional
        Needed if time stands in an expression.
    x0 : mapping of state to float
        Initial values of the mechanism's states, in their units; laws bring their own, which may be expressions of
        the motion at the time `begin`.
    parameters : mapping of Symbol to float, optional
        The mechanism's, in its units.
    outputs : mapping of str to Expr, optional
        The mechanism's.
    events, contacts, algebraic : iterable
        The mechanism's own Event, Unilateral and Algebraic.
    drives : mapping of symbol to Drive, optional
        Sampled inputs.
    begin : float, s
        Time of the start.

    Returns
    -------
    (System, dict, dict)
        The system, its initial state and absolute tolerances, both by name of the state and in its unit.

    Raises
    ------
    ValueError
        Two of them use one name; `attach(name=...)` tells laws apart.

    A block between two walls of Hertz's kind:

    >>> x, v = sp.symbols("x v", real=True)
    >>> right = Hertz().attach(position=x - 1, velocity=v, name="right")
    >>> left = Hertz().attach(position=-1 - x, velocity=-v, name="left")
    >>> system, begin, atol = assemble({x: v, v: left.force - right.force}, [left, right], x0={x: 0.0, v: 1.0})
    >>> solution = solve(system, (0, 4), begin)
    >>> [event.switch for event in solution.events if event.kind == "reset"]
    ['touch-down_right', 'lift-off_right', 'touch-down_left', 'lift-off_left']
    """
    all_pieces = [pieces] if isinstance(pieces, Pieces) else checks.all_of_kind("pieces", pieces, Pieces)
    rates, values, shown = dict(rates), dict(parameters or {}), dict(outputs or {})
    first = dict(x0)
    parts = {"events": list(events), "contacts": list(contacts), "algebraic": list(algebraic)}
    for piece in all_pieces:
        for mine, theirs in ((rates, piece.rates), (values, piece.parameters), (shown, piece.outputs)):
            common = {str(key) for key in mine} & {str(key) for key in theirs}
            if common:
                raise ValueError(
                    f"two parts of the system use the name {', '.join(sorted(common))}; give each law its own "
                    "`attach(name=...)`."
                )
            mine.update(theirs)
        first.update(piece.start)
        for name, items in parts.items():
            items += getattr(piece, name)
    system = System(rates, time=time, parameters=values, outputs=shown, drives=drives, **parts)
    groups = system.groups
    known = {p.name: v for p, v in system.parameters.items()} | ({} if time is None else {str(time): begin})
    known |= {str(symbol): record.at(begin) for symbol, record in (drives or {}).items()}
    for own in (x0, first):  # the mechanism's own are numbers; a law's may be expressions of them
        known |= {str(key): drive.value(e, known, f"`x0`, value of {key}") for key, e in own.items()}

    def each(of: Mapping[Any, Any], number: Callable[[Any], float]) -> dict[str, float]:
        return {name: number(e) for key, e in of.items() for name in groups.get(str(key), (str(key),))}

    scales = {key: scale for piece in all_pieces for key, scale in piece.scales.items()}
    begin_values = each({key: known[str(key)] for key in first}, float)
    return system, begin_values, each(scales, lambda scale: ATOL * scale)
