"""Random piecewise-affine systems, and their equilibria by linear algebra alone.

    x' = A0 x + b0 + sum_j lam_j (A_j x + b_j),   lam_j = sign(c_j x + d_j)

Off all surfaces an equilibrium solves a linear system; on one, with lam free, (A0 + lam A1) x + b0 + lam b1 = 0 and
c x + d = 0 have a solution where lam is an eigenvalue of a pencil of matrices; with A_j = 0 a linear system again.
"""

import itertools

import numpy as np
import scipy.linalg
import sympy as sp

from pwsmooth import Switch, System

BOX = 30.0  # to either side of 0, for each state
BEYOND = 4.0  # |lam| of virtual ones that are asked for


class Affine:
    """System number `seed`: 2 to 4 states, one switch with a jump in the Jacobian, or one to two without."""

    def __init__(self, seed):
        rng = np.random.default_rng([18, seed])
        self.n = n = int(rng.integers(2, 5))
        self.bent = bool(rng.integers(2))
        self.k = k = 1 if self.bent else int(rng.integers(1, 3))
        self.A0, self.b0 = rng.normal(size=(n, n)), rng.normal(size=n)
        self.A = rng.normal(size=(k, n, n)) * self.bent
        self.b, self.c, self.d = rng.normal(size=(k, n)), rng.normal(size=(k, n)), rng.normal(size=k)
        self.states = sp.symbols(f"x1:{n + 1}", real=True)
        x = sp.Matrix(self.states)
        lams = [Switch(f"lam{j}", float(self.d[j]) + (sp.Matrix(self.c[j]).T @ x)[0]) for j in range(k)]
        rates = sp.Matrix(self.A0) @ x + sp.Matrix(self.b0)
        for lam, A, b in zip(lams, self.A, self.b):
            rates += lam * (sp.Matrix(A) @ x + sp.Matrix(b))
        self.system = System(dict(zip(self.states, rates)))
        self.box = dict.fromkeys(self.states, (-BOX, BOX))

    def field(self, lam):
        """Matrix and vector at values of lam."""
        A = self.A0 + np.tensordot(lam, self.A, 1)
        return A, self.b0 + lam @ self.b

    def solutions(self):
        """All equilibria of the modes in the box: (sides, x, lam, admissible, eigenvalues, slopes of the layer)."""
        found = []
        for sides in itertools.product((1, -1, 0), repeat=self.k):
            held = [j for j, side in enumerate(sides) if side == 0]
            for x, lam in self._bent(sides) if self.bent and held else self._plain(np.array(sides), held):
                if np.abs(x).max() > BOX or np.abs(lam).max() > BEYOND:
                    continue
                h = self.c @ x + self.d
                inside = [abs(lam[j]) < 1 if j in held else h[j] * sides[j] > 0 for j in range(self.k)]
                found.append((sides, x, lam, all(inside), *self._stability(x, lam, held)))
        return found

    def _plain(self, sides, held):
        """Linear equations in x and the lam that are held."""
        A, b = self.field(sides.astype(float))
        k = len(held)
        square = np.block([[A, self.b[held].T], [self.c[held], np.zeros((k, k))]])
        right = np.concatenate([b, self.d[held]])
        solution = np.linalg.solve(square, -right)
        lam = sides.astype(float)
        lam[held] = solution[self.n :]
        return [(solution[: self.n], lam)]

    def _bent(self, sides):
        """Eigenvalues of the pencil P + lam Q on vectors (x, 1)."""
        P = np.block([[self.A0, self.b0[:, None]], [self.c, self.d[:, None]]])
        Q = np.block([[self.A[0], self.b[0][:, None]], [np.zeros((1, self.n + 1))]])
        values, vectors = scipy.linalg.eig(P, -Q)
        real = np.isfinite(values) & (np.abs(values.imag) < 1e-9 * (1 + np.abs(values)))
        vectors = vectors[:, real].real / vectors[-1, real].real
        return [(v[:-1], np.array([value])) for value, v in zip(values[real].real, vectors.T)]

    def _stability(self, x, lam, held):
        """Eigenvalues of Filippov's sliding field, without those across the surfaces, and of the layer's slope C b."""
        A, _ = self.field(lam)
        if not held:
            return np.linalg.eigvals(A), np.zeros(0)
        push = np.array([self.A[j] @ x + self.b[j] for j in held]).T
        C = self.c[held]
        slope = C @ push
        sliding = A - push @ np.linalg.solve(slope, C @ A)
        values = np.linalg.eigvals(sliding)
        return values[np.argsort(np.abs(values))[len(held) :]], np.diag(slope)
