"""What a port carries: layouts, arguments, domains, errors."""
