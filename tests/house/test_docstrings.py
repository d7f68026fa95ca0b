"""Every public name says what it takes and gives, in which shapes and units; its example runs.

Guards: laws/documenting.py, __init__.py.
"""

import doctest
import sys
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))

import docstring_rules
import public_names

NAMES = public_names.public_names()


@pytest.mark.parametrize("name", NAMES)
def test_docstring_is_complete(name):
    assert not docstring_rules.shortcomings(name, NAMES[name])


@pytest.mark.parametrize("name", [name for name, value in NAMES.items() if value.__doc__ and callable(value)])
def test_its_examples_run(name, monkeypatch, tmp_path):
    """In an empty namespace, as a reader pastes them, and in a directory of their own."""
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    said = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for test in doctest.DocTestFinder().find(NAMES[name], name, globs={}):
        runner.run(test, out=said.append)
    plt.close("all")
    assert not said, "".join(said)


def test_the_rules_see_what_is_missing():
    def bare(x):
        return x

    def vague(x):
        """Twice x.

        Parameters
        ----------
        x : array_like
            The x.

        Returns
        -------
        float
            The double.

        Examples
        --------
        >>> 1 + 1
        2
        """
        if x is None:
            raise ValueError("`x` is None; give a number.")
        return 2 * x

    assert any("docstring" in text for text in docstring_rules.shortcomings("bare", bare))
    found = "\n".join(docstring_rules.shortcomings("vague", vague))
    for what in (
        "without a shape",
        "`x` is a quantity without a unit",
        "`float` is a quantity",
        "Raises",
    ):
        assert what in found


def test_the_rules_ask_for_the_source_of_what_the_literature_has():
    def told(name, notes):
        def example():
            pass

        example.__doc__ = f"One law.\n\nNotes\n-----\n{notes}\n"
        example.__module__ = name.rpartition(".")[0]
        return "\n".join(docstring_rules.shortcomings(name, example))

    assert "no source" in told("pwsmooth.laws.friction.example", "A force.")
    assert "source" not in told("pwsmooth.laws.friction.example", "Source: Coulomb 1785.")
    assert "source" not in told("pwsmooth.studies.example", "A number.")
    assert "it cites outside" in told("pwsmooth.studies.example", "After Coulomb 1785.")
    assert "a source that is none" in told("pwsmooth.studies.example", "Source: defined here.")
