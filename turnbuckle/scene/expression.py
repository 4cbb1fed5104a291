"""Expressions of scene files."""
def compile_expression(text, variables):
    return None
