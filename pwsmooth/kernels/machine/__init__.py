"""Structs, compilation, vectors and calls through addresses."""
