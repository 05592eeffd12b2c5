"""Parts that methods of cpbench and adapters have in common."""
