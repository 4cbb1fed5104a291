"""Slow, obvious references in NumPy. They share no code with the library: tests hold the library against them."""
