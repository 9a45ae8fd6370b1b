"""Hypothesis profiles: ci repeats exactly, dev explores, fuzz explores for long."""

import os

from hypothesis import settings

settings.register_profile("ci", derandomize=True, deadline=None, max_examples=50, print_blob=True)
settings.register_profile("dev", deadline=None, max_examples=50)
settings.register_profile("fuzz", deadline=None, max_examples=5000)
settings.load_profile("ci" if os.environ.get("CI") else "dev")
