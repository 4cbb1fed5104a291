"""The graph of constrained objects (Displacement, Figure 8): who is tied to whom, and how."""
