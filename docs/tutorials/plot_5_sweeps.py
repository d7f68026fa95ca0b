r"""
Sweeps, stores and a cluster
============================

One orbit answers a question about one point. :func:`~pwsmooth.sweep` runs a system or a scene over
a grid of parameters, starts, phases and seeds, keeps *measures* of each orbit, and returns an
``xarray.Dataset``. A point that fails costs no other point, and the bits do not depend on where
it ran. Stores and clusters need two more packages, which ``pip install -e '.[cluster]'`` brings.
"""

# %%
# A map
# -----
# The block on a shaken plate again, with the hidden term that makes it stick: where in the
# plane of spring and drive does it stick, and how often?
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Strobe, Switch, System, sweep
from pwsmooth.studies import Work, read_store

t, y, v = sp.symbols("t y v", real=True)
k, sigma, rho = sp.symbols("k sigma rho", nonnegative=True)
lam = Switch("lam", v)
block = System(
    {
        y: v,
        v: -sigma * sp.sin(t)
        - k * y
        - v / 10
        - lam * (1 + rho * (1 - lam**2)),
    },
    time=t,
    parameters={k: 3.1, sigma: 2.4, rho: 3},
)
axes = {"sigma": np.linspace(1.6, 4, 33), "k": np.linspace(1.5, 5, 25)}
study = dict(
    x0={"y": 0.78, "v": -1.03},
    seen=Strobe(2 * sp.pi),
    transient=40,
    periods=5,
    measures=["sticks", "itinerary", "amplitude(y)"],
    units={"k": "N/m", "sigma": "N", "y": "m"},
)
found = sweep(block, axes, **study)
found

# %%
fig, panels = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
found.stick_time.T.plot(
    ax=panels[0], cbar_kwargs={"label": "time stuck a period"}
)
found.sticks.T.plot(
    ax=panels[1],
    levels=[-0.5, 0.5, 1.5, 2.5],
    cbar_kwargs={"label": "sticks a period", "ticks": [0, 1, 2]},
)
panels[0].set_title("How long it sticks")
panels[1].set_title("How often")
plt.show()

# %%
# A sweep over one parameter that keeps the strobes is an orbit diagram. Move the slider, or
# click in the diagram, and see the orbit that it is made of.
#
# .. explorer:: figure-8
#    :over: rho=0.2..8/40
#    :views: time, phase
#    :diagram:
#    :height: 800

# %%
# Everything that xarray can do can be done with it: here, which itineraries there are, and how
# many points have each.
words, counts = np.unique(found.itinerary.values, return_counts=True)
for i in np.argsort(-counts)[:6]:
    print(f"{counts[i]:5}  {words[i]}")
print("failed:", int((found.outcome < 0).sum()), "of", found.outcome.size)
# sphinx_gallery_start_ignore
# What the text says, checked.
assert (found.outcome >= 0).all() and counts.max() > 0.4 * found.outcome.size
# sphinx_gallery_end_ignore

# %%
# Measures of your own are functions of the :class:`~pwsmooth.Solution`; they run point by
# point, in Python.
from pwsmooth.studies import Function


def longest_stick(solution, window):
    """Duration of the longest stick that begins after the transient."""
    late = [s for s in solution.segments if s.start >= window.start]
    return max(
        (s.duration for s in late if s.name.startswith("stick")), default=0.0
    )


few = sweep(
    block,
    {"rho": [0.0, 1.0, 2.0, 3.0]},
    **{**study, "measures": [Function(longest_stick, names=("longest",))]},
)
print(few.longest.to_series().to_string())

# %%
# A store that survives
# ---------------------
# With ``work=Work(store=...)`` every chunk is written as it finishes. A sweep that was killed goes on where
# it was, and ends with the bits of an undisturbed one. Here it is interrupted after eight
# chunks, as by Ctrl-C.
from concurrent.futures import ThreadPoolExecutor

import xarray


class Interrupted(ThreadPoolExecutor):
    """Threads that take eight chunks and then meet Ctrl-C."""

    taken = 0

    def submit(self, *task):
        self.taken += 1
        if self.taken > 8:
            raise KeyboardInterrupt
        return super().submit(*task)


store = Path(tempfile.mkdtemp()) / "map.zarr"
with Interrupted(2) as pool:
    try:
        work = Work(executor=pool, chunk=40, store=store)
        sweep(block, axes, work=work, **study)
    except KeyboardInterrupt:
        half = xarray.open_zarr(store, consolidated=False)
        missing = int((half.outcome == -128).sum())
        print(
            f"interrupted: {missing} of {half.outcome.size} points have not run"
        )

resumed = sweep(block, axes, work=Work(store=store), **study)
print("resumed; identical to the undisturbed run:", resumed.identical(found))
# sphinx_gallery_start_ignore
# What the text says, checked.
assert resumed.identical(found) and 0 < missing < found.outcome.size
# sphinx_gallery_end_ignore

# %%
# A cluster
# ---------
# Any ``concurrent.futures.Executor`` runs the chunks; Dask's distributed client gives one for a
# laptop, a batch queue or a cloud alike. Two processes on this machine stand for them. Each
# starts by importing the script that it belongs to, so what only the first may do stands behind
# ``if __name__ == "__main__"``. Below is a whole script, written to a file and run; in a
# notebook no guard is needed (:ref:`an example <sweeps-cluster>`).
import subprocess
import sys

SCRIPT = """
import sys

import numpy as np
import sympy as sp
from dask.distributed import Client, LocalCluster

from pwsmooth import Strobe, Switch, System, sweep
from pwsmooth.studies import Work

t, y, v = sp.symbols("t y v", real=True)
k, sigma, rho = sp.symbols("k sigma rho", nonnegative=True)
lam = Switch("lam", v)
mu = lam * (1 + rho * (1 - lam**2))
block = System(
    {y: v, v: -sigma * sp.sin(t) - k * y - v / 10 - mu},
    time=t,
    parameters={k: 3.1, sigma: 2.4, rho: 3},
)

if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1) as cluster:
        with Client(cluster) as client:
            sweep(
                block,
                {"sigma": np.linspace(1.6, 4, 33), "k": np.linspace(1.5, 5, 25)},
                x0={"y": 0.78, "v": -1.03},
                seen=Strobe(2 * sp.pi),
                transient=40,
                periods=5,
                measures=["sticks", "itinerary", "amplitude(y)"],
                units={"k": "N/m", "sigma": "N", "y": "m"},
                work=Work(executor=client.get_executor(), store=sys.argv[1]),
            )
"""
script, store = store.with_name("study.py"), store.with_name("cluster.zarr")
script.write_text(SCRIPT)
subprocess.run([sys.executable, script, store], check=True)
again = read_store(store)
print("from two processes; identical:", again.equals(found))
# sphinx_gallery_start_ignore
# What the text says, checked.
assert again.equals(found)
# sphinx_gallery_end_ignore

# %%
# On a cluster, the line with ``LocalCluster`` is another one: ``SLURMCluster``, ``SSHCluster``
# or the address of a scheduler. The same study as a file, for the command line: ``pwsmooth
# sweep STUDY.toml --out DIR``, which resumes with ``--resume``. All measures, axes and options
# are listed in :doc:`/sweeps`. Next: :ref:`which method, which model
# <sphx_glr_auto_tutorials_plot_6_choosing.py>`.
