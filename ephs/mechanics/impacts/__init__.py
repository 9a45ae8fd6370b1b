"""Hard contact: gaps that close, islands of impacts, steps through impacts and persistent contact."""
