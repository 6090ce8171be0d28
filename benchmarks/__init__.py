"""Speed of the engine: ``python -m benchmarks`` prints a table with the machine; nothing here is asserted."""
