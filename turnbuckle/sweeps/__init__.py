"""Many runs of one scene with other values: one folder a run, a table and a plot at the end.

`sweep` is the way in. `values.py`: what is varied; `source.py`: values -> scene; `plan.py`: frozen scenes in folders;
`job.py`: one run, promoted into its place when it is whole; `local.py`, `cluster.py`: who runs it; `table.py`, `plot.py`.
"""
