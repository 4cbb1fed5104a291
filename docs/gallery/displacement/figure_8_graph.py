"""
Figure 8: the graph of constrained objects
==========================================

Who is tied to whom in the monocycle, and how: its graph has closed loops through wheel, legs and body. Drawn from the scene
itself; by the command::

    turnbuckle check monocycle --graph monocycle.svg
"""

from collections import Counter

from turnbuckle.scene.graph.edges import ANGLE, BOTH, POINT, constraint_graph
from turnbuckle.scene.graph.svg import write_graph
from turnbuckle.scenes import REGISTRY

graph = constraint_graph(REGISTRY["monocycle"]().definition)
write_graph(graph, "monocycle_graph.svg", "The monocycle")

# %%
# Beside the paper
# ----------------
#
# The paper's picture has eight objects and the world. It counts six points to point with an angle, while its Appendix A prints
# seven; the seventh, the right ankle, has an angle of 9, more than pi, which limits nothing. `rolling` on the floor is ours, and not counted.

kinds = Counter(edge.kind for edge in graph.edges if edge.name != "floor")
print(f"{'':26}{'section 5.3':>14}{'Appendix A':>14}{'here':>8}")
print(f"{'points to point + angle':26}{6:>14}{7:>14}{kinds[BOTH]:>8}")
print(f"{'points to point only':26}{2:>14}{2:>14}{kinds[POINT]:>8}")
print(f"{'angles only':26}{3:>14}{3:>14}{kinds[ANGLE]:>8}")
loops = len(graph.edges) - len(graph.nodes) + 1
print(f"{'objects with the world':26}{'9 (paper)':>14}{'':14}{len(graph.nodes):>8}")
print(f"{'independent loops':26}{'several':>14}{'':14}{loops:>8}")

# %%
# The number
# ----------
#
# Edges less nodes plus one: the number of independent loops that a tree-like method could not handle.

assert loops >= 4
