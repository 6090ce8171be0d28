"""Studies that train nothing."""
