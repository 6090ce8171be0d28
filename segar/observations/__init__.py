"""What an agent sees: states, pixels, and observations that are composed of others."""
