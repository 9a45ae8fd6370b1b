"""Elements stated once: from one plain function come slopes over steps, exact Jacobians, compiled relations, proofs."""
