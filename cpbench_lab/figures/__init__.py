"""What figures of problems show, computed."""
