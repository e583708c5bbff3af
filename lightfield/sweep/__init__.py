"""Sweeps: vary parameters of a scene over a grid, trace little, evaluate much, lose nothing.

`axes` what is varied; `plan` which cases share a trace; `work` what one worker does; `store` the Zarr store and its
journal; `runner` gives the work to Dask and follows it.
"""
