"""What a run of a large family keeps: some elements densely, the events on disk, a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...door import checks
from .event_statistics import Activity, Histogram, SlipHistogram


@checks.door()
@dataclass(frozen=True)
class Recorder:
    """What `solve(..., record=...)` keeps of a family whose events are local.

    The solution then has the states of all elements at the start and at the end alone.

    Parameters
    ----------
    elements : sequence of int, optional
        Numbers 1, ..., n (or -1, ..., -n from the end) of those that are kept at the times `t_eval`:
        `solution.recorded`.
    events : path, optional
        A folder, named .zarr, that takes the events while the run goes on: memory does not grow with their number.
        What stands there is overwritten.
    checkpoint : path, optional
        A file from which the same call goes on after it was killed or has spent its time, with the same bits; it is
        removed at the end. It wants `events`, or `keep_events` False; `statistics` go on with it.
    checkpoint_every : int
        Events between two checkpoints.
    statistics : mapping of str to (Histogram, SlipHistogram or Activity), optional
        What of the events is added up while the run goes on: `solution.statistics`, by these names.
    keep_events : bool
        Without them the memory of a run does not grow with its length; `solution.events` is empty then.
    progress : bool
        A line on the terminal: model time, events, elements that move.

    Raises
    ------
    ValueError, TypeError
        Another type; a file name that is no folder of Zarr's; a checkpoint without a folder of the
        events that are kept; a folder of events that are not.

    >>> Recorder(elements=[1, -1]).elements
    (1, -1)
    """

    elements: Sequence[int] | None = None
    events: Path | str | None = None
    checkpoint: Path | str | None = None
    checkpoint_every: int = 1_000_000
    progress: bool = False
    statistics: Mapping[str, Histogram | SlipHistogram | Activity] | None = None
    keep_events: bool = True

    def __post_init__(self) -> None:
        checks.fields(
            self, checkpoint_every=checks.integer(1, 2**62), progress=checks.flag, keep_events=checks.flag,
            statistics=checks.optional(checks.mapping),
        )  # fmt: skip
        for name, what in (self.statistics or {}).items():
            checks.instance(
                (Histogram, SlipHistogram, Activity), "Histogram(...), SlipHistogram(...) or Activity(...)"
            )(what, f"`statistics` of {name!r}")
        if self.elements is not None:
            checked = tuple(checks.whole(i, "`elements`", -(10**7), 10**7) for i in self.elements)
            if 0 in checked or len(set(checked)) < len(checked):
                raise ValueError(
                    f"`elements` is {checks.shown(self.elements)}; give numbers from 1 on, each once."
                )
            object.__setattr__(self, "elements", checked)
        for name in ("events", "checkpoint"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, checks.path(getattr(self, name), f"`{name}`"))
        if self.events is not None and Path(self.events).suffix != ".zarr":
            raise ValueError(f"`events` is {str(self.events)!r}; give a name that ends in .zarr.")
        if self.events is not None and not self.keep_events:
            raise ValueError("`events` is given with `keep_events` False; leave one of them out.")
        if self.checkpoint is not None and self.events is None and self.keep_events:
            raise ValueError(
                "`checkpoint` is given without `events`; give a folder for the events too, so that none is lost, or "
                "keep_events=False."
            )
