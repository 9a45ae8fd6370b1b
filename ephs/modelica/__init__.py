"""Components of Modelica as systems: flat equations, their relation at power ports, its structure."""
