"""`turnbuckle schema`: the JSON Schema of scene files."""

import typer

from turnbuckle.cli.report_errors import report_errors


@report_errors
def schema() -> None:
    """Print the JSON Schema of scene files, for editors that complete and check YAML."""
    import json

    from turnbuckle.scene.yaml_file import json_schema

    typer.echo(json.dumps(json_schema(), indent=2))
