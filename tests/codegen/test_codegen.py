"""Expression graphs and the pointwise functions of a model, against sympy itself.

Guards: codegen/fields.py, codegen/graph/.
"""

import ctypes
import math
import random

import mpmath
import numpy as np
import pytest
import sympy as sp

from pwsmooth.codegen import compile_model
from pwsmooth.codegen.graph.dag import Graph
from pwsmooth.codegen.graph.scalar import ScalarCode, Writer
from pwsmooth.codegen.graph.slopes import derivative
from pwsmooth.definition.model import EventSpec, Held, LayerState, Model, Multiplier, Select

t, x, y, z, lam, mu = sp.symbols("t x y z lam mu", real=True)
a, b = sp.symbols("a b", positive=True)


def call(compiled, name, sizes, *inputs, number=None):
    """Call a compiled function by its address with t and arrays; outputs start as nan."""
    inputs = [np.array([*np.atleast_1d(q), 0.0], float) for q in inputs[1:]], inputs[0]
    outputs = [np.full(size, np.nan) for size in sizes]
    pointers = [q.ctypes.data for q in (*inputs[0], *outputs)]
    head = [ctypes.c_double] if number is None else [ctypes.c_int64, ctypes.c_double]
    kind = ctypes.CFUNCTYPE(ctypes.c_int64, *head, *[ctypes.c_void_p] * len(pointers))
    code = kind(getattr(compiled, name))(*([] if number is None else [number]), inputs[1], *pointers)
    return (*outputs, code)


def random_expression(rng, depth):
    if depth == 0:
        numbers = [sp.Integer(rng.randint(-3, 3)), sp.Rational(rng.randint(1, 5), 7)]
        return rng.choice([x, y, t, a, b, lam, *numbers])
    left, right = (random_expression(rng, depth - 1) for _ in range(2))
    kind = rng.randrange(9)
    if kind == 0:
        return left + right
    if kind == 1:
        return left * right
    if kind == 2:
        return left / (2 + right**2)
    if kind == 3:
        return left ** rng.randint(-2, 4) if left != 0 else right
    if kind == 4:
        return rng.choice([sp.sin, sp.cos, sp.tanh, sp.atan, sp.erf])(left) - right
    if kind == 5:
        return sp.sqrt(1 + left**2) * right
    if kind == 6:
        return sp.Piecewise((left, x < y), (right, sp.Or(x > 2 * y, sp.Not(sp.Eq(a, b)))), (left * right, True))
    if kind == 7:
        return sp.Max(left, right) - sp.Abs(left)
    return (1 + left**2) ** sp.Rational(3, 2) / a - sp.exp(-(right**2))


def evaluate(graph, roots, values):
    """Run the scalar code of some nodes in Python itself."""
    body = Writer(0)
    code = ScalarCode(graph, body)
    code.emit(roots)
    scope = {"math": math, "sign": lambda u: float(np.sign(u)), **values}
    exec(body.text(), scope)
    return [eval(code.name(r), scope) for r in roots]


def test_scalar_code_of_random_expressions_agrees_with_sympy():
    rng = random.Random(5)
    model = Model(t, (x, y), (a, b), (x, y), (Multiplier(lam, "algebraic", lam),))
    compared = 0
    while compared < 150:
        expression = random_expression(rng, 3)
        graph = Graph(model)
        point = {s: rng.uniform(0.3, 1.7) for s in (x, y, t, a, b, lam)}
        values = {"x": [point[x], point[y]], "t": point[t], "p": [point[a], point[b]], "mult": [point[lam]]}
        reference = sp.lambdify((x, y, t, a, b, lam), expression, "mpmath")
        with mpmath.workdps(40):
            others = [mpmath.mpf(point[s]) for s in (y, t, a, b, lam)]
            h = mpmath.mpf("1e-12")
            try:
                below, expected, above = (mpmath.mpf(reference(point[x] + q, *others)) for q in (-h, 0, h))
            except ZeroDivisionError:
                continue
            if abs(expected) > 1e9:
                continue
            expected_slope = float((above - below) / (2 * h))
        root = graph.expression(expression)
        slope = derivative(graph, root, graph.var("x", 0))
        found = evaluate(graph, [root, slope], values)
        assert found[0] == pytest.approx(float(expected), rel=1e-11, abs=1e-11), expression
        assert found[1] == pytest.approx(expected_slope, rel=1e-9, abs=1e-9), expression
        compared += 1


