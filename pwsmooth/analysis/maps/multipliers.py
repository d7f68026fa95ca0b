"""Floquet multipliers of an orbit in segments: eigenvalues of A_N ... A_1, without the product.

    A_k Q_k-1 = Q_k R_k,   k = 1 ... N,  round and round  ->  A_N ... A_1 is similar to C R_N ... R_1,   C = Q_0^T Q_N

Orthogonal iteration makes C (block) diagonal; a multiplier is then the product of N numbers of its own size, so that
exp(-kT) is found beside exp(kT), where their product has lost it. Directions that have not come apart after some
rounds are of like size: their blocks are multiplied.

Source: A. Bojanczyk, G. Golub, P. Van Dooren, The periodic Schur decomposition, Proc. SPIE 1770 (1992) 31-42.

Chain: segments.py -> **multipliers** -> periodic_orbit.py.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_MOST_ROUNDS = 40  # directions whose growth differs by a factor of 0.39 or less have come apart by then
_APART = 37.0  # natural logarithm of what is coupled less than by a rounding
_COUPLED = 1e-10
_ROUNDED = 1e-12  # of a matrix's entry
_RANK = 1e-14  # of a matrix: what a stick leaves of the direction that it takes away


def cyclic_multipliers(matrices: Sequence[np.ndarray]) -> np.ndarray:
    """Eigenvalues of the product matrices[-1] ... matrices[0], shape (columns of the first,), largest first."""
    n = matrices[0].shape[1]
    if n == 0:
        return np.empty(0, complex)
    matrices = _balanced(matrices)
    frame = np.linalg.qr(np.random.default_rng(20).normal(size=(n, n)))[0]  # generic, the same in every call
    growth, blocks = np.zeros(n), [np.arange(n)]
    for rounds in range(1, _MOST_ROUNDS + 1):
        begin, triangles = frame, []
        for matrix in matrices:
            frame, triangle = np.linalg.qr(matrix @ frame)
            size = np.abs(np.diag(triangle))
            triangle[size <= _RANK * np.linalg.norm(matrix)] = 0.0
            triangles.append(triangle)
        with np.errstate(divide="ignore"):
            growth += np.log(np.abs([np.diag(R) for R in triangles])).sum(axis=0)
        closing = begin.T @ frame
        blocks = _blocks(growth / rounds, closing, rounds)
        if len(blocks) == n:
            break
    values = []
    for block in blocks:
        product = closing[np.ix_(block, block)]
        turned = np.eye(len(block))
        for R in triangles:
            turned = R[np.ix_(block, block)] @ turned
        values.append(np.linalg.eigvals(product @ turned).astype(complex))
    found = np.concatenate(values)
    return found[np.argsort(-np.abs(found), kind="stable")]


def _balanced(matrices: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The same between states in other units, of their own at each end of a segment."""
    cyclic, pairs = _cyclic(matrices)
    units = balanced(cyclic)
    return [matrix * units[column] / units[row][:, None] for (row, column), matrix in zip(pairs, matrices)]


def balanced(cyclic: np.ndarray) -> np.ndarray:
    """Units in which rows and columns of a matrix are of one size.

    Beside a canard a state answers to another one by 1e10: the digits of the other one would drown in its roundings.
    """
    from scipy.linalg import matrix_balance

    with np.errstate(
        invalid="ignore"
    ):  # units that no integer holds are no permutation, which is not asked for
        return matrix_balance(cyclic, permute=False, separate=True)[1][0]


def within_roundings(matrices: Sequence[np.ndarray], root: int) -> bool:
    """Whether roundings of the matrices are enough to make 1 or -1 an eigenvalue of their product."""
    cyclic, _ = _cyclic([*matrices[:-1], matrices[-1] / root])
    return bool(np.linalg.svd(cyclic - np.eye(len(cyclic)), compute_uv=False)[-1] <= _ROUNDED)


def _cyclic(matrices: Sequence[np.ndarray]) -> tuple[np.ndarray, list[tuple[slice, slice]]]:
    """The block-cyclic matrix with the N-th roots of their product's eigenvalues; rows and columns of each of them."""
    ends = np.cumsum([0, *(matrix.shape[1] for matrix in matrices)])
    places = [slice(*pair) for pair in zip(ends, ends[1:])]
    pairs = list(zip([*places[1:], places[0]], places))
    cyclic = np.zeros((ends[-1], ends[-1]))
    for (row, column), matrix in zip(pairs, matrices):
        cyclic[row, column] += matrix
    return cyclic, pairs


def _blocks(growth: np.ndarray, closing: np.ndarray, rounds: int) -> list[np.ndarray]:
    """Directions by blocks that no longer know of each other."""
    n, first, blocks = len(growth), 0, []
    for k in range(1, n):
        gap = growth[k - 1] - growth[k] if np.isfinite(growth[k]) else np.inf
        if rounds > 1 and (rounds - 1) * gap > _APART and np.abs(closing[k:, :k]).max() < _COUPLED:
            blocks.append(np.arange(first, k))
            first = k
    return [*blocks, np.arange(first, n)]
