"""Elements from one plain function: discrete slopes, exact Jacobians, compiled relations and proofs are derived."""
