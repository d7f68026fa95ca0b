"""What curves ask of an orbit in segments: its critical matrices, its multipliers, slopes segment by segment.

    mu is a multiplier  <->  the shift map's matrix, its last segment over mu, has the eigenvalue 1
    mu^2 - 2 kappa mu + 1 = 0  <->  the same of the segments run through twice, closed by -2 kappa half way

so that no product of the segments' matrices is formed, in which a multiplier of 1e8 hides those near to 1.

Chain: segments.py, multipliers.py, windows.py -> **pieces** -> conditions.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...results.solution import Solution
from .multipliers import cyclic_multipliers
from .poincare import Image
from .segments import Shooting
from .windows import PartedImage


@dataclass(frozen=True)
class PiecedImage(PartedImage):
    """Ends of segments, in the place of the points that they should be, and each alone; the segments of the parts."""

    ends: tuple[Image, ...] = ()
    nodes: tuple[int, ...] = ()

    @property
    def by_legs(self) -> tuple[tuple[Solution, ...], ...]:
        return tuple(end.runs for end in self.ends)


@dataclass(frozen=True)
class Pieces(Shooting):
    """The shift map of the segments of a map with a window or without: its images have parts and approach."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("map", "cuts"):
            raise AttributeError(name)
        return getattr(self.map, name)

    def with_parameters(self, values: Any) -> Pieces:
        return replace(self, map=self.map.with_parameters(values))

    def joined(self, images: Sequence[Image], derivatives: bool) -> Image:
        image = super().joined(images, derivatives)
        if not image.success or not derivatives:
            return image
        n, approach = len(images[0].x), None
        parts: list[Any] = []
        nodes: list[int] = []
        for k, one in enumerate(images):
            here = getattr(one, "parts", ())
            parts += here
            nodes += [k] * len(here)
            if (near := getattr(one, "approach", None)) is not None:
                approach = replace(near, slopes=spread(near.slopes, k, self.number, n))
        return PiecedImage(
            image.x, image.time, image.runs, image.jacobian, image.by_parameter, image.degenerate, parts=tuple(parts),
            approach=approach, ends=tuple(images), nodes=tuple(nodes),
        )  # fmt: skip

    def varied(
        self, X: np.ndarray, image: PiecedImage, moves: np.ndarray, names: Any
    ) -> Iterator[Image | None]:
        """Images of which one segment's point alone has been moved by (N, n), one after the other.

        None where that changes the itinerary. All are run anew at once: a segment does not know of the others.
        """
        moved = self.ends(X + moves.ravel(), names)
        for k, one in enumerate(image.ends):
            there = moved[k] if k < len(moved) and moved[k].success else None
            if there is None or there.word != one.word:
                yield None
            else:
                yield self.joined([*image.ends[:k], there, *image.ends[k + 1 :]], True)


def spread(slopes: np.ndarray, k: int, number: int, n: int) -> np.ndarray:
    """Slopes by the point of one segment and by parameters, as those by all points."""
    wide = np.zeros(number * n + len(slopes) - n)
    wide[k * n : (k + 1) * n], wide[number * n :] = slopes[:n], slopes[n:]
    return wide


def critical(map_: Any, DP: np.ndarray, root: complex) -> np.ndarray:
    """Singular where `root` is a multiplier."""
    if not isinstance(map_, Shooting):
        return DP - root * np.eye(len(DP))
    n = len(DP) // map_.number
    matrix = DP.astype(np.result_type(DP, root))
    matrix[:n] /= root
    return matrix - np.eye(len(DP))


def by_root(map_: Any, left: np.ndarray, root: complex) -> np.ndarray:
    """A row vector times the matrix by which `critical` has taken the slopes of the map."""
    if not isinstance(map_, Shooting):
        return left
    n = len(left) // map_.number
    return np.append(left[:n] / root, left[n:])


def square(map_: Any, DP: np.ndarray, kappa: float) -> np.ndarray:
    """Singular where kappa +- i sqrt(1 - kappa^2) are multipliers."""
    if not isinstance(map_, Shooting):
        return DP @ DP - 2 * kappa * DP + np.eye(len(DP))
    N, n = map_.number, len(DP) // map_.number
    matrix = np.zeros((2 * N, n, 2 * N, n))
    for k, A in enumerate((*map_.matrices(DP),) * 2):
        matrix[(k + 1) % (2 * N), :, k] += A
    matrix = matrix.reshape(2 * N * n, -1) - np.eye(2 * N * n)
    # Closed: A v_2N-1 - 2 kappa v_N + v_0 = 0.
    matrix[:n, N * n : (N + 1) * n] -= 2 * kappa * np.eye(n)
    matrix[:n, :n] += 2 * np.eye(n)
    return matrix


def spectrum(map_: Any, DP: np.ndarray) -> np.ndarray:
    """Multipliers of the map."""
    if isinstance(map_, Shooting):
        return cyclic_multipliers(list(map_.matrices(DP)))
    return np.linalg.eigvals(DP).astype(complex)
