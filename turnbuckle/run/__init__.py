"""Many steps: recordings, checkpoints, the report. `turnbuckle.run_scene` is `turnbuckle.run.run.run`."""
