"""Running: what to run (plan), who runs it (worker, referee), limits and order (runner), results (store)."""
