"""Collecting experience: collectors, replay, what a learner sees of rewards."""
