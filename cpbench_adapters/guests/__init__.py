"""Programs that run in another interpreter than cpbench's and need nothing of it: started by path, never imported."""
