"""From each module to the tests that guard it: tests/guards.py."""

import ast
import re

import guards


def test_every_module_has_tests_that_guard_it():
    found = guards.guards()
    assert [module for module, tests in found.items() if not tests and not guards.why_unguarded(module)] == []
    assert "kernels/instant/test_friction_loops.py" in found["kernels/instant/resting.py"]


def test_what_tests_say_that_they_guard_is_there():
    for path in guards.TESTS.rglob("test_*.py"):
        said = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("Guards: ")[2]
        places = re.findall(r"[\w/]+(?:\.py|/)", said)
        assert [place for place in places if not (guards.PACKAGE / place).exists()] == [], path
