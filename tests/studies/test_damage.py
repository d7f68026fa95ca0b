"""Damaged stores and caches are never believed: a few cases of tests/fuzz/damage.py."""

import pytest

from tests.fuzz import damage


@pytest.mark.parametrize("what, number", [(damage.stores, 25), (damage.caches, 6)])
def test_what_is_damaged_is_made_again_or_refused_in_words(what, number, tmp_path):
    verdicts, failures = what(range(number), 1, tmp_path)
    assert not failures
    assert sum(verdicts.values()) >= number