def test_shared_subexpressions_are_one_node():
    graph = Graph(Model(t, (x, y), (a,), (x, y)))
    first = graph.expression(sp.sin(x * y) * a)
    count = len(graph.nodes)
    assert graph.expression(a * sp.sin(y * x)) == first and len(graph.nodes) == count
    product = graph.mul(graph.var("x", 1), graph.var("x", 0))
    assert graph.mul(graph.fun("sin", product), graph.var("p", 0)) == first and len(graph.nodes) == count


def test_what_a_scope_needs_anyway_is_computed_once_and_outside_the_branch():
    model = Model(t, (x, y), (a,), (x, y), (Multiplier(lam, "switch", -lam, x),))
    graph = Graph(model)
    shared = sp.sin(x * y)
    roots = [graph.expression(e) for e in (Select(lam, shared + x, y), Select(lam, y * x, shared**2), shared)]
    body = Writer()
    ScalarCode(graph, body).emit(roots)
    text = body.text()
    assert text.count("math.sin") == 1
    assert text.index("math.sin") < text.index("if ")
    assert text.count("if mult[0] == 1.0") == 1  # both selections in one branch


@pytest.mark.parametrize(("multiplier", "expected"), [(1.0, 0.5), (-1.0, 0.5), (0.25, 2.0)])
def test_a_choice_by_whether_a_multiplier_is_held_is_written_once_for_both_of_its_sides(multiplier, expected):
    graph = Graph(Model(t, (x,), (), (x,), (Multiplier(lam, "switch", lam, x),)))
    root, body = graph.expression(Held(lam, 1 / x, x)), Writer(0)
    ScalarCode(graph, body).emit([root])
    assert body.text().count("1.0 / ") == 1
    assert evaluate(graph, [root], {"x": [2.0], "mult": [multiplier]}) == [expected]


def test_a_selection_that_joins_an_earlier_one_finds_its_shared_parts_outside_the_branch():
    model = Model(t, (x, y), (a,), (x, y), (Multiplier(lam, "switch", -lam, x),))
    graph = Graph(model)
    first = graph.expression(Select(lam, x, y))
    shared = graph.expression(sp.cos(x * y))  # numbered after the selection that its user joins
    body = Writer()
    ScalarCode(graph, body).emit([first, graph.expression(Select(lam, sp.cos(x * y) ** 2, x)), shared])
    assert body.text().count("math.cos") == 1
    assert body.text().index("math.cos") < body.text().index("if ")


def test_fields_give_rates_surfaces_and_residuals():
    switch = Multiplier(lam, "switch", -a * lam + sp.sin(t), x - y)
    closed = Multiplier(mu, "algebraic", mu + x)
    events = (EventSpec("top", y - 1), EventSpec("clock", every=sp.Integer(1)))
    model = Model(t, (x, y), (a,), (y - a * lam, -x + mu), (switch, closed), events)
    dx, h, g, _ = call(compile_model(model), "fields", (2, 4, 2), 0.3, [1.5, 0.25], [-1.0, 2.0], [0.5])
    np.testing.assert_allclose(dx, [0.25 + 0.5, -1.5 + 2.0], rtol=1e-15)
    np.testing.assert_allclose(h, [1.25, 0.0, -0.75, 0.0], rtol=1e-15)
    np.testing.assert_allclose(g, [0.5 + math.sin(0.3), 3.5], rtol=1e-15)


