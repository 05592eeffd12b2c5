"""Whether a physics engine satisfies its own law, step by step."""
