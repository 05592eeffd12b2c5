"""What the lecture page computes: small problems, conversions there and back, and Newton's methods step by step."""
