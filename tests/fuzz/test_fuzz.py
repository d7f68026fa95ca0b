"""The adversary in the suite: fixed seeds, a few structures a fuzzer; `python -m tests.fuzz` is the long mode.

No case is silently wrong; each fuzzer sees planted faults; the oracle meets closed forms.
"""

import importlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pwsmooth.paths.derivatives.of_solution import Derivatives
from tests.fuzz import affine, invariance, judging, planted  # one name, one compile cache of the oracle
from tests.fuzz.__main__ import NAMES, OF_DERIVATIVES, fuzz
from tests.fuzz.compose import reference

# Structures, cases of each, step: the short command plays every `step`-th structure, the thorough one the others.
# Nearly all of the time goes into compiling structures.
SIZES = {
    "affine": (6, 20, 3), "contacts": (10, 20, 3), "resets": (6, 20, 1), "hidden": (8, 25, 2), "smooth": (6, 8, 1),
    "invariance": (6, 15, 1), "discs": (8, 4, 8), "lines": (5, 6, 2), "assemblies": (12, 1, 5), "links": (9, 1, 4),
    "loops": (8, 10, 3), "layers": (12, 1, 5), "noises": (17, 1, 6), "slopes": (8, 20, 4), "differences": (12, 2, 5),
    "gradients": (6, 10, 2), "compose": (4, 3, 1),
}  # fmt: skip
# Of compositions these: the long mode still meets structures that are wrong.
NUMBERS = {"compose": (16, 19, 21, 23)}
REST = [name for name, (_, _, step) in SIZES.items() if step > 1]


def no_case_is_wrong(name, rest):
    structures, each, step = SIZES[name]
    numbers = NUMBERS.get(name) or [k for k in range(structures) if (k % step > 0) == rest]
    tally = fuzz(name, structures * each, structures, seed=7, numbers=numbers)
    assert tally.failures == []
    right = sum(n for kind, n in tally.counts.items() if kind.startswith("right"))
    assert right > 0.6 * sum(tally.counts.values())


@pytest.mark.parametrize("name", NAMES + OF_DERIVATIVES)
def test_no_random_case_is_silently_wrong(name):
    no_case_is_wrong(name, rest=False)


def test_a_case_of_which_the_reference_is_too_slow_is_kept(monkeypatch):
    monkeypatch.setattr(reference, "SECONDS", 0)
    tally = fuzz("compose", 1, 1, seed=7, numbers=[16])
    assert tally.too_slow == [[700016, 700016000]]
    assert "not judged" in str(tally)


@pytest.mark.parametrize("name", REST)
def test_no_random_case_of_other_structures_is_silently_wrong(name):
    no_case_is_wrong(name, rest=True)


# Structures and cases that were wrong once: a step's end taken for another root, of numbers that one program had left
# behind the rows of the other; an error estimate of the pair that passed through 0; a pulse that a step passed over.
WERE_WRONG = {
    "hidden": [(7700124, 133), (7700124, 143), (7700239, 14), (7700297, 105), (7700188, 1)],
    "contacts": [(9200076, 6), (9200182, 14), (9200266, 26), (9700291, 114)],
    "smooth": [(9500072, 70), (9500253, 46), (9700010, 1), (9700041, 9), (9700046, 13), (9700185, 0)],
}


@pytest.mark.parametrize(
    ("name", "key", "case"), [(name, *at) for name, all_at in WERE_WRONG.items() for at in all_at]
)
def test_what_was_wrong_once_is_right(name, key, case):
    module = importlib.import_module(f"tests.fuzz.{name}")
    played = getattr(module, "compiled", judging.compiled)(module, key)
    assert getattr(module, "play", judging.play)(played, key * 1000 + case).kind == judging.RIGHT


# Derivatives that were wrong or refused: touches as deep as roundings, that short steps saw as crossings; one surface
# twice; bounces that are slow beside their table; folds that an arc reaches to the last bit, or spans that end on one.
OF_DERIVATIVES_ONCE = {
    "slopes": [(100027, 34), (100187, 21), (100242, 20), (100086, 0), (100086, 48), (100150, 3), (100196, 14)],
    "differences": [
        (300001, 15),
        (300002, 55),
        (300005, 8),
        (300005, 15),
        (300006, 56),
        (300012, 25),
        (300015, 23),
    ],
}


