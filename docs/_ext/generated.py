"""Writes the pages that are made from the code, the figures and the data, before Sphinx looks for sources."""

import re
from pathlib import Path

import api_pages
import docstring_rules
import figure_pages
import layer_pages
import study_pages
from page import AUTO, ROOT, forget_old_pages, plain, write
from sphinx.errors import ExtensionError
from sphinx.util import logging

logger = logging.getLogger(__name__)
_SCRIPT = re.compile(r"\]\(((?:\.\./)*)((?:tutorials|howto|gallery)/[\w/]+)\.py\)")
_TEST = re.compile(r"^- `(\w+\.py)::test_(\w+)`$", re.MULTILINE)


def generate(app):
    """docs/auto, except what sphinx-gallery writes there."""
    for text in docstring_rules.every_shortcoming():
        logger.warning("%s", text, type="docstring")
    api_pages.write_pages()
    study_pages.write_pages()
    layer_pages.write_pages()
    try:
        figure_pages.write_pages(Path(app.config.pwsmooth_figures))
    except FileNotFoundError as error:
        raise ExtensionError(str(error)) from error
    forget_old_pages(api_pages.API, figure_pages.GALLERY, study_pages.STUDIES)
    for name in ("CHANGELOG", "CONTRIBUTING"):
        source = ROOT / f"{name}.md"
        if source.is_file():
            # Links that lead from the root of the repository to these pages.
            text = source.read_text(encoding="utf-8").replace("](docs/", "](../")
            write(AUTO / f"{name.lower()}.md", text)


def name_tests(app, name, content):
    """Names of tests are sentences: set as such, their file behind them."""
    if name == "event_contract":
        content[0] = _TEST.sub(lambda m: f"- {plain(m[2].replace('_', ' '))} (`{m[1]}`)", content[0])


def lead_to_pages(app, name, content):
    """Links to a script, which hold where these files are read as they are, lead to the page made of it."""
    content[0] = _SCRIPT.sub(r"](\1auto/\2)", content[0])


def look_at_galleries(app):
    """Warns of a script of a gallery that left no picture: its page would be words, and its thumbnail a blank."""
    for gallery in app.config.sphinx_gallery_conf["examples_dirs"]:
        for script in sorted((ROOT / "docs" / gallery).rglob("plot_*.py")):
            images = AUTO / script.parent.relative_to(ROOT / "docs") / "images"
            if not list(images.glob(f"sphx_glr_{script.stem}_0*.png")):
                logger.warning("%s left no picture", script, type="gallery")


def setup(app):
    app.add_config_value("pwsmooth_figures", "", "env", str)
    # Before sphinx-gallery (priority 500), which reads what is there.
    app.connect("builder-inited", generate, priority=100)
    app.connect("builder-inited", look_at_galleries, priority=900)
    app.connect("source-read", name_tests)
    app.connect("source-read", lead_to_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