def test_linear_gives_the_gradients_of_residuals_and_surfaces():
    residuals = (lam**3 * x + lam * mu, sp.sin(mu) * a + lam)
    surfaces = (x**2 * y + t, sp.exp(x) * t**2)
    multipliers = (
        Multiplier(lam, "switch", residuals[0], surfaces[0]),
        Multiplier(mu, "switch", residuals[1], surfaces[1]),
    )
    model = Model(t, (x, y), (a,), (x, y), multipliers, (EventSpec("e", x * y * t),))
    compiled = compile_model(model)
    # The surface exp(x) t**2 does not depend on y: five entries, then three derivatives by time.
    G, dh, _ = call(compiled, "linear", (4, 8), 0.3, [1.5, 0.25], [0.4, -0.7], [0.5])
    row, col = compiled.pattern("DH")
    assert (row.tolist(), col.tolist()) == ([0, 2, 3, 5], [0, 1, 0, 0, 1])
    assert [part.tolist() for part in compiled.pattern("G")] == [[0, 2, 4], [0, 1, 0, 1]]
    point = {t: 0.3, x: 1.5, y: 0.25, lam: 0.4, mu: -0.7, a: 0.5}
    expected_G = [r.diff(s).subs(point) for r in residuals for s in (lam, mu)]
    gradients = [s.diff(q).subs(point) for s in (*surfaces, x * y * t) for q in (x, y)]
    expected_dh = [d for d in gradients if d != 0]
    expected_dh += [s.diff(t).subs(point) for s in (*surfaces, x * y * t)]
    np.testing.assert_allclose(G, np.array(expected_G, float), rtol=1e-14)
    np.testing.assert_allclose(dh, np.array(expected_dh, float), rtol=1e-14)


def test_the_slope_of_a_selection_by_its_own_multiplier_is_the_affine_one_at_its_ends():
    model = Model(t, (x,), (), (x,), (Multiplier(lam, "switch", Select(lam, x**2, 3 * x), x),))
    for value in (1.0, -1.0, 0.2):
        G, _, _ = call(compile_model(model), "linear", (1, 2), 0.0, [2.0], [value], [])
        assert G[0] == (4.0 - 6.0) / 2


def test_an_undefined_branch_is_never_evaluated():
    # 0 * inf on the inactive side would be nan, (-0.5)**1.5 is nan.
    switch = Multiplier(lam, "switch", -lam, x, regularity="kink")
    rate = Select(lam, x ** sp.Rational(3, 2) / (x + sp.Rational(1, 2)), a * x)
    model = Model(t, (x,), (a,), (rate,), (switch,), outputs=(("force", rate),))
    compiled = compile_model(model)
    assert call(compiled, "outputs", (1,), 0.0, [-0.5], [-1.0], [3.0])[0][0] == -1.5
    assert call(compiled, "fields", (1, 1, 1), 0.0, [-0.5], [-1.0], [3.0])[0][0] == -1.5
    assert np.isnan(call(compiled, "outputs", (1,), 0.0, [-0.5], [1.0], [3.0])[0][0])


def test_a_nested_selection_is_taken_by_both_statuses():
    inner = Select(mu, x, sp.log(x))
    model = Model(
        t,
        (x,),
        (),
        (Select(lam, inner, sp.log(x) + 1),),
        (Multiplier(lam, "switch", -lam, x), Multiplier(mu, "switch", -mu, x - 1)),
    )
    compiled = compile_model(model)
    for first, second, expected in ((1, 1, -2.0), (1, -1, math.nan), (-1, 1, math.nan)):
        dx = call(compiled, "fields", (1, 2, 2), 0.0, [-2.0], [first, second], [])[0]
        np.testing.assert_equal(dx[0], expected)


def test_a_reset_reads_the_values_before_and_writes_only_what_it_updates():
    events = (
        EventSpec("swap", x - y, when=sp.And(x > 0, sp.Ne(z, 1)), update=((0, y), (1, x + a))),
        EventSpec("stop", x, terminal=True),
    )
    model = Model(t, (x, y, z), (a,), (y, x, sp.Integer(0)), events=events, n_memory=1)
    compiled = compile_model(model)
    new, code = call(compiled, "act", (3,), 0.0, [2.0, 5.0, 0.0], [], [0.5], number=0)
    assert code == 1
    np.testing.assert_equal(new, [5.0, 2.5, np.nan])
    for start in ([-2.0, 5.0, 0.0], [2.0, 5.0, 1.0]):
        new, code = call(compiled, "act", (3,), 0.0, start, [], [0.5], number=0)
        assert code == 0 and np.all(np.isnan(new))
    assert call(compiled, "act", (3,), 0.0, [2.0, 5.0, 0.0], [], [0.5], number=1)[1] == 1


