"""The figures of M. R. Jeffrey, On the mathematical basis of solid friction, one a file.

Each file has NAME, TITLE, CAPTION and `draw(fast)`, which returns a Figure and the claims that it checks.
"""
