"""`python -m pwsmooth`: the command line, where the command `pwsmooth` is not on the path."""

from .cli import main

if __name__ == "__main__":
    main()
