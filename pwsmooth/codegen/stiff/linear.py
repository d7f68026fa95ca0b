"""Sparse elimination of (mu_e/h) I - J, written out for one pattern of J, four eigenvalues at once.

Lane e of every array holds the system of eigenvalue mu_e: lane 0 is the real one, the others are complex. The
order of elimination is fixed at generation (least fill, pivots on the diagonal): mu/h dominates there, and a
bad pivot costs only a slower Newton iteration, which the step control answers.
"""

from __future__ import annotations

import numpy as np

# Beyond this many multiplications a loop over a plan serves better than unrolled text.
MOST_PRODUCTS = 700


class Elimination:
    """Symbolic LU: `factor` and `solve` as lists of operations on (row, column) entries."""

    def __init__(self, n: int, pattern: set[tuple[int, int]]):
        rows = {i: {j for (r, j) in pattern if r == i} | {i} for i in range(n)}
        left = set(range(n))
        self.order: list[int] = []
        self.lower: list[tuple[int, int]] = []  # (i, k): entry i of column k, divided by the pivot
        self.upper: dict[int, list[int]] = {}  # pivot -> columns right of it
        self.products = 0
        while left:
            columns = {j: [i for i in left if j in rows[i]] for j in left}
            k = min(left, key=lambda q: ((len(rows[q] & left) - 1) * (len(columns[q]) - 1), q))
            left.remove(k)
            self.order.append(k)
            self.upper[k] = sorted(rows[k] & left)
            for i in columns[k]:
                if i != k:
                    self.lower.append((i, k))
                    rows[i] |= rows[k] & left
                    self.products += len(self.upper[k]) + 1
        self.slots: dict[tuple[int, int], int] = {}
        for k in self.order:
            for entry in [(k, k)] + [(i, q) for i, q in self.lower if q == k] + [(k, j) for j in self.upper[k]]:
                self.slots[entry] = len(self.slots)

    @property
    def worthwhile(self) -> bool:
        return self.products <= MOST_PRODUCTS


class _Complex:
    """Names of the parts of an entry; im is None where it is real in every lane."""

    def __init__(self, re: str, im: str | None):
        self.re, self.im = re, im


def _product(a: _Complex, b: _Complex) -> tuple[str, str | None]:
    re = f"{a.re} * {b.re}"
    if a.im and b.im:
        return f"({re} - {a.im} * {b.im})", f"({a.re} * {b.im} + {a.im} * {b.re})"
    if a.im or b.im:
        return re, f"{a.im} * {b.re}" if a.im else f"{a.re} * {b.im}"
    return re, None


def elimination_lines(n: int, pattern: set, elimination: Elimination) -> tuple[list[str], dict]:
    """Lines that eliminate from the entries j<i>_<j> of J and mr + i mi, and the names of what they leave (pivots
    inverted)."""
    lines: list[str] = []
    entry: dict[tuple[int, int], _Complex] = {}
    for i in range(n):
        lines.append(f"    a{i}_{i}r = mr - j{i}_{i}" if (i, i) in pattern else f"    a{i}_{i}r = mr")
        entry[i, i] = _Complex(f"a{i}_{i}r", "mi")
    for i, j in sorted(pattern):
        if i != j:
            lines.append(f"    a{i}_{j}r = splat4(-j{i}_{j})")
            entry[i, j] = _Complex(f"a{i}_{j}r", None)
    for k in elimination.order:
        pivot = entry[k, k]
        lines += [f"    d{k} = 1.0 / ({pivot.re} * {pivot.re} + {pivot.im} * {pivot.im})",
                  f"    v{k}r = {pivot.re} * d{k}", f"    v{k}i = -{pivot.im} * d{k}"]  # fmt: skip
        inverse = _Complex(f"v{k}r", f"v{k}i")
        for i in [i for i, q in elimination.lower if q == k]:
            re, im = _product(entry[i, k], inverse)
            lines += [f"    l{i}_{k}r = {re}", f"    l{i}_{k}i = {im}"]
            multiplier = _Complex(f"l{i}_{k}r", f"l{i}_{k}i")
            for j in elimination.upper[k]:
                re, im = _product(multiplier, entry[k, j])
                old = entry.get((i, j))
                name = f"a{i}_{j}"
                lines.append(f"    {name}r = {old.re} - {re}" if old else f"    {name}r = -{re}")
                lines.append(f"    {name}i = {old.im} - {im}" if old and old.im else f"    {name}i = -{im}")
                entry[i, j] = _Complex(f"{name}r", f"{name}i")
            entry[i, k] = multiplier
        entry[k, k] = inverse
    return lines, entry


