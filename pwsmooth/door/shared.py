"""What docstrings share: entries of arguments and results, and where examples import names from.

The one place where a name that many docstrings use changes. What one docstring alone says stands there, and its own
entry counts before the shared one.
Chain: **shared** -> documenting.py.
"""

#: Entries by folder or module, of which the nearest counts; a result has its annotation for a name, as `-> Axes`.
ARGUMENTS = {
    "pwsmooth": """
ax : Axes, optional
    Where to draw; a new figure by default.
work : Work, optional
    Executor, workers, chunk, store, progress.
seen : Strobe or Return
    Once a period of the drive, or whenever an autonomous system crosses a surface.
**options
    For `pwsmooth.solve`.
-> Axes
    Where it was drawn.
""",
    "pwsmooth.plotting": """
sol : Solution
    What is drawn.
""",
    "pwsmooth.definition.families": """
edges : array_like, shape (nb + 1,), in the unit of what is counted
    Ascending: of the classes a <= value < b.
""",
    "pwsmooth.definition.sigmoids": """
lam : Expr or float, dimensionless
    Lambda, between -1 and 1.
eps : Expr or float, in the unit of h
    Width of the layer, > 0.
-> Expr
    Dimensionless, between -1 and 1.
""",
    "pwsmooth.laws.joint": """
name : str
    Without the joint's name.
scale : float
    Usual size in the state's unit.
**assumptions : bool
    Of the symbol; `real` by default.
""",
    "pwsmooth.laws.friction": """
p : namespace
    The parameters' symbols.
""",
    "pwsmooth.laws.friction.realtime": """
v : float, m/s
    Velocity at the start.
h : float, s
    Length of the step.
""",
    "pwsmooth.laws.contact.stiffness": """
E_star : float, Pa
    Composite modulus.
""",
    "pwsmooth.laws.contact.restitution": """
stiffness : float, N/m^n
    K.
mass : float, kg
    Reduced mass.
speed : float, m/s
    v0 at touch-down.
""",
    "pwsmooth.laws.contact.eta": """
name : str
    Key of the table `ETA`.
""",
    "pwsmooth.scenes": """
t_span : (float, float), s
    Suggested span.
m : float, kg
    Mass, > 0.
g : float, m/s^2
    Gravity.
k : float, N/m
    Spring.
c : float, N s/m
    Damper.
amplitude : float, N
    Of the drive.
omega : float, rad/s
    Of the drive.
normal : Expr of t, optional
    Normal load; the law is per unit of load then.
period : float, s, optional
    Period of the drive.
parameters : mapping of (Symbol or str) to float, optional
    Values of the drive's symbols, in its units.
""",
    "pwsmooth.scenes.sliding": """
law : Law
    Of friction.
""",
    "pwsmooth.scenes.impact": """
law : Law
    A contact law.
""",
    "pwsmooth.scenes.planar": """
law : Law
    Of friction in the plane.
""",
    "pwsmooth.scenes.planar_bodies": """
velocity : (float, float), m/s
    At the start.
""",
    "pwsmooth.scenes.assemblies": """
law : Law
    Of friction, of each block; internal states of it are each block's own.
k : float, N/m
    Spring to the frame, > 0.
coupling : float, N/m
    Spring to each neighbour, > 0.
pull : float, m/s
    Speed of the belt, > 0.
rough : float, m
    Blocks start on the belt, up to so far from their places, > 0.
periodic : bool
    Opposite sides are joined.
seed : int
    Of these random places.
""",
    "pwsmooth.scenes.slider_crank": """
phi : float or array_like, any shape, rad
    Crank angles.
rpm : float, in units of revolutions a minute
    Crank speed.
rod_mass : float, kg
    Mass of the rod.
rod_inertia : float, kg m^2
    About the rod's centre of mass at mid-length.
slider_mass : float, kg
    Mass of the slider.
""",
    "pwsmooth.scenes.sketch": """
name : str
    Its own, in its sketch.
x, y : Expr, in the unit of length
    Of its middle.
x_1, y_1, x_2, y_2 : Expr, in the unit of length
    Its ends.
radius : float, in the unit of length
    Its size.
width : float, in the unit of length
    Across.
angle : Expr, rad
    By which it is turned.
phase : str
    A switch or contact whose status colours it.
""",
    "pwsmooth.costs": """
system : System
    Event-driven.
t_span : (float, float), in the unit of the model's time
    As of `solve`.
x0 : mapping of state to float, or sequence of float, length n
    As of `solve`, in the units of the states.
by : sequence of str or Symbol
    As of `solve`: parameters, initial values of states and memories, "t0".
q : array_like, shape (k,)
    Values of the quantities, in their units.
expression : Expr
    Of states, multipliers, parameters and time.
switch : Switch, Symbol or str
    Switch, contact or event, by its name.
kind : str, optional
    As of `EventRecord`; any without.
number : int
    0 for the first of these events.
start, end : float, in the unit of the model's time, optional
    The window; the span without.
-> Quantity
    In the unit of the expression.
""",
    "pwsmooth.fitting": """
rtol : float, dimensionless
    Of the runs.
record : int
    Which one, in the order in which they were given.
""",
    "pwsmooth.analysis": """
x : ndarray, shape (n,)
    The point, in the units of the states.
""",
    "pwsmooth.analysis.equilibria.finding": """
system : System
    Autonomous: exact, layered or smoothed.
sides : mapping of switch, disc or contact to {1, -1, 0}, optional
    Only modes in which these are on that side (a disc slips: 1); 0: held on the surface, a closed contact.
""",
    "pwsmooth.analysis.lyapunov": """
time : float, in the unit of the model's time
    Length of the average.
""",
    "pwsmooth.analysis.sticking.regions": """
drive : Expr
    Base acceleration q''(t) times the mass, N.
stiffness : Expr
    Spring k, N/m.
load : Expr
    Normal load N, N.
lam : Symbol
    The multiplier.
""",
    "pwsmooth.analysis.sticking.capture": """
sigmoid : {"algebraic", "tanh", "erf"} or Expr
    Shape L(u) of the layer; an expression is one in u.
""",
    "pwsmooth.studies": """
x0 : mapping of state to float, or sequence of float, length n
    Initial values of the states that are not swept, in their units.
transient, periods : int
    Of the drive, or returns: unseen, and measured.
t_span : (float, float), in the unit of the model's time
    Without a drive or a section: the span of a run.
measure_from : float, in the unit of the model's time
    With `t_span`: where in the span measuring begins.
max_seconds : float, in units of processor time, s, optional
    After these no further chunk begins.
setting : Setting
    Names, letters, units and periods of the sweep.
""",
    "pwsmooth.studies.attraction": """
system : System
    Driven, seen by a Strobe, or autonomous, seen by a Return.
axes : mapping of name to sequence of float, any length
    The grid: starts of states, of `basins` also values of parameters, in their units.
x0 : mapping of state to float, optional
    Values of the states that are no axes, in their units; of `basins` also expressions that follow the axes: {v: -2*x}.
max_count : int
    Longest orbit, in periods or returns, that counts as periodic.
""",
    "pwsmooth.studies.quantities": """
*names : str or Symbol
    States, multipliers or outputs.
""",
    "pwsmooth.compare.ladders": """
build : callable
    Law -> Scene.
name, title : str
    For the command line, and in words.
observables : sequence of Observable
    What can be asked for by name.
tolerance : float, in the unit of the observable
    Largest distance that is accepted.
observable : Observable
    What was looked at.
richest : Law
    `HertzImpact`, `LinearResidual` or `ResidualIndentation`.
points : int
    Samples of the window.
window : (float, float), s
    Span that the observables look at.
""",
    "pwsmooth.compare.ladders.observables": """
name : str
    Of the observable.
of : str
    Name of the quantity in the motion.
""",
    "pwsmooth.compare.hazards.stability_map": """
method : str
    One of `methods`.
""",
    "pwsmooth.compare.efficiency.charts": """
axes : Axes
    Where to draw.
""",
    "pwsmooth.compare.efficiency": """
error : float, dimensionless
    Of the state, in units of its sizes.
work : {"seconds", "evaluations"}
    The horizontal axis.
""",
}

