"""What a trained agent achieves: episodes, transfers, baselines, videos, probes."""
