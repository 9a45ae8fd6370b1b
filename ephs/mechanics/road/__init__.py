"""Motion of the links of a mechanism in world axes.

In come the constants of links and joints (`records`) and the elements and rates of the joints; out go frames, twists,
accelerations, energies, multipliers of constraints and how far loops are open. The outward sweep is in `tree`, the
recursion of articulated inertias in `linear`, rows of loops in `cuts` and `rows`, their order in `elimination`, and the
programs of a class of mechanisms in `programs`. Start reading at `tree`.
"""
