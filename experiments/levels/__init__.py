"""What a level setting means: builders, variations, conditions, mixed levels."""