#: How examples get what is not of this package.
STATEMENTS = {
    "math": "import math",
    "tempfile": "import tempfile",
    "plt": "import matplotlib.pyplot as plt",
    "np": "import numpy as np",
    "sp": "import sympy as sp",
}

#: Where examples get names from, besides what the packages around a module have in `__all__`.
HOMES = {
    "pwsmooth": "plotting",
    "pwsmooth.scenes": """
        IdealSliderCrank Scene Sketch assemble billiard_ball block_lattice block_on_belt block_train bristle_bot caster
        chain_of_blocks element_cloud falling_ball firing_lattice force_driven free_impact friction_oscillator
        granular_chain grazing_amplitude gripped_bar impact_oscillator incline planar_oscillator plate_stack
        position_control prescribed_motion pressed_block pulled_block rate_state_train shaken_plate slider_crank
        spinning_disc stacked_plates t""",
    "pwsmooth.laws": "Joint Law Pieces law parameter",
    "pwsmooth.laws.friction": """
        BlimanSorine BlimanSorineFirst BoucWen Contensou Coulomb Dahl Elastoplastic ElastoplasticFixed GMS HiddenStatic
        LimitEllipsoid LuGre LuGreFadingDamping Masing MaxwellSlip ModifiedCoulomb ModifiedDahl MultistateXKY
        RollingResistance StaticKinetic StribeckFriction TorsionalResistance VelocityWeakening Wojewoda XKY""",
    "pwsmooth.laws.contact": """
        Anagnostopoulos BaiImpact ETA Hertz HertzImpact HuntCrossley KelvinVoigt LinearResidual LiuImpact
        ResidualHuntCrossley ResidualIndentation RigidImpact composite_modulus contact_duration damping_factor
        effective_restitution exact_eta hertz_stiffness journal_stiffness maximal_indentation phase_curve
        restitution""",
    "pwsmooth.fitting": "Record compare fit_law",
    "pwsmooth.costs": """
        Objective at at_event duration event_time final integral largest misfit smallest value_and_gradient""",
    "pwsmooth.studies": """
        Amplitude Cost Extremes Function Itinerary Lyapunov Measure Period Points Statistics Window Work
        ensemble make_plan orbit_diagram read_store refine refine_basins""",
    "pwsmooth.diagrams": "read_diagram",
    "pwsmooth.compare": "CASES METHODS case_of ladder stability work_precision",
    "pwsmooth.compare.exact": "Check ExactProblem problems verify",
    "pwsmooth.compare.hazards": "Axis Finding Hazard",
    "pwsmooth.compare.ladders": """
        Observable Rung Step amplitude centre contact_rungs contact_setting curve end_value friction_rungs
        friction_setting judge least peak period recommend scenes setting_of share_below""",
    "pwsmooth.analysis.continuation": "Steps",
    "pwsmooth.analysis.equilibria": "equilibria",
    "pwsmooth.analysis.global_objects": "manifold sliding_portrait",
    "pwsmooth.analysis.lyapunov": "lyapunov_exponents",
    "pwsmooth.families": "Activity Histogram Recorder SlipHistogram",
    "pwsmooth.analysis.maps": "Stroboscopic variations",
    "pwsmooth.analysis.sticking": "fold",
}
