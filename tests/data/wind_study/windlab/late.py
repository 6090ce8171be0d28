"""What is loaded by a name that is computed."""

SIGN = 1.0
