"""Measurements, each a function that prints, and writes its table and plot."""
