"""The laboratory: proofs, diagnosis, reduction and search of failures, sweeps, figures, Dask.

It comes in by entry points, as any other package does; `cpbench` does not import it.
"""
