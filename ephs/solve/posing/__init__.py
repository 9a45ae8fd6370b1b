"""Problems: systems with initial states and inputs; events, and errors.

In come a system and what users ask for; out goes a `Problem`. Start with `problem`.
"""
