"""Generated code as machine code, and where it is kept."""
