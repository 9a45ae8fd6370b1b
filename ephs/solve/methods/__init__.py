"""Methods on the descriptor form of any system: the natural discretisations and Radau IIA."""
