"""Pages of the sources (viewcode) without their links back, which it makes wrong for names that have two homes.

`pwsmooth.basins` is documented there and lives in `pwsmooth.analysis.basins`: viewcode writes one prefix for all
names of a module. The links from the reference to the source are right and stay.
"""


def without_links_back(app):
    """Forget where each name is documented; called before viewcode writes its pages."""
    modules = getattr(app.env, "_viewcode_modules", {})
    modules.pop("builtins", None)  # an alias such as `Word = tuple[...]` has no source of its own
    for name, entry in modules.items():
        if entry:
            code, tags, _, prefix = entry
            modules[name] = code, tags, {}, prefix
    return ()


def setup(app):
    app.connect("html-collect-pages", without_links_back, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
