"""fit_law(): the parameters of a law from a measured motion and force.

Chain: laws, scenes, fitting.py -> **fit_law**.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..definition.drives import Drive
from ..door import checks
from ..laws import Law
from ..scenes import prescribed_motion
from .fitting import fit
from .records import Record, measured
from .result import Fit

__all__ = ["fit_law"]


@checks.door(
    [*inspect.signature(fit).parameters][3:],
    law=checks.instance(Law, "a friction or contact law"), t=checks.numbers, motion=checks.numbers,
    kind=checks.one_of("position", "velocity"), by=checks.optional(checks.several), settle=checks.nonnegative,
    force=measured,
)  # fmt: skip
def fit_law(
    law: Law,
    t: Any,
    motion: Any,
    force: Any,
    *,
    kind: str = "position",
    by: Sequence[str] | None = None,
    settle: float = 0.0,
    noise: float | None = None,
    rtol: float = 1e-8,
    **options: Any,
) -> Fit:
    """Fit a law to measured motion and force: `fit` of the rig `prescribed_motion`.

    Parameters
    ----------
    law : Law
        Its parameters are the first guess; they should have the right size.
    t : array_like, shape (n,)
        Times, in units consistent with those of the law.
    motion : array_like, shape (n,)
        Position or velocity there, in units of the law. It is taken as exact; where its noise matters, `success` is
        False and the message says by how many stated errors.
    force : array_like, shape (n,)
        Friction force there, in units of the law; nan where it is missing.
    kind : {"position", "velocity"}
        What `motion` is.
    by : sequence of str, optional
        Parameters to fit; all that are not structural and not 0 without. One with a value for each element counts as
        many.
    settle : float, in the unit of `t`
        Time at the start that is left out of the comparison: the law starts relaxed, the experiment may not have.
    noise : float, in units of `force`, optional
        Standard deviation of the samples; estimated without.
    **options
        Further ones of `fit`, such as `bounds` and `priors`.

    Returns
    -------
    Fit
        Its `law` has the fitted parameters.

    Raises
    ------
    ValueError
        Arrays of different lengths, an unknown name in `by`; as `fit`.

    >>> times = np.linspace(0, 3, 61)
    >>> x = 3e-5 * np.sin(4 * times)
    >>> data = prescribed_motion(Dahl(F_c=1.2, sigma0=8e4), position=Drive(times, x)).solve(t_eval=times)["force"]
    >>> found = fit_law(Dahl(), times, x, data)
    >>> round(found.law.F_c, 6), round(found.law.sigma0, 2)
    (1.2, 80000.0)
    """
    if not t.shape == motion.shape == force.shape:
        raise ValueError(
            f"`t`, `motion` and `force` have the shapes {t.shape}, {motion.shape}, {force.shape}; give one "
            "sequence of the same length each."
        )
    scene = prescribed_motion(law, **{kind: Drive(t, motion)})
    used = np.where(t >= t[0] + settle, force, np.nan)
    found = fit(scene, Record(t, {"force": used}, noise=noise), _free(law, by), rtol=rtol, **options)
    message = found.message
    if found.message.startswith("The drive "):
        message = "`motion`" + message[message.index(" has noise") :].replace("the drive", "it")
    found.law, found.message = _with(law, found.values, message)
    return found


def _free(law: Law, names: Sequence[str] | None) -> list[str]:
    fields = {f.name: f for f in dataclasses.fields(law)}  # type: ignore[arg-type]
    fitted = [name for name, f in fields.items() if not f.metadata["structural"]]
    if names is None:
        return [name for name in fitted if getattr(law, name) != 0]
    for name in names:
        if name not in fitted:
            raise ValueError(
                f"`by` names {checks.shown(name)}; parameters of {type(law).__name__} are {', '.join(fitted)}."
            )
    return list(names)


def _with(law: Law, values: dict[str, float], message: str) -> tuple[Law, str]:
    """The law with fitted values, or as it was, with the reason in the message."""
    changed: dict[str, Any] = {}
    for name, old in law.values.items():
        if isinstance(old, tuple):
            changed[name] = tuple(values.get(f"{name}_{i + 1}", v) for i, v in enumerate(old))
        elif name in values:
            changed[name] = values[name]
    try:
        return dataclasses.replace(law, **changed), message  # type: ignore[type-var]
    except ValueError as error:
        return law, f"{message} The fitted values are none of this law: {error}"
