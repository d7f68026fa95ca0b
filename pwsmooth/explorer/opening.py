"""explore(): a page from a script, a widget in a notebook; and what both give back."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import re
import sys
import webbrowser
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.maps.seen import Strobe
from ..door import checks
from ..results.files import write_whole
from ..results.solution import Solution
from .code import figure, script
from .describe import describe
from .export import standalone
from .live import state_of
from .presets import PRESETS, as_asked, preset_of, subject_of_preset, with_preset, with_ranges
from .processes import SHOWN, packed, refuse_in_a_process_that_begins
from .state import decoded
from .subject import USUAL, Made, Subject, named_subject, subject_of, subject_of_study

__all__ = ["explore"]


class Explorer:
    """What is explored, with the state of its page.

    Attributes
    ----------
    subject : Subject
        The system, its start, span and words.
    """

    def __init__(self, subject: Subject, shown: Mapping[str, Any] | None = None) -> None:
        self.subject = subject
        self._server: Any = None
        self._state: dict[str, Any] = dict(shown or {})

    @property
    def state(self) -> dict[str, Any]:
        """Parameters `p`, start `x0` and `t_span` that the page shows, as names and numbers, with its law and view."""
        return self._now()[1]

    def _now(self) -> tuple[Subject, dict[str, Any]]:
        """The subject with the law and in the view that the page shows, and that page's state."""
        latest = self._server.state if self._server is not None else {}
        asked = {**self._state, **{k: latest[k] for k in SHOWN if k in latest}}
        subject = as_asked(self.subject, asked)
        known = describe(subject)
        own = {k: known[k] for k in ("names", "phase")}
        own["switch"] = next(iter(known["switches"]), "")
        p, x0, span = state_of(subject, asked)
        return subject, {**own, **asked, "p": p, "x0": x0, "t_span": span}

    @property
    def solution(self) -> Solution:
        """The orbit of that state."""
        subject, state = self._now()
        return subject.solve(state["t_span"], state["x0"], state["p"])

    def code(self, view: str = "time") -> str:
        """A script that gives the same numbers, with the plot of a view."""
        subject, state = self._now()
        return script(subject, {**state, "for": view})

    def save(self, path: Any, view: str = "time") -> None:
        """A figure of a view of the state, in the house style: PNG, PDF or SVG, as the name ends."""
        path = checks.path(path, "`path`")
        ending = path.suffix.removeprefix(".").lower()
        subject, state = self._now()
        write_whole(path, figure(subject, {**state, "for": view, "format": ending}))

    def export(self, path: Any, over: Mapping[Any, Any], *, views: Any = None, diagram: bool = False) -> None:
        """One HTML file without Python: a slider over these values of a parameter, with the state's other numbers."""
        path = checks.path(path, "`path`")
        subject, now = self._now()
        state = {k: v for k, v in now.items() if k in ("p", "x0", "t_span")}
        text = standalone(subject, over, views=views, diagram=diagram, state=state)
        write_whole(path, text.encode())

    def open(self) -> str:
        """Serve a page of its own, beside whatever runs; returns its address."""
        need_websockets()
        from .server import Server

        if self._server is None:
            self._server = Server(self.subject)
            self._server.start()
        return self._server.url

    def close(self) -> None:
        """End that page's server and processes."""
        if self._server is not None:
            self._server.stop()
            self._ended()

    def _ended(self) -> None:
        """Keep what the page showed; a value that the system refuses is not kept."""
        with contextlib.suppress(ValueError, TypeError):
            self._state = self.state
        self._server = None


@checks.door()
def explore(
    system_or_scene: Any,
    x0: Any = None,
    *,
    t_span: Sequence[float] | None = None,
    seen: Strobe | None = None,
    ranges: Mapping[Any, Sequence[float]] | None = None,
    views: Sequence[str] | None = None,
    preset: str | None = None,
    noise: Any = None,
    show: bool = True,
) -> Any:
    """Open a page on which the system answers while a slider moves; Ctrl-C ends it, or `.close()` in a notebook.

    Parameters
    ----------
    system_or_scene : System or Scene
        A System alone needs `x0` and `t_span`.
    x0 : mapping of state to float, or sequence of float, length n, optional
        Start, in the units of the states.
    t_span : (float, float), in the unit of the model's time, optional
        Span of the orbit.
    seen : Strobe, optional
        A period of the drive: with it orbit diagram, basins and section are offered.
    ranges : mapping of parameter to (float, float), optional
        Ends of sliders, in the units of the parameters.
    views : sequence of str, optional
        Of "time", "phase", "characteristic", "layer", "diagram", "basins", "section", "mechanism", "noise"; by default
        all that the system has.
    preset : str, optional
        A state of a scene that is worth a look; `pwsmooth explore --list` lists them.
    noise : Kicks or Diffusion, optional
        With it paths under noise are a view.
    show : bool
        Whether a page, or in a notebook a widget, is opened.

    Returns
    -------
    Explorer
        With `.state`, `.solution`, `.code()` and `.save(path)`.

    Raises
    ------
    ValueError, TypeError
        Bad input, with the argument, its value and the remedy.
    ImportError
        The extra is not installed.
    RuntimeError
        The process that calls it runs the script of another one, to have what that defines.

    Notes
    -----
    The page is served on this machine alone, to whoever has its address. Its processes do not run the script again,
    unless the system contains functions or classes that the script defines; then the call belongs under
    ``if __name__ == "__main__":``.

    >>> x, v = sp.symbols("x v", real=True)
    >>> block = System({x: v, v: -x - sp.sign(v)})
    >>> explored = explore(block, {x: 3.5, v: 0}, t_span=(0, 10), show=False)
    >>> explored.solution.itinerary[-1], "solve(system, " in explored.code()
    ('stick (sgn(v) sliding)', True)
    """
    show = checks.flag(show, "`show`")
    refuse_in_a_process_that_begins()
    subject = subject_of(system_or_scene, x0, t_span=t_span, seen=seen, ranges=ranges, views=views, noise=noise)
    subject = with_ranges(subject, subject.name.partition(",")[0].replace(" ", "_"))
    if preset is not None:
        subject = with_preset(subject, preset_of(checks.name(preset, "`preset`")))
    explorer = Explorer(subject)
    if not show:
        return explorer
    packed(subject)  # what no process can be given is refused here, and not when the page asks
    if "ipykernel" in sys.modules and importlib.util.find_spec("anywidget"):
        from .widget import widget_of

        return widget_of(explorer)
    serve(explorer)
    return explorer


