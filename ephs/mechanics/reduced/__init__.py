"""Scenes in joint coordinates: a spanning tree with its loops cut, and methods on that."""
