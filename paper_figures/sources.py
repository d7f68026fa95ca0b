"""Where the expected values of claims come from: `Claim(..., **solid_friction("section 6"))`.

The three sources, by the names that the claims use:

solid friction    M. R. Jeffrey, On the mathematical basis of solid friction
friction thesis   X. Xiong's thesis, the end of chapter 4 and the beginning of chapter 5
clearance joint   Wang, Liu and Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545, as lecture slides show it
"""


def solid_friction(place):
    """Printed in the first source, at this place."""
    return {"origin": "printed", "where": f"solid friction, {place}"}


def friction_thesis(place, *, origin="printed"):
    """Printed in the second; of chapter 4 the equations had to be reconstructed."""
    return {"origin": origin, "where": f"friction thesis, {place}"}


def clearance_joint(place):
    """Printed in the third."""
    return {"origin": "printed", "where": f"clearance joint, {place}"}


def computed(how):
    """Computed by another program, in the way that is said."""
    return {"origin": "independent", "where": how}


def closed_form(what=""):
    """In closed form from the equations."""
    return {"origin": "derived", "where": what}


# By construction: it can only fail if the code is wrong.
IDENTITY = {"origin": "identity"}
# Our own expectation, which no source states.
EXPECTED = {"origin": "expected"}
