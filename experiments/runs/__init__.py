"""The run folder and its files: settings, tables, journal, versions. It imports settings and commands, and no torch."""
