"""The experiments of the paper as a plan of runs, and how the plan is carried out."""
