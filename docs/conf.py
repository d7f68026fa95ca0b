"""Sphinx configuration of the documentation; `python docs/build.py` runs it with everything that it needs.

Nothing is fetched: mathematics is set by a MathJax that comes with a Python package, and no page loads a
file from another host (docs/check_pages.py opens every page with the network blocked).
"""

import os
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

import matplotlib

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(DOCS), str(DOCS / "_ext"), str(ROOT), str(ROOT / "experiments")]
# Kernels of the executed pages are processes of their own: they find the checkout as this one does.
os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
# Scripts draw without a display; kernels draw into their pages.
matplotlib.use("agg")
os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
# In the kernels every matplotlib figure shows as a picture, pyplot imported or not, and sharp at any size.
profile = DOCS / "_build" / "ipython" / "profile_default"
profile.mkdir(parents=True, exist_ok=True)
(profile / "ipython_kernel_config.py").write_text(
    "c = get_config()\nc.IPKernelApp.matplotlib = 'inline'\nc.InlineBackend.figure_formats = {'svg'}\n",
    encoding="utf-8",
)
os.environ["IPYTHONDIR"] = str(profile.parent)

project = "pwsmooth"
author = "the pwsmooth developers"
copyright = author
version = release = installed_version("pwsmooth")

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
    "numpydoc",
    "myst_nb",
    "sphinx_design",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "offline_math",
    "names",
    "source_pages",
    "explorer_pages",
    "generated",
]
# docs/auto is written at build time (docs/_ext, sphinx-gallery); its .ipynb and .py are downloads, not pages.
exclude_patterns = [
    "_build",
    "_ext",
    "tutorials",
    "howto",
    "gallery",
    "jupyter_execute",
    "**/.ipynb_checkpoints",
    "**/README.rst",
]
exclude_patterns += ["auto/**/*.ipynb", "auto/**/*.py", "auto/**/GALLERY_HEADER.rst"]
source_suffix = {".rst": "restructuredtext", ".md": "myst-nb", ".ipynb": "myst-nb"}
root_doc = "index"
nitpicky = True
# Every reference to a name of this package has to be found; the words for types in docstrings are plain English.
nitpick_ignore_regex = [("py:.*", r"(?!pwsmooth).*")]
suppress_warnings = ["config.cache"]  # functions in the configuration of sphinx-gallery cannot be pickled

autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
numpydoc_class_members_toctree = False
toc_object_entries_show_parents = "hide"
add_module_names = False
smartquotes = False  # y'' is a second derivative
default_role = "name"
python_use_unqualified_type_names = True
maximum_signature_line_length = 88

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "attrs_inline", "attrs_block"]
myst_heading_anchors = 3
myst_links_external_new_tab = False
nb_execution_mode = "cache"
nb_execution_cache_path = os.environ.get("PWSMOOTH_DOCS_CACHE", str(DOCS / "_build" / "jupyter"))
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True  # a cell's error in the log, not only in a file of the build
nb_merge_streams = True
nb_output_stderr = "show"
nb_render_markdown_format = "myst"


GALLERIES = [name for name in ("tutorials", "howto", "gallery") if list((DOCS / name).rglob("plot_*.py"))]


def house_style(gallery_conf, where):
    """Pictures of every script in the project's style, whatever the one before it did."""
    import matplotlib

    from pwsmooth.plotting import _RC

    matplotlib.rcdefaults()
    matplotlib.rcParams.update(_RC | {"figure.figsize": (7.0, 3.0), "figure.constrained_layout.use": True})


def pictures(block, block_vars, gallery_conf, **options):
    """A script's pictures, and as the first of them, unseen on its page, the thumbnail."""
    import matplotlib.pyplot as plt
    from sphinx_gallery.scrapers import matplotlib_scraper

    paths, figures = block_vars["image_path_iterator"], [plt.figure(n) for n in plt.get_fignums()]
    path = next(paths) if figures and not len(paths) else None
    shown = matplotlib_scraper(block, block_vars, gallery_conf, **options)
    if path:
        draw_thumbnail(figures[0]).savefig(path, dpi=100)
    return shown


def draw_thumbnail(figure):
    """The curves of one panel (the first, or the one with the label "thumbnail"), thick and without words."""
    shown = next((ax for ax in figure.axes if ax.get_label() == "thumbnail"), figure.axes[0])
    for ax in figure.axes:
        if ax is not shown:
            ax.remove()
    for words in [*shown.texts, shown.get_legend(), *figure.texts, *figure.legends]:
        if words:
            words.remove()
    shown.set(xticks=[], yticks=[], xlabel="", ylabel="")
    shown.minorticks_off()
    for side in ("left", "center", "right"):
        shown.set_title("", loc=side)
    for line in shown.lines:
        line.set(linewidth=2 * line.get_linewidth(), markersize=2 * line.get_markersize())
    figure.set_size_inches(4, 2.8)
    figure.set_layout_engine("none")
    shown.set_position((0.04, 0.04, 0.92, 0.92))
    return figure


sphinx_gallery_conf = {
    "image_scrapers": (pictures,),
    "subsection_order": ["gallery/mechanics", "gallery/control", "gallery/nature", "*"],
    "examples_dirs": GALLERIES,
    "gallery_dirs": [f"auto/{name}" for name in GALLERIES],
    "filename_pattern": r"/plot_",
    "ignore_pattern": r"/(?!plot_)[^/]*\.py$",
    "within_subsection_order": "FileNameSortKey",
    "reset_modules": (house_style,),
    "reset_modules_order": "before",
    "abort_on_example_error": False,  # the build goes on and -W fails it, so that every broken page is named
    "only_warn_on_example_error": True,
    "download_all_examples": False,
    "write_computation_times": False,  # its page would load tables from another host
    "show_memory": False,
    "show_signature": False,
    "remove_config_comments": True,
    "min_reported_time": 5,
    "doc_module": (),
    "image_srcset": ["2x"],  # sharp on a phone
    "capture_repr": ("_repr_html_", "__repr__"),
    "plot_gallery": True,
}

html_theme = "pydata_sphinx_theme"
html_title = "pwsmooth"
templates_path = ["_templates"]
html_favicon = "_static/favicon.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["pictures.js"]
html_show_sourcelink = False
html_show_copyright = False
html_context = {"default_mode": "auto"}
html_theme_options = {
    "logo": {"image_light": "_static/favicon.svg", "image_dark": "_static/favicon.svg", "text": "pwsmooth"},
    "navbar_align": "left",
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "header_links_before_dropdown": 7,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["version"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
copybutton_exclude = ".linenos, .gp, .go"
pwsmooth_figures = os.environ.get("PWSMOOTH_DOCS_FIGURES", str(DOCS / "_build" / "figures"))
