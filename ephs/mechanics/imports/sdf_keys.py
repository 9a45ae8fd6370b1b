"""Elements of SDF without an effect on motion, and values of others that have none: defaults of the specification."""

from ephs.mechanics.imports.file_element import Plain

# Step sizes and the like are of a solver.
_SOLVERS = (
    "physics/name physics/default physics/type physics/max_step_size physics/real_time_factor "
    "physics/real_time_update_rate physics/max_contacts physics/ode/solver physics/bullet/solver physics/dart/solver "
    "physics/dart/collision_detector physics/simbody/min_step_size physics/simbody/accuracy "
    "physics/simbody/max_transient_velocity physics/bullet/constraints/split_impulse "
    "physics/bullet/constraints/split_impulse_penetration_threshold"
)


def _plain(*paths: str) -> dict[str, tuple[str, ...]]:
    return {path: () for text in paths for path in text.split()}


ROOT: Plain = _plain("light")
WORLD: Plain = {
    **_plain("light gui scene audio spherical_coordinates magnetic_field atmosphere", _SOLVERS),
    "wind/linear_velocity": ("0 0 0",),
    **{f"physics/{engine}/constraints/cfm": ("0",) for engine in ("ode", "bullet")},
    **{f"physics/{engine}/constraints/erp": ("0.2",) for engine in ("ode", "bullet")},
    **{f"physics/{engine}/constraints/contact_surface_layer": ("0.001",) for engine in ("ode", "bullet")},
    "physics/ode/constraints/contact_max_correcting_vel": ("100",),
}
MODEL: Plain = {**_plain("allow_auto_disable light"), "enable_wind": ("0",)}
LINK: Plain = {
    **_plain("must_be_base_link light audio_source audio_sink battery particle_emitter"),
    **_plain("visual/name visual/material visual/meta visual/cast_shadows visual/transparency visual/laser_retro"),
    **_plain("visual/visibility_flags"),
    "gravity": ("1",),
    "velocity_decay/linear": ("0",),
    "velocity_decay/angular": ("0",),
    **{word: ("0",) for word in ("self_collide", "kinematic", "enable_wind")},
}
COLLISION: Plain = {
    **_plain("laser_retro surface/bounce/threshold surface/contact/bullet/split_impulse"),
    **_plain("surface/contact/bullet/split_impulse_penetration_threshold"),
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
_JOINT: Plain = {
    **_plain("physics/provide_feedback"),
    **_plain("physics/ode/provide_feedback physics/ode/implicit_spring_damper physics/simbody/must_be_loop_joint"),
    **{f"physics/ode/{word}": ("0",) for word in ("cfm", "limit/cfm", "suspension/cfm", "bounce", "max_force")},
    **{f"physics/ode/{word}": ("0.2",) for word in ("erp", "limit/erp", "suspension/erp")},
}
_AXIS: Plain = {
    "initial_position": ("0",),
    "limit/effort": ("-1", "inf"),
    "limit/velocity": ("-1", "inf"),
    "limit/stiffness": ("1e8",),
    "limit/dissipation": ("1",),
}


def joint_keys(count: int, *, fixed: bool) -> Plain:
    """Keys without an effect of a joint with this many axes; fixed joints may have axes, and those of ball joints no
    direction."""
    if fixed:
        return {**_JOINT, **_plain("axis axis2")}
    axes = {f"{axis}/{path}": plain for axis in ("axis", "axis2")[: max(count, 1)] for path, plain in _AXIS.items()}
    return {**_JOINT, **axes, **({} if count else _plain("axis/xyz axis/use_parent_model_frame"))}
