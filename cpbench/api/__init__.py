"""The Python interface: what `import cpbench` offers, and what the commands stand on.

`problems` loads, converts and measures, `solving` solves here and now, `runs` benchmarks in processes of their own and
reads results, `advice` names solvers. All of it is reached as `cpbench.NAME`.
"""
