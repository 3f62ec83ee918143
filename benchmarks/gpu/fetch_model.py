"""The forms of the Fetch model that MuJoCo Warp takes: it has no margins where meshes or boxes meet."""

import mujoco
import numpy as np

KINDS = ("margin 0", "one contact", "grown")


def change(model, kind):
    """Turn a model, in place, into one of the forms.

    - "margin 0": margins are left out, so that fingers touch one millimetre later.
    - "grown": likewise, and bodies grow by their margins instead, which is the same for faces.
    - "one contact": margins stay; meshes touch in one point at a time, and boxes by another code.
    """
    if kind == "one contact":
        bits = mujoco.mjtDisableBit
        model.opt.disableflags |= bits.mjDSBL_MULTICCD | bits.mjDSBL_NATIVECCD
    elif kind in ("margin 0", "grown"):
        if kind == "grown":
            _grow(model)
        model.geom_margin[:] = 0
        model.geom_gap[:] = 0
    else:
        raise ValueError(kind)


def _grow(model):
    for geom in np.flatnonzero(model.geom_margin > 0):
        margin = model.geom_margin[geom]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            model.geom_size[geom] += margin
        else:
            _grow_mesh(model, model.geom_dataid[geom], margin)
        model.geom_aabb[geom, 3:] += 2 * margin
        model.geom_rbound[geom] += 2 * margin


def _grow_mesh(model, mesh, margin):
    """Move each corner so that the planes that meet in it move outwards by the margin."""
    first, polygons = model.mesh_vertadr[mesh], model.mesh_polyadr[mesh]
    normals = model.mesh_polynormal[polygons : polygons + model.mesh_polynum[mesh]]
    for vertex in range(first, first + model.mesh_vertnum[mesh]):
        begin, number = model.mesh_polymapadr[vertex], model.mesh_polymapnum[vertex]
        if not number:
            continue
        planes = normals[model.mesh_polymap[begin : begin + number]]
        shift = np.linalg.lstsq(planes, np.full(number, margin), rcond=0.05)[0]
        model.mesh_vert[vertex] += shift * min(1.0, 3 * margin / max(np.linalg.norm(shift), 1e-12))
