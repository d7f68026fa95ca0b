"""Fit: the fitted system with errors, and what to ask of it: identifiability, profiles, a picture; fits side by side.

Chain: gauss_newton.py, identifiability.py -> **result** -> fitting.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..door import checks
from ..door.describe import Described, Rows
from ..door.documenting import complete
from .gauss_newton import Minimum, minimise
from .identifiability import Identifiability, covariance
from .records import Record
from .shooting import Shooting

if TYPE_CHECKING:
    import pandas

__all__ = ["Comparison", "Fit", "Profile", "compare"]


@checks.door()
class Fit(Described):
    """A fitted system; `fit` and `fit_law` make it.

    Parameters
    ----------
    system : System
        As it was given.
    problem, found : Shooting, Minimum
        What was minimised, and the least misfit.
    count : int
        How many of the unknowns are parameters.
    estimated : mapping of str to float
        Noise levels that were estimated, in the units of what was measured.
    fixed : ndarray of bool, shape (nq,), dimensionless
        Unknowns that had one value only.
    cost : float, dimensionless
        As the attribute.
    options : mapping of str to int
        Of the search, for profiles.

    Attributes
    ----------
    system : System
        With the fitted parameters.
    law : Law or None
        With the fitted parameters, of `fit_law`.
    values, errors : dict of str to float
        Fitted parameters and their standard errors, in their units; inf where the data do not determine one, nan for
        one at its bound.
    starts, start_errors : list of dict of str to float, in units of the states
        Of each record its fitted initial values and their errors.
    covariance : ndarray, shape (np, np)
        Of the fitted parameters, in the order of `values` and in their units.
    noise : dict of str to float
        Noise levels that were estimated, by the name of what was measured, in its unit.
    rms : dict of str to float
        Root mean square of model minus data, in the units of what was measured.
    samples, quantities : int
        Measured numbers, and fitted ones: parameters, initial values, noise levels.
    chi2 : float, dimensionless
        Sum of squares of model minus data in units of the noise, priors included.
    aic, bic : float, dimensionless
        Akaike's and the Bayesian information criterion; among models of the same data the smallest is the best.
    cost : float, dimensionless
        Processor time of the runs, s per unit of time of the records.
    runs, failures : int
        Runs along all records, and those of them that did not finish.
    success : bool
        Whether a least misfit was found.
    message : str
        How the fit ended.
    problems : list of NoDerivative
        Instants of the last runs at which there is no derivative; errors do without what passes through them.

    Source: errors are those of the linearised problem at the least misfit.

    >>> v = sp.Symbol("v", real=True)
    >>> F = sp.Symbol("F", positive=True)
    >>> sliding = System({v: -F * sp.sign(v)}, parameters={F: 0.3})
    >>> t = np.linspace(0, 3, 31)
    >>> noise = 0.01 * np.random.default_rng(1).normal(size=t.size)
    >>> found = fit(sliding, Record(t, {"v": np.fmax(1 - 0.5 * t, 0) + noise}, x0={"v": 1}), ["F"])
    >>> bool(abs(found.values["F"] - 0.5) < 3 * found.errors["F"]), found.samples, found.quantities
    (True, 31, 2)
    """

    law: Any = None

    def __init__(self, system: Any, problem: Shooting, found: Minimum, count: int, estimated: Mapping[str, float],
                 fixed: np.ndarray, cost: float, options: Mapping[str, Any]) -> None:  # fmt: skip
        self._problem, self._found, self._count, self._options = problem, found, count, options
        names = problem.coordinates.names
        self._names, self._fixed = list(names[:count]), fixed
        numbers = list(found.at.values.values())
        self.values = dict(zip(names[:count], numbers))
        self.starts = [
            {name: numbers[i] for name, i in zip(e.record.unknown, columns)}
            for e, columns in zip(problem.experiments, problem.columns)
        ]
        self.system = system.with_parameters({name: self.values[name] for name in self._names})
        self.noise, self.cost = dict(estimated), cost
        self.runs, self.failures, self.success, self.message = (
            found.runs,
            found.failures,
            found.success,
            found.message,
        )
        self.problems = found.slopes.problems
        low, high = problem.coordinates.low, problem.coordinates.high
        self._bound = ~fixed & ((found.z <= low + 1e-9) | (found.z >= high - 1e-9))
        loose = ~(self._bound | fixed)
        whole = np.full((len(names), len(names)), np.nan)
        whole[np.ix_(loose, loose)] = covariance(found.slopes.jacobian[:, loose])
        slope = problem.coordinates.slopes(found.z)
        whole *= np.outer(slope, slope)
        errors = np.sqrt(np.abs(np.diag(whole)))
        self.covariance = whole[:count, :count]
        self.errors = dict(zip(self._names, errors.tolist()))
        self.start_errors = [
            {name: float(errors[i]) for name, i in zip(e.record.unknown, columns)}
            for e, columns in zip(problem.experiments, problem.columns)
        ]
        self.chi2 = 2.0 * found.at.misfit
        self._judge()

    def _judge(self) -> None:
        """Sums of squares by what was measured, and the criteria made of them."""
        squares: dict[str, list[float]] = {}
        given = deviance = 0.0
        self.samples, free = 0, {name: [0, 0.0] for name in self.noise}
        for i, e in enumerate(self._problem.experiments):
            for k, name in enumerate(e.names):
                r = self._difference(i)[k][e.there[k]]
                squares.setdefault(name, []).extend(r**2)
                self.samples += len(r)
                if (level := e.record.noise.get(name)) is not None:
                    given += float(np.sum((r / level) ** 2)) + len(r) * math.log(2 * math.pi * level**2)
                else:
                    free[name] = [free[name][0] + len(r), free[name][1] + float(np.sum(r**2))]
        self.rms = {name: math.sqrt(np.mean(r)) for name, r in squares.items()}
        for n, square in free.values():  # the likeliest level puts n into the exponent
            deviance += n * (math.log(2 * math.pi * max(square, np.finfo(float).tiny) / n) + 1)
        self.quantities = int(np.sum(~self._fixed)) + len(self.noise)
        self.aic = given + deviance + 2 * self.quantities
        self.bic = given + deviance + self.quantities * math.log(self.samples)

    @property
    def parameters(self) -> int:
        """Number of fitted parameters."""
        return len(self.values)

    @property
    def records(self) -> list[Record]:
        """What was fitted."""
        return [e.record for e in self._problem.experiments]

    def _difference(self, i: int) -> np.ndarray:
        e = self._problem.experiments[i]
        return self._model(i) - e.data

    def _model(self, i: int) -> np.ndarray:
        e = self._problem.experiments[i]
        return np.concatenate([e.values(arc) for arc in self._found.at.arcs[i]], axis=1)

    @checks.door(record=checks.integer(0))
    def predicted(self, name: Any, record: int = 0) -> np.ndarray:
        """What the fitted system does, at the times of a record.

        Parameters
        ----------
        name : str or Symbol
            Of what was measured.

        Returns
        -------
        ndarray, shape (nt,)
            In the unit of what was measured; nan where all samples were missing.
        """
        e = self._experiment(record)
        whole = np.full(e.record.t.shape, np.nan)
        whole[np.isin(e.record.t, e.t)] = self._model(record)[self._row(e, name)]
        return whole

    def _experiment(self, record: int) -> Any:
        experiments = self._problem.experiments
        if record >= len(experiments):
            raise ValueError(f"`record` is {record}; there are {len(experiments)}, counted from 0.")
        return experiments[record]

    def _row(self, e: Any, name: Any) -> int:
        name = str(checks.named(name))
        if name not in e.names:
            raise ValueError(f"`name` is {name!r}; this record has {', '.join(e.names)}.")
        return e.names.index(name)

    # ---- what the data determine

    @checks.door(limit=checks.positive)
    def identifiability(self, limit: float = 1.0) -> Identifiability:
        """Which combinations of the parameters the data determine.

        Parameters
        ----------
        limit : float, dimensionless
            Error of a logarithm from which on a combination counts as free.

        Returns
        -------
        Identifiability
            From the singular values of the Jacobian by logarithms of parameters, the residuals in units of the noise.
        """
        loose = ~(self._bound | self._fixed)
        own = np.flatnonzero(loose[: self._count])
        others = self._count + np.flatnonzero(loose[self._count :])
        jacobian = self._found.slopes.jacobian[:, [*own, *others]]
        return Identifiability(jacobian, [self._names[i] for i in own], len(others), limit)

    @checks.door(name=checks.key, points=checks.integer(3), width=checks.positive)
    def profile(self, name: Any, points: int = 13, width: float = 3.0) -> Profile:
        """How the misfit grows as one parameter is held at other values and all others are fitted again.

        Parameters
        ----------
        name : str or Symbol
            The parameter.
        points : int
            How many values.
        width : float, dimensionless
            How far to both sides, in standard errors.

        Returns
        -------
        Profile
            Where the errors of the linearised problem can be trusted it is a parabola.

        Raises
        ------
        ValueError
            No such parameter; one without a finite error, whose profile has no scale.
        """
        name = str(checks.named(name))
        if name not in self.values:
            raise ValueError(f"`name` is {name!r}; fitted parameters are {', '.join(self.values)}.")
        error = self.errors[name]
        if not 0 < error < math.inf:
            raise ValueError(
                f"{name!r} has the error {error:g}, which sets no scale; give it a prior, or bounds apart."
            )
        i, coordinates = self._names.index(name), self._problem.coordinates
        reach = width * error / coordinates.slopes(self._found.z)[i]
        offsets = np.linspace(-reach, reach, points | 1)
        found = np.full(len(offsets), self._found.at.misfit)
        fixed = self._fixed.copy()
        fixed[i] = True
        middle = len(offsets) // 2
        for side in (range(middle - 1, -1, -1), range(middle + 1, len(offsets))):
            at = self._found
            for k in side:  # each from its neighbour
                z = at.z.copy()
                z[i] = self._found.z[i] + offsets[k]
                if not coordinates.low[i] <= z[i] <= coordinates.high[i]:
                    found[k] = np.nan
                    continue
                at = minimise(self._problem, z, at.at.nodes, fixed, told=lambda _: None, **self._options)
                found[k] = at.at.misfit
        places = [self._found.z.copy() for _ in offsets]
        for z, offset in zip(places, offsets):
            z[i] += offset
        at_values = np.array([coordinates.values(z)[i] for z in places])
        return Profile(name, self.values[name], at_values, 2 * (found - self._found.at.misfit))

    # ---- to look at

    @checks.door(record=checks.integer(0))
    def plot(self, record: int = 0, axes: Any = None) -> np.ndarray:
        """Data and model of a record against time, and below them what remains.

        Parameters
        ----------
        axes : sequence of Axes, optional
            Two for each column of the record; a new figure without.

        Returns
        -------
        ndarray of Axes
            Of each column its picture and its residual.
        """
        from .. import plotting

        e = self._experiment(record)
        size = 2 * len(e.names)
        panels = plotting.axes_for(
            axes, size, (7.0, 0.6 + 1.4 * size), f"{len(e.names)} columns; give two for each"
        )
        for k, name in enumerate(e.names):
            above, below, there = panels[2 * k], panels[2 * k + 1], e.there[k]
            above.plot(
                e.t[there], e.data[k, there], ".", color=plotting.COLOUR["mark"], markersize=3, label="measured"
            )
            above.plot(e.t, self._model(record)[k], color=plotting.COLOUR["right"], label="fitted")
            above.set_ylabel(name)
            below.plot(
                e.t[there], self._difference(record)[k, there], ".", color=plotting.COLOUR["left"], markersize=3
            )
            level = e.record.noise.get(name, self.noise.get(name))
            below.axhspan(-level, level, color=plotting.LINEAR_SHADE, alpha=0.5, linewidth=0, zorder=0)
            below.set_ylabel(f"fitted - measured\n{name}")
            below.margins(x=0)
        panels[0].legend(loc="best")
        panels[-1].set_xlabel(str(e.system.model.time))
        return panels

    def _described(self) -> tuple[str, Rows]:
        found, unseen = [], []
        for name, value in self.values.items():
            error = self.errors[name]
            if math.isinf(error):
                unseen.append(f"{name} = {value:.6g}: the data do not determine it")
            elif math.isnan(error):
                found.append(f"{name} = {value:.6g}, at its bound")
            else:
                found.append(f"{name} = {value:.6g} +- {error:.2g}")
        began = [
            f"{name} = {value:.6g} +- {errors[name]:.2g}" + (f" (record {i})" if len(self.starts) > 1 else "")
            for i, (start, errors) in enumerate(zip(self.starts, self.start_errors))
            for name, value in start.items()
        ]
        what = type(self.law).__name__ if self.law is not None else "a system"
        rms = ", ".join(f"{name} {value:.4g}" for name, value in self.rms.items())
        return f"Fit of {what}: rms {rms}", {
            "found": found,
            "not seen": unseen,
            "start": began,
            "samples": [f"{self.samples}, BIC {self.bic:.6g}"],
            "runs": [f"{self.runs}, {self.failures} failed"],
            "message": [self.message],
            "no derivative": [str(problem) for problem in self.problems],
        }.items()


@complete
class Profile(NamedTuple):
    """The profile likelihood of a parameter.

    Attributes
    ----------
    name : str
        The parameter.
    best : float
        Its fitted value, in its unit.
    values : ndarray, shape (n,)
        At which it was held, in its unit.
    excess : ndarray, shape (n,), dimensionless
        Sum of squares in units of the noise, above that of the fit; nan beyond a bound.

    >>> t = np.linspace(0, 3, 61)
    >>> v = 1 + 0.5 * np.sin(t)
    >>> found = fit_law(Coulomb(sigma2=0.1), t, v, 1.2 + 0.4 * v, kind="velocity", noise=0.01)
    >>> profile = found.profile("sigma2", points=5)
    >>> low, high = profile.interval()
    >>> low < 0.4 < high
    True
    """

    name: str
    best: float
    values: np.ndarray
    excess: np.ndarray

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Values between which the parameter lies at a level of confidence.

        Parameters
        ----------
        level : float, dimensionless
            Between 0 and 1.

        Returns
        -------
        (float, float)
            In the unit of the parameter; infinite to a side on which the profile does not reach the level.
        """
        from scipy.stats import chi2

        wanted = math.sqrt(chi2.ppf(level, 1))
        # Its root with the sign of the side is a straight line where the problem is linear.
        root = np.sqrt(np.fmax(self.excess, 0.0)) * np.sign(self.values - self.best)
        there = np.isfinite(root)
        root, values = np.maximum.accumulate(root[there]), self.values[there]
        low, high = np.interp([-wanted, wanted], root, values, left=-math.inf, right=math.inf)
        return float(low), float(high)

    def plot(self, ax: Any = None) -> Any:
        """The excess against the parameter.

        Returns
        -------
        Axes
            Where it was drawn.
        """
        from .. import plotting

        (ax,) = plotting.axes_for(None if ax is None else [ax], 1, (4.5, 3.0), "one profile")
        ax.plot(self.values, self.excess, ".-", color=plotting.COLOUR["right"])
        ax.axvline(self.best, color=plotting.COLOUR["mark"], linewidth=0.8)
        ax.set(xlabel=self.name, ylabel="excess of the sum of squares")
        return ax