def need_websockets() -> None:
    """ImportError with the remedy where the extra is missing."""
    checks.needs("websockets", "websockets>=15", "explore", "the page")


def serve(
    explorer: Explorer, port: int = 0, browser: bool = True, say: Any = print, fragment: str = ""
) -> None:
    """Serve the explorer's page until Ctrl-C; where an event loop runs already, beside it until `explorer.close()`."""
    need_websockets()
    from .server import Server

    server = explorer._server = Server(explorer.subject, port)
    server.fragment = fragment

    def told(ends: str = "Ctrl-C") -> None:
        say(f"{explorer.subject.name}: {server.url}\n{ends} ends it.")
        if browser:
            webbrowser.open(server.url)

    if _in_a_loop():  # a notebook without the widget, which must not wait for Ctrl-C
        server.start()
        return told("`.close()`")
    asyncio.run(server.serve(told))
    explorer._ended()


def _in_a_loop() -> bool:
    """Whether an event loop runs this code, as that of a notebook does."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


def listing() -> str:
    """The scenes, with the law that each has where none is named, and the presets."""
    from ..studies.study import known_scenes

    lines = ["scenes"]
    for name in known_scenes():
        law = USUAL.get(name, Made()).law
        lines.append(f"    {name}" + (f"  --law {law}" if law else ""))
    lines.append("presets")
    lines += [f"    {name:<17} {preset.said}" for name, preset in PRESETS.items()]
    return "\n".join(lines)


def stated(subject: Subject, state: str) -> Subject:
    """The subject in the state of a link; ValueError where it has no such names."""
    try:
        asked = decoded(state)
    except ValueError:  # also of text that is no UTF-8
        raise ValueError("`--state` is no state; give what `Copy link` shows.") from None
    subject = as_asked(subject, asked)
    p, x0, span = state_of(subject, asked)
    return replace(subject, system=subject.system.with_parameters(p), start=x0, t_span=span)


def command(
    what: str,
    law: str | None,
    preset: str | None,
    state: str,
    port: int,
    browser: bool,
    allow_code: bool,
    say: Any,
    read_only: bool = False,
    export: Path | None = None,
    over: str = "",
) -> None:
    """What `pwsmooth explore` does."""
    values = _range(over) if export is not None else None
    if over and export is None:
        raise ValueError("`--over` belongs to `--export`; name the file, or leave it out.")
    if values is None:
        need_websockets()
    if preset is not None:
        if what or law:
            raise ValueError("a preset brings its scene and its law; leave these out, or the preset.")
        subject = subject_of_preset(preset)
    elif not what:
        raise ValueError(
            "nothing is named: give a scene, a study or a preset; `pwsmooth explore --list` shows them."
        )
    elif what.endswith(".toml"):
        subject = subject_of_study(Path(what), allow_code=allow_code)
    else:
        subject = with_ranges(named_subject(what, law), what)
    if state and not re.fullmatch(r"[A-Za-z0-9_-]{1,12000}", state):
        raise ValueError("`--state` is no state; give what `Copy link` shows.")
    given = f"--preset {preset}" if preset else what + (f" --law {law}" if law else "")
    if read_only:  # what the page sends does not count: the state is applied here
        subject = replace(stated(subject, state) if state else subject, read_only=True)
    subject = replace(subject, command=f"pwsmooth explore {given}")
    if values is not None:
        subject = stated(subject, state) if state else subject
        Explorer(subject).export(export, values)
        say(f"{export}: {subject.name}, a slider over {over}")
        return
    serve(Explorer(subject), port, browser, say, f"&s={state}" if state else "")


def _range(over: str) -> dict[str, np.ndarray]:
    """The values of `--over NAME=LOW:HIGH:COUNT`."""
    found = re.fullmatch(r"\s*(.+?)\s*=\s*([^:=]+):([^:=]+):([^:=]+)", over)
    try:
        name, low, high, count = found.groups()  # type: ignore[union-attr]
        return {name: np.linspace(float(low), float(high), checks.integer(2)(int(count), "`--over`, count"))}
    except (AttributeError, ValueError):
        raise ValueError(
            f"`--over` is {over!r}; give NAME=LOW:HIGH:COUNT with two values at least, such as rho=1:4:60."
        ) from None
