"""Notation of the primitives of rigid-body mechanics in printed equations: with Ad, ad*, inclusions.

Each function takes a `Voice` and gives efforts by port for a storage, (flows by port, conditions) for a process.
Operators are those of Lohmayer, Capobianco, Leyendecker, sections 3 to 5, with the corrections of the errata.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # SymPy is loaded when equations are asked for
    from ephs.semantics.symbols.voices import Voice

Relations = tuple[dict[str, Any], tuple[Any, ...]]


def kinetic(w: "Voice") -> dict[str, Any]:
    """p.e = 𝕀⁻¹ p."""
    return {"p": w.operator("inertia", w.label) * w.x["p"]}


def nothing(w: "Voice") -> dict[str, Any]:
    """No energy: every effort is zero."""
    return dict.fromkeys(w.x, 0)


def idle(w: "Voice") -> Relations:
    """No flow and no condition."""
    return dict.fromkeys(w.e, 0), ()


def lie_poisson(w: "Voice") -> Relations:
    """p.f = −ad*_{p.e} p."""
    return {"p": -w.operator("ad*", w.e["p"]) * w.x["p"]}, ()


def frame_change(w: "Voice") -> Relations:
    """inner.e = Ad_{o⁻¹} outer.e, outer.f = −Ad*_{o⁻¹} λ with λ = inner.f; o is named after the path of its box."""
    outer, inner = w.e
    lam = w.multiplier()
    flows = {outer: -w.operator("Ad*", w.element) * lam, inner: lam}
    return flows, (w.e[inner] - w.operator("Ad", w.element) * w.e[outer],)


def holonomic(w: "Voice") -> Relations:
    """f = C*λ, 0 = C e with C = [Ad_{I(q_r)⁻¹}, −1, i]."""
    lam, relative = w.multiplier(), w.operator("group", w.x["q_r"])
    flows = {
        "p_j1": w.operator("Ad*", relative) * lam,
        "p_j2": -lam,
        "p_r": w.operator("include*", w.label) * lam,
    }
    carried = w.operator("Ad", relative) * w.e["p_j1"]
    return flows, (carried - w.e["p_j2"] + w.operator("include", w.label) * w.e["p_r"],)


def lengthening(w: "Voice") -> Relations:
    """p_r.f = w* e.e, e.f = −w p_r.e, with the row w of `ephs.mechanics.elements.strain.stretching` at q_r."""
    flows = {"p_r": w.operator("lengthen*", w.label) * w.e["e"], "e": -w.operator("lengthen", w.label) * w.e["p_r"]}
    return flows, ()


def friction(w: "Voice") -> Relations:
    """p_r.f = μ u_r, s.f = −μ(u_r, u_r)/θ."""
    u = w.e["p_r"]
    return {"p_r": w.operator("metric", w.label) * u, "s": -w.pairing(u, u) / w.temperature("s")}, ()
