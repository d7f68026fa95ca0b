"""What a sliding portrait holds: regions, sliding flows, lines and points of a switching surface; its picture.

Chain: **portrait** -> portraits.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...door import checks
from ...door.describe import Described, Rows
from ...door.documenting import complete

if TYPE_CHECKING:
    import xarray

__all__ = ["FoldLine", "SlidingPortrait", "TwoFold"]

#: Kinds of regions, by their number; -1 where there are no values.
REGIONS = (
    "crossing up",
    "crossing down",
    "attracting sliding",
    "repelling sliding",
    "captured from below",
    "captured from above",
    "repelling, with hidden branches",
)


@complete
@dataclass(frozen=True)
class FoldLine:
    """A line on which the field of one side is tangent to the surface.

    Attributes
    ----------
    side : int
        1 or -1, of which side.
    points : ndarray, shape (2, N)
        In the coordinates, in their units.
    visible : ndarray of bool, shape (N,)
        Whether the field leads away from the surface there; dimensionless.

    >>> FoldLine(1, np.zeros((2, 3)), np.array([True, True, False])).visible.sum()
    np.int64(2)
    """

    side: int
    points: np.ndarray
    visible: np.ndarray


@complete
@dataclass(frozen=True)
class TwoFold:
    """A point at which the folds of both sides meet.

    Attributes
    ----------
    point : ndarray, shape (2,)
        In the coordinates, in their units.
    kind : str
        "visible-visible", "visible-invisible" or "invisible-invisible".

    >>> TwoFold(np.zeros(2), "invisible-invisible").kind
    'invisible-invisible'
    """

    point: np.ndarray
    kind: str


@checks.door()
@dataclass(frozen=True, repr=False)
class SlidingPortrait(Described):
    """The flow on the surface of a switch.

    Attributes
    ----------
    system : System
        Of which.
    switch : str
        Its name.
    coordinates : (str, str)
        Names of the coordinates on the surface.
    axes : (ndarray, ndarray), shapes (nx,) and (ny,)
        Their values, in their units.
    regions : ndarray of int, shape (ny, nx)
        Places in `REGIONS`, dimensionless: "captured from below" is where motion from there meets a hidden branch of
        sliding, and that from above crosses.
    lam : ndarray, shape (k, ny, nx)
        Multipliers of the sliding flows, in order, dimensionless; nan where there are fewer.
    attracts : ndarray of bool, shape (k, ny, nx)
        Whether each attracts, dimensionless.
    velocity : ndarray, shape (k, 2, ny, nx)
        Of the coordinates along each, in their units over that of time.
    folds : tuple of FoldLine
        Tangencies of the fields on both sides.
    hidden_folds : tuple of ndarray, shape (3, N)
        Lines on which two sliding flows meet: the coordinates in their units, and the multiplier.
    two_folds : tuple of TwoFold
        Points.
    equilibria : tuple of Equilibrium
        Pseudo-equilibria, of an autonomous system.

    Friction that is stronger at rest holds a block at forces up to 16/9, and captures it at forces up to 1:

    >>> t, y, v = sp.symbols("t y v", real=True)
    >>> lam = Switch("lam", v)
    >>> block = System({y: v, v: sp.sin(t) - 3 * y - lam * (1 + 3 * (1 - lam**2))}, time=t)
    >>> portrait = sliding_portrait(block, lam, {t: (0, 6), y: (-1, 1)})
    >>> sorted({round(float(abs(l)), 9) for line in portrait.hidden_folds for l in line[2]})
    [0.666666667]
    """

    system: Any
    switch: str
    coordinates: tuple[str, str]
    axes: tuple[np.ndarray, np.ndarray]
    regions: np.ndarray
    lam: np.ndarray
    attracts: np.ndarray
    velocity: np.ndarray
    folds: tuple[FoldLine, ...]
    hidden_folds: tuple[np.ndarray, ...]
    two_folds: tuple[TwoFold, ...]
    equilibria: tuple[Any, ...]

    @property
    def shares(self) -> dict[str, float]:
        """Part of the grid that each kind of region takes."""
        found = {name: float(np.mean(self.regions == k)) for k, name in enumerate(REGIONS)}
        return {name: share for name, share in found.items() if share}

    def to_dataset(self) -> xarray.Dataset:
        """What is known on the grid, with its names.

        Returns
        -------
        xarray.Dataset
            Over the coordinates: `region` in words, and of every `flow` the multiplier, whether it attracts and the
            velocity of each coordinate.
        """
        import xarray

        x, y = self.coordinates
        words = np.array([*REGIONS, ""])[self.regions]
        flows = {"lam": self.lam, "attracts": self.attracts}
        flows |= {f"d{name}/dt": self.velocity[:, k] for k, name in enumerate(self.coordinates)}
        return xarray.Dataset(
            {"region": ((y, x), words), **{name: (("flow", y, x), value) for name, value in flows.items()}},
            coords=dict(zip(self.coordinates, self.axes)),
            attrs={"switch": self.switch},
        )

    def plot(self, ax: Any = None) -> Any:
        """The portrait: regions in shades, sliding flows as streamlines, folds, two-folds and pseudo-equilibria.

        Visible folds are solid and invisible ones dashed, in the colour of their side; hidden folds are dotted; flows
        that repel are thin.

        Returns
        -------
        Axes
            Where it was drawn.
        """
        from matplotlib.colors import ListedColormap

        from ...plotting import COLOUR, LINEAR_SHADE, NONLINEAR_SHADE, axes_for

        new, (ax,) = ax is None, axes_for(ax, 1, (5.5, 4.2), "one portrait; give one")
        shades = [
            "white",
            "white",
            "white",
            LINEAR_SHADE,
            "#FBE5D6",
            NONLINEAR_SHADE,
            NONLINEAR_SHADE,
            "#F3D9E6",
        ]
        ax.pcolormesh(
            *self.axes, self.regions, cmap=ListedColormap(shades), vmin=-1.5, vmax=6.5, rasterized=True
        )
        for lam, attracts, velocity in zip(self.lam, self.attracts, self.velocity):
            for which, colour, width in ((attracts, "stick", 0.9), (~attracts & np.isfinite(lam), "fast", 0.5)):
                speed = np.where(which, velocity, np.nan)
                if np.isfinite(speed).any() and min(which.any(axis=0).sum(), which.any(axis=1).sum()) > 1:
                    ax.streamplot(
                        *self.axes, *np.ma.masked_invalid(speed), color=COLOUR[colour], linewidth=width,
                        arrowsize=0.7, density=0.9,
                    )  # fmt: skip
        for fold in self.folds:
            for visible, line in ((True, "-"), (False, "--")):
                shown = np.where(fold.visible == visible, fold.points, np.nan)
                ax.plot(*shown, line, color=COLOUR["right" if fold.side > 0 else "left"])
        for points in self.hidden_folds:
            ax.plot(points[0], points[1], ":", color=COLOUR["exact"])
        for two in self.two_folds:
            ax.plot(*two.point, "D", color=COLOUR["exact"], markersize=5)
        for e in self.equilibria:
            at = [e.x0[name] for name in self.coordinates]
            ax.plot(*at, "o", color=COLOUR["exact"], fillstyle="full" if e.stable else "none")
        if new:
            for name, shade in (("attracting sliding", 3), ("repelling sliding", 4), ("captured", 5)):
                if any(name in region for region in self.shares):
                    ax.plot([], [], "s", color=shades[shade], markeredgecolor=COLOUR["mark"], label=name)
            ax.legend(loc="upper left", bbox_to_anchor=(1, 1))
        limits = [(axis[0], axis[-1]) for axis in self.axes]
        ax.set(xlabel=self.coordinates[0], ylabel=self.coordinates[1], xlim=limits[0], ylim=limits[1])
        return ax

    def _described(self) -> tuple[str, Rows]:
        lines = [
            f"of the side {fold.side:+d}, {fold.points.shape[1]} points, {fold.visible.mean():.0%} visible"
            for fold in self.folds
        ]
        x, y = self.coordinates
        return f"SlidingPortrait of {self.switch} over {x} and {y}", {
            "regions": [f"{share:.1%} {name}" for name, share in self.shares.items()],
            "flows": [f"up to {len(self.lam)} at a point"] if len(self.lam) else [],
            "folds": lines,
            "hidden folds": [f"{line.shape[1]} points, lambda {line[2].min():.6g} to {line[2].max():.6g}"
                             for line in self.hidden_folds],
            "two-folds": [f"{two.kind} at ({two.point[0]:.9g}, {two.point[1]:.9g})" for two in self.two_folds],
            "pseudo-equilibria": [f"{e.stability} at " + ", ".join(f"{n} = {e.x0[n]:.9g}" for n in self.coordinates)
                                  for e in self.equilibria],
        }.items()  # fmt: skip
