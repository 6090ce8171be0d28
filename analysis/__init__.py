"""From run folders to tables, statistics, figures and the report."""
