"""One mechanism's equations in joint coordinates: rates, constraints, exact derivatives, heat and states."""
