"""Jacobians of corotational tetrahedra as dense blocks of each element (NumPy, vectorised); `corotational` has the notation.

Exact derivatives of the elastic force: ``-dF/dx = B^T C B + W^T T W``, B from corners to ``sym(R^T dF)``, W to w. Where the
negative part of the second term would outweigh the masses over a step, it is raised to a bound, as in `stiffness`.
"""

import numpy as np

from turnbuckle.bodies.corotational import gradients_at_rest, lame
from turnbuckle.bodies.stiffness import skew
from turnbuckle.data.model import Corotational

SAFE = 1e-3  # of tr(S)^3, as in `corotational`


def nearest_rotations(f: np.ndarray) -> np.ndarray:
    """The rotation R (n, 3, 3) with the largest ``R : f`` for each of ``f`` (n, 3, 3)."""
    u, _, vt = np.linalg.svd(f)
    u[:, :, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))[:, None]
    return u @ vt


def corotational_jacobians(solid: Corotational, x: np.ndarray, room: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K = dF/dx and D = dF/dv of each element, (n, 12, 12), at positions ``x``; ``room`` as in `stiffness.jacobians`."""
    n = len(solid.corners)
    if n == 0:
        return np.zeros((0, 12, 12)), np.zeros((0, 12, 12))
    g, volume = gradients_at_rest(solid.rest)
    g = np.concatenate([-g.sum(axis=1, keepdims=True), g], axis=1)
    lam, mu = (volume * c for c in lame(solid))
    f = np.einsum("nka,nkb->nab", x[solid.corners], g)
    r = nearest_rotations(f)
    s = r.transpose(0, 2, 1) @ f
    s = 0.5 * (s + s.transpose(0, 2, 1))
    total = np.trace(s, axis1=1, axis2=2)
    turning = total[:, None, None] * np.eye(3) - s
    safe = (total > 0.0) & (np.linalg.det(turning) > SAFE * np.abs(total) ** 3)
    inverse = np.zeros_like(turning)
    inverse[safe] = np.linalg.inv(turning[safe])
    # rate[n, corner, axis]: R^T dF for a unit motion of a corner along a world axis
    rate = np.einsum("nab,nkc->nkabc", r, g).reshape(n, 12, 3, 3)
    strain = 0.5 * (rate + rate.transpose(0, 1, 3, 2))
    axial = 0.5 * np.stack([rate[..., i, j] - rate[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=-1)
    stiffness = _law(strain, lam, mu)
    factor = 2.0 * mu - lam * (total - 3.0)
    t = 4.0 * np.where(safe[:, None, None], mu[:, None, None] * np.eye(3) - factor[:, None, None] * inverse, 0.0)
    bent = np.einsum("npi,nij,nqj->npq", axial, t, axial, optimize=True)
    bound = np.min(room[solid.corners], axis=1)
    large = np.flatnonzero(np.sqrt(np.einsum("nij,nij->n", bent, bent)) > bound)
    if len(large):
        values, vectors = np.linalg.eigh(bent[large])
        values = np.maximum(values, -bound[large, None])
        bent[large] = np.einsum("nij,nj,nkj->nik", vectors, values, vectors)
    turns = np.einsum("nij,npj->npi", 2.0 * inverse, axial)
    moved = rate - np.einsum("npab,nbc->npac", skew(turns.reshape(-1, 3)).reshape(n, 12, 3, 3), s)
    damping = _law(0.5 * (moved + moved.transpose(0, 1, 3, 2)), lam, mu)
    return -(stiffness + bent), -solid.damping[:, None, None] * damping


def _law(strain: np.ndarray, lam: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """``2 mu e_p : e_q + lambda tr(e_p) tr(e_q)`` for strains (n, p, 3, 3)."""
    trace = np.trace(strain, axis1=2, axis2=3)
    flat = strain.reshape(*strain.shape[:2], 9)
    out = 2.0 * mu[:, None, None] * (flat @ flat.transpose(0, 2, 1))
    return out + lam[:, None, None] * trace[:, :, None] * trace[:, None, :]


def corotational_rows(solid: Corotational, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """``R K_e R^T`` as ``sum k g g^T``, seven rows an element: six strains and their trace.

    Returns corners (7 n, 4), gradients (7 n, 4, 3) [1/m], k (7 n,) [J] and k_d (7 n,) [J s]: what tells how large a step
    an explicit scheme may take.
    """
    n = len(solid.corners)
    if n == 0:
        return np.zeros((0, 4), np.int32), np.zeros((0, 4, 3)), np.zeros(0), np.zeros(0)
    g, volume = gradients_at_rest(solid.rest)
    g = np.concatenate([-g.sum(axis=1, keepdims=True), g], axis=1)
    lam, mu = (volume * c for c in lame(solid))
    r = nearest_rotations(np.einsum("nka,nkb->nab", x[solid.corners], g))
    y = np.einsum("nab,nkb->nka", r, g)
    eye = np.eye(3)
    rows = [y[:, :, [a]] * eye[a] for a in range(3)]  # strains in world axes have the same invariants
    rows += [0.5 * (y[:, :, [a]] * eye[b] + y[:, :, [b]] * eye[a]) for a, b in ((1, 2), (2, 0), (0, 1))]
    k = np.stack([2.0 * mu] * 3 + [4.0 * mu] * 3 + [lam])
    gradients = np.stack([*rows, y]).reshape(-1, 4, 3)
    return np.tile(solid.corners, (7, 1)), gradients, k.ravel(), (k * solid.damping).ravel()
