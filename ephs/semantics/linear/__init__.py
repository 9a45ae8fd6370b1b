"""Linear algebra on abstract numbers: factors, solutions, rank."""
