"""Sweeps: vary parameters of a scene over a grid, trace little, evaluate much, lose nothing.

`axes` what is varied; `sweep_plan` which cases are evaluated together, `sharing` which share a trace; `work`
what one worker does; `schema`, `store` and `zarrfile` the Zarr store and its journal; `cluster` and `runner`
give the work to Dask and follow it.
"""

from lightfield.rooms import open_room

open_room(__name__)  # `lightfield.sweep(...)`
