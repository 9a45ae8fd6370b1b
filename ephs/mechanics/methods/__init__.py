"""Methods in joint coordinates, and the registry of all methods by name."""
