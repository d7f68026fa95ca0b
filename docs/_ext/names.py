"""The role of single backticks in docstrings: a link where it is a public name, code otherwise.

`solve()`, `Solution` and `pwsmooth.analysis.sticking.fold` are links; `x0`, an argument, is code.
"""

import re

from docutils import nodes
from public_names import public_names
from sphinx import addnodes


def short_names():
    """Name without its module -> full name, where only one public object has it."""
    full = list(public_names())
    last = [name.rpartition(".")[2] for name in full]
    return {short: name for short, name in zip(last, full) if last.count(short) == 1}


_LITERAL = re.compile(r"(`+[^`]*`+)")


def bars(app, what, name, obj, options, lines):
    """The bars of |x| in a docstring are absolute values, not substitutions of reStructuredText."""
    for i, line in enumerate(lines):
        if "|" in line and not line.lstrip().startswith((">>>", "...", "|", "+")):
            parts = _LITERAL.split(line)
            lines[i] = "".join(p if p.startswith("`") else p.replace("|", r"\|") for p in parts)


def typed(app, what, name, obj, options, lines):
    """Indented parts of a module's docstring, equations and columns, stay as they were typed."""
    if what != "module":
        return
    result, inside = [], False
    for line in lines:
        if line.strip() == "..":  # the mark that numpydoc leaves at the end
            break
        if line.strip() and line.startswith(" ") != inside:
            inside = not inside
            result += ["", "::", ""] if inside else [""]
        result.append(line)
    lines[:] = result


def setup(app):
    full, short = set(public_names()), short_names()

    def name_role(role, rawtext, text, lineno, inliner, options=None, content=()):
        bare = text.removesuffix("()")
        # A lower-case word alone may be an argument of that name: only with its brackets is it the function.
        known = bare in short and (text != bare or not bare.islower())
        target = bare if bare in full else short[bare] if known else None
        literal = nodes.literal(rawtext, text, classes=["xref", "py", "py-obj"] if target else [])
        if target is None:
            return [literal], []
        reference = addnodes.pending_xref(
            rawtext, literal, refdomain="py", reftype="obj", reftarget=target, refexplicit=False, refwarn=True
        )
        reference["refdoc"] = inliner.document.settings.env.docname
        return [reference], []

    app.add_role("name", name_role)
    app.connect("autodoc-process-docstring", bars, priority=900)  # after numpydoc
    app.connect("autodoc-process-docstring", typed, priority=901)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
