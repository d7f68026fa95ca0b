"""Running a diffusion: what is checked at the door, and one trajectory as a Solution.

Chain: diffusion.py, diffusion_path.py, ensemble -> **this file** -> lowering.py (symbols), kernels/noise/path.py
(steps), on the Brownian path of kernels/noise/tree.py.
"""

from __future__ import annotations

import copy
import ctypes
import functools
import sys
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from ..definition.families.many import carried
from ..door import checks
from ..paths.call import Options
from ..paths.event_driven import EventDriven
from .lowering import NEAREST, lower, meaning, split

_LONGEST_GRID = 2**31  # intervals


class DiffusionRun:
    """A diffusion on one view, checked and compiled: what solve() and ensemble() run."""

    def __init__(self, system: Any, noise: Any) -> None:
        self.system, self.noise = system, noise
        model = system.model
        text = model.families.template.model if model.families else model
        contacts = [str(m.symbol) for m in text.multipliers if m.kind == "contact"]
        if contacts:
            raise ValueError(
                f"the system has the contact {checks.listing(contacts)}; a diffusion with contacts is not provided. "
                "Use Kicks, or a contact law with a finite stiffness."
            )
        timed = [e.name for e in text.events if e.surface is None]
        if timed:
            raise ValueError(
                f"the event {checks.listing(timed)} happens at given times, which a diffusion's steps do not meet; "
                "solve from one instant to the next, or use Kicks."
            )
        self.acts = False
        try:
            found = self._lower(model) if model.families else None
        except ValueError:
            # It may be a mistake: the elements written out tell it in the user's names.
            self.system = system = system._without_levels()
            model, found = system.model, None
        if found is None:
            found = self._lower(replace(model, rhs=tuple(model.rhs)) if model.families else model)
        if not self.acts:
            return
        self.lowered, numbers = found
        more = {**numbers, NEAREST: noise.step / 2 ** (noise.level + noise.finest)}
        self.values = carried(
            self.lowered.model.parameters, system.parameters,
            {s: value for s, value in more.items() if s in self.lowered.model.parameters},
        )  # fmt: skip
        self._view = copy.copy(system)
        self._view.model, self._view.parameters = self.lowered.model, self.values
        self._warn()

    def _lower(self, model):
        """The noise on this form of the system's model, and the values of its own symbols; sets whether it acts."""
        system, noise = self.system, self.noise
        own = {name: sp.Symbol(name, real=True) for name in noise.parameters}
        named = meaning(system, model, own)
        for name in own:
            if named[name] is not own[name]:
                raise ValueError(f"`parameters` of the diffusion names {name!r}, which the system has already.")
        extra = {own[name]: value for name, value in noise.parameters.items()}
        if model.families:
            template = model.families.template
            text, parameters = template.model, zip(template.model.parameters, template.families("parameters"))
            values = {p: system.parameters[p] for p, family in parameters if family is None} | extra
            written = noise.of_elements(text.states, system.groups)
        else:
            text, values = model, {**system.parameters, **extra}
            written = noise.entries(text.states, system.groups)
        entries, numbers = split(written, named, values, lift=True)
        for i, _, _ in entries:
            if i >= len(text.states) - text.n_memory:
                raise ValueError(
                    f"`amplitude` drives {text.states[i].name!r}, which is a memory: it changes in events only."
                )
        self.acts = bool(entries)
        if not self.acts:
            return None
        used = tuple(s for s in extra if any(s in e.free_symbols for _, _, e in entries))
        extra = {s: extra[s] for s in used}
        try:
            lowered = lower(model, entries, used, noise.convention)
            if lowered.holds({**values, **numbers}):
                return lowered, extra | numbers
        except ValueError:
            pass
        # Keep the numbers in place: terms may cancel only with their values.
        entries, _ = split(written, named, values, lift=False)
        return lower(model, entries, used, noise.convention), extra

    def _warn(self) -> None:
        model = self.system.model
        if self.lowered.model.families:
            model = model.families.template.model
        slides = [
            m for m, spread in zip(model.multipliers, self.lowered.spreads)
            if spread != 0 and m.kind in ("switch", "disc") and m.regularity == "sliding"
        ]  # fmt: skip
        if slides:
            m = slides[0]
            hidden = " and its hidden terms never act" if m.hidden else ""
            surface = "h . h" if m.kind == "disc" else m.surface
            warnings.warn(
                f"the diffusion acts on the surface {surface} = 0 of {m.symbol}: at eps = 0 such a path does not "
                f"stick{hidden}. For sticking under noise take the smoothed view, or Kicks.",
                stacklevel=_levels_to_caller(),
            )

    def interval(self, t: float, what: str) -> int:
        """Number of the interval that begins at t; ValueError if t is no multiple of the step."""
        t, step = float(t), self.noise.step
        number = round(t / step)
        if abs(t / step - number) > 1e-6 or abs(number) > _LONGEST_GRID:
            raise ValueError(
                f"{what} is {t!r}, which is no multiple of the diffusion's `step` {step!r}; the nearest one is "
                f"{number * step!r}. Choose a step that divides it, such as {abs(t) / max(1, abs(number))!r}."
            )
        return number

    def bundle(self, **ensemble):
        """The kernel's Diffused; the arrays of an `ensemble` are `starts`, `snapshots` and `grid`, else empty."""
        from ..codegen import compile_model
        from ..kernels.noise import state as names

        lowered, noise = self.lowered, self.noise
        self._code = compile_model(lowered.model)  # its addresses live as long as it
        sizes = dict(
            n=len(lowered.model.states),
            m=len(lowered.model.multipliers),
            ne=len(lowered.model.events),
            q=lowered.q,
            outputs=int(lowered.parts[-1]),
            trajectories=len(ensemble.get("snapshots", ())),
            times=0,
            levels=names.DEEPEST + 2,
        )
        return names.Diffused.zeros(
            sizes,
            outputs=self._code.outputs,
            q=lowered.q,
            moving=int(lowered.moving),
            at=lowered.parts,
            **dict(zip(("G_row", "G_source", "G_place"), lowered.G)),
            **dict(zip(("M_row", "M_first", "M_second", "M_place"), lowered.milstein)),
            **_steps(noise),
            seed=noise.seed,
            noisy=lowered.noisy.astype(np.int64),
            **ensemble,
        )


