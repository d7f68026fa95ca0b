"""Pages of the sources (viewcode) without their links back, some of which viewcode makes wrong.

`pwsmooth.basins` is documented there and lives in `pwsmooth.studies.attraction`: viewcode writes one prefix for all
names of a module. The links from the reference to the source are right and stay.
"""

import re

_BACK = re.compile(r'<a class="viewcode-back"[^>]*>.*?</a>', flags=re.DOTALL)


def without_links_back(app, pagename, templatename, context, doctree):
    """The page's body without `[docs]`."""
    if pagename.startswith("_modules/"):
        context["body"] = _BACK.sub("", context["body"])


def forget_aliases(app):
    """An alias such as `Word = tuple[...]` is of the module builtins, which has no page."""
    getattr(app.env, "_viewcode_modules", {}).pop("builtins", None)
    return ()


def setup(app):
    app.connect("html-page-context", without_links_back)
    app.connect("html-collect-pages", forget_aliases, priority=100)  # before viewcode
    return {"parallel_read_safe": True, "parallel_write_safe": True}
