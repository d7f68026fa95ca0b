"""A permanent adversary: random models against oracles that never use the package.

    python -m tests.fuzz NAME --cases 50000 --structures 300 --seed 0 --resume FILE
    python -m tests.fuzz --self-test

Chain: compiling.py -> oracle.py (numbers) and models.py (one description -> a System and the oracle's tables) ->
the fuzzers, each a module with `structure(seed)` and `case(structure, seed)` -> running.py (counts, resumes, prints
scripts).
"""
