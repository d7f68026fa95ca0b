"""Methods of one step that `solve(method=...)` chooses by the name of their file, each a unit `step`.

    step(P, C, S, W, h, refine) -> float

A step of at most h from S, which is left at its start. In W.step.rows stand polynomials in the time since then, of
degree 7 at most: the states, from row n the multipliers, from n + m the surfaces; in W.pair.next_step what to try next.
`refine` >= 0 asks for the step that ends where that surface is 0 (or that multiplier at its bound), near h. Returns the
step's size, 0 with values and slopes alone where none can be made, nan if it failed; where a zero that was asked for is
none of the step itself, less the size of a shorter step.
"""
