"""``python -m segar.analysis.report`` is ``segar report``."""

from segar.analysis.report.make import main

if __name__ == "__main__":
    main()
