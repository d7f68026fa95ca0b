"""What the data say of the fitted quantities: covariance, and the combinations that they determine.

    J = d(residual in units of the noise)/d(coordinates),   covariance = (J^T J)^-1

Coordinates are logarithms of positive quantities, so that a direction in them is a product of powers.
Chain: gauss_newton.py -> **identifiability** -> result.py.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..door import checks
from ..door.describe import Described, Rows
from ..door.documenting import complete

_BLIND = 1e-9  # of the largest singular value: what is below is rounding
_WORTH = 0.05  # of a direction: smaller parts are not told


def covariance(jacobian: np.ndarray) -> np.ndarray:
    """Of the coordinates; inf, not a number of rounding, where the data do not see a direction."""
    if not jacobian.shape[1]:
        return np.zeros((0, 0))
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    blind = singular <= _BLIND * singular.max(initial=0.0)
    weights = np.where(blind, np.inf, 1 / np.where(blind, 1.0, singular) ** 2)
    products = directions[:, :, None] * directions[:, None, :]
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(products) > 1e-12, weights[:, None, None] * products, 0.0).sum(axis=0)


@complete
class Combination(NamedTuple):
    """A combination of parameters, and how well it is known.

    Attributes
    ----------
    powers : dict of str to float
        Parameter -> its power in the product; of a parameter that is fitted as it is, its weight in units of its size.
    error : float, dimensionless
        Standard error of its logarithm; inf where the data do not see it.
    singular_value : float, dimensionless
        Of the scaled Jacobian.

    >>> t = np.linspace(0, 3, 61)
    >>> v = 1 + 0.5 * np.sin(t)
    >>> found = fit_law(Coulomb(sigma2=0.1), t, v, 1.2 + 0.4 * v, kind="velocity", noise=0.01)
    >>> best, second = found.identifiability().combinations
    >>> best.words, best.error < second.error < 0.1
    ('F_c * sigma2^0.44', True)
    """

    powers: dict[str, float]
    error: float
    singular_value: float

    @property
    def words(self) -> str:
        """The product, without factors that hardly matter."""
        largest = max(map(abs, self.powers.values()))
        told = {name: power / largest for name, power in self.powers.items() if abs(power) > _WORTH * largest}
        return " * ".join(
            name if round(power, 2) == 1 else f"{name}^{power:.2g}" for name, power in told.items()
        )


@checks.door()
class Identifiability(Described):
    """Which combinations of the parameters the data determine, the best known first; `Fit.identifiability` makes it.

    Parameters
    ----------
    jacobian : ndarray, shape (m, np + nuisance), dimensionless
        d(residual in units of the noise)/d(coordinates): of the parameters, then of unknown initial values.
    names : list of str
        The parameters.
    nuisance : int
        How many initial values.
    limit : float, dimensionless
        Error from which on a combination counts as free.

    Attributes
    ----------
    combinations : list of Combination
        As many as parameters; at right angles to each other in the logarithms.
    limit : float, dimensionless
        Error from which on a combination counts as free.

    Source: singular values of the Jacobian by logarithms, without what unknown initial values could explain.

    >>> t = np.linspace(0, 3, 61)
    >>> v = 1 + 0.5 * np.sin(t)
    >>> found = fit_law(Coulomb(sigma2=0.1), t, v, 1.2 + 0.4 * v, kind="velocity", noise=0.01)
    >>> len(found.identifiability().known), found.identifiability().free
    (2, [])
    """

    def __init__(self, jacobian: np.ndarray, names: list[str], nuisance: int, limit: float) -> None:
        count = len(names)
        own, others = jacobian[:, :count], jacobian[:, count : count + nuisance]
        if nuisance:  # what unknown initial values could explain tells nothing of parameters
            left, singular, _ = np.linalg.svd(others, full_matrices=False)
            basis = left[:, singular > _BLIND * singular.max(initial=0.0)]
            own = own - basis @ (basis.T @ own)
        _, singular, directions = np.linalg.svd(own, full_matrices=False)
        seen = singular > _BLIND * singular.max(initial=0.0)
        self.limit = limit
        self.combinations = [
            Combination(dict(zip(names, (row * np.sign(row[np.abs(row).argmax()])).tolist())),
                        float(1 / value) if known else np.inf, float(value))
            for row, value, known in zip(directions, singular, seen)
        ]  # fmt: skip

    @property
    def known(self) -> list[Combination]:
        """Combinations with an error below the limit."""
        return [c for c in self.combinations if c.error < self.limit]

    @property
    def free(self) -> list[Combination]:
        """The others: they may change by their own size, and more, without a trace in the data."""
        return [c for c in self.combinations if not c.error < self.limit]

    def _described(self) -> tuple[str, Rows]:
        free = len(self.free)
        return f"Identifiability: {len(self.known)} of {len(self.combinations)} combinations are known", {
            "known": [f"{c.words} to {100 * c.error:.2g} %" for c in self.known],
            "free": [
                f"{c.words}, error {'inf' if np.isinf(c.error) else f'{100 * c.error:.2g} %'}"
                for c in self.free
            ],
            "advice": [f"fix {free} of the parameters, give priors, or measure more"] if free else [],
        }.items()
