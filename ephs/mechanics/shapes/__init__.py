"""Shapes of surfaces, and the gaps between pairs of them."""
