"""Port bundles: layout of flows and efforts at ports, checked arguments, domains, errors."""
