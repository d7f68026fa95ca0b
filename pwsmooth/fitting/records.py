"""Record: what was measured in one experiment, and what is known of its beginning.

Chain: **record** -> shooting.py, which runs the system along it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..door import checks
from ..door.columns import read_columns
from ..door.describe import Described, Rows, listed, values

__all__ = ["Record"]


def measured(value: Any, what: str) -> np.ndarray:
    """Floats, of which some may be nan: missing samples."""
    try:
        found = checks.as_floats(value)
    except (TypeError, ValueError):
        raise TypeError(
            f"{what} is {checks.shown(value)}; give a sequence of numbers, nan where one is missing."
        ) from None
    if np.isinf(found).any() or not np.isfinite(found).any():
        raise ValueError(
            f"{what} is infinite somewhere, or nan everywhere; give numbers, nan where one is missing."
        )
    return found


@checks.door()
@dataclass(frozen=True, repr=False)
class Record(Described):
    """One experiment: samples of some outputs, their noise, and how the motion began.

    Parameters
    ----------
    t : array_like, shape (nt,), in the unit of the model's time
        Times of the samples, increasing.
    values : mapping of str to array_like, shape (nt,)
        Samples of states, multipliers or outputs by name, in their units; nan where one is missing.
    noise : float or mapping of str to float, optional
        Standard deviation of the samples, in their units; without, it is estimated from what remains.
    x0 : mapping of state to float, optional
        State at the time `begin`, in its units; without, that of the scene, or for unknown ones that are measured the
        first sample.
    unknown : sequence of str
        States whose initial value is fitted; `x0` has the first guess.
    parameters : mapping of (Symbol or str) to float, optional
        Values that differ in this experiment from those of the system, in its units.
    begin : float, in the unit of the model's time, optional
        When the run begins; the first sample by default.
    system : System or Scene, optional
        Where this experiment had another one, such as another measured drive; it shares the fitted parameters by name.

    Raises
    ------
    ValueError, TypeError
        Times that do not increase, columns of another length, a noise that is not positive, a `begin` after the first
        sample.

    >>> Record([0.0, 0.5, 1.0], {"x": [0.1, np.nan, 0.3]}, noise=0.01, unknown=["v"], x0={"v": 0.0})
    Record: 2 samples over 0 to 1
      samples 2 of x, noise 0.01
      x0      v = 0
      unknown v
    """

    t: Any
    values: Mapping[str, Any]
    noise: Any = None
    x0: Mapping[Any, float] = field(default_factory=dict)
    unknown: Sequence[str] = ()
    parameters: Mapping[Any, float] = field(default_factory=dict)
    begin: float | None = None
    system: Any = None

    def __post_init__(self) -> None:
        checks.fields(
            self, t=checks.numbers, values=checks.mapping, x0=checks.values, unknown=checks.several,
            parameters=checks.values, begin=checks.optional(checks.number),
        )  # fmt: skip
        if not (np.diff(self.t) > 0).all():
            raise ValueError("`t` of Record does not increase; sort the samples, and give each time once.")
        columns = {
            str(checks.named(name)): measured(column, f"`values` of {name}")
            for name, column in self.values.items()
        }
        for name, column in columns.items():
            if column.shape != self.t.shape:
                raise ValueError(
                    f"`values` of {name!r} have the shape {column.shape}, `t` has {self.t.shape}; give a value, or "
                    "nan, for each time."
                )
        if not columns:
            raise ValueError("`values` of Record is empty; give the samples of at least one state or output.")
        if isinstance(self.noise, Mapping):
            noise = {
                str(checks.named(key)): checks.positive(level, f"`noise` of {key}")
                for key, level in self.noise.items()
            }
        else:
            noise = (
                {}
                if self.noise is None
                else dict.fromkeys(columns, checks.positive(self.noise, "`noise` of Record"))
            )
        if strange := noise.keys() - columns.keys():
            raise ValueError(
                f"`noise` names {', '.join(sorted(strange))}, which `values` does not have; leave it out."
            )
        if self.begin is not None and self.begin > self.t[0]:
            raise ValueError(
                f"`begin` is {self.begin:g}, after the first sample at {self.t[0]:g}; begin before it."
            )
        unknown = tuple(str(checks.named(name)) for name in self.unknown)
        for name, value in (("values", columns), ("noise", noise), ("unknown", unknown)):
            object.__setattr__(self, name, value)

    @classmethod
    def from_csv(
        cls, path: Any, values: Mapping[Any, Any], *, time: Any = 0, noise: Any = None, x0: Any = None,
        unknown: Sequence[str] = (), parameters: Any = None, begin: float | None = None, system: Any = None,
    ) -> Record:  # fmt: skip
        """A record from a text file with commas, semicolons, tabs or spaces between its columns.

        Parameters
        ----------
        path : str or Path
            The last line before the first numbers is the header; other lines without numbers are left out. An empty
            field, or nan, is a missing sample.
        values : mapping of str to (int or str)
            State, multiplier or output -> its column, counted from 0, or by its name in the header.
        time : int or str
            Column of the times.
        noise, x0, unknown, parameters, begin, system : optional
            As of `Record`.

        Returns
        -------
        Record
            Of these columns.

        Raises
        ------
        ValueError, TypeError
            A line with too few columns, or with a column that is no number; a name that no header has; what `Record`
            raises.
        OSError
            The file cannot be read.

        >>> from pathlib import Path
        >>> _ = Path("run.csv").write_text("time,position\\n0,0.1\\n0.5,\\n1,0.3\\n")
        >>> Record.from_csv("run.csv", {"x": "position"}, time="time", noise=0.01)
        Record: 2 samples over 0 to 1
          samples 2 of x, noise 0.01
        """
        columns = checks.mapping(values, "`values`", "names to columns")
        times, *found = read_columns(path, [time, *columns.values()], gaps=True)
        return cls(
            times, dict(zip(columns, found)), noise, x0 or {}, unknown, parameters or {}, begin, system
        )  # fmt: skip

    @property
    def samples(self) -> int:
        """Number of samples that are there, of all columns."""
        return sum(int(np.isfinite(column).sum()) for column in self.values.values())

    def _described(self) -> tuple[str, Rows]:
        told = [
            f"{np.isfinite(column).sum()} of {name}"
            + (f", noise {self.noise[name]:g}" if name in self.noise else "")
            for name, column in self.values.items()
        ]
        return f"Record: {self.samples} samples over {self.t[0]:g} to {self.t[-1]:g}", {
            "samples": told,
            "x0": values(self.x0, self.x0.values()),
            "unknown": listed(list(self.unknown)),
            "parameters": values(self.parameters, self.parameters.values()),
        }.items()
