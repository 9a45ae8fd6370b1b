"""Units of the Functional Mock-up Interface as environments of a run: sampled signals, and power ports in balance."""
