"""The run folder and its files: settings, tables, journal, versions."""
