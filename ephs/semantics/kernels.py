"""Compiled discrete relations of the scalar library. See `kernel_table` for the one signature they all have.

Relations: from (h, θ₀), parameters p, x⁰ and increment v of the states read, e and λ, they write the flows f (n,),
the conditions c (k,) and the Jacobian J of (f, c) by (e, λ, v), (n+k, n+k+m). Storages: from x⁰ and v they write the
effort e (n,), ∂e/∂v (n, n) in the place of f, and the energy at x⁰·exp v in the place of c.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

import numba as nb


def no_effort(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """The environment, and storages without energy: e = 0."""
    n = dims[0]
    effort, slope, energy = nb.carray(e, n), nb.carray(f, n * n), nb.carray(c, 1)
    effort[:] = 0.0
    slope[:] = 0.0
    energy[0] = 0.0
    return 0


def quadratic(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """E = ½ xᵀ Q x on a vector space; p = Q (n, n)."""
    n = dims[0]
    q, x, step = nb.carray(p, n * n), nb.carray(x0, n), nb.carray(v, n)
    effort, slope, energy = nb.carray(e, n), nb.carray(f, n * n), nb.carray(c, 1)
    total = 0.0
    for i in range(n):
        mean = end = 0.0
        for j in range(n):
            entry = q[i * n + j]
            mean += entry * (x[j] + 0.5 * step[j])
            end += entry * (x[j] + step[j])
            slope[i * n + j] = 0.5 * entry
        effort[i] = mean
        total += 0.5 * (x[i] + step[i]) * end
    energy[0] = total
    return 0


def exponential(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """E = c1 (exp(s/c2) − 1); p = c1, c2."""
    par, reference = nb.carray(p, 2), nb.carray(scal, 3)
    effort, slope, energy = nb.carray(e, 1), nb.carray(f, 1), nb.carray(c, 1)
    c1, c2 = par[0], par[1]
    s, rise = nb.carray(x0, 1)[0], nb.carray(v, 1)[0] / c2
    theta = c1 / c2 * math.exp(s / c2)
    if abs(rise) < 1e-4:
        mean = 1.0 + rise * (0.5 + rise * (1.0 / 6.0 + rise / 24.0))
        mean_slope = 0.5 + rise * (1.0 / 3.0 + rise / 8.0)
    else:
        mean = math.expm1(rise) / rise
        mean_slope = (math.exp(rise) - mean) / rise
    effort[0] = theta * mean - reference[1]
    slope[0] = theta * mean_slope / c2
    energy[0] = c1 * math.expm1(s / c2 + rise)
    return 0


def ideal_gas(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """E = c1 exp(s/c2) (v0/v)^(1/c): each factor's difference quotient times the other's mean; p = c1, c2, v0, c."""
    par, reference = nb.carray(p, 4), nb.carray(scal, 3)
    effort, slope, energy = nb.carray(e, 2), nb.carray(f, 4), nb.carray(c, 1)
    state, step = nb.carray(x0, 2), nb.carray(v, 2)
    c2, k, volume = par[1], 1.0 / par[3], state[1]
    heat, growth = step[0] / c2, step[1] / volume
    if not (volume > 0.0 and growth > -1.0):
        return 4
    a, b = par[0] * math.exp(state[0] / c2), (par[2] / volume) ** k
    rise, fall = math.expm1(heat), math.expm1(-k * math.log1p(growth))
    fall_slope = -k * (1.0 + fall) / (1.0 + growth)
    first = rise / heat if heat != 0.0 else 1.0
    second = fall / growth if growth != 0.0 else -k
    first_slope = 0.5 + heat / 3.0 if abs(heat) < 1e-3 else (1.0 + rise - first) / heat
    if abs(growth) < 1e-3:
        second_slope = k * (k + 1.0) * (0.5 - (k + 2.0) * growth / 3.0)
    else:
        second_slope = (fall_slope - second) / growth
    by_s, by_v = a / c2 * first, b / volume * second
    effort[0] = by_s * b * (1.0 + 0.5 * fall) - reference[1]
    effort[1] = by_v * a * (1.0 + 0.5 * rise) + reference[2]
    slope[0] = a / (c2 * c2) * first_slope * b * (1.0 + 0.5 * fall)
    slope[1] = by_s * b * 0.5 * fall_slope / volume
    slope[2] = by_v * a * 0.5 * (1.0 + rise) / c2
    slope[3] = b / (volume * volume) * second_slope * a * (1.0 + 0.5 * rise)
    energy[0] = a * (1.0 + rise) * b * (1.0 + fall)
    return 0


def constant_structure(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """f = L e + Cᵀ λ, 0 = C e; p = L (n, n), C (k, n)."""
    n, k, m = dims[0], dims[1], dims[2]
    par, effort, force = nb.carray(p, n * n + k * n), nb.carray(e, n), nb.carray(lam, k)
    flow, condition, slope = nb.carray(f, n), nb.carray(c, k), nb.carray(jac, (n + k) * (n + k + m))
    width, at = n + k + m, n * n
    for i in range(n):
        total = 0.0
        for j in range(n):
            entry = par[i * n + j]
            total += entry * effort[j]
            slope[i * width + j] = entry
        for j in range(k):
            entry = par[at + j * n + i]
            total += entry * force[j]
            slope[i * width + n + j] = entry
        for j in range(m):
            slope[i * width + n + k + j] = 0.0
        flow[i] = total
    for i in range(k):
        total = 0.0
        for j in range(n):
            entry = par[at + i * n + j]
            total += entry * effort[j]
            slope[(n + i) * width + j] = entry
        for j in range(k + m):
            slope[(n + i) * width + n + j] = 0.0
        condition[i] = total
    return 0


def modulated_gyrator(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """f = x (e₂, −e₁) with a state x at the midpoint."""
    state = nb.carray(x0, 1)[0] + 0.5 * nb.carray(v, 1)[0]
    effort, flow, slope = nb.carray(e, 2), nb.carray(f, 2), nb.carray(jac, 6)
    flow[0], flow[1] = state * effort[1], -state * effort[0]
    slope[0], slope[1], slope[2] = 0.0, state, 0.5 * effort[1]
    slope[3], slope[4], slope[5] = -state, 0.0, -0.5 * effort[0]
    return 0


def dissipation(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """p.f = μ u, s.f = −⟨u|μ u⟩/θ on ports (p, s); p = μ (d, d)."""
    n, m = dims[0], dims[2]
    d, width = n - 1, n + m
    mu, effort, flow = nb.carray(p, d * d), nb.carray(e, n), nb.carray(f, n)
    slope = nb.carray(jac, n * width)
    theta = nb.carray(scal, 3)[1] + effort[d]
    slope[:] = 0.0
    power = 0.0
    for i in range(d):
        total = 0.0
        for j in range(d):
            total += mu[i * d + j] * effort[j]
            slope[i * width + j] = mu[i * d + j]
        flow[i] = total
        slope[d * width + i] = -2.0 * total / theta
        power += effort[i] * total
    flow[d] = -power / theta
    slope[d * width + d] = power / (theta * theta)
    return 0 if theta > 0.0 else 2


def heat_transfer(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """s1.f = −h(θ₂−θ₁)/θ₁, s2.f = −h(θ₁−θ₂)/θ₂; p = h."""
    conductance, effort = nb.carray(p, 1)[0], nb.carray(e, 2)
    flow, slope, reference = nb.carray(f, 2), nb.carray(jac, 4), nb.carray(scal, 3)
    first, second = reference[1] + effort[0], reference[1] + effort[1]
    rise = effort[1] - effort[0]
    flow[0], flow[1] = -conductance * rise / first, conductance * rise / second
    slope[0], slope[1] = conductance * second / (first * first), -conductance / first
    slope[2], slope[3] = -conductance / second, conductance * first / (second * second)
    return 0 if first > 0.0 and second > 0.0 else 2
