"""Sweeps over a tree of links, each stated once as a staged function."""
