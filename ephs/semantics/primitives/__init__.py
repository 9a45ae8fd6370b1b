"""Components: a primitive is its structure."""
