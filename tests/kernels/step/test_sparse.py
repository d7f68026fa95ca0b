"""The sparse linear system of the solved multipliers against dense linear algebra.

Guards: kernels/surface/sparse.py.
"""

import numpy as np
import pytest

from pwsmooth.codegen.machine.cache import load_kernels
from pwsmooth.kernels import state, work
from pwsmooth.paths.problem import _both_ways, _diagonal, _groups


class Numbers:
    """Attributes by name, as a kernel sees a Bundle."""

    def __init__(self, **values):
        self.__dict__.update(values)


def arrow(elements, size, hubs, rng, neighbours=False):
    """A random matrix of `elements` groups of `size` that couple through the last `hubs` rows and columns."""
    m = elements * size + hubs
    pattern = np.zeros((m, m), bool)
    for q in range(elements):
        stop = (q + 2 if neighbours else q + 1) * size
        pattern[q * size : (q + 1) * size, q * size : min(stop, m - hubs)] = True
    pattern[m - hubs :, :] = pattern[:, m - hubs :] = True
    pattern |= np.eye(m, dtype=bool)
    return np.where(pattern, rng.normal(size=(m, m)), 0.0), pattern


def compressed(matrix, pattern):
    row = np.concatenate([[0], np.cumsum(pattern.sum(axis=1))])
    return row, np.nonzero(pattern)[1], matrix[pattern]


@pytest.mark.parametrize("neighbours", [False, True])
@pytest.mark.parametrize("hubs", [0, 1, 3])
@pytest.mark.parametrize("size", [1, 2, 3])
def test_groups_and_hubs_give_the_solution_of_the_dense_system(size, hubs, neighbours):
    sparse = load_kernels("surface.sparse")
    rng = np.random.default_rng(7)
    for _ in range(20):
        A, pattern = arrow(4, size, hubs, rng, neighbours)
        m = len(A)
        row, col, G = compressed(A, pattern)
        hub = np.arange(m - hubs, m)
        block_row, block_member = _groups(row, col, hub)
        assert len(block_row) - 1 == (1 if neighbours else 4)
        mask = rng.integers(0, 2, m)
        b = rng.normal(size=m)
        P = Numbers(m=m, g_row=row, g_col=col, g_diagonal=_diagonal(row, col), hub=hub, block_row=block_row,
                    block_member=block_member)  # fmt: skip
        linear = work.Linear.zeros(dict(group=m, hubs=hubs, m=m))
        linear.rhs[:m] = b
        W = Numbers(G=G, mask=mask, linear=linear)
        assert sparse.solve_masked(P, W)
        on = mask == 1
        # Backward stable elimination: the residual is a few eps of |A||u|, with growth for no pivoting across groups.
        rest = A[np.ix_(on, on)] @ linear.rhs[:m][on] - b[on]
        scale = np.abs(A[np.ix_(on, on)]).sum() * np.abs(linear.rhs[:m][on]).max(initial=0.0) + 1.0
        assert np.abs(rest).max(initial=0.0) <= 1e-11 * scale


def test_an_entry_is_found_by_its_row_and_column():
    sparse = load_kernels("surface.sparse")
    rng = np.random.default_rng(3)
    A, pattern = arrow(3, 2, 1, rng)
    row, col, values = compressed(A, pattern)
    for i in range(len(A)):
        for j in range(len(A)):
            assert sparse.entry(row, col, values, i, j) == A[i, j]


def test_a_link_goes_through_what_is_solved_and_no_further():
    sparse = load_kernels("surface.sparse")
    rng = np.random.default_rng(4)
    lengths = set()
    for _ in range(50):
        m = 8
        pattern = np.eye(m, dtype=bool) | (rng.random((m, m)) < 0.12)
        row, col = compressed(pattern.astype(float), pattern)[:2]
        link_row, link_col = _both_ways(row, col)
        kind = rng.choice([state.SLIDING, state.CONTACT, state.ALGEBRAIC, state.KINK, state.CROSSING], m)
        status = rng.choice([state.SOLVED, 1, -1], m)
        P = Numbers(m=m, kind=kind, link_row=link_row, link_col=link_col)
        S = Numbers(status=status)
        # A path of j passes only through what is solved: powers of the couplings with all others cut off.
        either = pattern | pattern.T
        passes = (status == state.SOLVED) & (kind != state.KINK) & (kind != state.CROSSING)
        for j in range(m):
            linear = work.Linear.zeros(dict(group=m, hubs=0, m=m))
            linear.linked[:] = 7
            W = Numbers(linear=linear)
            sparse.link(P, S, W, j)
            reached = np.arange(m) == j
            for _ in range(m):
                through = reached & (passes | (np.arange(m) == j))
                reached = reached | either[through].any(axis=0)
            assert np.array_equal(linear.linked != 0, reached) and set(linear.linked) <= {0, 1}
            lengths.add(int(reached.sum()))
    assert len(lengths) > 4  # chains among them, not only neighbours
