"""Systems of many equal elements: one element as notation, written out or as a template."""
