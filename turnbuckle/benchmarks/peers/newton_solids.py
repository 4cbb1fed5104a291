"""A ready scene of solids in Newton (Warp) with VBD: `python -m turnbuckle.benchmarks.peers.newton_solids TASK`.

Newton's surfaces are made of the tetrahedra's own corners, so contact acts on, and the referee judges, their boundary.
"""

from turnbuckle.benchmarks.peers.newton_cloth import main

if __name__ == "__main__":
    main("the same tetrahedra, neo-Hookean, touching by their boundary")
