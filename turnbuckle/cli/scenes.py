"""`turnbuckle scenes`: the ready scenes and their parameters."""

import typer

from turnbuckle.cli.report_errors import report_errors


@report_errors
def scenes() -> None:
    """List the ready scenes with their parameters."""
    import inspect

    from turnbuckle.scenes import REGISTRY

    for name, make in REGISTRY.items():
        parameters = inspect.signature(make).parameters.values()
        shown = (p.name if p.default is p.empty else f"{p.name}={p.default!r}" for p in parameters)
        first = (inspect.getdoc(make) or "").strip().partition("\n")[0]
        typer.echo(f"{name}({', '.join(shown)})")
        if first:
            typer.echo(f"    {first}")
