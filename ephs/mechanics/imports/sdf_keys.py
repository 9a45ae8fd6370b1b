"""Elements of SDF that the reader knows, and values of others that have no effect: defaults of the specification."""

from ephs.mechanics.imports.keys import Known

# Step sizes and the like are of a solver.
_SOLVERS = (
    "physics/name physics/default physics/type physics/max_step_size physics/real_time_factor "
    "physics/real_time_update_rate physics/max_contacts physics/ode/solver physics/bullet/solver physics/dart/solver "
    "physics/dart/collision_detector physics/simbody/min_step_size physics/simbody/accuracy "
    "physics/simbody/max_transient_velocity physics/bullet/constraints/split_impulse "
    "physics/bullet/constraints/split_impulse_penetration_threshold"
)


def _known(*paths: str) -> dict[str, tuple[str, ...]]:
    return {path: () for text in paths for path in text.split()}


ROOT: Known = _known("version model world light")
WORLD: Known = {
    **_known("name gravity model include plugin light gui scene audio frame spherical_coordinates magnetic_field"),
    **_known("atmosphere", _SOLVERS),
    "wind/linear_velocity": ("0 0 0",),
    **{f"physics/{engine}/constraints/cfm": ("0",) for engine in ("ode", "bullet")},
    **{f"physics/{engine}/constraints/erp": ("0.2",) for engine in ("ode", "bullet")},
    **{f"physics/{engine}/constraints/contact_surface_layer": ("0.001",) for engine in ("ode", "bullet")},
    "physics/ode/constraints/contact_max_correcting_vel": ("100",),
}
MODEL: Known = {
    **_known("name canonical_link placement_frame pose static self_collide allow_auto_disable link joint frame model"),
    **_known("include plugin gripper light"),
    "enable_wind": ("0",),
}
LINK: Known = {
    **_known("name pose inertial/auto inertial/pose inertial/mass inertial/inertia visual collision must_be_base_link"),
    **_known("sensor plugin light projector audio_source audio_sink battery particle_emitter"),
    "gravity": ("1",),
    "velocity_decay/linear": ("0",),
    "velocity_decay/angular": ("0",),
    **{word: ("0",) for word in ("self_collide", "kinematic", "enable_wind")},
}
COLLISION: Known = {
    **_known("name pose geometry laser_retro surface/contact/ode/kp surface/contact/collide_without_contact"),
    **_known("surface/friction/ode/mu surface/bounce/threshold surface/contact/bullet/split_impulse"),
    **_known("surface/contact/bullet/split_impulse_penetration_threshold"),
    "surface/bounce/restitution_coefficient": ("0",),
    "surface/contact/collide_bitmask": ("65535", "0xffff"),
    "surface/contact/category_bitmask": ("65535",),
    "surface/contact/collide_without_contact_bitmask": ("1",),
    "surface/contact/poissons_ratio": ("0.3",),
    "surface/contact/elastic_modulus": ("-1",),
    "surface/contact/ode/max_vel": ("0.01",),
    "surface/contact/ode/min_depth": ("0",),
    "surface/contact/bullet/kp": ("1e12",),
    **{f"surface/contact/{engine}/kd": ("1",) for engine in ("ode", "bullet")},
    **{f"surface/contact/{engine}/soft_cfm": ("0",) for engine in ("ode", "bullet")},
    **{f"surface/contact/{engine}/soft_erp": ("0.2",) for engine in ("ode", "bullet")},
    **{f"surface/friction/{engine}/fdir1": ("0 0 0",) for engine in ("ode", "bullet")},
    "surface/friction/ode/slip1": ("0",),
    "surface/friction/ode/slip2": ("0",),
    "surface/friction/bullet/friction": ("1",),
    "surface/friction/bullet/friction2": ("1",),
    "surface/friction/torsional/coefficient": ("0", "1"),
    "surface/friction/torsional/use_patch_radius": ("1",),
    **{f"surface/friction/torsional/{word}": ("0",) for word in ("patch_radius", "surface_radius", "ode/slip")},
}
_JOINT: Known = {
    **_known("name type parent child pose thread_pitch screw_thread_pitch sensor physics/provide_feedback"),
    **_known("physics/ode/provide_feedback physics/ode/implicit_spring_damper physics/simbody/must_be_loop_joint"),
    **{f"physics/ode/{word}": ("0",) for word in ("cfm", "limit/cfm", "suspension/cfm", "bounce", "max_force")},
    **{f"physics/ode/{word}": ("0.2",) for word in ("erp", "limit/erp", "suspension/erp")},
}
_AXIS: Known = {
    **_known("xyz use_parent_model_frame dynamics/damping dynamics/friction dynamics/spring_stiffness"),
    **_known("dynamics/spring_reference limit/lower limit/upper"),
    "initial_position": ("0",),
    "limit/effort": ("-1", "inf"),
    "limit/velocity": ("-1", "inf"),
    "limit/stiffness": ("1e8",),
    "limit/dissipation": ("1",),
}


def joint_keys(count: int, *, fixed: bool) -> Known:
    """Known keys of a joint with this many axes; fixed joints and ball joints may have axes that are not used."""
    used = ("axis", "axis2")[: max(count, 1)]
    axes = (
        _known("axis axis2") if fixed else {f"{axis}/{path}": plain for axis in used for path, plain in _AXIS.items()}
    )
    return {**_JOINT, **axes}
