"""The constants of the stiff path that both the kernels and the generated steps obey: no code, no compiler."""

# The gate (gate.py): how much of the way to a layer a step may go, and what counts as inside, in eps.
THETA, REACH = 0.9, 2.0

# Newton: iterations at most, and in how many more, 2^DOUBLINGS, the rate must promise convergence.
MAX_NEWTON, DOUBLINGS = 10, 3

# The last collocation polynomial predicts the stages of a step of at most so many times its length, by order.
LONGEST_PREDICTION = (4.0, 3.0, 2.0)