@pytest.mark.parametrize(
    ("name", "key", "case"), [(name, *at) for name, all_at in OF_DERIVATIVES_ONCE.items() for at in all_at]
)
def test_what_had_a_wrong_derivative_once_has_none(name, key, case):
    module = importlib.import_module(f"tests.fuzz.{name}")
    played = getattr(module, "compiled", judging.compiled)(module, key)
    assert module.play(played, key * 1000 + case).kind in (judging.RIGHT, "justly refused")


@pytest.mark.parametrize("name", OF_DERIVATIVES)
def test_a_planted_wrong_derivative_is_seen(name, monkeypatch):
    module = importlib.import_module(f"tests.fuzz.{name}")
    played = getattr(module, "compiled", judging.compiled)(module, 4)
    right = [seed for seed in range(4000, 4006) if module.play(played, seed).kind == judging.RIGHT]
    replayed = Derivatives._replay

    def spoiled(self, *arguments, **options):
        run = replayed(self, *arguments, **options)
        factor = 1 + 1e-5
        return run._replace(
            end=factor * run.end, at_sample=factor * run.at_sample, at_point=factor * run.at_point
        )

    monkeypatch.setattr(Derivatives, "_replay", spoiled)
    assert len(right) > 2 and all(module.play(played, seed).kind == judging.WRONG for seed in right)


def test_the_oracle_agrees_with_closed_forms():
    for what, got, exact in planted.closed_forms():
        assert got == pytest.approx(exact, abs=1e-9), what


def test_the_oracle_agrees_with_matrix_exponentials():
    assert planted.against_exponentials() < 1e-11


def test_the_reference_of_compositions_agrees_with_closed_forms():
    for what, got, exact in reference.closed_forms():
        assert got == pytest.approx(exact, abs=2e-7), what


@pytest.mark.parametrize("name", NAMES)
def test_a_planted_wrong_number_is_seen(name):
    cases = 1 if name == "smooth" else 4  # what is wrong there is computed again in the finest steps
    number, found = planted.seen(name, "a wrong number", structures=1, cases=cases)
    assert number > 0 and found == number


# ---- one structure under transformations that hypothesis shrinks to the plainest that fails


@pytest.fixture(scope="module")
def base():
    """A structure with two switches, a case that slides, and its run."""
    played = invariance.compiled(None, 0)
    case = affine.case(played.model, 2, options=False)
    return played, case, invariance._run(played.system["as is"], case)


PROPERTY = settings(
    max_examples=60,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@PROPERTY
@given(power=st.integers(-9, 9))
def test_states_of_any_size_move_alike(base, power):
    played, case, run = base
    s = 10.0**power
    other = invariance._run(played.system["as is"], invariance.scaled(played.model, case, s))
    assert other.x / s == pytest.approx(run.x, abs=1e-7)


@PROPERTY
@given(by=st.floats(-100, 100))
def test_time_has_no_origin(base, by):
    played, case, run = base
    other = invariance._run(played.system["as is"], invariance.shifted(played.model, case, by))
    assert other.x == pytest.approx(run.x, abs=1e-7)


@PROPERTY
@given(fractions=st.lists(st.floats(0.01, 0.99), max_size=5, unique=True))
def test_a_run_in_pieces_is_the_run(base, fractions):
    played, case, run = base
    t0, start, end = case.t0, case.start, case.instants[-1]
    for instant in [*sorted(t0 + f * (end - t0) for f in fractions), end]:
        piece = invariance._run(played.system["as is"], case, np.array([instant]), start, t0)
        t0, start = instant, piece.x[:, -1]
    assert start == pytest.approx(run.x[:, -1], abs=1e-7)


@PROPERTY
@given(digits=st.floats(6, 12), method=st.sampled_from(["taylor", "rk"]))
def test_tolerances_and_methods_agree(base, digits, method):
    played, case, run = base
    options = {"rtol": 10**-digits, "method": method}
    other = invariance._run(played.system["as is"], case, **options)
    assert other.x == pytest.approx(run.x, abs=judging.tolerance(options, 1 + np.abs(run.x).max()))