def _levels_to_caller() -> int:
    """How far up, as `warnings.warn` counts, the code stands that has called the package."""
    frame, level, package = sys._getframe(1), 1, __name__.partition(".")[0]
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in (package, "functools"):
        frame, level = frame.f_back, level + 1
    return level


def _steps(noise):
    return {name: getattr(noise, name) for name in ("step", "resolution", "level", "finest")}


def _free(problem, lowered):
    """The Problem in which switches that the noise acts on do not slide, and none to second order."""
    from ..kernels import state

    kind = problem.kind.copy()
    kind[kind == state.SECOND_ORDER] = state.CROSSING
    slides = (kind == state.SLIDING) | (kind == state.CROSSING)
    kind[lowered.noisy[: len(kind)] & slides] = state.KINK
    return problem.changed(kind=kind)


class Path(EventDriven):
    """One trajectory: the event-driven run with the stochastic loop in the place of its own."""

    def __init__(self, run: DiffusionRun, max_steps, strict):
        view, noise = run._view, run.noise
        options = Options(max_steps=max_steps, strict=strict)
        # Where nothing switches, none of the event-driven run's own steps is ever taken.
        super().__init__(view.model, options, series=bool(view.model.multipliers or view.model.events))
        self.periodic = []  # its steps look at all surfaces
        self.owner = run
        self.problem = _free(self.parts.new_problem(np.array(view.parameter_values, float)), run.lowered)
        self.tolerances = _steps(noise)

    def diffuse(self, first, last, start, times, spending):
        """The Solution between two intervals, of the system as it was given; the kernel runs to its end."""
        from ..codegen.machine.units import unit_address

        owner = self.owner
        step = owner.noise.step
        t0, t1 = first * step, last * step
        control, state = self.timed(t0, t1, owner.values), self.begin(t0, t1, start)
        noise = owner.bundle()
        noise.interval, noise.last, noise.trajectory, noise.recording = first, last, owner.noise.trajectory, 1
        diffuse = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 6)(unit_address("diffuse"))

        def advance(record):
            return diffuse(*(b.address for b in (self.problem, control, state, record, self.work, noise)))

        more = functools.partial(self.larger, state, t0, t1)
        code, record = self.advanced(advance, more, control, state, self.first_record(times), spending)
        solution = self.finish(
            owner.system, code, self.problem, state, self._kept(record, state), record, times
        )
        solution.noise = owner.noise
        solution.cost = {"steps": state.steps,
                         "refused": noise.rejected, "events": len(solution.events)}  # fmt: skip
        return solution
