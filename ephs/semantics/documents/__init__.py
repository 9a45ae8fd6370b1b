"""Systems and primitives as documents."""