def factor_lines(n: int, pattern: set, elimination: Elimination) -> list[str]:
    """Body of factor(J, m, lu): J has the pattern's entries by rows, m the eigenvalues over h, lu is overwritten."""
    lines = [f"    j{i}_{j} = J[{k}]" for k, (i, j) in enumerate(sorted(pattern))]
    lines += ["    mr = load4(m, 0)", "    mi = load4(m, 4)"]
    body, entry = elimination_lines(n, pattern, elimination)
    lines += body
    for key, slot in elimination.slots.items():
        part = entry[key]
        lines.append(f"    store4(lu, {8 * slot}, {part.re})")
        lines.append(f"    store4(lu, {8 * slot + 4}, {part.im or 'splat4(0.0)'})")
    return lines


def substitution_lines(elimination: Elimination, entry: dict, indent: str) -> list[str]:
    """Overwrites r<i> + i q<i> with the solution, in the names that `elimination_lines` left."""
    lines = []

    def subtract(i, k):
        re, im = _product(entry[i, k], _Complex(f"r{k}", f"q{k}"))
        lines.extend([f"{indent}r{i} = r{i} - {re}", f"{indent}q{i} = q{i} - {im}"])

    for k in elimination.order:
        for i in [i for i, q in elimination.lower if q == k]:
            subtract(i, k)
    for k in reversed(elimination.order):
        for j in elimination.upper[k]:
            subtract(k, j)
        re, im = _product(entry[k, k], _Complex(f"r{k}", f"q{k}"))
        lines += [f"{indent}a{k} = {re}", f"{indent}q{k} = {im}", f"{indent}r{k} = a{k}"]
    return lines


def real_substitution_lines(elimination: Elimination, entry: dict, indent: str) -> list[str]:
    """Overwrites the numbers g<i> with the solution for the real eigenvalue, the first of the lanes."""
    lines = []
    for k in elimination.order:
        for i in [i for i, q in elimination.lower if q == k]:
            lines.append(f"{indent}g{i} = g{i} - lane({entry[i, k].re}, 0) * g{k}")
    for k in reversed(elimination.order):
        for j in elimination.upper[k]:
            lines.append(f"{indent}g{k} = g{k} - lane({entry[k, j].re}, 0) * g{j}")
        lines.append(f"{indent}g{k} = lane({entry[k, k].re}, 0) * g{k}")
    return lines


def solve_lines(n: int, elimination: Elimination) -> list[str]:
    """Body of solve(lu, r): r[8 i + e] and r[8 i + 4 + e] hold the two parts and are overwritten."""
    lines, entry = [], {}
    for i in range(n):
        lines += [f"    r{i} = load4(r, {8 * i})", f"    q{i} = load4(r, {8 * i + 4})"]
    for (i, j), slot in elimination.slots.items():
        entry[i, j] = _Complex(f"u{i}_{j}r", f"u{i}_{j}i")
        lines += [f"    u{i}_{j}r = load4(lu, {8 * slot})", f"    u{i}_{j}i = load4(lu, {8 * slot + 4})"]
    lines += substitution_lines(elimination, entry, "    ")
    for i in range(n):
        lines += [f"    store4(r, {8 * i}, r{i})", f"    store4(r, {8 * i + 4}, q{i})"]
    return lines


# ---- what is too large to be written out


def _order(size: int, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Unknowns in an order of elimination that fills little: minimum degree, as SuperLU finds it."""
    from scipy import sparse
    from scipy.sparse.linalg import splu

    pattern = sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), (size, size)).tocsc()
    pattern.data[:] = -1.0
    dominant = sparse.diags(2.0 + np.asarray(abs(pattern).sum(axis=0)).ravel())
    found = splu((dominant + pattern).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0)
    return np.argsort(found.perm_c)


def plan(n: int, size: int, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """How kernels/stiff/sparse.py eliminates `size` unknowns, n of them states, with entries of J in these places."""
    order = _order(size, rows, columns)
    place = np.empty(size, np.int64)
    place[order] = np.arange(size)
    r, c = place[rows], place[columns]
    # Of L + U, made symmetric: what stands right of a pivot is handed to the first row in it.
    upper: list[set[int]] = [set() for _ in range(size)]
    for i, j in {(int(min(pair)), int(max(pair))) for pair in zip(r, c)}:
        upper[i].add(j)
    lower: list[list[int]] = [[] for _ in range(size)]
    for k, right in enumerate(upper):
        right.discard(k)
        if right:
            first = min(right)
            upper[first] |= right
        for i in right:
            lower[i].append(k)
    by_row = np.argsort(r, kind="stable")
    starts = [np.cumsum([0, *map(len, part)]) for part in (lower, upper)]
    entry = np.searchsorted(r[by_row], np.arange(size + 1))
    flat = [np.array([k for row in part for k in sorted(row)], np.int64) for part in (lower, upper)]
    return np.concatenate([[size, n], order, entry, *starts, by_row, c[by_row], *flat]).astype(np.int64)


def length(plan: np.ndarray) -> int:
    """Numbers that the elimination of a plan keeps."""
    size = int(plan[0])
    lower, upper = 3 + 3 * size, 4 + 4 * size  # where the last of their starts stand
    return 8 * (2 * size + int(plan[lower]) + int(plan[upper]))
