"""What the agreement tests found, for the end of pytest's report; with several workers it comes from one of them. The first
line is the heading."""

lines: list[str] = []
