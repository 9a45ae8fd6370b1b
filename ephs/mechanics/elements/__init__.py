"""Elements: systems and primitives between bodies, one idea a file."""
