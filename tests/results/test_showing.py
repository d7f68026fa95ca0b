"""What systems and results show of themselves: short text, tables, pictures without arguments."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Family, Strobe, Switch, System, basins, find_orbit, follow, plotting, solve
from pwsmooth.analysis.lyapunov import lyapunov_exponents
from pwsmooth.door.describe import LONGEST
from pwsmooth.laws.contact import Hertz
from pwsmooth.results.records import EventRecord, Listed
from pwsmooth.scenes import free_impact
from pwsmooth.studies import orbit_diagram
from pwsmooth.studies.attractors import FAILED, UNSETTLED

matplotlib.use("Agg")

t, x, v, z, a = sp.symbols("t x v z a", real=True)
lam = Switch("lam", v)
LOGISTIC = System({x: 0 * x}, time=t, parameters={a: 2.8}, events=[Event(every=1, update={x: a * x * (1 - x)})])
TWO_WELLS = System({x: x - x**3 - sp.sin(t) / 10, v: -v}, time=t)


@pytest.fixture(scope="module")
def branch():
    return follow(find_orbit(LOGISTIC, {x: 0.6}, seen=Strobe(1, phase=0.5)), {a: 3.3})


@pytest.fixture(scope="module")
def found():
    return basins(TWO_WELLS, {x: [-2, -1, 1], v: [0, 1]}, Strobe(2 * sp.pi), transient=20)


@pytest.fixture(scope="module")
def diagram():
    return orbit_diagram(LOGISTIC, a, [2.5, 3.2, 5.0], {x: 0.3}, Strobe(1), keep=4)


def many():
    chain = Family(100)
    u, w = chain.symbols("u w")
    springs = chain.neighbour(u, 1) - 2 * u + chain.neighbour(u, -1)
    system = System({u: w, w: springs - chain.sum(u) / 9 - sp.sign(w) / 10})
    return solve(system, (0, 5), {u: np.sin(np.arange(100)), w: 0})


def test_what_is_long_is_shown_in_a_few_lines(branch, found, diagram):
    long = many()
    exponents = lyapunov_exponents(TWO_WELLS, {x: 1, v: 0}, 20, count=2)
    shown = [
        long, long.system, long.events, long.segments, branch, branch.points[0], found, diagram, exponents,
        free_impact(Hertz()),
    ]  # fmt: skip
    assert len(long.events) > 100 and len(long.states) == 200
    for thing in shown:
        lines = repr(thing).splitlines()
        assert len(lines) <= 20 and max(map(len, lines)) < LONGEST + 60, repr(thing)
        html = thing._repr_html_()
        assert html.startswith("<table>") and html.count("<tr>") == html.count("</tr>") and len(html) < 8000
    assert " more" in repr(long) and "events" in repr(long.events)


def test_a_system_sets_its_equations_in_notebooks():
    block = System({x: v, v: -x - lam * (1 + a * z), z: (1 - lam**2 - z) / a}, parameters={a: 3})
    html = block._repr_html_()
    assert r"<span class='math'>\(\dot{x} = v\)</span>" in html
    assert r"\lambda = \operatorname{sign}" in html and r"\frac{" in html
    chain = Family(9)
    (u,) = chain.symbols("u")
    html = System({u: chain.neighbour(u, 1) - chain.sum(u)})._repr_html_()
    assert r"{u}_{i+1}" in html and r"\sum_i {u}_{i}" in html and "MemberSum" not in html


def test_an_equation_that_nobody_reads_is_cut_and_not_set():
    huge = sum(sp.sin(k * x) for k in range(200))
    system = System({x: huge})
    assert len(repr(system)) < 400 and " ... " in repr(system)
    assert r"\(" not in system._repr_html_() and len(system._repr_html_()) < 800


def test_lists_of_records_show_themselves_and_stay_lists():
    records = Listed(EventRecord(float(k), "s", "crossing") for k in range(40))
    assert repr(records).splitlines()[0] == "40 events" and len(repr(records).splitlines()) == 14
    assert records[:2] == list(records)[:2] and repr(records[:1]) == "1 events\n   t = 0: crossing [s]"
    assert repr(Listed()) == "none"


def test_a_branch_is_a_table_and_a_picture(branch):
    pytest.importorskip("pandas")
    table = branch.to_dataframe()
    assert list(table.columns) == ["a", "x", "period", "stable", "largest_multiplier", "largest_exponent"]
    # The logistic map's fixed point is 1 - 1/a, its multiplier 2 - a.
    np.testing.assert_allclose(table["x"], 1 - 1 / table["a"], atol=1e-10)
    np.testing.assert_allclose(table["largest_multiplier"], abs(2 - table["a"]), atol=1e-8)
    ax = branch.plot()
    assert [line.get_linestyle() for line in ax.lines] == ["-", "--", "None"]
    assert ax.lines[-1].get_label() == "flip"
    np.testing.assert_allclose(ax.lines[-1].get_data(), [[3], [2 / 3]], atol=1e-8)
    assert branch.plot("x").get_ylabel() == "x on the section"
    with pytest.raises(ValueError, match="`name`.*'w'"):
        branch.plot("w")


def test_basins_have_a_legend_that_names_what_has_no_attractor(found):
    ax = found.plot()
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "2: period 6.28319",
        "1: period 6.28319",
    ]
    kinds = np.array([2 * ["orbit of period 1"], ["not settled", "failed"], 2 * ["orbit of period 1"]])
    some = replace(found, labels=np.array([[0, 1], [UNSETTLED, FAILED], [0, 0]]), kinds=kinds)
    for shown in (some.plot(), some.plot(plotting.new_figure().subplots())):
        names = [label for label in shown.get_legend_handles_labels()[1]]
        assert names == ["2: period 6.28319", "1: period 6.28319", "unsettled", "failed"]
    assert "16.7% not settled" in repr(some) and "16.7% failed" in repr(some)
    assert "settled" not in repr(found)
    line = replace(found, axes={"x": np.arange(3.0)}, labels=np.array([0, 1, UNSETTLED]))
    assert line.plot().get_xlabel() == "x"


def test_a_diagram_says_where_runs_failed_and_why(diagram):
    (word,) = diagram.failures
    assert list(diagram.failures[word]) == [5.0] and f"1 {word}, first at 5" in repr(diagram)
    ax = diagram.plot()
    assert ax.get_ylabel() == "x, once a period" and ax.lines[1].get_label() == word
    assert list(ax.lines[1].get_xdata()) == [5.0]
    assert diagram[sp.Function("x", real=True)(t)].shape == diagram["x"].shape
    for ask in (diagram.__getitem__, lambda name: diagram.plot(ax, name)):
        with pytest.raises(KeyError, match="'q' is no state of this diagram; they are x"):
            ask("q")


def test_exponents_that_are_gone_are_drawn_at_the_edge():
    stick = System({x: v, v: -x - sp.sign(v) + sp.cos(t)}, time=t)
    exponents = lyapunov_exponents(stick, {x: 3.5, v: 0}, 50, count=2)
    ax = exponents.plot()
    assert np.isneginf(exponents.exponents[1]) and list(ax.lines[-1].get_xdata()) == [2]
    assert "-inf" in repr(exponents)


def test_the_layer_of_static_friction_has_the_roots_of_its_closed_form():
    static = System({x: v, v: -x - lam * (1 + 3 * (1 - lam**2))})
    run = solve(static, (0, 10), {x: 3.5, v: 0})
    ax = run.plot_layer()
    curve = ax.lines[1].get_xydata()
    # It comes to rest at x = -1.5, as under Coulomb's friction 1.
    np.testing.assert_allclose(curve[:, 1], 1.5 - curve[:, 0] * (1 + 3 * (1 - curve[:, 0] ** 2)), atol=1e-8)
    roots = [(line.get_xdata()[0], line.get_fillstyle()) for line in ax.lines[2:]]
    exact = sorted(root.real for root in np.roots([3, 0, -4, 1.5]) if abs(root) < 1)
    np.testing.assert_allclose([root for root, _ in roots], exact, atol=1e-4)
    assert [fill for _, fill in roots] == ["full", "none"]
    # The solution takes the first one on its way from -1.
    assert run["lam"][-1] == pytest.approx(roots[0][0], abs=1e-4)
    assert ax.texts[0].xy[0] == pytest.approx(roots[0][0], abs=1e-4)


def test_a_state_as_fast_as_the_layer_has_an_axis():
    hidden = System({x: v, v: -2.4 * sp.sin(t) - 3.1 * x - lam * (1 + 3 * z), z: (1 - lam**2 - z) * 10}, time=t)
    run = solve(hidden.layered({z: 0.5}), (0, 5), {x: 0, v: 1})
    ax = run.plot_layer("lam", t=2.4)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        "lam",
        "z",
    ) and ax.get_title() == "layer of lam at t = 2.37602"
    assert ax.get_ylim()[0] < 0 < 1 < ax.get_ylim()[1]


def test_a_layer_that_is_not_there_is_refused():
    run = solve(System({x: 1 - sp.sign(x - 2) * 2}), (0, 5), {x: 0}, t_eval=[1, 3])
    with pytest.raises(ValueError, match="no column at t = 0.666666667, where sgn.*without `t_eval`"):
        run.plot_layer()
    with pytest.raises(
        ValueError, match=r"`switch` is 'lam', which does not meet.*those that do are sgn\(x - 2\)"
    ):
        run.plot_layer("lam")
    with pytest.raises(ValueError, match="no switch of this solution meets its surface"):
        solve(System({x: -x}), (0, 5), {x: 1}).plot_layer()
    with pytest.raises(ValueError, match="has a family"):
        many().plot_layer()


@pytest.mark.parametrize(
    "name, said",
    [
        ("x", r"it is a state: solution\['x'\]"),
        (lam, r"it is a multiplier: solution\['lam'\].*solution\(t, 'lam'\)"),
        ("force", "it is an output"),
        ("a", r"it is a parameter, whose value is solution.parameters\['a'\]"),
        ("w", "give times. It is no state, multiplier or output of this solution; they are x, v, lam, force"),
    ],
)
def test_a_name_in_the_place_of_times_is_told_what_it_is(name, said):
    run = solve(
        System({x: v, v: -a * x - lam}, parameters={a: 2}, outputs={"force": lam}), (0, 1), {x: 1, v: 0}
    )
    with pytest.raises(TypeError, match=f"`t` is '{name}'; {said}"):
        run(name)


def test_a_backend_that_is_loaded_within_the_style_stays_interactive():
    """Notebooks load theirs with the first figure, and show nothing where it is not interactive."""
    before = matplotlib.rcParams.copy()
    try:
        with pytest.raises(KeyError), plotting.style():
            matplotlib.interactive(True)
            raise KeyError
        assert matplotlib.is_interactive()
        changed = {key for key in before if before[key] != matplotlib.rcParams[key]}
        assert changed == {"interactive"}
    finally:
        matplotlib.interactive(False)


def test_an_orbit_that_is_missing_is_said_to_be_so_once():
    for rate, period in ((-x + sp.sin(2 * t), 1), (1 + sp.sin(t), 2 * sp.pi)):
        missing = find_orbit(System({x: v, v: rate}, time=t), {x: 1, v: 0}, seen=Strobe(period))
        assert not missing.success
        assert repr(missing).lower().count("no orbit") == 1 and repr(missing).startswith("No orbit")


def test_an_exponent_of_minus_infinity_has_no_error():
    exponents = lyapunov_exponents(System({x: -sp.sign(x), v: -v}), {x: 1, v: 1}, 20, count=2)
    assert np.isneginf(exponents.exponents).any()
    assert repr(exponents).endswith("+- 0.5, -inf")
