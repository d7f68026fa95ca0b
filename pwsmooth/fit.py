"""fit(): the parameters of a friction law from a measured motion and force, and laws side by side on one data set.

    min over p of  sum_k (f_law(t_k; p) - f_k)^2

Each forward run is the event-driven solution along the spline of the measured motion, compiled once; values are
exchanged without compiling.
Chain: laws, scenes -> **fit**.
"""

from __future__ import annotations

import dataclasses
import time as clock
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .definition import checks
from .definition.describe import Described, Rows
from .definition.drives import Drive
from .laws import Law
from .scenes import prescribed_motion

__all__ = ["Fit", "compare", "fit"]

_FAILED = 1e3  # residual of a run that fails, in units of the data's size: the optimizer turns back


@dataclass(frozen=True, repr=False)
class Fit(Described):
    """A fitted law.

    Attributes
    ----------
    law : Law
        With the fitted parameters.
    values, errors : dict of str to float
        Fitted parameters and their standard errors (from the residual and its slope), in the units of the law; inf
        where the data does not determine a parameter.
    covariance : ndarray, shape (np, np)
        Of the fitted parameters, in the order of `values` and in their units.
    residual : float, in the unit of the data
        Root mean square of force minus data.
    force : ndarray, shape (n,)
        Of the fitted law, at the data's times, in their unit.
    cost : float, dimensionless
        Processor time of one run, s per s of motion.
    runs, failures : int
        Forward runs of the optimizer, and those that did not finish.
    success : bool
        Whether the optimizer converged.
    message : str
        What it said.

    Notes
    -----
    Source: nonlinear least squares, SciPy's trust-region method; the errors are those of the linearised problem.

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.fit import fit
    >>> from pwsmooth.laws.friction import Coulomb
    >>> t = np.linspace(0, 3, 61)
    >>> v = np.cos(4 * t)
    >>> found = fit(Coulomb(sigma2=0.1), t, v, 1.2 * np.sign(v) + 0.4 * v, kind="velocity")
    >>> {name: round(value, 6) for name, value in found.values.items()}, found.parameters
    ({'F_c': 1.2, 'sigma2': 0.4}, 2)
    """

    law: Law
    values: dict[str, float]
    errors: dict[str, float]
    covariance: np.ndarray
    residual: float
    force: np.ndarray
    cost: float
    runs: int
    failures: int
    success: bool
    message: str

    @property
    def parameters(self) -> int:
        """Number of fitted parameters."""
        return len(self.values)

    def _described(self) -> tuple[str, Rows]:
        found, unseen = [], []
        for name, value in self.values.items():
            if np.isinf(error := self.errors[name]):
                unseen.append(f"{name} = {value:.6g}: the data does not determine it")
            else:
                found.append(f"{name} = {value:.6g} +- {error:.2g}")
        return f"Fit of {type(self.law).__name__}: rms {self.residual:.4g}", {
            "found": found,
            "not seen": unseen,
            "runs": [f"{self.runs}, {self.failures} failed"],
            "message": [self.message],
        }.items()


_OPTIONS: dict[str, checks.Check] = {
    "t": checks.numbers, "motion": checks.numbers, "force": checks.numbers,
    "kind": checks.one_of("position", "velocity"), "settle": checks.nonnegative, "max_runs": checks.integer(1),
    "rtol": lambda value, what: checks.relative_tolerance(value),
}  # fmt: skip


