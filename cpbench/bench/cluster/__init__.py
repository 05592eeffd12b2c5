"""Many machines: lanes elsewhere, lent by Dask."""
