"""Two short solvers, by which cpbench is tested where no other package of solvers is installed.

They are plugins, as a user writes them: `cpbench --plugin FILE`, or their files in `CPBENCH_PLUGINS`. No run takes them
otherwise.
"""
