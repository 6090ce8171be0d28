"""Statistics that hold for runs that share levels and seeds: tidy tables in, tables or small dataclasses out."""
