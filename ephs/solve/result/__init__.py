"""Solutions: states, ledgers, labelled arrays, and their files."""