@checks.door()
class Comparison(Described):
    """Fits of the same data side by side, the smallest BIC first; `compare` makes it.

    Parameters
    ----------
    fits : mapping of str to Fit
        By their names.

    Attributes
    ----------
    fits : dict of str to Fit
        By their names.

    >>> t = np.linspace(0, 3, 61)
    >>> v = 1 + 0.5 * np.sin(t)
    >>> fits = [fit_law(Coulomb(sigma2=0.1), t, v, 1.2 + 0.4 * v, kind="velocity", noise=0.01)]
    >>> print(compare(fits).to_dataframe().loc["Coulomb", "quantities"])
    2
    """

    def __init__(self, fits: Mapping[str, Fit]) -> None:
        self.fits = dict(sorted(fits.items(), key=lambda item: item[1].bic))

    def to_dataframe(self) -> pandas.DataFrame:
        """A row for each fit.

        Returns
        -------
        pandas.DataFrame
            With `quantities`, `states` (internal ones and those of the mechanism), rms of each output, `chi2`, `aic`,
            `bic`, `cost`, `free` (combinations that the data do not determine), `success`.
        """
        import pandas

        rows = {
            name: {
                "quantities": fit.quantities, "states": len(fit.system.states),
                **{f"rms {key}": value for key, value in fit.rms.items()},
                "chi2": fit.chi2, "aic": fit.aic, "bic": fit.bic, "cost": fit.cost,
                "free": len(fit.identifiability().free), "success": fit.success,
            }
            for name, fit in self.fits.items()
        }  # fmt: skip
        return pandas.DataFrame.from_dict(rows, orient="index")

    def _described(self) -> tuple[str, Rows]:
        best = next(iter(self.fits.values()))
        return f"{len(self.fits)} fits of {best.samples} samples", {
            name: [
                f"BIC {fit.bic:.6g} (+{fit.bic - best.bic:.4g}), "
                + ", ".join(f"rms {key} {value:.4g}" for key, value in fit.rms.items())
                + f", {fit.quantities} fitted, cost {fit.cost:.2g}" + ("" if fit.success else ", not converged")
            ]
            for name, fit in self.fits.items()
        }.items()  # fmt: skip


