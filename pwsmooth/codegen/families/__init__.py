"""Code for families: loops over their elements."""
