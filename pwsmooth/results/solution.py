"""What a solve returns: states, multipliers and outputs by name, segments, events, itinerary, cost, outcome.

Place in the chain: solve() -> Solution -> plotting, analysis, sweeps. Columns of `t`, `x`, `mult` and `status`
belong together; an event contributes two columns of equal time, the state before it and the state after.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from ..definition.families.many import Numbers, Symbols
from ..definition.model import Model
from ..definition.views import substitutes
from ..door import calls, checks
from ..door.describe import Described, Rows, listed, values
from . import outputs
from .failures import blow_up_in_words, gaps_in_words
from .records import KINDS, Ambiguity, AmbiguityLog, Dense, EventLog, EventRecord, Listed, Outcome, Segment

if TYPE_CHECKING:
    import pandas
    import xarray

    from .sampling import Sampled

# What SciPy's solutions have, and where it is here.
_SCIPY = {
    "t_events": "take `event_times()`, or `events`, which say more",
    "y_events": "take `events`, and the columns at their times",
    "sol": "call it, solution(t), after solve(..., dense_output=True)",
    "nfev": "it is in `cost`",
    "njev": "it is in `cost`",
    "nlu": "it is in `cost`",
    "ts": "times are `t`",
    "ys": "states are `x`, and solution[name] is one of them",
}
MANY = 64  # multipliers, whose itinerary nobody reads
_FOLLOWING = "algebraic", "component"  # multipliers that follow the state or a disc, and have no word in it

__all__ = ["Ambiguity", "Dense", "EventRecord", "Outcome", "Segment", "Solution"]


def _rows(values: Any, dtype: Any, nt: int) -> np.ndarray:
    values = np.asarray(values, dtype)
    return values if values.ndim == 2 else values.reshape(-1, nt)


@checks.door()
class Solution(Described):
    """A solved trajectory.

    Indexing gives a state, multiplier or output by name at the solution's times, `solution["v"]`; calling it
    evaluates the dense output, `solution(t, "v")`.

    Parameters
    ----------
    system : System
        The view that was solved; `system.model` gives the names and the outputs.
    t : ndarray, shape (nt,)
        Times in the unit of the model's, not decreasing; an event has two columns, before and after.
    x, mult : ndarray, shapes (n, nt) and (m, nt)
        States (memories last) and multipliers, in the units of the model.
    status : ndarray of int8, shape (m, nt)
        +1 or -1 on a side of a switch's surface (+1 for an open contact), 0 while the multiplier is solved;
        dimensionless.
    events : sequence of EventRecord
        What happened, in order.
    dense : Dense or None
        The steps' polynomials, where they were kept.
    outcome : Outcome
        How the run ended.
    cost, tolerances : dict
        Counts (steps, evaluations, events, ...), and the tolerances that actually ran.
    ambiguities : sequence of Ambiguity
        Where the solution is not unique, and what was taken.
    parameters : mapping of (Symbol or str) to float
        Values of this run, in the units of the model.
    course : (ndarray, shape (k,), and ndarray, shape (m, k)), optional
        Times and statuses of the run from its start to its end, both sides of every event, where the columns are
        others (`t_eval`).
    backward : bool
        Whether the run went back in time, from the last column to the first.

    Attributes
    ----------
    noise : Kicks, Diffusion or None
        What `solve` was given; of a loaded solution in words, as a str.
    sketch : Sketch or None
        The mechanism of the scene that was solved, for `animate`.
    course : (ndarray, shape (k,), and ndarray, shape (m, k)), or None
        As given.
    derivatives : Derivatives or None
        By the quantities of `solve(by=...)`.

    Notes
    -----
    `t`, `y`, `success` and `message` are SciPy's names.

    Columns are the ends of steps, which are long, and the events: ``solution["x"].max()`` is the largest of these and
    not of the motion. The extremes themselves have columns with an event where the rate vanishes, such as
    ``Event(v)`` of a velocity v; ``solution.sample()["x"].max()`` comes near, with dense output.

    >>> x, v = sp.symbols("x v", real=True)
    >>> block = System({x: v, v: -x - sp.sign(v)}, outputs={"energy": (x**2 + v**2) / 2})
    >>> solution = solve(block, (0, 10), {x: 3.5, v: 0}, dense_output=True)
    >>> solution.itinerary
    ('slip left (sgn(v)=-1)', 'slip right (sgn(v)=+1)', 'stick (sgn(v) sliding)')
    >>> [f"{time:.6f}" for time in solution.event_times("crossing")], f"{solution['x'][-1]:.6f}"
    (['3.141593'], '-0.500000')
    >>> print(f"{solution(1.0, 'energy'):.6f}")
    4.975756
    """

    def __init__(
        self,
        system: Any,
        t: np.ndarray,
        x: np.ndarray,
        mult: np.ndarray,
        status: np.ndarray,
        events: Sequence[EventRecord],
        dense: Any,
        outcome: Outcome,
        cost: Mapping[str, Any],
        tolerances: Mapping[str, Any],
        ambiguities: Sequence[Ambiguity],
        parameters: Mapping[Any, float],
        course: tuple[np.ndarray, np.ndarray] | None = None,
        backward: bool = False,
    ) -> None:
        self.system = system
        self.t = np.asarray(t, dtype=float)
        nt = len(self.t)
        self.x, self.mult = _rows(x, float, nt), _rows(mult, float, nt)
        self.status = _rows(status, np.int8, nt)
        self.course = course and (course[0], _rows(course[1], np.int8, len(course[0])))
        self.backward = backward
        self.events = events if isinstance(events, EventLog) else Listed(events)
        self.dense = dense
        self.outcome = outcome
        self.cost = dict(cost)
        self.tolerances = dict(tolerances)
        self.ambiguities = ambiguities if isinstance(ambiguities, AmbiguityLog) else Listed(ambiguities)
        # A Symbol's name is what str() gives, a hundred times sooner.
        if isinstance(parameters, Numbers):
            self.parameters: Mapping[Any, float] = parameters
        else:
            self.parameters = {getattr(key, "name", key): float(value) for key, value in parameters.items()}
        self.noise: Any = None  # what solve(noise=...) was given
        self.sketch: Any = None  # of the scene that was solved
        self.tape: Any = (
            None  # paths/derivatives/tangents.py, of an event-driven run with dense output or derivatives
        )
        self.whole: Any = None  # of a run without a tape that was asked for times, the one with its own
        self.recorded: Any = None  # elements of a large family that were kept, and its events
        self.catalogue: Any = None
        self.statistics: Any = None  # of its events, by name
        self.derived: Any = None  # what makes the Derivatives of a run by=...

    @property
    def derivatives(self) -> Any:
        """The `Derivatives` of a run that was solved with `by`; None of any other."""
        # Made anew, on numbers that are kept: a solution that held what holds it would wait for the garbage collector.
        return None if self.derived is None else self.derived(self)

    # ---- scipy's names -----------------------------------------------------------------------------

    @property
    def y(self) -> np.ndarray:
        """States, shape (n, nt), in the units of the model."""
        return self.x

    @property
    def success(self) -> bool:
        """Whether the run did what was asked."""
        return self.outcome >= Outcome.FINISHED  # as Outcome.success, which long studies would feel

    @property
    def message(self) -> str:
        """The outcome in words, with what to try next."""
        if self.outcome in (Outcome.STEP_UNDERFLOW, Outcome.NOT_FINITE) and (blow_up := blow_up_in_words(self)):
            return f"{self.outcome.name.lower().replace('_', ' ')}: {blow_up}"
        if self.outcome is Outcome.BEHIND_CONTACT and (gaps := gaps_in_words(self)):
            return f"{self.outcome} At t = {self.t[-1]:.9g} {gaps}."
        named = {Outcome.SINGULAR_POINT: -1, Outcome.IRREVERSIBLE: 0}
        if self.outcome not in named or not self.events:
            return str(self.outcome)
        return f"{self.outcome} Here: {self.events[named[self.outcome]]}."

    # ---- names -------------------------------------------------------------------------------------

    @property
    def model(self) -> Model:
        """The lowered model of the view that was solved."""
        return self.system.model

    @functools.cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the states, memories last."""
        if isinstance(self.model.states, Symbols):
            return self.model.states
        return tuple(s.name for s in self.model.states)

    @functools.cached_property
    def _shown(self) -> tuple[str, ...]:
        """The states without the last ones, memories that number the cells of drives and hold pieces of controls."""
        cells = sum(len(event.update) for event in self.model.events if event.tables)
        pieces = sum(len(u._memories) for u in getattr(self.system, "_controls", ()))
        return self.states[: len(self.states) - cells - pieces]

    @functools.cached_property
    def multipliers(self) -> tuple[str, ...]:
        """Names of the multipliers: switches, contact forces, algebraic unknowns."""
        return tuple(m.symbol.name for m in self.model.multipliers)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names computed from states and multipliers: the outputs, slaved states, smoothed switches."""
        return tuple(self._expressions)

    @functools.cached_property
    def _expressions(self) -> Mapping[str, Any]:
        """Name -> expression; with a template, its place among the template's."""
        if self.model.families is not None:
            return outputs.names(self.model.families)
        own = {str(name): sp.sympify(expression, strict=True) for name, expression in self.model.outputs}
        return substitutes(self.system) | own

    def _lookup(self, name: Any, t: np.ndarray, x: np.ndarray, mult: np.ndarray) -> np.ndarray:
        name = str(name)
        if name in self.states:
            return x[self.states.index(name)]
        if name in self._expressions:
            given = self.parameters
            p = (
                given.array.tolist()
                if isinstance(given, Numbers)
                else [given[str(s)] for s in self.model.parameters]
            )
            with np.errstate(all="ignore"):  # branches that are not selected may be undefined there
                if self.model.families is not None:
                    return outputs.of_family(self.model, name, t, x, mult, p)
                result = outputs.vectorised(self.model, self._expressions[name])(t, *x, *mult, *p)
            found = np.array(np.broadcast_to(result, t.shape), dtype=float)
            if name in self.multipliers:  # a component of a disc: the direction in which a slip begins is 0/0
                found = np.where(np.isnan(found), mult[self.multipliers.index(name)], found)
            return found
        if name in self.multipliers:
            return mult[self.multipliers.index(name)]
        raise KeyError(f"{name!r} is {self._none_of_these(name)}")

    def _meant(self, name: str) -> str:
        """What a name in the place of times may have meant."""
        kinds = {
            "a state": self.states,
            "a multiplier": self.multipliers,
            "an output": self.outputs,
            "a parameter": self.parameters,
        }
        kind = next((kind for kind, names in kinds.items() if name in names), None)
        if kind is None:
            return f"give times. It is {self._none_of_these(name)}"
        if kind == "a parameter":
            return f"it is a parameter, whose value is solution.parameters[{name!r}]. Give times here."
        return f"it is {kind}: solution[{name!r}] at the solution's times, solution(t, {name!r}) at others."

    def _none_of_these(self, name: Any) -> str:
        known = (*self._shown, *self.multipliers, *self.outputs)
        return f"no state, multiplier or output of this solution; they are {', '.join(known)}.{calls.hint(name, known)}"

    def __iter__(self) -> Iterator[str]:
        """The names that indexing takes, but for the time."""
        return iter((*self._shown, *self.multipliers, *self.outputs))

    def __contains__(self, name: Any) -> bool:
        """Whether indexing takes a name (or Symbol)."""
        known = ("t", str(self.model.time), *self.states, *self.multipliers, *self.outputs)
        return str(checks.named(name)) in known

    def __getattr__(self, name: str) -> Any:
        """What is meant where an attribute does not exist: SciPy's names, and misspelt ones."""
        if name in dir(type(self)):  # one that exists, and failed inside
            return object.__getattribute__(self, name)
        if remedy := _SCIPY.get(name):
            raise AttributeError(f"a Solution has no `{name}`: {remedy}.")
        raise AttributeError(f"a Solution has no `{name}`." + calls.hint(name, _public(type(self))))

    def __getitem__(self, name: Any) -> np.ndarray:
        """A state, multiplier or output by name (or Symbol), at the solution's times; "t" gives the times."""
        name = checks.named(name)
        if str(name) == "t" or str(name) == str(self.model.time):
            return self.t
        return self._lookup(name, self.t, self.x, self.mult)

    def __call__(self, t: Any, name: Any = None) -> np.ndarray:
        """Dense evaluation.

        Parameters
        ----------
        t : float or array_like
            Times inside the solved span; at an event the side after it.
        name : str or Symbol, optional
            One state, multiplier or output; all states without.

        Returns
        -------
        ndarray
            Shape (n,) or (n, nt) without `name`, () or (nt,) with it.

        Raises
        ------
        ValueError, TypeError
            No dense output was kept, or a time lies outside the solved span; a name in the place of times.
        """
        if isinstance(t, (str, sp.Symbol)):
            raise TypeError(f"`t` is {str(t)!r}; {self._meant(str(t))}")
        if self.dense is None:
            raise ValueError(
                "No dense output was kept; solve with `dense_output=True` for values between steps."
            )
        at = checks.array(t, "`t`")
        if name is not None and str(checks.key(name, "`name`")) not in (
            *self.states,
            *self.multipliers,
            *self.outputs,
        ):
            raise ValueError(f"`name` is {str(name)!r}, which is {self._none_of_these(str(name))}")
        flat = at.ravel()
        slack = 4 * np.spacing(max(abs(self.t[0]), abs(self.t[-1])))
        if flat.size and not (flat.min() >= self.t[0] - slack and flat.max() <= self.t[-1] + slack):
            raise ValueError(
                f"`t` reaches from {flat.min():.9g} to {flat.max():.9g}: it leaves the solved span [{self.t[0]:.9g}, "
                f"{self.t[-1]:.9g}]. Ask within it, or solve further."
            )
        if self.t[-1] > self.t[0]:
            x, mult = self.dense(flat)
        else:  # a run that ended at its start
            x, mult = (np.repeat(rows[:, -1:], len(flat), axis=1) for rows in (self.x, self.mult))
        last = flat == self.t[-1]
        # No step begins there, but an event may have acted.
        x[:, last], mult[:, last] = self.x[:, -1:], self.mult[:, -1:]
        if name is None:
            return x[:, 0] if at.ndim == 0 else x.reshape(len(x), *at.shape)
        return self._lookup(name, flat, x, mult).reshape(at.shape)

    # ---- segments and events -----------------------------------------------------------------------

    @functools.cached_property
    def segments(self) -> list[Segment]:
        """Maximal intervals of constant status of the whole run; instants are dropped unless nothing else is there."""
        t, status = self.course or (self.t, self.status)
        changes = np.flatnonzero(np.any(np.diff(status, axis=1) != 0, axis=0)) + 1
        firsts = [0, *changes.tolist()]
        lasts = [*(changes - 1).tolist(), len(t) - 1]
        pieces = [(i, j) for i, j in zip(firsts, lasts) if t[j] > t[i]] or [(0, len(t) - 1)]
        merged = [pieces[0]]
        for i, j in pieces[1:]:
            # An instant between two pieces of one status (a direct re-capture) does not split them.
            if np.array_equal(status[:, i], status[:, merged[-1][0]]):
                merged[-1] = (merged[-1][0], j)
            else:
                merged.append((i, j))
        starts, ends = (t[list(columns)].tolist() for columns in zip(*merged))
        statuses = [tuple(status[:, i].tolist()) for i, _ in merged]
        if self.course:
            # A column of `t_eval` at an event is that of the side after it.
            firsts = [0, *np.searchsorted(self.t, starts[1:]).tolist(), len(self.t)]
            merged = [(i, j - 1) for i, j in zip(firsts, firsts[1:])]
        return Listed(self._segment(*piece) for piece in zip(starts, ends, statuses, merged))

    def _segment(self, start: float, end: float, status: tuple[int, ...], columns: tuple[int, int]) -> Segment:
        names = [
            _status_name(self.model, j, s)
            for j, s in enumerate(status)
            if self.model.multipliers[j].kind not in _FOLLOWING
        ]
        return Segment(start, end, ", ".join(names) or "smooth", status, *columns)

    def _holds(self, status: Any) -> Any:
        """Whether a surface or a contact is held, of a status (m,) or of several (m, n); unknowns always are solved."""
        rows = [j for j, mu in enumerate(self.model.multipliers) if mu.kind not in _FOLLOWING]
        return np.any(np.asarray(status)[rows] == 0, axis=0)

    @property
    def itinerary(self) -> tuple[str, ...]:
        """Names of the segments in order."""
        return tuple(segment.name for segment in self.segments)

    @checks.door(kind=checks.optional(checks.name), switch=checks.optional(checks.key))
    def event_times(self, kind: str | None = None, switch: Any = None) -> np.ndarray:
        """Times of the events of one kind or switch, both, or all.

        Parameters
        ----------
        kind : str, optional
            As of `EventRecord`; "slip" matches every "slip by ...".
        switch : Switch, Symbol or str, optional
            Switch, contact or event, by its name.

        Returns
        -------
        ndarray, shape (ne,)
            In the unit of the model's time.

        Raises
        ------
        ValueError
            There is no such kind, or no switch, contact or event of that name in the system.
        """

        def times(kind: str | None, switch: Any) -> np.ndarray:
            def wanted(e: EventRecord) -> bool:
                right_kind = kind is None or e.kind == kind or e.kind.startswith(kind + " by")
                return right_kind and (switch is None or e.switch == str(switch))

            if isinstance(self.events, EventLog):
                return self.events.times_of(wanted)
            return np.array([e.time for e in self.events if wanted(e)])

        found = times(kind, switch)
        if found.size:
            return found
        if kind is not None and kind not in KINDS and not times(kind, None).size:
            if kind in self._switches:
                raise ValueError(f"`kind` is {kind!r}, a switch, a contact or an event: give switch={kind!r}.")
            near = calls.hint(kind, KINDS)
            raise ValueError(f"`kind` is {checks.shown(kind)}; kinds of events are {', '.join(KINDS)}.{near}")
        if switch is not None and not times(None, switch).size:
            names = self._switches
            if str(switch) not in names:
                raise ValueError(
                    f"`switch` is {checks.shown(str(switch))}, no switch, contact or event of this system; they are "
                    f"{', '.join(listed(names)) or 'none'}." + calls.hint(switch, names)
                )
        return found

    @property
    def _switches(self) -> list[str]:
        """Names that stand in events: switches, contacts, unknowns, recorded events."""
        events = (event.name for event in self.model.events if event.recorded)
        return [*self.multipliers, *events, *substitutes(self.system)]

    # ---- other forms -------------------------------------------------------------------------------

    def save(self, path: Any) -> None:
        """Write the solution to one file, from which `load` gives it back bit for bit.

        Parameters
        ----------
        path : path
            The file; an older one is replaced as a whole. No name ending is added; ".npz" tells others how to read it.

        Raises
        ------
        TypeError, ValueError
            What the file cannot hold: SciPy's dense output, functions that the package does not know.
        OSError
            The file cannot be written.

        Notes
        -----
        A zip of NumPy arrays and one JSON text: times, states, multipliers, events, ambiguities, outcome, parameters,
        dense output, and the system as a tree of names. `numpy.load` reads the arrays without the package. The noise of
        a run is kept in words. Derivatives, and the statistics of a `Recorder`, are not in the file; a warning says so.

        >>> x = sp.Symbol("x", real=True)
        >>> solution = solve(System({x: -2 * sp.sign(x)}), (0, 5), {x: 1}, dense_output=True)
        >>> solution.save("relay.npz")
        >>> again = Solution.load("relay.npz")
        >>> again.itinerary == solution.itinerary, bool(again(0.3, "x") == solution(0.3, "x"))
        (True, True)
        """
        from .files import write_whole
        from .saving import pack, warn_of_what_is_left_out

        write_whole(checks.path(path, "`path`"), pack(self))
        warn_of_what_is_left_out(self)

    @classmethod
    def load(cls, path: Any) -> Solution:
        """A solution that `save` wrote. Opening a file runs nothing that is in it.

        Parameters
        ----------
        path : path
            The file.

        Returns
        -------
        Solution
            With its system, which solves, plots and is changed as the one that was saved.

        Raises
        ------
        ValueError
            The file is damaged, or none that `save` wrote.
        OSError
            There is no such file, or it cannot be read.
        """
        from .saving import unpack

        at = checks.path(path, "`path`")
        content = at.read_bytes()
        try:
            arguments, further = unpack(content)
        except ValueError as error:
            raise ValueError(
                f"`path` is {str(at)!r}, which is damaged, or no file that Solution.save wrote: {error}."
            ) from None
        solution = cls(**arguments)
        for name, part in further.items():
            setattr(solution, name, part)
        return solution

    def to_dataset(self) -> xarray.Dataset:
        """The solution as a labelled data set, whose times are unique.

        xarray's `interp` joins columns, the ends of long steps, by straight lines: values between them are those of
        ``solution(t, name)``, with dense output.

        Returns
        -------
        xarray.Dataset
            Every state, multiplier, status and output over time, at an event those after it; the events with the states
            before and after them, nan where `t_eval` left them out; provenance as attributes.
        """
        import xarray

        last = np.append(self.t[1:] != self.t[:-1], True)
        data: dict[str, Any] = {name: ("time", row[last]) for name, row in zip(self._shown, self.x)}
        data.update({name: ("time", row[last]) for name, row in zip(self.multipliers, self.mult)})
        data.update({f"status_{name}": ("time", row[last]) for name, row in zip(self.multipliers, self.status)})
        data.update({name: ("time", self[name][last]) for name in self.outputs})
        data["event_kind"] = ("event", np.array([e.kind for e in self.events], dtype=str))
        data["event_switch"] = ("event", np.array([e.switch for e in self.events], dtype=str))
        at = np.array([e.time for e in self.events], dtype=float)
        columns = {
            "states_before": np.searchsorted(self.t, at),
            "states_after": np.searchsorted(self.t, at, side="right") - 1,
        }
        for name, column in columns.items():
            column = np.clip(column, 0, len(self.t) - 1)
            x = self.x[: len(self._shown), column]
            data[name] = ("event", "state_name"), np.where(self.t[column] == at, x, np.nan).T
        attributes: dict[str, Any] = {f"parameter {k}": v for k, v in self.parameters.items()}
        attributes.update({f"tolerance {k}": v for k, v in self.tolerances.items()})
        attributes.update({f"cost {k}": v for k, v in self.cost.items()})
        attributes["outcome"] = self.message
        if self.noise is not None:
            attributes["noise"] = str(self.noise)
        coordinates = {"time": self.t[last], "event_time": ("event", at), "state_name": list(self._shown)}
        return xarray.Dataset(data, coords=coordinates, attrs=attributes)

    def to_dataframe(self, n: int | None = None) -> pandas.DataFrame:
        """The solution as a table over time, a column each for states, multipliers and outputs.

        Parameters
        ----------
        n : int, optional
            Instants evenly over the span, the ends among them, by the dense output; without it the solution's own, with
            the statuses, as `to_dataset` has them.

        Returns
        -------
        pandas.DataFrame
            With unique times as its index, at an event the values after it. The list `events` makes a table of its own.

        Raises
        ------
        ValueError
            `n` where no dense output was kept.
        """
        import pandas

        if n is not None:
            t = np.linspace(self.t[0], self.t[-1], checks.whole(n, "`n`", 2))
            names = (*self._shown, *self.multipliers, *self.outputs)
            return pandas.DataFrame({name: self(t, name) for name in names}, index=pandas.Index(t, name="time"))
        data = self.to_dataset()
        return data[
            [name for name, column in data.data_vars.items() if column.dims == ("time",)]
        ].to_dataframe()

    def sample(
        self,
        points: int = 6000,
        names: Sequence[Any] | None = None,
        *,
        chord: float | None = None,
        scale: Mapping[Any, float] | None = None,
    ) -> Sampled:
        """Points to draw: even places of each step's own variable, in one matrix product, through folds too.

        A few times as fast as ``solution(t)`` at so many times, and with both sides of every event.

        Parameters
        ----------
        points : int
            About so many: each step has 2 to 33 of them.
        names : sequence of str or Symbol, optional
            States, multipliers or outputs; all states and multipliers without.
        chord : float, dimensionless, optional
            Drop points as long as the whole curve stays so near the chords between those that are kept, in units of
            `scale`. The distance is that in the space of time and all `names`, so that it holds in every picture of
            them.
        scale : mapping of str to float, optional
            What counts as 1, such as a pixel: of "t" and of each name, in its unit; by default the range of each.

        Returns
        -------
        Sampled
            The points; `Sampled.t`, `Sampled.values`, or by name.

        Raises
        ------
        ValueError, TypeError
            No dense output was kept; an unknown name; a number that is not positive.

        >>> x, v = sp.symbols("x v", real=True)
        >>> solution = solve(System({x: v, v: -x - sp.sign(v)}), (0, 10), {x: 3.5, v: 0}, dense_output=True)
        >>> drawn = solution.sample(200, ["x", "v"])
        >>> float(drawn["x"].max()), len(solution.sample(200, ["x", "v"], chord=0.01)) < len(drawn)
        (3.5, True)
        """
        from .sampling import sampled

        if self.dense is None:
            raise ValueError(
                "No dense output was kept; solve with `dense_output=True` to draw what is between steps."
            )
        points = checks.whole(points, "`points`", 2)
        known = (*self.states, *self.multipliers, *self.outputs)

        def name_of(key: Any, what: str, of: Sequence[str]) -> str:
            name = str(checks.key(key, what))
            if name not in of:
                raise ValueError(f"{what} has {name!r}, which is {self._none_of_these(name)}")
            return name

        given = (*self._shown, *self.multipliers) if names is None else checks.several(names, "`names`")
        chosen = [name_of(name, "`names`", known) for name in given]
        if not chosen:
            raise ValueError("`names` is empty; give at least one, or leave it out.")
        sizes = checks.mapping({} if scale is None else scale, "`scale`", "names to sizes of a unit")
        return sampled(
            self,
            points,
            chosen,
            checks.optional(checks.positive)(chord, "`chord`"),
            {
                name_of(key, "`scale`", ("t", *known)): checks.positive(size, f"`scale` of {key}")
                for key, size in sizes.items()
            },
        )

    def plot(
        self, names: Sequence[Any] | None = None, axes: Any = None, *, phase: Sequence[Any] | None = None
    ) -> np.ndarray:
        """States (or `names`) against time, one Axes each, with the stuck or sliding segments shaded.

        Parameters
        ----------
        names : sequence of str or Symbol, optional
            States, multipliers or outputs.
        axes : sequence of Axes, optional
            Where to draw, one for each name; a new figure by default.
        phase : (str or Symbol, str or Symbol), optional
            Two states, multipliers or outputs to draw against each other instead, in the colours of the first switch.

        Returns
        -------
        ndarray of Axes
            One for each name, or one.

        Raises
        ------
        ValueError
            `names` and `phase` together.
        """
        from .. import plotting

        if phase is None:
            return plotting.plot_solution(self, names, axes)
        if names is not None:
            raise ValueError(
                "`names` are drawn against time and `phase` against each other; give one of the two."
            )
        return plotting.plot_phase(self, phase, axes)

    def animate(
        self,
        sketch: Any = None,
        path: Any = None,
        *,
        fps: int = 25,
        seconds: float = 8.0,
        t_span: Sequence[float] | None = None,
        names: Sequence[Any] = (),
    ) -> Any:
        """A film of the mechanism.

        Parameters
        ----------
        sketch : Sketch, optional
            Its shapes; by default those of the scene that was solved.
        path : path, optional
            A file to write: ".gif", ".html" (with buttons, and all in it), or ".mp4" where ffmpeg is found.
        fps : int, dimensionless
            Frames in a second of the film, up to 100.
        seconds : float, s
            Length of the film.
        t_span : (float, float), in the unit of the model's time, optional
            Part of the run that it shows; all of it without.
        names : sequence of str or Symbol
            States, multipliers or outputs to draw below, with a dot that runs along.

        Returns
        -------
        FuncAnimation
            Of matplotlib; its ``to_jshtml()`` is what a notebook shows.

        Raises
        ------
        ValueError, TypeError
            No sketch, no dense output, an unknown name, a span outside the run, another ending, no ffmpeg; more than
            5000 frames.

        >>> from pwsmooth.scenes.sketch import Block
        >>> x, v = sp.symbols("x v", real=True)
        >>> run = solve(System({x: v, v: -x - sp.sign(v)}), (0, 10), {x: 3.5, v: 0}, dense_output=True)
        >>> film = run.animate(Sketch([Block("block", x, 0.2, width=1, height=0.4)]), fps=2, seconds=1)
        >>> len(film.to_jshtml()) > 10_000
        True
        """
        from ..plotting import films

        sketch = self.sketch if sketch is None else sketch
        if not (hasattr(sketch, "pose") and hasattr(sketch, "describe")):
            raise TypeError(
                f"`sketch` is {checks.shown(sketch)}; give a pwsmooth.scenes.Sketch, or solve a scene that has one."
            )
        if self.dense is None:
            raise ValueError("No dense output was kept; solve with `dense_output=True` for a film.")
        at = checks.optional(checks.path)(path, "`path`")
        if at is not None:
            films.writer_of(at)
        fps = checks.whole(fps, "`fps`", 1, 100)
        frames = fps * checks.positive(seconds, "`seconds`")
        if frames > 5000:
            raise ValueError(f"`fps` times `seconds` are {frames:.9g} frames; give at most 5000.")
        first, last = (self.t[0], self.t[-1]) if t_span is None else checks.span(t_span)
        if not self.t[0] <= first < last <= self.t[-1]:
            raise ValueError(
                f"`t_span` is ({first:g}, {last:g}); give one within ({self.t[0]:g}, {self.t[-1]:g})."
            )
        curves = [str(checks.key(name, "`names`")) for name in checks.several(names, "`names`")]
        for name in curves:
            if name not in (*self.states, *self.multipliers, *self.outputs):
                raise ValueError(f"`names` has {name!r}, which is {self._none_of_these(name)}")
        made = films.film(self, sketch, np.linspace(first, last, max(2, round(frames))), fps, curves)
        if at is not None:
            films.write(made, at, fps)
        return made

    def plot_layer(self, switch: Any = None, t: float | None = None, ax: Any = None) -> Any:
        """The layer of a switch at an event: the field in which its multiplier moves there, see `plotting.plot_layer`.

        Parameters
        ----------
        switch : Switch, Symbol or str, optional
            The first that meets its surface, without.
        t : float, in the unit of the model's time, optional
            The event of the switch nearest to it; the first one without.

        Returns
        -------
        Axes
            Where it was drawn.

        Raises
        ------
        ValueError
            A switch that does not meet its surface, a solution without a column at that instant, a family.
        """
        from .. import plotting

        return plotting.plot_layer(self, switch, t, ax)

    def _layer(self, switch: Any, t: float | None) -> Any:
        from .layers import layer_of

        return layer_of(self, switch, t)

    # ---- repr --------------------------------------------------------------------------------------

    def _described(self) -> tuple[str, Rows]:
        if len(self.mult) <= MANY:
            steps = self.itinerary
            shown = " | ".join(steps[:6]) + (f" | ... ({len(steps)} segments)" if len(steps) > 6 else "")
        else:
            shown = f"of {len(self.mult)} multipliers; see `segments` and `events`"
        kinds = Counter(event.kind for event in self.events)
        first, last = f"{self.t[0]:.9g}", f"{self.t[-1]:.9g}"
        span = f"{last} to {first}, backward in time" if self.backward else f"{first} to {last}"
        return f"Solution: {self.message}", {
            "time": [f"{span}, {len(self.t)} column{'s' * (len(self.t) != 1)}"],
            "end": values(self._shown, self.x[:, 0 if self.backward else -1]),
            "events": listed([f"{count} {kind}" for kind, count in kinds.items()]) or ["none"],
            "itinerary": [shown],
            "cost": listed([f"{k} {v}" for k, v in self.cost.items()]),
            "tolerances": listed([f"{k} {v}" for k, v in self.tolerances.items()]),
            "noise": [] if self.noise is None else [str(self.noise)],
            "ambiguities": list(map(str, self.ambiguities)),
        }.items()