@checks.door()
def compare(fits: Mapping[str, Fit] | Iterable[Fit]) -> Comparison:
    """Fits of the same data side by side.

    Parameters
    ----------
    fits : mapping of str to Fit, or iterable of Fit
        Each of the same records; without names they are called as their laws.

    Returns
    -------
    Comparison
        The smallest BIC first.

    Raises
    ------
    ValueError, TypeError
        None, or fits of different data; what is no Fit; two laws of one name.

    >>> t = np.linspace(0, 3, 61)
    >>> v = 0.01 * np.cos(4 * t)
    >>> force = StribeckFriction(F_c=1.0, F_s=1.4, v_s=0.004).steady_force(v)
    >>> laws = [Coulomb(sigma2=0.1), StribeckFriction(v_s=0.003)]
    >>> list(compare(fit_law(law, t, v, force, kind="velocity") for law in laws).fits)
    ['StribeckFriction', 'Coulomb']
    """
    if isinstance(fits, Mapping):
        named = {str(name): fit for name, fit in fits.items()}
    else:
        given = checks.several(fits, "`fits`")
        named = {
            f"model {i + 1}" if getattr(fit, "law", None) is None else type(fit.law).__name__: fit
            for i, fit in enumerate(given)
        }
        if len(named) < len(given):
            raise ValueError("`fits` has two of one law; give a dict with a name for each.")
    if not named:
        raise ValueError("`fits` is empty; give at least one.")
    checks.all_of_kind("fits", named.values(), Fit)
    data = {
        tuple(column.tobytes() for r in fit.records for column in (r.t, *r.values.values()))
        for fit in named.values()
    }
    if len(data) > 1:
        raise ValueError(
            "`fits` are of different data, whose criteria cannot be compared; fit the same records."
        )
    return Comparison(named)
