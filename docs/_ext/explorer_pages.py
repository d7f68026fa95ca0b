"""`.. explorer:: PRESET` sets a page of `pwsmooth explore` that needs no Python: a slider, and what follows it.

    .. explorer:: figure-8
       :over: rho=0.1..6/60
       :views: time, phase
       :diagram:
       :height: 560

It is a file of its own, shown in a frame, so that neither its style nor its keys meddle with the page's.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np
from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective

_OVER = re.compile(r"(\w+)\s*=\s*([-+.\deE]+)\s*\.\.\s*([-+.\deE]+)\s*/\s*(\d+)")


class Explorer(SphinxDirective):
    """The directive."""

    required_arguments = 1
    option_spec = {
        "over": directives.unchanged_required, "views": directives.unchanged, "diagram": directives.flag,
        "height": directives.positive_int,
    }  # fmt: skip

    def run(self) -> list[nodes.Node]:
        told = _OVER.fullmatch(self.options["over"].strip())
        if told is None:
            raise self.error("`:over:` is written PARAMETER=FIRST..LAST/COUNT, such as rho=0.1..6/60")
        name, low, high, count = told.groups()
        views = re.split(r"[\s,]+", self.options["views"].strip()) if self.options.get("views") else None
        over = {name: np.linspace(float(low), float(high), int(count))}
        key = f"{self.arguments[0]} {self.options}"
        digest = hashlib.sha256(key.encode()).hexdigest()[:8]
        file = Path("_static") / "explorers" / f"{self.arguments[0]}-{digest}.html"
        out = Path(self.env.app.outdir) / file
        if not out.exists():
            out.parent.mkdir(parents=True, exist_ok=True)
            out.write_text(made(self.arguments[0], over, views, "diagram" in self.options), encoding="utf-8")
        depth = self.env.docname.count("/")
        title = f"{self.arguments[0]}: a slider of {name}, and what the system does"
        frame = (
            f'<iframe class="explorer-frame" src="{"../" * depth}{file.as_posix()}" title="{title}" loading="lazy" '
            f'height="{self.options.get("height", 620)}"></iframe>'
        )
        return [nodes.raw("", frame, format="html")]


def made(preset: str, over: dict[str, Any], views: Any, diagram: bool) -> str:
    """The file's text."""
    from pwsmooth.explorer.export import standalone
    from pwsmooth.explorer.presets import subject_of_preset

    return standalone(subject_of_preset(preset), over, views=views, diagram=diagram)


def setup(app: Any) -> dict[str, Any]:
    """For Sphinx."""
    app.add_directive("explorer", Explorer)
    return {"parallel_read_safe": True}
