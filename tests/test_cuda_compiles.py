"""Every kernel compiles for CUDA. Needs no GPU: NVRTC comes with Warp."""

import importlib
import pkgutil

import pytest
import warp as wp

from turnbuckle.bodies.tetrahedra import tetrahedra_forces
from turnbuckle.constraints.points.attach import land_attachments

PACKAGES = [
    "bodies", "compute", "constraints.points", "contact", "integrators", "linalg", "solvers.contact", "step",
]  # fmt: skip


def modules() -> list[wp.Module]:
    found = [tetrahedra_forces(1).module, *(land_attachments(size).module for size in (3, 4, 5))]
    for package in PACKAGES:
        path = importlib.import_module(f"turnbuckle.{package}").__path__
        for info in pkgutil.iter_modules(path):
            module = wp.get_module(importlib.import_module(f"turnbuckle.{package}.{info.name}").__name__)
            if module.kernels:
                found.append(module)
    return found


@pytest.mark.slow
def test_kernels_compile_for_cuda(tmp_path):
    found = modules()
    assert len(found) > 15
    for module in found:
        wp.compile_aot_module(module, device=None, arch=80, module_dir=str(tmp_path), use_ptx=True)
    assert len(list(tmp_path.glob("*.ptx"))) >= len(found)
