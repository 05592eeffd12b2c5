"""Running: what to run (plan), what runs it (worker, referee), limits and order (runner), results (store)."""
