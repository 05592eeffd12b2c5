"""Selection of problems for short runs. Optional: only its command imports it."""
