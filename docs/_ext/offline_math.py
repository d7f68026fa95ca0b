"""MathJax from the package sphinx-mathjax-offline, of its 24 MB only what TeX to HTML needs.

The package's own `setup` sets the path and copies everything; its files are used here without it.
"""

from importlib.util import find_spec
from pathlib import Path

from sphinx.util.fileutil import copy_asset

ENTRY = "tex-chtml.js"  # loader, TeX reader and HTML writer in one file
PARTS = (ENTRY, "input/tex/extensions", "output/chtml/fonts/woff-v2")


def bundled() -> Path:
    """Directory of MathJax 3 inside the installed package."""
    found = find_spec("sphinx-mathjax-offline")
    if found is None or found.origin is None:
        raise ImportError("sphinx-mathjax-offline is missing; `pip install -e '.[docs]'` brings it")
    return Path(found.origin).parent / "static" / "mathjax"


def copy_mathjax(app, error):
    """The parts into _static/mathjax of a page build that succeeded."""
    if error is None and app.builder.format == "html":
        for part in PARTS:
            source, target = bundled() / part, Path(app.outdir) / "_static" / "mathjax" / part
            copy_asset(source, target if source.is_dir() else target.parent)


def formulas_in_outputs(app, page, template, context, doctree):
    """A page whose outputs have formulas needs MathJax as one that has its own."""
    if "class='math'" in context.get("body", ""):
        context["has_maths_elements"] = True


def setup(app):
    app.connect("html-page-context", formulas_in_outputs, priority=400)  # before Sphinx asks
    app.connect("build-finished", copy_mathjax)
    app.config.mathjax_path = f"mathjax/{ENTRY}"
    # No context menu: its accessibility parts would be fetched when opened. Overlong formulas scroll (site.css).
    app.config.mathjax3_config = {"options": {"enableMenu": False}}
    return {"parallel_read_safe": True, "parallel_write_safe": True}
