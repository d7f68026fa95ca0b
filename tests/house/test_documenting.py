"""A docstring says what is special; what many share is written once and put in (pwsmooth/door/documenting.py)."""

import importlib
import inspect
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

import pwsmooth
from pwsmooth.door import documenting, shared
from pwsmooth.laws import Law, law, parameter

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))

import public_names

NAMES = public_names.public_names()


def described(function, module="pwsmooth.scenes.sliding"):
    function.__module__ = module
    return inspect.getdoc(documenting.complete(function))


def test_a_shared_argument_is_described_at_its_place_in_the_call():
    def pushed(first, m, last):
        """A block.

        Parameters
        ----------
        first : str
            One.
        last : str
            Another.
        """

    text = described(pushed)
    assert text.index("first : str") < text.index("m : float, kg\n    Mass, > 0.") < text.index("last : str")


def test_what_a_docstring_says_itself_counts():
    def pushed(m):
        """A block.

        Parameters
        ----------
        m : float, kg
            Mass of the first of two.
        """

    assert described(pushed).count("m : float, kg") == 1 and "Mass, > 0." not in described(pushed)


def test_the_nearest_folder_counts():
    def pushed(k):
        """A block.

        >>> 1 + 1
        2
        """

    assert "Spring.\n" in described(pushed, "pwsmooth.scenes.sliding")
    pushed.__doc__ = "A block.\n\n>>> 1 + 1\n2\n"
    assert "Spring to the frame" in described(pushed, "pwsmooth.scenes.assemblies")


def test_an_entry_of_several_arguments_needs_all_of_them():
    def shown(transient):
        """A diagram.

        >>> 1 + 1
        2
        """

    assert "transient" not in described(shown)


def test_an_example_shows_the_imports_that_it_needs_and_no_others():
    def pushed():
        """A block.

        A word in a string is no name, an attribute and a keyword are none, and what it makes itself is not imported:

        >>> x = sp.Symbol("np")
        >>> diagram = x.solve = lambda t, period=1: t
        >>> Coulomb(F_c=1.0)
        Coulomb(F_c=1.0)
        """

    text = described(pushed)
    assert ">>> import sympy as sp\n>>> from pwsmooth.laws.friction import Coulomb\n>>> x = sp" in text
    assert text.count("import ") == 2
    assert "Examples\n--------\nA word in a string" in text


def test_a_name_is_imported_from_where_the_module_itself_stands():
    # `Joint` is a part of a sketch and the contract's joint; `refine` goes for an orbit and for a sweep.
    assert documenting._home("Joint", "pwsmooth.scenes.sketch") == "pwsmooth.scenes.sketch"
    assert documenting._home("Joint", "pwsmooth.laws.joint") == "pwsmooth.laws"
    assert documenting._home("refine", "pwsmooth.studies.refining") == "pwsmooth.studies"
    assert documenting._home("System", "pwsmooth.system") == "pwsmooth"


def test_a_source_gets_its_heading():
    def pushed():
        """A block.

        Source: Coulomb 1785.
        """

    assert described(pushed) == "A block.\n\nNotes\n-----\nSource: Coulomb 1785."


def test_a_sentence_alone_stays_one():
    def pushed(m, ax):
        """A block."""

    assert described(pushed) == "A block."


@pytest.mark.parametrize("name", [name for name, value in NAMES.items() if callable(value)])
def test_a_complete_docstring_stays_as_it_is(name):
    value = NAMES[name]
    gives = documenting._signature(value) if inspect.isfunction(value) else ([], "")
    text = inspect.getdoc(value)
    module = getattr(value, "__module__", "pwsmooth")
    assert documenting.completed(text, *gives, module, {}, {}).strip() == text.strip()


def test_a_law_of_ones_own_may_have_any_docstring():
    @law
    class Odd(Law):
        """A law.

        >>> this is no code
        >>> nor (this
        """

        c: float = parameter(0.5, "N s/m", "damping")

    assert "c : float, N s/m, default 0.5" in Odd.__doc__


def test_a_law_of_one_sentence_names_its_source():
    @law
    class Bare(Law):
        """A law without parameters."""

        source = "Coulomb 1785"

    assert Bare.__doc__ == "A law without parameters.\n\nNotes\n-----\nSource: Coulomb 1785.\n"


@pytest.mark.parametrize("home", [*shared.HOMES])
def test_examples_import_from_where_the_names_are(home):
    module = importlib.import_module(home)
    missing = [name for name in shared.HOMES[home].split() if not hasattr(module, name)]
    assert not missing, f"{home} has no {missing}: change HOMES in pwsmooth/door/shared.py"


def test_each_shared_entry_serves_several_docstrings():
    served = Counter()
    for value in NAMES.values():
        for holder in (value, *vars(value).values()) if inspect.isclass(value) else (value,):
            text = inspect.getdoc(holder) or ""
            module = getattr(holder, "__module__", None) or getattr(value, "__module__", "")
            for scope in shared.ARGUMENTS:
                if f"{module}.".startswith(f"{scope}."):
                    entries = documenting._ENTRY.findall(shared.ARGUMENTS[scope])
                    served.update(
                        (scope, e.rstrip()) for e in entries if e.rstrip().removeprefix("-> ") in text
                    )
    few = [
        (scope, entry)
        for scope, text in shared.ARGUMENTS.items()
        for entry in map(str.rstrip, documenting._ENTRY.findall(text))
        if served[scope, entry] < 2
    ]
    assert not few, "write these where they are used"


def test_without_docstrings_the_package_works():
    code = "import pwsmooth.scenes; print(pwsmooth.scenes.block_on_belt.__doc__)"
    done = subprocess.run([sys.executable, "-OO", "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "None", done.stderr


def test_a_module_of_the_package_is_named_as_the_table_has_it():
    for scope in shared.ARGUMENTS:
        assert importlib.import_module(scope).__name__.startswith(pwsmooth.__name__)
