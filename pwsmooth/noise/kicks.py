"""Noise on any system: random kicks at regular times, and diffusions.

    Kicks        x_i(t+) = x_i(t-) + kappa_i xi   at t = T, 2T, ...;  xi uniform on [-1, 1] or standard normal
    Diffusion    dx = f(t, x, lambda) dt + G(t, x, lambda) dW         (Ito)

They are two scalings and not two sizes of one noise. Kicks come at slow intervals: a layer of width eps relaxes
between them and forgets them one by one, so that leaving a layer is an event of a single kick and a function of
kappa/eps. A diffusion acts all the time: in the layer's own variables u = h/eps, tau = t/eps it has the intensity
D**2/eps, and the layer is left by accumulation (Kramers).

Chain: solve -> **this file** -> kernels/noise/*.py. The random numbers are addressed, not drawn in sequence
(kernels/noise/random.py).
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy as sp

from ..definition.families.template import family_model
from ..definition.model import EventSpec, Model
from ..door import checks

LAWS = ("uniform", "normal", "laplace")


@checks.door()
@dataclass(frozen=True)
class Kicks:
    """Random displacements of states at the times `every`, 2 `every`, ...

    Between two kicks the motion is the deterministic one; after each, switches are classified anew: a sticking
    state kicked off its surface slips, a kick across a surface is a crossing.

    Parameters
    ----------
    size : float or mapping of state to float
        kappa, in the unit of each state, >= 0: half width of the uniform law, standard deviation of the others.
    every : float, in units of time
        Time between two kicks, > 0; they fall on its multiples.
    on : state or sequence of states, optional
        Which states are kicked, independently of each other; not needed where `size` is a mapping. The member symbol of
        a family stands for the states of all its elements.
    law : {"uniform", "normal", "laplace"}
        Uniform on [-kappa, kappa] (standard deviation kappa/sqrt(3)), or normal or Laplace's (exponential tails) with
        standard deviation kappa.
    seed : int
        0 <= seed < 2**63.
    trajectory : int
        Number of the trajectory within an ensemble of one seed.

    Raises
    ------
    ValueError, TypeError
        A negative or infinite size, `every` not positive, no states, an unknown law, a seed that is no integer.

    Notes
    -----
    Kick number k is a function of (seed, trajectory, k) alone (Philox4x64-10): a run over (0, 10) continued over
    (10, 20) meets the same kicks as one over (0, 20). A size of 0 leaves the deterministic run as it is, to the bit.

    Source: Jeffrey, On the mathematical basis of solid friction, figures 11 to 13, whose distribution is not printed;
    Philox of Salmon et al. 2011.

    >>> x = sp.Symbol("x")
    >>> walk = solve(System({x: 0 * x}), (0, 10), {x: 0}, noise=Kicks(0.1, every=1, on=x, seed=7))
    >>> len(walk.event_times("reset"))
    10
    """

    size: Any
    every: float
    on: Any = None
    law: str = "uniform"
    seed: int = 0
    trajectory: int = 0

    def __post_init__(self) -> None:
        every = checks.positive(self.every, "`every` of the kicks")
        checks.fields(self, law=checks.one_of(*LAWS))
        for name in ("seed", "trajectory"):
            object.__setattr__(self, name, checks.exact_integer(getattr(self, name), f"`{name}`"))
        object.__setattr__(self, "every", every)
        if isinstance(self.size, Mapping):
            names = _names(self.on) if self.on is not None else tuple(str(key) for key in self.size)
            sizes_of = {str(key): value for key, value in self.size.items()}
            if set(sizes_of) != set(names):
                raise ValueError(
                    f"`size` has values for {checks.listing(sizes_of)}, `on` names {checks.listing(names)}; leave `on` "
                    "out, or name the same states."
                )
        elif self.on is None:
            raise ValueError("`on` is not given; name the states that are kicked, such as on=('y', 'v').")
        else:
            names = _names(self.on)
            sizes_of = dict.fromkeys(names, self.size)
        if not names:
            raise ValueError("`on` is empty; name the states that are kicked, such as on=('y', 'v').")
        if len(set(names)) < len(names):
            raise ValueError(f"`on` names a state twice: {checks.listing(names)}.")
        sizes = tuple(_size(sizes_of[name], name) for name in names)
        object.__setattr__(self, "on", names)
        object.__setattr__(self, "size", sizes[0] if len(set(sizes)) == 1 else dict(zip(names, sizes)))

    def _prepared(self, system: Any) -> KickedRun | None:
        """What kicks this system; None where no kick has a size.

        Raises
        ------
        ValueError
            `on` names no state of the system, or a memory.
        """
        run = KickedRun(system, self)
        return run if len(run.where) else None

    @property
    def sizes(self) -> tuple[float, ...]:
        """Size of every kicked state, in the order of `on`."""
        if isinstance(self.size, Mapping):
            return tuple(self.size[name] for name in self.on)
        return (self.size,) * len(self.on)

    def __str__(self) -> str:
        sizes = ", ".join(f"{name} by {size:g}" for name, size in zip(self.on, self.sizes))
        return (
            f"{self.law} kicks of {sizes}, every {self.every:g}, seed {self.seed}, trajectory {self.trajectory}"
        )


def _names(on: Any) -> tuple[str, ...]:
    if isinstance(on, (str, sp.Symbol)):
        return (str(on),)
    if not isinstance(on, Sequence) or not all(isinstance(s, (str, sp.Symbol)) for s in on):
        raise TypeError(f"`on` is {checks.shown(on)}; give states by name or Symbol, such as on=('y', 'v').")
    return tuple(str(s) for s in on)


def _size(value: Any, name: str) -> float:
    size = checks.number(value, f"`size` of {name!r}")
    if not 0 <= size < math.inf:
        raise ValueError(f"`size` of {name!r} is {size:g}; give a finite number >= 0.")
    return size


@functools.lru_cache(maxsize=64)
def _with_kicks(model: Model) -> tuple[Model, sp.Symbol]:
    """The model with one more time event, without an update of its own, and the symbol of its period.

    Of a model with families the template gets it, as an event of the whole system.
    """
    families = model.families
    if families is not None:
        text, every = _with_kicks(families.template.model)
        template = replace(
            families.template, model=text, event_families=(*families.template.event_families, None)
        )
        return family_model(replace(families, template=template)), every
    taken = {s.name for s in (model.time, *model.states, *model.parameters)}
    taken |= {m.symbol.name for m in model.multipliers} | {e.name for e in model.events}
    name = "kicks"
    while name in taken or f"every_{name}" in taken:
        name += "_"
    every = sp.Symbol(f"every_{name}", positive=True)
    event = EventSpec(name, every=every)
    return replace(model, events=(*model.events, event), parameters=(*model.parameters, every)), every


class KickedRun:
    """A system with kicks, ready to run: its model, and the compiled functions that kick in place of its own.

    ValueError where `on` names no state of this view, or a memory.
    """

    def __init__(self, system: Any, kicks: Kicks) -> None:
        self.kicks = kicks
        states = list(system.states)
        memories = set(states[len(states) - system.model.n_memory :])
        by_name = {s.name: s for s in states}
        sizes = {
            by_name.get(name) or checks.lookup(name, states, "`on` of the kicks", "state"): size
            for group, size in zip(kicks.on, kicks.sizes)
            for name in system.groups.get(group, (group,))  # a member's name is that of all elements
        }
        for symbol in sizes:
            if symbol in memories:
                raise ValueError(
                    f"`on` of the kicks names {symbol.name!r}, which is a memory: it changes in events only. Kick a "
                    "state, or write an Event."
                )
        model, every = _with_kicks(system.model)
        self.system = copy.copy(system)
        self.system.model = model
        self.system.parameters = {**system.parameters, every: kicks.every}
        numbers = {s: i for i, s in enumerate(states)}
        pairs = [(numbers[s], size) for s, size in sizes.items() if size > 0]
        self.where = np.array([i for i, _ in pairs], np.int64)
        self.size = np.array([size for _, size in pairs], float)
        self.index = len(model.events) - 1
        self._kept: list[Any] = []  # what the kernels reach by address

    def _headed(self, act: int, p: np.ndarray) -> np.ndarray:
        """Parameters with the address of a Kick in the word before them."""
        from ..kernels.noise.state import Kick

        kicks = self.kicks
        kick = Kick(
            act=act,
            index=self.index,
            every=kicks.every,
            law=LAWS.index(kicks.law),
            seed=kicks.seed,
            trajectory=kicks.trajectory,
            where=self.where,
            size=self.size,
        )
        words = np.concatenate([[np.int64(kick.address).view(float)], p])
        self._kept += [kick, words]
        return words[1:]

    def problem(self, problem: Any) -> Any:
        """The event-driven path's Problem with kicks in it."""
        from ..codegen.machine.units import unit_address

        return problem.changed(p=self._headed(problem.act, problem.p), act=unit_address("kick_act"))

    def smooth(self, addresses: np.ndarray, act: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(addresses, parameters) of the smoothed path with kicks in them; `act` is the place of its `act`."""
        from ..codegen.machine.units import unit_address

        p = self._headed(int(addresses[act]), p)
        addresses = addresses.copy()
        addresses[act] = unit_address("kick_act_smooth")
        return addresses, p