def test_an_impact_writes_the_whole_state():
    contact = Multiplier(lam, "contact", -a + lam, x, impact=(x, -b * y))
    model = Model(t, (x, y), (a, b), (y, -a + lam), (contact,), (EventSpec("e", y),))
    new, code = call(compile_model(model), "act", (2,), 0.0, [0.0, -3.0], [0.0], [9.81, 0.5], number=1)
    assert code == 1
    np.testing.assert_equal(new, [0.0, 1.5])


def test_layer_gives_residuals_and_rates_with_the_layered_states_free():
    layered = LayerState(z, sp.oo, 1 - lam**2 - z, 1 - lam**2)
    model = Model(
        t,
        (x,),
        (a,),
        (x,),
        (Multiplier(lam, "switch", -a * lam * (2 - lam**2), x),),
        layer_states=(layered,),
        layer_residuals=(-a * lam * (1 + z),),
    )
    compiled = compile_model(model)
    g, q, _ = call(compiled, "layer", (1, 1), 0.0, [0.0], [0.5], [0.25], [3.0])
    assert g[0] == -3 * 0.5 * 1.25 and q[0] == 0.5
    assert compiled.nz == 1


def test_functions_with_jumps_have_their_values_in_resets():
    values = (
        sp.Mod(x, 3),
        sp.sign(x),
        sp.Heaviside(x),
        sp.Abs(x),
        sp.Max(x, -1, y),
        sp.floor(x),
        sp.atan2(x, y),
    )
    model = Model(t, (x, y), (), (x, y), outputs=tuple((f"o{i}", e) for i, e in enumerate(values)))
    out, _ = call(compile_model(model), "outputs", (len(values),), 0.0, [-2.5, -1.25], [], [])
    np.testing.assert_allclose(out, [0.5, -1.0, 0.0, 2.5, -1.0, -3.0, math.atan2(-2.5, -1.25)], rtol=1e-15)


def test_functions_that_a_model_lacks_have_address_0():
    compiled = compile_model(Model(t, (x,), (), (-x,)))
    assert (compiled.outputs, compiled.layer, compiled.jet_general) == (0, 0, 0)


def test_a_model_without_switches_can_still_be_asked_for_its_gradients_and_resets():
    compiled = compile_model(Model(t, (x,), (), (-x,)))
    G, dh, _ = call(compiled, "linear", (1, 1), 0.0, [1.0], [], [])
    assert np.isnan(G[0]) and np.isnan(dh[0])  # nothing to write
    assert call(compiled, "act", (1,), 0.0, [1.0], [], [], number=0)[1] == 1


def test_an_undefined_symbol_is_named():
    with pytest.raises(ValueError, match="uses y"):
        _ = compile_model(Model(t, (x,), (), (-y,))).fields


def test_equal_models_share_one_compilation():
    def model():
        return Model(t, (x,), (a,), (-a * x,))

    assert compile_model(model()) is compile_model(model())


def test_selections_whose_groups_need_each_other_are_written_one_by_one():
    # Two by one multiplier, two by another; the second of each stands on the first of the other.
    other = sp.Symbol("other", real=True)
    switches = (Multiplier(lam, "switch", -lam, x), Multiplier(other, "switch", -other, y))
    graph = Graph(Model(t, (x, y), (a,), (x, y), switches))
    one, two = Select(lam, x, y), Select(other, y + 1, x)
    roots = [graph.expression(e) for e in (two, Select(lam, two**2, 3 * x), one, Select(other, one**2, 5 * y))]
    ScalarCode(graph, Writer()).emit(roots)
    for mult in ([1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]):
        first, second = (2.0 if mult[0] > 0 else 7.0), (8.0 if mult[1] > 0 else 2.0)
        expected = [second**2 if mult[0] > 0 else 6.0, first**2 if mult[1] > 0 else 35.0]
        assert evaluate(graph, roots[1::2], {"x": [2.0, 7.0], "mult": mult}) == expected
