"""`reduce`: from the paper's equations to the least that serve, step by step, with the reasons."""

from ephs.mechanics.rewrite.coordinates import coordinate_steps
from ephs.mechanics.rewrite.rewrite import rewrite
from ephs.mechanics.rewrite.rules import RULES
from ephs.mechanics.rewrite.steps import Reduction, Step, listed
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.model import Scene
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import no_model
from ephs.solve.running.threads import in_one_thread


@in_one_thread
def reduce(model: System | Scene) -> Reduction:
    """Variables eliminated from a model, the justification, and the unknowns left after each step.

    Rewrites of the system come first; of a scene the reductions of coordinates follow, down to the form that
    ``form="reduced"`` integrates.

    Raises
    ------
    SemanticsError
        The model has no square system of equations.
    """
    if isinstance(model, Scene):
        problem = problem_of_scene(model)
        system, name = problem.system, model.name
    elif isinstance(model, System):
        problem, system, name = None, model, "system"
    else:
        raise no_model(model)
    # an outer port whose effort is prescribed has a flow for an unknown, here and in all that follow
    held = sum(system.interface[port].quantity.space.dim for port in problem.prescribed) if problem else 0
    before = _unknowns(system) + held
    steps: list[Step] = []
    for rule in RULES:
        done = rewrite(system, [rule])
        if done.done:
            system, after = done.system, _unknowns(done.system) + held
            where = tuple(dict.fromkeys(str(site.where) for site in done.done))
            steps.append(Step(rule.name, rule.strength, where, f"{listed(where)}: {rule.why}", before, after))
            before = after
    if problem is not None and isinstance(model, Scene):
        steps += coordinate_steps(model, problem, before)
    return Reduction(name, tuple(steps))


def _unknowns(system: System) -> int:
    d = system.descriptor()
    return d.rate_size + d.effort_size + d.multiplier_size