def _public(cls: type) -> list[str]:
    return [
        name for name in (*dir(cls), "t", "x", "mult", "status", "events", "cost") if not name.startswith("_")
    ]


@functools.lru_cache(maxsize=256)
def _is_slip_velocity(model: Model, j: int) -> bool:
    """Whether the surface of multiplier j is a state's rate, up to a function of time: then one slips on it."""
    families = model.families
    if families is not None:
        model, j = families.template.model, families.locate("multipliers", j)[0]
    h = model.multipliers[j].surface
    if h is None:
        return False
    unknowns = {*model.states, *(m.symbol for m in model.multipliers)}
    moving = h.as_independent(*unknowns, as_Add=True)[1]
    # Compare the form, without expanding: the rates of a mechanism take minutes to expand.
    return moving != 0 and any(
        rate.as_independent(*unknowns, as_Add=True)[1] in (moving, -moving) for rate in model.rhs
    )


def _status_name(model: Model, j: int, status: int) -> str:
    multiplier = model.multipliers[j]
    name = str(multiplier.symbol)
    if multiplier.kind == "disc":
        return f"slip ({name})" if status else f"stick ({name} sliding)"
    if multiplier.kind == "contact":
        return f"contact ({name}) " + ("open" if status else "closed")
    side = f"{name}={status:+d}" if status else f"{name} sliding"
    if not _is_slip_velocity(model, j):
        return side
    word = {1: "slip right", -1: "slip left", 0: "stick"}[status]
    return f"{word} ({side})"