@checks.door(
    law=checks.instance(Law, "a friction or contact law"), free=checks.optional(checks.several), **_OPTIONS
)
def fit(
    law: Law,
    t: Any,
    motion: Any,
    force: Any,
    *,
    kind: str = "position",
    free: Sequence[str] | None = None,
    settle: float = 0.0,
    rtol: float = 1e-8,
    max_runs: int = 200,
) -> Fit:
    """Fit a law to measured motion and force.

    Parameters
    ----------
    law : Law
        Its parameters are the first guess; they should have the right size.
    t : array_like, shape (n,)
        Times, in units consistent with those of the law.
    motion : array_like, shape (n,)
        Position or velocity there, in units of the law.
    force : array_like, shape (n,)
        Friction force there, in units of the law.
    kind : {"position", "velocity"}
        What `motion` is.
    free : sequence of str, optional
        Parameters to fit; all that are not structural and not 0 without. One with a value for each element counts as
        many.
    settle : float, in the unit of `t`
        Time at the start that is left out of the comparison: the law starts relaxed, the experiment may not have.
    rtol : float, dimensionless
        Of the forward runs.
    max_runs : int
        Bound on the optimizer's evaluations (without those of its slopes).

    Returns
    -------
    Fit
        The fitted law, its errors and what it cost.

    Raises
    ------
    ValueError
        Arrays of different lengths, an unknown name in `free`, fewer data than parameters.

    Notes
    -----
    Positive parameters are fitted by their logarithm: they stay positive, and steps are relative.

    Source: nonlinear least squares, SciPy's trust-region method.

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.fit import fit
    >>> from pwsmooth.laws.friction import Dahl
    >>> from pwsmooth import Drive
    >>> from pwsmooth.scenes import prescribed_motion
    >>> times = np.linspace(0, 3, 61)
    >>> x = 3e-5 * np.sin(4 * times)
    >>> data = prescribed_motion(Dahl(F_c=1.2, sigma0=8e4), position=Drive(times, x)).solve(t_eval=times)["force"]
    >>> found = fit(Dahl(), times, x, data)
    >>> round(found.values["F_c"], 6), round(found.values["sigma0"], 2)
    (1.2, 80000.0)
    """
    from scipy.optimize import least_squares

    if not t.shape == motion.shape == force.shape:
        raise ValueError(
            f"`t`, `motion` and `force` have the shapes {t.shape}, {motion.shape}, {force.shape}; give one "
            "sequence of the same length each."
        )
    scene = prescribed_motion(law, **{kind: Drive(t, motion)})
    forward = _Forward(law, scene, _free(law, free), t, settle, rtol)
    data = force[forward.used]
    if len(data) <= len(forward.names):
        raise ValueError(
            f"{len(data)} samples after `settle` cannot determine {len(forward.names)} parameters; "
            "give more data, or fewer `free` ones."
        )
    size = float(np.abs(data).max()) or 1.0

    def residuals(coordinates):
        model = forward(coordinates)
        return np.full(data.shape, _FAILED) if model is None else (model - data) / size

    first = forward.start
    # The runs' own error, some rtol, must not show in the slopes.
    found = least_squares(residuals, first, x_scale="jac", diff_step=max(1e-6, rtol**0.5), max_nfev=max_runs)
    begun = clock.process_time()
    model = forward(found.x)
    cost = (clock.process_time() - begun) / (t[-1] - t[0])
    if model is None:
        model = np.full(data.shape, np.nan)
    rms = float(np.sqrt(np.mean((model - data) ** 2)))
    spread = np.sum(((model - data) / size) ** 2) / (len(data) - len(first))
    # A direction that the data does not see has an infinite error: the pseudo-inverse would call it exact.
    _, singular, directions = np.linalg.svd(found.jac, full_matrices=False)
    blind = singular <= 1e-9 * singular.max()
    weights = np.where(blind, np.inf, 1 / np.where(blind, 1.0, singular) ** 2)
    with np.errstate(invalid="ignore"):
        covariance = spread * np.where(
            np.abs(directions[:, :, None] * directions[:, None, :]) > 1e-12,
            weights[:, None, None] * directions[:, :, None] * directions[:, None, :],
            0.0,
        ).sum(axis=0)
    slope = forward.slopes(found.x)
    covariance = covariance * np.outer(slope, slope)
    values = forward.values(found.x)
    errors = dict(zip(values, np.sqrt(np.abs(np.diag(covariance))).tolist()))
    best, message = _with(law, values, found.message)
    return Fit(
        best,
        values,
        errors,
        covariance,
        rms,
        model,
        cost,
        forward.runs,
        forward.failures,
        bool(found.success),
        message,
    )


