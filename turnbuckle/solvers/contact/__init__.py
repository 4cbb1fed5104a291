"""Solvers of the frictional contact problem (Contact, 3.3, 3.4, 5)."""
