"""The reduced form of a mechanism: joint coordinates of a spanning tree, loops closed by the least constraints."""