@checks.door(laws=checks.several)
def compare(laws: Iterable[Law], t: Any, motion: Any, force: Any, **options: Any) -> list[Fit]:
    """Fit several laws to one data set.

    Parameters
    ----------
    laws : iterable of Law
        Each with its first guess.
    t : array_like, shape (n,)
        Times, in units consistent with those of the laws.
    motion : array_like, shape (n,)
        Position or velocity there, in units of the laws.
    force : array_like, shape (n,)
        Friction force there, in units of the laws.
    **options
        Those of `fit` but `free`, which is left to each law.

    Returns
    -------
    list of Fit
        The smallest residual first.

    Raises
    ------
    ValueError
        `free` is given; as `fit`.

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.fit import compare
    >>> from pwsmooth.laws.friction import Coulomb, StribeckFriction
    >>> t = np.linspace(0, 3, 61)
    >>> v = 0.01 * np.cos(4 * t)
    >>> force = StribeckFriction(F_c=1.0, F_s=1.4, v_s=0.004).steady_force(v)
    >>> laws = [Coulomb(sigma2=0.1), StribeckFriction(v_s=0.003)]
    >>> [type(found.law).__name__ for found in compare(laws, t, v, force, kind="velocity")]
    ['StribeckFriction', 'Coulomb']
    """
    checks.all_of_kind("laws", laws, Law)
    if "free" in options:
        raise ValueError("`free` belongs to one law; call `fit` for each.")
    return sorted((fit(law, t, motion, force, **options) for law in laws), key=lambda found: found.residual)


def _free(law: Law, names: Sequence[str] | None) -> list[str]:
    fields = {f.name: f for f in dataclasses.fields(law)}  # type: ignore[arg-type]
    fitted = [name for name, f in fields.items() if not f.metadata["structural"]]
    if names is None:
        return [name for name in fitted if getattr(law, name) != 0]
    for name in names:
        if name not in fitted:
            raise ValueError(
                f"`free` names {checks.shown(name)}; parameters of {type(law).__name__} are {', '.join(fitted)}."
            )
    return list(names)


class _Forward:
    """The force of a law at the data's times as a function of the fitted coordinates."""

    def __init__(self, law, scene, free, t, settle, rtol):
        self.law, self.scene, self.t, self.rtol = law, scene, t, rtol
        self.used = t >= t[0] + settle
        self.runs = self.failures = 0
        self.names, values, self.owner, logarithmic = [], [], [], []
        for field in dataclasses.fields(law):
            if field.name not in free:
                continue
            value = getattr(law, field.name)
            for i, v in enumerate(value if isinstance(value, tuple) else (value,)):
                self.names.append(f"{field.name}_{i + 1}" if isinstance(value, tuple) else field.name)
                values.append(v)
                self.owner.append(field.name)
                # Fit log(p) where p > 0 by assumption or by the first guess.
                logarithmic.append(field.metadata["sign"] != "real" and v > 0)
        self.logarithmic, first = np.array(logarithmic), np.array(values)
        self.unit = np.where(self.logarithmic, 1.0, np.abs(first) + (first == 0))
        self.start = np.where(
            self.logarithmic, np.log(np.where(self.logarithmic, first, 1.0)), first / self.unit
        )

    def _plain(self, coordinates):
        bounded = np.clip(coordinates, -200, 200)
        return np.where(self.logarithmic, np.exp(bounded), coordinates * self.unit)

    def values(self, coordinates):
        return dict(zip(self.names, self._plain(coordinates).tolist()))

    def slopes(self, coordinates):
        """d value/d coordinate"""
        return np.where(self.logarithmic, self._plain(coordinates), self.unit)

    def __call__(self, coordinates):
        self.runs += 1
        values: dict[str, Any] = {}
        for owner, value in zip(self.owner, self._plain(coordinates).tolist()):
            values.setdefault(owner, []).append(value)
        values = {name: value if len(value) > 1 else value[0] for name, value in values.items()}
        run = self.scene.solve(parameters=values, t_eval=self.t, rtol=self.rtol, max_steps=200_000)
        if not run.success or len(run.t) != len(self.t):
            self.failures += 1
            return None
        force = run["force"][self.used]
        return force if np.isfinite(force).all() else None


def _with(law, values, message):
    """The law with fitted values, or as it was, with the reason in the message."""
    changed: dict[str, Any] = {}
    for name, old in law.values.items():
        if isinstance(old, tuple):
            changed[name] = tuple(values.get(f"{name}_{i + 1}", v) for i, v in enumerate(old))
        elif name in values:
            changed[name] = values[name]
    try:
        return dataclasses.replace(law, **changed), message
    except ValueError as error:
        return law, f"{message} The fitted values are none of this law: {error}"
