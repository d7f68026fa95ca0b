"""Structs, compilation, vectors and calls through addresses."""

# What their object code names in place of numba's function, of a name as long, that frees an array: theirs are lent.
NEVER_CALLED = "pws_MemInfo_call_dtor"
